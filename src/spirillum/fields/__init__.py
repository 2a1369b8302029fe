"""Velocity and pressure of the fluid around a swimming robot, at points and on grids."""
