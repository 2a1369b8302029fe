"""How Python calls the loops that are written in C (csrc/): by the stubs of `core`, whose annotations are the contract.

Arrays are annotated with their dtype and shape (`Float64[Array, "n 8 8"]`); a named dimension has one length in all
arguments of a call, and C gets the lengths behind the arguments, in the order in which their names first appear. An
array of any shape has `"..."`.
"""

from __future__ import annotations

import ctypes
import inspect
import os
import sys
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from contextvars import ContextVar
from functools import cache, wraps
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, TypeAlias, TypeVar, cast, get_type_hints

import numpy as np

if TYPE_CHECKING:
    from typing import Annotated as Complex128
    from typing import Annotated as Float32
    from typing import Annotated as Float64
    from typing import Annotated as Int64
    from typing import Annotated as UInt8

    Array: TypeAlias = np.ndarray[tuple[int, ...], np.dtype[Any]]
else:
    Array = np.ndarray

    class _ArrayOf:
        """Annotations of arrays of a dtype, with their shape."""

        def __init__(self, dtype):
            self._dtype = np.dtype(dtype)

        def __getitem__(self, array_and_shape):
            array, shape = array_and_shape
            return Annotated[array, self._dtype, shape]

    Complex128, Float32, Float64 = _ArrayOf("complex128"), _ArrayOf("float32"), _ArrayOf("float64")
    Int64, UInt8 = _ArrayOf("int64"), _ArrayOf("uint8")

__all__ = [
    "Array",
    "Complex128",
    "Float32",
    "Float64",
    "Int64",
    "UInt8",
    "in_one_thread",
    "native",
    "processor_count",
    "rows_in_one_thread",
    "run_together",
    "thread_count",
]


