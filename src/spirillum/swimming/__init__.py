"""Resistance and drive to steady swimming: one force balance and one motor for every model."""
