"""Which tail to build: numeric fields of a robot, chosen for an objective under conditions and unknowns."""
