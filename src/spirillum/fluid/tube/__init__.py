"""The model `tube`: the resolved robot in a circular tube, with no calibrated factor."""
