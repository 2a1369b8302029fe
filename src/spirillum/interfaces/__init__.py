"""Bindings to other tools: python-control, Gymnasium, FMU, and a remote at a serial port."""
