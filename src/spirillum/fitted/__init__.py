"""What a calibration has found, as files: factors and friction (`calibration.toml`), draws (`posterior.nc`)."""
