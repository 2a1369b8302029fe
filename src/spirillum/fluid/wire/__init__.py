"""The model `slender`: a wire of any curve and solids of revolution, resolved in unbounded fluid."""
