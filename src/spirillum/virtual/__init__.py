"""The virtual camera: videos of a robot as an experiment's camera sees it, each with its truth.

It shares nothing with `spirillum.vision` but the robot's geometry: what measures a video is tested by it.
"""
