"""A robot whose nose seems to be at the other end is said to be turned round only where its tail is found that way."""

from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

import numpy as np
import pytest

from spirillum.vision.camera.optics import optics_of
from spirillum.vision.flag import Flag
from spirillum.vision.setup import load_setup
from spirillum.vision.track import identity
from spirillum.vision.track.body import BodyFinder
from spirillum.vision.track.identity import Identified, identify
from spirillum.vision.track.initial_detection import Start
from spirillum.vision.video.frames import Frame

pytest.importorskip("cv2")


@pytest.mark.parametrize("tail_there", [True, False])
def test_the_direction_is_named_where_a_whole_tail_says_so(
    flat_pictures: ModuleType, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, *, tail_there: bool
) -> None:
    flat, path, asked = flat_pictures.flat(), tmp_path / "setup.toml", []
    path.write_text(flat.setup_text())
    setup, robot = load_setup(path)
    body = BodyFinder(robot, optics_of(setup, flat.size, flat.focal), (0, 0, *flat.size))

    def look(_name: str, setup: Any, body: Any, *_: Any) -> Identified:
        """A first look that finds no robot as stated, and one the other way round or not."""
        asked.append((setup.robot.direction, body.optics.direction))
        turned = len(asked) == 2
        flags = () if turned else (Flag("nose-on-the-other-side", "", ()),)
        start = Start(body, 1.0, (0.0, 0.0), [], [], 1.0, 1.0, [], flags)
        stripes: Any = SimpleNamespace(flags=())
        wire: Any = SimpleNamespace(readable=1.0 if turned and tail_there else 0.1, flags=())
        return Identified(start, stripes, wire, 1.0, robot=turned and tail_there)

    monkeypatch.setattr(identity, "identified_at", look)
    monkeypatch.setattr(identity, "best_other_size", lambda *_: None)
    monkeypatch.setattr(identity, "resized", lambda body, _size: body)
    picture = np.zeros((*flat.size[::-1], 3), dtype=np.uint8)
    found = identify("film.mp4", setup, body, [Frame(0, 0.0, picture)], picture.astype(float))
    assert asked == [("right", "right"), ("left", "left")]
    assert [flag.name for flag in (*found.start.flags, *found.flags)] == [
        *(["nose-on-the-other-side"] if tail_there else []),
        "not-the-robot",
    ]
