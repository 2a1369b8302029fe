"""Robots as frozen, validated data, SI inside; their geometry and limits."""
