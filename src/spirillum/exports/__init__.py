"""The robot for other programs: files of its shape, masses, joint and resistance. `spirillum.export` writes them."""
