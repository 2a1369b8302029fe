"""How loops are compiled: by Numba, once for each machine.

Kernels assign and multiply element by element: slices of arrays and `@` take seconds longer to compile.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

import numba

__all__ = ["compiled", "compiled_parallel"]

_F = TypeVar("_F", bound=Callable[..., Any])


def _compile(function: _F, **options: Any) -> _F:
    try:
        kernel: _F = numba.njit(cache=True, nogil=True, error_model="numpy", **options)(function)
    except RuntimeError:  # no folder to keep the machine code in: it is compiled again in every process
        kernel = numba.njit(nogil=True, error_model="numpy", **options)(function)
    return kernel


def compiled(function: _F) -> _F:
    """Compile a function of numbers and arrays; its machine code is kept on disk for the next process."""
    return _compile(function)


def compiled_parallel(function: _F) -> _F:
    """Compile a function whose `numba.prange` loops run on several cores; its machine code is kept on disk."""
    return _compile(function, parallel=True)
