"""Compiles csrc/ into the package: by the system's C compiler, else by the one that comes as a wheel (ziglang).

The build hook of the package calls it. In a clone on PYTHONPATH, after a change of csrc/: `python csrc/build.py`. What
Python calls is declared once, in C (see core.h): the module kernels/core.py is written from these declarations.
"""

from __future__ import annotations

import hashlib
import os
import platform
import re
import shutil
import subprocess
import sys
import sysconfig
import tempfile
from pathlib import Path
from typing import NamedTuple

SOURCES = Path(__file__).parent
PACKAGE = SOURCES.parent / "src/spirillum/kernels"
SUFFIXES = {"win": ".dll", "mac": ".dylib"}
"""Of libraries, by the first letters of a wheel's tag; else .so."""
FLAGS = (
    *("-std=c11", "-O2", "-g0", "-fPIC", "-fvisibility=hidden"),  # zig adds debugging information, gcc does not
    # The same numbers on every processor: no fused products, no sums in another order; `errno` and traps are not read.
    *("-ffp-contract=off", "-fno-math-errno", "-fno-trapping-math"),
    "-fopenmp-simd",  # heeds `omp simd`, which needs no library
)
STRICT = ("-Wall", "-Wextra", "-Wshadow", "-Wconversion", "-Wno-sign-conversion", "-Werror")
"""Of the project's own tests: a compiler of tomorrow may warn of more."""
WIDE = ("-mavx2", "-mbmi2")
"""Of a second build for x86-64, which processors since 2013 take."""
ZIG = [sys.executable, "-m", "ziglang", "cc"]
TARGETS = {
    "manylinux_2_17_x86_64": "x86_64-linux-gnu.2.17",
    "manylinux_2_17_aarch64": "aarch64-linux-gnu.2.17",
    "macosx_11_0_arm64": "aarch64-macos.11.0",
    "macosx_11_0_x86_64": "x86_64-macos.11.0",
    "win_amd64": "x86_64-windows-gnu",
}
"""What zig calls the platform of a wheel."""


STUBS = PACKAGE / "core.py"
_EXPORTED = re.compile(
    r"/\*(?P<doc>(?:(?!\*/).)*)\*/\nEXPORT (?P<type>\w+) (?P<name>\w+)\((?P<arguments>(?!void).*?)\) \{", re.DOTALL
)
_ARGUMENT = re.compile(r"(?:const )?(?P<type>\w+) (?P<name>[^/]*?)\s*(?:/\* \((?P<shape>.*?)\) \*/)?,")
_COMMENT = re.compile(r"/\*.*?\*/", re.DOTALL)
_ENUM = re.compile(r"\benum \{(.*?)\}", re.DOTALL)
_STRUCT = re.compile(r"^typedef struct \{(.*?)^\} (\w+);", re.DOTALL | re.MULTILINE)
_FIELDS = re.compile(r"(struct|union) \{(.*?)\}(.*?);|(\w+) (.*?);", re.DOTALL)
_COLUMNS = ("State", "Seen", "Drive", "Weight", "Site", "Wire", "Station", "Wall", "Ring", "Tube", "Limits", "Memory")
_COLUMNS += ("Film", "Motor", "Loaded", "Axial", "AxialState")
"""Structs of numbers that Python packs or reads: the place of each field becomes a constant."""
_NUMBERS = {"void": "None", "double": "float", "int64_t": "int", "bool": "bool"}
_ARRAYS = {"float": "Float32", "int64_t": "Int64", "uint8_t": "UInt8", "Amplitude": "Complex128"}  # else of doubles


class Compiler(NamedTuple):
    """How C is compiled."""

    command: list[str]
    tag: str
    """Platform that is compiled for, as the names of wheels have it."""

    @property
    def suffix(self) -> str:
        """End of a library's name."""
        return SUFFIXES.get(self.tag[:3], ".so")


