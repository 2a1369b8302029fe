"""File formats that several rooms write or read: NetCDF, MP4, VTK images, Parquet."""
