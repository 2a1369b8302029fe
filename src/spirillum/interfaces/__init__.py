"""The robot in the terms of others' tools: python-control, Gymnasium, and a remote at a serial port."""
