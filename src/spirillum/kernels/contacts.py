"""Where a robot touches the wall of its tube: columns of sites, wire and stations, and what carries there.

The equations stand in csrc/contacts.c and csrc/dry_friction.c.
"""

from __future__ import annotations

# A site on body or coupling: ring of radius rho (semi-axis b along the motor axis) at x, with a ball of radius beta.
SITE_X, SITE_RING, SITE_HALF, SITE_BALL, SITE_ROTOR = 0, 1, 2, 3, 4  # m; last: 1 where it turns with the rotor
SITE = 5

# The wire: radius and amplitude, m; taper over length, 1/m (0: none); h k, rad/m (0: no helix of one size); x of the
# root and axial length, m.
WIRE_RADIUS, AMPLITUDE, TAPER, HAND_K, ROOT, LENGTH = 0, 1, 2, 3, 4, 5
WIRE = 6

# A station along a wire: distance from the root, m; its place at phase 0, m, and the derivative of that by it, both
# (x, y, z); the angle of its wire, rad.
STATION_XI, STATION_POINT, STATION_SLOPE, STATION_TURN = 0, 1, 4, 7
STATION = 8
