"""Compiled loops, apart from the physics that calls them: ring modes of the Stokeslet, sums over points."""
