"""A window to draw in, off-screen or live, and words for machines that cannot."""

from __future__ import annotations

import ctypes
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from spirillum.errors import InputError
from spirillum.optional_dependencies import import_optional

_INSTEAD = "allowed: a display, or -o FILE, which needs none"
_CHOICE = "VTK_DEFAULT_OPENGL_WINDOW"
_OFF_SCREEN = "vtkEGLRenderWindow"
_SOFTWARE = "vtkOSOpenGLRenderWindow"
_SOFTWARE_LIBRARIES = ("libOSMesa.so", "libOSMesa.so.8", "libOSMesa.so.6")


def new_plotter(size: tuple[int, int], *, live: bool = False, samples: int = 4) -> Any:
    """An empty PyVista plotter with an OpenGL context.

    Args:
        size: width and height, pixels.
        live: a window on the screen instead of a picture in memory.
        samples: samples of each pixel; 0: one.
    """
    if live and not _has_display():
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
            window.SetMultiSamples(samples)
            if not live:  # nobody looks: the picture is read from where it was drawn
                window.SetFrameBlitModeToNoBlit()
                window.SwapBuffersOff()
        finally:
            vtkLogger.SetStderrVerbosity(verbosity)
            vtkObject.SetGlobalWarningDisplay(talkative)
    return plotter


def _has_display() -> bool:
    if not sys.platform.startswith("linux"):
        return True
    return bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))


@contextmanager
def _quiet_context(*, live: bool) -> Iterator[None]:
    """Off-screen drawing asks for no display, so that nothing complains about one; the environment is put back."""
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
