"""Names of columns in Python are those of the structs in C, all of them."""

import ctypes
import importlib

from spirillum.kernels.native import library


def columns_of_c() -> dict[str, dict[str, int]]:
    """What csrc/columns.c states, by module and name."""
    core = library()
    core.column_name.restype, core.column_value.restype = ctypes.c_char_p, ctypes.c_int64
    found: dict[str, dict[str, int]] = {}
    for n in range(core.columns_count()):
        name, value = core.column_name(ctypes.c_int64(n)).decode(), core.column_value(ctypes.c_int64(n))
        if value < 0:
            found[name] = own = {}
        else:
            own[name] = value
    return found


def test_columns_are_those_of_c() -> None:
    stated = columns_of_c()
    assert set(stated) == {"rigid_links", "contacts", "two_links", "tube_motion", "stiff_steps"}
    for name, columns in stated.items():
        module = vars(importlib.import_module(f"spirillum.kernels.{name}"))
        constants = {key: value for key, value in module.items() if key.isupper() and isinstance(value, int | float)}
        if name != "rigid_links":
            constants.pop("SEEN", None)
        assert constants == columns
