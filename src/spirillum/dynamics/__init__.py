"""Motion in time: held or free runs, films at the wall, remote control, rotating fields, settling."""
