"""Beside the models: what was observed, and its statistics."""
