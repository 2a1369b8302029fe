"""Answers as tables for people: one module for each kind of answer, named after its schema."""
