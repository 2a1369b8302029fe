"""Shape-typed arrays: one axis of robots (or a single value that holds for all of them) comes first."""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING, TypeAlias

import numpy as np

if not TYPE_CHECKING and "jaxtyping" in sys.modules:  # where tests check shapes at every call
    from jaxtyping import Bool, Complex, Float, Int
else:
    from typing import Annotated as Bool
    from typing import Annotated as Complex
    from typing import Annotated as Float
    from typing import Annotated as Int

if TYPE_CHECKING:
    _Floats = np.ndarray[tuple[int, ...], np.dtype[np.float64]]
    _Complexes = np.ndarray[tuple[int, ...], np.dtype[np.complex128]]
    _Truths = np.ndarray[tuple[int, ...], np.dtype[np.bool_]]
    _Integers = np.ndarray[tuple[int, ...], np.dtype[np.int64]]
else:
    _Floats = _Complexes = _Truths = _Integers = np.ndarray

Values: TypeAlias = Float[_Floats, "*#n"]
"""Floats of any shape; all of them broadcast against each other."""
Samples: TypeAlias = Float[_Floats, "..."]  #: Floats of any shape, unrelated to others.
Whole: TypeAlias = Int[_Integers, "..."]  #: Whole numbers of any shape, such as indices.
Amplitudes: TypeAlias = Complex[_Complexes, "..."]  #: Complex amplitudes of Fourier modes.
Vectors: TypeAlias = Float[_Floats, "*#n 3"]
"""Cartesian vectors."""
Tensors: TypeAlias = Float[_Floats, "*#n 3 3"]
"""Cartesian 3x3 matrices."""
PerRobot: TypeAlias = Float[_Floats, "#n"]
"""One float for each robot, or one for all."""
Flags: TypeAlias = Bool[_Truths, "#n"]
"""One truth value for each robot, or one for all."""
Axial: TypeAlias = Float[_Floats, "*#n 4 4"]
"""Axial resistance of both parts: rows and columns (F_x, T_x; U_x, Omega_x) of body, then of rotor."""
AxialLoad: TypeAlias = Float[_Floats, "*#n 4"]
"""Axial wrench (F_x, T_x) on body, then on rotor."""
AxialWhole: TypeAlias = Float[_Floats, "*#n 3 3"]
"""Axial resistance of the whole robot: force on it, torque on body, torque on rotor against U, Omega, omega."""
MeanFlow: TypeAlias = Float[_Floats, "*#n 5"]
"""Mean velocity of the fluid per unit (U_x, Omega_x) of body and of rotor, and with the robot at rest."""
Matrix6: TypeAlias = Float[_Floats, "*#n 6 6"]
"""Resistance matrix of one rigid part: force then torque against velocity then rotation."""
Matrix12: TypeAlias = Float[_Floats, "*#n 12 12"]
"""Resistance matrix of both parts: body, then rotor."""
