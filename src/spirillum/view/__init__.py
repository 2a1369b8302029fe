"""Figures, three-dimensional pictures and videos, annotated videos."""
