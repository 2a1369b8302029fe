"""Models in closed form: slender-body theory (1)-(7), resistive force theory (8)-(16), Perrin's spheroid."""
