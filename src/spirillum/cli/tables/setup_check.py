"""Text of `setup check`."""

from __future__ import annotations

from rich.console import Console
from rich.markup import escape

from spirillum.cli.tables.parts import Answer
from spirillum.display import percent


def table(answer: Answer, console: Console) -> None:
    """Text of `setup check`."""
    console.print(f"{escape(answer['file'])}: valid, robot {escape(answer['robot'])}", highlight=False, soft_wrap=True)
    total = percent(answer["scale_uncertainty"])
    parts = sorted(answer["scale_sources"].items(), key=lambda item: -item[1])
    words = ", ".join(f"{name} {percent(share)}" for name, share in parts)
    console.print(
        f"standard uncertainty of lengths from heights and scale: {total}{': ' + words if words else ''}",
        highlight=False,
        soft_wrap=True,
    )
    if (film := answer.get("film")) is not None:
        pixel, size = film["length_per_pixel"]["value"], film["apparent_body_size"]
        ruler = f"{film['markers']} lines of the ruler" if film["markers"] else "no ruler"
        stripes = "its stripes fit" if film["stripes_fit"] else "its stripes do not fit"
        console.print(
            f"{escape(film['name'])}: robot on {film['frames_with_robot']} of {film['frames']} frames looked at, "
            f"{size:.3f} times as large as its file says; {stripes}, tail read on {100 * film['tail_readable']:.0f} %; "
            f"{ruler}, {1e3 * pixel:.4g} mm a pixel",
            highlight=False,
            soft_wrap=True,
        )