def compiler() -> Compiler:
    """Return the compiler: `SPIRILLUM_CC`, the system's `cc` or zig for this machine, zig for `SPIRILLUM_WHEEL`."""
    if tag := os.environ.get("SPIRILLUM_WHEEL"):
        return Compiler([*ZIG, "-target", TARGETS[tag]], tag)
    own = sysconfig.get_platform().replace("-", "_").replace(".", "_")
    if stated := os.environ.get("SPIRILLUM_CC"):
        return Compiler(stated.split(), own)
    return Compiler([found] if (found := shutil.which("cc")) and _finds_headers(found) else ZIG, own)


def _finds_headers(command: str) -> bool:
    """Whether a compiler works: machines may have its name alone, or no headers of the C library."""
    line = [command, "-E", "-x", "c", "-include", "math.h", os.devnull]
    return not subprocess.run(line, capture_output=True, check=False).returncode  # noqa: S603


def needs_zig() -> bool:
    """Whether the compiler is the one that comes as a wheel."""
    return compiler().command[: len(ZIG)] == ZIG


def digest() -> str:
    """Return the digest of all C sources, which the library states as `csrc_digest`."""
    found = hashlib.sha256()
    for path in sorted(SOURCES.glob("*.[ch]")):
        found.update(path.read_bytes())
    return found.hexdigest()


def is_current() -> bool:
    """Whether the package's library and stubs were made from these sources."""
    library = PACKAGE / f"_core{compiler().suffix}"
    made = library.exists() and STUBS.exists()
    return made and digest().encode() in library.read_bytes() and STUBS.read_text(encoding="utf-8") == stubs()


def stubs() -> str:
    """Return the module of stubs: for each exported function its arguments, but for lengths, and its comment."""
    found = [
        '"""The functions of csrc/, as C declares them; written by csrc/build.py."""\n',
        "from __future__ import annotations\n",
        "from spirillum.kernels.native import Array, Complex128, Float32, Float64, Int64, UInt8, native\n",
    ]
    headers = _structs("".join(path.read_text(encoding="utf-8") for path in sorted(SOURCES.glob("*.h"))))
    constants = _constants(headers)
    found += [f"{name} = {value}" for name, value in constants.items()]
    for path in sorted(SOURCES.glob("*.c")):
        text = path.read_text(encoding="utf-8")
        structs = headers | _structs(text)
        found += [_stub(exported, structs, constants, path.name) for exported in _EXPORTED.finditer(text)]
    return "\n".join(found)


def _structs(text: str) -> dict[str, str]:
    """Return the fields of structs of numbers, by name; complex numbers are none."""
    found = {name: fields for fields, name in _STRUCT.findall(_COMMENT.sub("", text))}
    return {name: fields for name, fields in found.items() if name not in _ARRAYS}


def _constants(structs: dict[str, str]) -> dict[str, int]:
    """Return the enumerators of headers, and the places of fields in structs and the sizes of these: STATE_PHASE."""
    text = _COMMENT.sub("", "".join(path.read_text(encoding="utf-8") for path in sorted(SOURCES.glob("*.h"))))
    found: dict[str, int] = {}
    for listed in _ENUM.findall(text):
        for number, one in enumerate(listed.split(",")):
            name, _, value = (part.strip() for part in one.partition("="))
            if not value or value.isdigit():
                found[name] = int(value or number)
    for name in _COLUMNS:
        prefix = re.sub(r"(?<=[a-z])(?=[A-Z])", "_", name).upper()
        found[f"{prefix}_SIZE"] = _add_places(found, prefix, structs, structs[name], 0)
    return found


def _add_places(
    found: dict[str, int], prefix: str, structs: dict[str, str], fields: str, begin: int, *, overlap: bool = False
) -> int:
    """Note the places of fields, one after the other or in a union; return the end of the longest."""
    place = end = begin
    for group, inner, names, kind, plain in _FIELDS.findall(fields):
        for declared in (plain or names).split(","):
            name, *sizes = re.findall(r"\w+", declared) or [""]
            start, length = begin if overlap else place, 1
            if name:
                found[f"{prefix}_{name.upper()}"] = start
            if kind != "double":
                own = inner or structs[kind]
                length = _add_places(found, prefix, structs, own, start, overlap=group == "union") - start
            for size in sizes:
                length *= int(found.get(size, size))
            place = start + length
            end = max(end, place)
    return end


