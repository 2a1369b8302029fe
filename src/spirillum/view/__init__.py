"""Figures, three-dimensional pictures and films, annotated videos."""
