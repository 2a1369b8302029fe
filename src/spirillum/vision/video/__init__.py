"""Frames of a video with their times."""