def processor_count() -> int:
    """Return how many processors this process may use, as in a container or a job of a cluster."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


_SCALARS = {float: ctypes.c_double, int: ctypes.c_int64, bool: ctypes.c_bool}
_THREADS = int(os.environ.get("OMP_NUM_THREADS") or 0) or processor_count()
_SHARES = 4  # Shares of the rows for each thread: some rows take longer than others.

_alone: ContextVar[bool] = ContextVar("alone", default=False)

_T = TypeVar("_T")
_F = TypeVar("_F", bound=Callable[..., Any])
_Sizes: TypeAlias = dict[str, int]


@cache
def library() -> ctypes.CDLL:
    """Return the compiled library, in its build for this processor; ImportError where there is none."""
    suffix = {"win32": ".dll", "darwin": ".dylib"}.get(sys.platform, ".so")
    try:
        core = ctypes.CDLL(str(Path(__file__).with_name(f"_core{suffix}")))
    except OSError as error:
        raise ImportError(
            f"{error}; the compiled loops are built by 'pip install .' or 'python csrc/build.py'"
        ) from error
    wide = Path(__file__).with_name(f"_core_v3{suffix}")
    if core.has_wide_vectors() and wide.exists():
        return ctypes.CDLL(str(wide))
    if not hasattr(core, "resistance_at"):
        raise ImportError("the compiled loops were built for a processor with AVX2; build them on this one")
    return core


def sources_digest() -> str:
    """Return the digest of the C sources that the library was compiled from."""
    function = library().csrc_digest
    function.restype = ctypes.c_char_p
    return cast("bytes", function()).decode()


def native(*written: str, rows: str = "") -> Callable[[_F], _F]:
    """Turn a stub into a call of the C function of its name; threads may share the work over the dimension `rows`."""
    # `written` are arrays that the function writes to: they need the dtype of their annotation, contiguous; others are
    # copied where they are not.

    def decorate(stub: _F) -> _F:
        count = stub.__code__.co_argcount
        prepared: _Call | None = None

        @wraps(stub)
        def call(*arguments: Any, **keywords: Any) -> Any:
            nonlocal prepared
            if keywords or len(arguments) != count:
                arguments = inspect.signature(stub).bind(*arguments, **keywords).args
            if prepared is None:
                prepared = _Call(stub, frozenset(written), rows)
            return prepared(arguments)

        return cast("_F", call)

    return decorate


def thread_count() -> int:
    """Number of threads that may work: 1 where the machine has no more, or other processes have them."""
    return 1 if _alone.get() else _THREADS


def in_one_thread() -> bool:
    """Whether the work of this process stays in one thread."""
    return thread_count() == 1


def run_together(*work: Callable[[], _T]) -> list[_T]:
    """Return what functions return: the first runs in this thread, others beside it, as far as there are threads."""
    if in_one_thread() or len(work) == 1:
        return [one() for one in work]
    with ThreadPoolExecutor(len(work) - 1) as pool:  # The compiled loops release the GIL.
        others = [pool.submit(one) for one in work[1:]]
        return [work[0](), *(future.result() for future in others)]


@contextmanager
def rows_in_one_thread() -> Iterator[None]:
    """While the block runs, rows are worked through by this thread alone: other processes have the other cores."""
    token = _alone.set(True)
    try:
        yield
    finally:
        _alone.reset(token)


_FIRST_BYTE: Callable[[Any], Any] = (ctypes.c_char * 1).from_buffer


def _pointer(array: np.ndarray[Any, Any]) -> Any:
    """Return what ctypes takes as a pointer to the first element; three times as fast where the array is writable."""
    try:
        return _FIRST_BYTE(array)
    except (TypeError, ValueError):  # of a read-only or an empty one
        return array.ctypes.data


class _ArrayArgument:
    """Check of an array."""

    def __init__(self, name: str, annotation: Any, *, is_written: bool) -> None:
        self.name, self.is_written = name, is_written
        self.dtype, dimensions = annotation.__metadata__
        shape = dimensions.split()
        self.shape = None if shape == ["..."] else tuple(int(size) if size.isdigit() else size for size in shape)

    def accepted(self, value: Any) -> np.ndarray[Any, Any]:
        """Return the array as C takes it."""
        if isinstance(value, np.ndarray) and value.dtype == self.dtype and value.flags.c_contiguous:
            return value
        if self.is_written:
            raise TypeError(f"{self.name} must be a contiguous array of {self.dtype}")
        return np.asarray(value).astype(self.dtype, order="C", casting="same_kind")

    def add_sizes(self, shape: tuple[int, ...], sizes: _Sizes) -> None:
        """Check a shape; add its named lengths to those of the call."""
        if self.shape is None:
            return
        fits = len(shape) == len(self.shape)
        for length, size in zip(shape, self.shape, strict=False):
            fits &= length == (sizes.setdefault(size, length) if isinstance(size, str) else size)
        if not fits:
            raise ValueError(f"{self.name} has shape {shape}; expected {self.shape} with {sizes}")


class _Call:
    """A function of the library with the checks of its arguments."""

    def __init__(self, stub: Callable[..., Any], written: frozenset[str], rows: str) -> None:
        hints = get_type_hints(stub, include_extras=True)
        returned = hints.pop("return")
        self._kinds = [
            hint if hint in _SCALARS else _ArrayArgument(name, hint, is_written=name in written)
            for name, hint in hints.items()
        ]
        self._arrays = [(n, kind) for n, kind in enumerate(self._kinds) if isinstance(kind, _ArrayArgument)]
        names = [size for _, kind in self._arrays for size in kind.shape or ()]
        self._names = tuple(dict.fromkeys(name for name in names if isinstance(name, str)))
        self._rows = rows
        self._function: Any = library()[stub.__name__]
        self._function.restype = _SCALARS.get(returned)
        passed: list[Any] = [_SCALARS.get(hint, ctypes.c_void_p) for hint in hints.values()]
        self._function.argtypes = passed + [ctypes.c_int64] * len(self._names)
        self._last: tuple[list[tuple[int, ...]], _Sizes] | None = None

    def __call__(self, arguments: tuple[Any, ...]) -> Any:
        values, shapes = list(arguments), []
        for n, expected in self._arrays:
            value = values[n]
            # Most arrays are as they should be: dtypes of one kind are one object.
            if not (type(value) is np.ndarray and value.dtype is expected.dtype and value.flags.c_contiguous):
                value = values[n] = expected.accepted(value)
            shapes.append(value.shape)
        sizes = self._sizes(shapes)
        if self._rows and not in_one_thread():
            return self._run_in_threads(values, sizes)
        return self._run(values, sizes)

    def _sizes(self, shapes: list[tuple[int, ...]]) -> _Sizes:
        """Return the named lengths of arrays; those of the last call are known."""
        last = self._last
        if last is not None and last[0] == shapes:
            return last[1]
        sizes: _Sizes = {}
        for (_, expected), shape in zip(self._arrays, shapes, strict=True):
            expected.add_sizes(shape, sizes)
        sizes = {name: sizes[name] for name in self._names}
        self._last = shapes, sizes
        return sizes

    def _run(self, values: list[Any], sizes: _Sizes) -> Any:
        passed = values.copy()
        for n, _ in self._arrays:
            passed[n] = _pointer(values[n])
        try:
            return self._function(*passed, *sizes.values())
        except ctypes.ArgumentError:  # numbers of NumPy that ctypes does not know
            numbers = [
                kind(value) if kind in _SCALARS else value for kind, value in zip(self._kinds, passed, strict=True)
            ]
            return self._function(*numbers, *sizes.values())

    def _run_in_threads(self, values: list[Any], sizes: _Sizes) -> None:
        """Let threads share the rows of the arrays whose first dimension has this name."""
        count = sizes[self._rows]
        cut = [n for n, kind in self._arrays if (kind.shape or ("",))[0] == self._rows]

        def run(low: int, high: int) -> None:
            part = [value[low:high] if n in cut else value for n, value in enumerate(values)]
            self._run(part, sizes | {self._rows: high - low})

        edges = np.linspace(0, count, min(_SHARES * _THREADS, count) + 1).astype(int).tolist()
        with ThreadPoolExecutor(_THREADS) as pool:
            list(pool.map(run, edges[:-1], edges[1:]))
