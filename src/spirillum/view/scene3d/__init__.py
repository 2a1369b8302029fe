"""Pictures and videos of a robot in three dimensions; needs the extra `3d`."""
