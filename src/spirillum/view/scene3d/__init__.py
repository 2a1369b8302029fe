"""Pictures and films of a robot in three dimensions; needs the extra `3d`."""
