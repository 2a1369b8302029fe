"""The page: a robot in its tube, alive in the browser; `spirillum page`."""
