"""How much may be read: every limit on the size of a file, or of what it declares, stands on this page."""

from __future__ import annotations

LARGEST_TEXT = 1 << 20
"""Robot, study, setup and calibration files, and marks of folders, bytes."""
MOST_LEVELS = 24
"""Parts of a dotted key in a TOML file: tables within tables. The files of this program have at most five."""
LARGEST_TABLE = 128 << 20
"""Tables in CSV or Parquet, bytes."""
MOST_ROWS = 1_000_000
"""Rows of a table."""
MOST_COLUMNS = 500
"""Columns of a table."""
MOST_CELLS = 5_000_000
"""Cells of a table."""
LONGEST_CELL = 10_000
"""A text in a cell of a Parquet file, characters."""
LARGEST_NETCDF = 512 << 20
"""A run or a posterior, bytes: on disk, and as its arrays declare."""
MOST_VARIABLES = 2000
"""Groups and variables in a NetCDF file."""
MOST_PIXELS = 50_000_000
"""Pixels of a frame or an image."""
SMALLEST_SIDE = 32
"""Pixels of a frame's shorter side."""
LARGEST_PICTURE = 512 << 20
"""An image in a folder, bytes."""
MOST_IMAGES = 1_000_000
"""Images in a folder."""
LONGEST_PATH = 4096
"""A file's name with its folders, characters."""
LONGEST_NAME = 255
"""A file or folder by itself, bytes: what the usual file systems hold."""
MOST_POINTS = 2000
"""Points of a tail's centre line or of a body's outline."""
