"""Plotter windows, off-screen or live, and encoders of their frames: MP4 (H.264), GIF."""

from __future__ import annotations

import ctypes
import os
import sys
import zlib
from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np

from spirillum.errors import InputError
from spirillum.formats.h264 import H264Writer, h264_writer
from spirillum.optional_dependencies import import_optional

_INSTEAD = "allowed: a display, or -o FILE, which needs none"
_CHOICE = "VTK_DEFAULT_OPENGL_WINDOW"
_OFF_SCREEN = "vtkEGLRenderWindow"
_SOFTWARE = "vtkOSOpenGLRenderWindow"
_SOFTWARE_LIBRARIES = ("libOSMesa.so", "libOSMesa.so.8", "libOSMesa.so.6")


def new_plotter(size: tuple[int, int], *, live: bool = False) -> Any:
    """An empty PyVista plotter with an OpenGL context, in a window if `live`, else in memory."""
    display = not sys.platform.startswith("linux") or os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")
    if live and not display:
        raise InputError(f"--window: DISPLAY is not set; {_INSTEAD}")
    with _quiet_context(live=live):
        pyvista = import_optional("pyvista", "a 3D picture")
        from vtkmodules.vtkCommonCore import vtkLogger, vtkObject

        verbosity, talkative = vtkLogger.GetCurrentVerbosityCutoff(), vtkObject.GetGlobalWarningDisplay()
        vtkLogger.SetStderrVerbosity(vtkLogger.VERBOSITY_OFF)
        vtkObject.GlobalWarningDisplayOff()
        try:
            plotter = pyvista.Plotter(off_screen=not live, window_size=list(size), lighting="none")
            window = plotter.render_window
            if window is None or not _can_draw(window):
                plotter.close()
                raise InputError(
                    "this machine cannot draw in 3D: neither EGL nor OSMesa is there; allowed: install Mesa's libEGL "
                    "(package libegl1 of Debian and Ubuntu)"
                )
            if live and window.GetClassName() in (_OFF_SCREEN, _SOFTWARE):
                plotter.close()
                raise InputError(f"--window: DISPLAY = {os.environ.get('DISPLAY')!r} cannot be opened; {_INSTEAD}")
            window.SetMultiSamples(4)
            if not live:  # nobody looks: the picture is read from where it was drawn
                window.SetFrameBlitModeToNoBlit()
                window.SwapBuffersOff()
        finally:
            vtkLogger.SetStderrVerbosity(verbosity)
            vtkObject.SetGlobalWarningDisplay(talkative)
    return plotter


@contextmanager
def _quiet_context(*, live: bool) -> Iterator[None]:
    """Disable the display during off-screen rendering to avoid warnings; restores the environment."""
    if live or not sys.platform.startswith("linux"):
        yield
        return
    wanted = {_CHOICE: os.environ.get(_CHOICE, _OFF_SCREEN), "EGL_LOG_LEVEL": os.environ.get("EGL_LOG_LEVEL", "fatal")}
    kept = {name: os.environ.get(name) for name in wanted}
    os.environ |= wanted
    try:
        yield
    finally:
        for name, value in kept.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value


def _can_draw(window: Any) -> bool:
    """Whether the context is real: without OSMesa's library VTK's last resort would end the program."""
    if window.GetClassName() != _SOFTWARE:
        return bool(window.SupportsOpenGL())
    for name in _SOFTWARE_LIBRARIES:
        try:
            ctypes.CDLL(name)
        except OSError:
            continue
        return True
    return False


FILMS = {".mp4": "a film", ".gif": "a film"}  #: Endings of the supported video files, for `output_target`.
_PALETTE_FRAMES = 9
_QUALITY = {"crf": "18", "preset": "veryfast"}


def video_writer(
    path: Path, size: tuple[int, int], fps: int, words: dict[str, str]
) -> AbstractContextManager[H264Writer | _Gif]:
    """A writer for frames of one size; the file is complete when the block ends."""
    if path.suffix.lower() == ".gif":
        return _gif(path, fps, words)
    return h264_writer(path, size, Fraction(fps), words, quality=_QUALITY, instead="a .gif", extra="3d")


class _Gif:
    def __init__(self, fps: int) -> None:
        self._fps = fps
        self._frames: list[bytes] = []
        self._shape: tuple[int, ...] = ()

    def add(self, image: np.ndarray) -> None:
        """Store a frame, compressed: the video's colours are chosen after the last one."""
        self._shape = image.shape
        self._frames.append(zlib.compress(np.ascontiguousarray(image).tobytes(), 1))

    def _image(self, number: int) -> np.ndarray:
        return np.frombuffer(zlib.decompress(self._frames[number]), dtype=np.uint8).reshape(self._shape)

    def pictures(self) -> Iterator[Any]:
        """The frames in at most 256 colours, chosen from frames of the whole video."""
        from PIL import Image

        chosen = np.unique(np.linspace(0, len(self._frames) - 1, _PALETTE_FRAMES).astype(int))
        several = Image.fromarray(np.concatenate([self._image(int(number)) for number in chosen]))
        # Frequent colours for the shades of glass and body, far ones for the stripes.
        parts = ((160, Image.Quantize.MEDIANCUT), (95, Image.Quantize.MAXCOVERAGE))
        colours = [value for count, method in parts for value in (several.quantize(count, method).getpalette() or [])]
        palette = Image.new("P", (1, 1))
        palette.putpalette([255, 255, 255, *colours])
        for number in range(len(self._frames)):
            frame = Image.fromarray(self._image(number))
            yield frame.quantize(palette=palette, dither=Image.Dither.NONE)

    def durations(self) -> list[int]:
        """Time of each frame, ms: whole hundredths of a second, as the format requires, that add up to the video's."""
        ends = np.round(100.0 * np.arange(len(self._frames) + 1) / self._fps).astype(int)
        return [int(10 * step) for step in np.diff(ends)]


@contextmanager
def _gif(path: Path, fps: int, words: dict[str, str]) -> Iterator[_Gif]:
    writer = _Gif(fps)
    yield writer
    pictures = writer.pictures()
    next(pictures).save(
        path,
        format="gif",
        save_all=True,
        append_images=pictures,
        duration=writer.durations(),
        loop=0,
        optimize=False,
        comment=" ".join(words.values()).encode("ascii", "replace"),
    )