def _stub(exported: re.Match[str], structs: dict[str, str], constants: dict[str, int], source: str) -> str:
    doc = re.sub(r"\n \*", "\n", exported["doc"]).replace("\n ", "\n    ").strip()
    rows = re.search(r"\n *Threads share (\w+)\.", doc)
    options, arguments, lengths = [f'rows="{rows[1]}"'] if rows else [], [], set[str]()
    for kind, declared, shape in _ARGUMENT.findall(exported["arguments"] + ","):
        name = re.search(r"(\w+)\W*(?:\[.*)?$", declared)[1]  # type: ignore[index]
        if name in lengths:
            continue
        if declared == name:
            arguments.append(f"{name}: {_NUMBERS[kind]}")
            continue
        sizes = shape.split(", ") if shape else re.findall(r"\d+", declared)
        if kind in structs and sizes != ["..."]:
            sizes.append(str(_add_places(dict(constants), "", structs, structs[kind], 0)))
        lengths |= set(sizes)
        arguments.append(f'{name}: {_ARRAYS.get(kind, "Float64")}[Array, "{" ".join(sizes)}"]')
        if f"const {kind} {declared}" not in exported["arguments"]:
            options.insert(0, f'"{name}"')
    head = f"def {exported['name']}({', '.join(arguments)}) -> {_NUMBERS[exported['type']]}:"
    return f'\n@native({", ".join(options)})\n{head}\n    """{doc}\n\n    See csrc/{source}.\n    """\n'


def compile_all(folder: Path = PACKAGE, flags: tuple[str, ...] = (), *, wide: bool = True) -> list[Path]:
    """Compile csrc/ into a folder; return the libraries, each replaced as a whole.

    Wheels for x86-64 have a baseline and a wide variant. What is built for this machine has the wide one alone, where
    the processor takes it: its `_core` holds nothing but that question.
    """
    every, tag = sorted(SOURCES.glob("*.c")), compiler().tag
    if folder == PACKAGE:
        STUBS.write_text(stubs(), encoding="utf-8")
    core, wide_core = (folder / f"_core{name}{compiler().suffix}" for name in ("", "_v3"))
    machine = tag if tag in TARGETS else platform.machine().lower()
    if not wide or not machine.endswith(("x86_64", "amd64")):
        return [_compiled(core, every, flags)]
    if tag not in TARGETS:
        asked = _compiled(core, [SOURCES / "core.c"], flags)
        if not _runs_wide(asked):
            return [_compiled(core, every, flags)]
        return [asked, _compiled(wide_core, every, (*flags, *WIDE))]
    return [_compiled(core, every, flags), _compiled(wide_core, every, (*flags, *WIDE))]


def _runs_wide(library: Path) -> bool:
    question = f"import ctypes; raise SystemExit(not ctypes.CDLL({str(library)!r}).has_wide_vectors())"
    return not subprocess.run([sys.executable, "-c", question], capture_output=True, check=False).returncode  # noqa: S603


def _compiled(library: Path, files: list[Path], flags: tuple[str, ...]) -> Path:
    """Compile files on all processors, which zig does by itself, and link them."""
    command = [*compiler().command, *FLAGS, *flags, f'-DCSRC_DIGEST="{digest()}"']
    parts = [str(path) for path in files]
    with tempfile.TemporaryDirectory(dir=library.parent) as work:
        if not needs_zig():
            count = min(os.cpu_count() or 1, len(parts))
            begun = [subprocess.Popen([*command, "-c", *parts[n::count]], cwd=work) for n in range(count)]  # noqa: S603
            for compiling in begun:
                if compiling.wait():
                    raise subprocess.CalledProcessError(compiling.returncode, compiling.args)
            parts = sorted(path.name for path in Path(work).glob("*.o"))
        subprocess.run([*command, "-shared", "-o", library.name, *parts, "-lm"], cwd=work, check=True)  # noqa: S603
        (Path(work) / library.name).replace(library)
    return library


if __name__ == "__main__":
    compile_all()
