"""Noise, lamp, lost frames, tilt, glare: each as large as its option says, each alone."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

import spirillum as sp
from spirillum.robot.load import load
from spirillum.virtual.artifacts import Degradation
from spirillum.virtual.disturbances import Disturbances, tilt_of
from spirillum.virtual.optics import VirtualLens, tank_of
from spirillum.virtual.pictures import Painter
from spirillum.virtual.trial import render

LENS = VirtualLens(0.21, 0.06, 1.4, 370.0, (320, 240))
BODY = (0.035, 0.018)


def of(seed: int = 0, **what: Any) -> Disturbances:
    return Disturbances(Degradation.of(what), seed, LENS, 20.0, BODY, 0.03)


def test_noise_has_its_standard_deviation(tmp_path: Path) -> None:
    options: dict[str, Any] = {
        "camera": {"size": (160, 120)},
        "trial": {"duration": "0.1 s"},
        "motion": {"tail_rate": "1 Hz"},
    }
    for name, what in (("clean", Degradation()), ("noisy", Degradation(noise=8.0))):
        render("biorob2012-wide", tmp_path / name, **options, degradation=what)
    clean, noisy = (
        np.stack([np.asarray(Image.open(path), dtype=float) for path in sorted((tmp_path / name).iterdir())])
        for name in ("clean", "noisy")
    )
    inside = (clean > 40) & (clean < 215)
    noise = (noisy - clean)[inside]
    assert noise.std() == pytest.approx(8.0, rel=0.03)
    assert abs(noise.mean()) < 0.2
    first, second = (noisy - clean)[:2]
    assert abs(np.corrcoef(first.ravel(), second.ravel())[0, 1]) < 0.05  # new on every frame


def test_the_lamp_drifts_by_its_share() -> None:
    for seed in range(6):
        gains = np.array([of(seed, lamp_drift=0.2).gain(time) for time in np.linspace(0, 20, 200)])
        assert 0.1 < np.abs(gains[:, 1] - 1.0).max() <= 0.2 + 1e-12
        assert np.abs(gains[:, 0] / gains[:, 2] - 1.0).max() < 0.15
    assert np.allclose(of().gain(3.0), 1.0)


def test_as_many_frames_are_lost_as_stated_but_not_the_ends() -> None:
    kept = of(dropped=0.05).retained_frames(600)
    assert kept.sum() == 570
    assert kept[0]
    assert kept[-1]
    assert of().retained_frames(600).all()


def test_the_tilt_has_its_size_and_any_direction() -> None:
    tilts = np.array([tilt_of(Degradation.of({"tilt": 0.035}), seed) for seed in range(40)])
    assert np.allclose(np.hypot(*tilts.T), 0.035)
    assert (tilts.min(axis=0) < -0.02).all()
    assert (tilts.max(axis=0) > 0.02).all()


def test_glare_covers_its_share_of_the_body() -> None:
    lens = VirtualLens(0.21, 0.06, 1.4, 740.0, (640, 480))
    light = np.zeros((480, 640, 3), dtype=np.float32)
    place = np.array([0.01, 0.0, 0.0115])
    Disturbances(Degradation(glare=0.2), 3, lens, 20.0, BODY, 0.03).disturb(light, 1.0, place)
    edge = lens.project(place + np.array([[0.0, 0.0, 0.0], [1e-3, 0.0, 0.0]]))[:, 0]
    body = (abs(edge[1] - edge[0]) / 1e-3) ** 2 * BODY[0] * BODY[1] * 0.94
    assert (light[..., 0] > 0.4).sum() == pytest.approx(0.2 * body, rel=0.1)


def test_glare_goes_along_or_stands_still() -> None:
    for moves, expected in ((True, 20.0), (False, 0.0)):
        centres = []
        for x in (0.0, 0.01):
            light = np.zeros((240, 320, 3), dtype=np.float32)
            of(3, glare=0.2, glare_moves=moves).disturb(light, 1.0, np.array([x, 0.0, 0.0115]))
            weight = light[..., 0].sum(axis=0)
            centres.append(float((weight * np.arange(320)).sum() / weight.sum()))
        assert centres[1] - centres[0] == pytest.approx(expected, abs=0.3)


def test_a_hand_passes_and_bubbles_stay_few() -> None:
    light = np.ones((240, 320, 3), dtype=np.float32)
    hand = of(1, hand=True)
    darkest = []
    for time in np.linspace(0, 20, 81):
        picture = light.copy()
        hand.disturb(picture, float(time), np.zeros(3))
        darkest.append(picture.min())
    assert min(darkest) == pytest.approx(0.55, abs=0.02)
    assert darkest[0] == pytest.approx(1.0, abs=1e-3) or darkest[-1] == pytest.approx(1.0, abs=1e-3)
    picture = light.copy()
    of(1, bubbles=5).disturb(picture, 0.0, np.zeros(3))
    assert 0 < (picture != light).mean() < 0.05


def test_one_disturbance_does_not_change_another() -> None:
    alone, together = of(4, dropped=0.1), of(4, dropped=0.1, noise=8.0, bubbles=4, hand=True, glare=0.3)
    assert (alone.retained_frames(100) == together.retained_frames(100)).all()


def test_presets_and_wrong_values() -> None:
    degraded = Degradation.of("degraded")
    assert degraded.noise == 8.0
    assert degraded.dropped == 0.05
    assert [Degradation(crf=crf).uncompressed().crf for crf in (0, 18)] == [0, 0]
    changed = Degradation.of({"preset": "degraded", "noise": None, "crf": 20})
    assert changed == degraded.model_copy(update={"crf": 20})
    for wrong in ({"noise": -1.0}, {"crf": 60}, {"dropped": 1.0}, {"tilt": 1.0}, {"glare": 2.0}, {"bubbles": 1.5}):
        with pytest.raises(sp.InputError, match="allowed"):
            Degradation.of(wrong)
    with pytest.raises(sp.InputError, match="did you mean noise"):
        Degradation.of({"preset": "clean", "nois": 3.0})


def test_the_glass_darkens_its_edges_and_leaves_the_middle() -> None:
    tank = tank_of(load("biorob2012-wide"), "top")
    over = Painter(load("biorob2012-wide"), tank, LENS).still.over
    edge = LENS.project(np.array([[0.0, 0.5 * (tank.tube + tank.outside), tank.tube_height]]))[0]
    assert over[round(edge[1]), 160] < 0.8
    assert over[120, 160] > 0.9
