"""The band of a study: what predict gives robot by robot, resumable, and named in dataset, claims and figures."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from matplotlib.legend import Legend

import spirillum as sp
from spirillum.papers.biorob2012.claims_predicted import claims_of_study
from spirillum.papers.biorob2012.evidence import Evidence
from spirillum.papers.registry import figures_of
from spirillum.studies.columns import AT_POSES, BandTask
from spirillum.view.figures.style import look_of_model

MODELS = ["sbt", "walled"]


@pytest.fixture
def leaning(walled: Any, monkeypatch: pytest.MonkeyPatch) -> Any:
    """Walls whose drag rises as the gap falls, in the narrow channel more than in the wide one."""
    made_up = type(walled).axial

    def axial(self: Any, batch: Any) -> np.ndarray:
        place = batch.placement
        drag = np.zeros((batch.size, 4, 4))
        drag[:, 0, 0] = (1e-3 / (place.gap or 0.5e-3) - 3.0 * (place.pitch or 0.0)) * 0.04 / batch.channel_diameter
        return made_up(self, batch) + drag

    def steepest(g: Any, _radius: float, gap: float, _drop: float, _yaw: float) -> float:
        return (6e-3 + gap - g.amplitude) / g.tail_length

    monkeypatch.setattr(type(walled), "axial", axial)
    monkeypatch.setattr("spirillum.swimming.band._steepest", steepest)
    return walled


@pytest.fixture
def question(small: dict[str, object]) -> dict[str, object]:
    """Two tails in two channels, one reading."""
    return {**small, "friction": ["none", "rotor"], "models": MODELS, "claims": "biorob2012"}


@pytest.fixture(scope="module")
def kept() -> list[Any]:
    """The study with its band, once it was asked for."""
    return []


@pytest.fixture
def banded(leaning: Any, question: dict[str, object], kept: list[Any]) -> Any:
    """The study with its band, computed once for all tests, which do not change it."""
    if not kept:
        kept.append(sp.study(question, band=True))
    return kept[0]


def test_every_entry_is_what_predict_says(leaning: Any, banded: Any) -> None:
    dataset = banded
    assert dataset["forward_velocity_at_place"].dims[-1] == "place"
    for channel, wavelength, amplitude in (("wide", 0.020, 0.0015), ("narrow", 0.025, 0.0025)):
        tail = {"tail.wavelength": f"{wavelength} m", "tail.amplitude": f"{amplitude} m"}
        one = sp.predict(sp.load(f"biorob2012-{channel}", **tail), model="walled", friction="rotor")
        assert one.band is not None
        here = {"channel": channel, "wavelength": wavelength, "amplitude": amplitude}
        found = dataset.sel(**here, model="walled", friction="rotor")
        np.testing.assert_allclose(found["gap_at_place"], one.band.gap, rtol=1e-12)
        np.testing.assert_allclose(found["pitch_at_place"], one.band.pitch, rtol=1e-12)
        for name in AT_POSES:
            np.testing.assert_allclose(found[f"{name}_at_place"], getattr(one.band.swimming, name), rtol=1e-12)
            limits = [float(found[f"{name}_{end}"]) for end in ("low", "high")]
            assert limits == pytest.approx(one.band.limits(name), rel=1e-12)
    assert dataset["forward_velocity_low"].sel(model="sbt").isnull().all()
    assert "band" in dataset["forward_velocity_low"].attrs["long_name"]


def test_without_a_band_nothing_of_it_is_there(leaning: Any, question: dict[str, object], banded: Any) -> None:
    dataset = sp.study(question)
    assert not [name for name in dataset.data_vars if str(name).endswith(("_low", "_high", "_at_place"))]
    assert "place" not in dataset.dims
    assert "gap and pitch are unknown: answers are for one pose" in dataset.attrs["warnings"]
    assert "answers are for one pose" not in banded.attrs["warnings"]
    assert dataset.attrs["fingerprint"] != banded.attrs["fingerprint"]


def test_models_and_band_override_the_file(leaning: Any, question: dict[str, object]) -> None:
    dataset = sp.study({**question, "band": True}, models=["walled"], band=False)
    assert list(dataset["model"].values) == ["walled"]
    assert "place" not in dataset.dims


def test_interrupted_band_resumes_where_it_stopped(
    leaning: Any, question: dict[str, object], banded: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("spirillum.results.study.write_report", lambda *_, **__: None)
    done: list[int] = []
    original = BandTask.answer

    def counted(task: Any, loaded: Any, observed: Any) -> Any:
        if len(done) == 3:
            raise KeyboardInterrupt
        done.append(task.pose)
        return original(task, loaded, observed)

    monkeypatch.setattr(BandTask, "answer", counted)
    with pytest.raises(KeyboardInterrupt):
        sp.study(question, band=True, output=tmp_path / "out")
    (parts,) = (tmp_path / "out").glob("parts-*")
    assert len(list(parts.glob("*.npz"))) == 4 + 3
    monkeypatch.setattr(BandTask, "answer", original)
    assert sp.study(question, band=True, output=tmp_path / "out").identical(banded)


def test_robots_that_share_a_place_come_one_after_the_other(leaning: Any, question: dict[str, object]) -> None:
    told: list[str] = []
    sp.study(question, band=True, progress=lambda what, _done, _total: told.append(what))
    band = [words for words in told if "band" in words]
    assert band[0] == "walled, band: gap 1 mm, pitch 0 deg, 4 robots"
    assert len(band) == 2 * (3 + 3 * 2 * 2)  # two channels; three level places, six pitched ones by amplitude
    assert all(words.endswith("2 robots") for words in band if "pitch 0 deg" not in words)


def test_drop_is_judged_over_the_band_and_nothing_is_called_fitted(
    leaning: Any, question: dict[str, object], banded: Any
) -> None:
    def by_walled(dataset: Any) -> Any:
        (claim,) = [c for c in claims_of_study(dataset) if c.claim.endswith("wide to narrow, by walled")]
        return claim

    alone = by_walled(sp.study(question))
    assert alone.verdict == "undecidable"
    assert "gap 0.5 mm, level" in alone.computed
    assert "no factor is fitted" in alone.reason
    dataset = banded
    over = by_walled(dataset)
    assert "over the band, at the same gap and pitch in both channels" in over.computed
    drops = Evidence(dataset).drops_of_the_band("walled")
    assert drops is not None
    assert drops.shape == (2, 2, 10)
    low, high = drops.min(), drops.max()
    assert f"{100 * low:.1f} to {100 * high:.1f} %" in over.computed
    assert over.verdict == ("undecidable" if low <= 0.389 <= high else "disagrees")


def test_models_without_walls_say_nothing_about_the_channel(question: dict[str, object]) -> None:
    grid: Any = {**question["grid"], "wavelengths": ["25 mm"], "amplitudes": ["2.5 mm"]}  # type: ignore[dict-item]
    claims = claims_of_study(sp.study({**question, "models": ["slender"], "grid": grid}))
    (slower,) = [claim for claim in claims if claim.claim == "Robots travel slower in the narrow channel"]
    assert slower.verdict == "undecidable"
    assert "no model of this study has the channel's walls" in slower.reason


@pytest.mark.usefixtures("unplaced")
def test_figures_draw_the_band_and_name_it(banded: Any) -> None:
    dataset = banded
    pictures = figures_of(dataset)
    assert list(pictures) == ["fig5-wide", "fig6-narrow", "bound", "drop"]
    figures = {name: picture.figure() for name, picture in pictures.items()}
    for name, picture in pictures.items():
        figure = figures[name]
        entries = [text.get_text() for legend in figure.findobj(Legend) for text in legend.get_texts()]
        assert "walled: band" in entries, name
        assert "band" in picture.caption.lower()
        assert "interval" not in picture.caption
    figure = figures["fig5-wide"]
    colour = look_of_model("walled").colour
    shades = [item for item in figure.axes[0].collections if item.get_facecolor().size]
    from matplotlib.colors import to_hex

    assert {to_hex(shade.get_facecolor()[0]) for shade in shades} == {colour.lower()}
    heights = np.concatenate([shade.get_paths()[0].vertices[:, 1] for shade in shades])
    part = dataset.sel(channel="wide", model="walled", friction="none").isel(wavelength=0)
    expected = [float(part[f"advance_per_radian_{end}"].pipe(pick)) for end, pick in (("low", min), ("high", max))]
    assert (heights.min(), heights.max()) == pytest.approx([2e3 * np.pi * value for value in expected])


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"models": ["sbt"], "band": True}, "band = true with models sbt; allowed: only with a model that computes"),
        ({"band": True, "placement": {"gap": "1 mm", "pitch": "0 deg"}}, "the placement leaves nothing open"),
        ({"band": "yes"}, "band"),
    ],
)
def test_band_that_cannot_be_is_refused(
    walled: Any, question: dict[str, object], changes: dict[str, object], words: str
) -> None:
    with pytest.raises(sp.InputError) as caught:
        sp.study({**question, **changes})
    assert words in str(caught.value)
    assert "\n" not in str(caught.value)


def test_wrong_model_is_named(question: dict[str, object]) -> None:
    with pytest.raises(sp.InputError, match="models = 'cube' is unknown"):
        sp.study({**question, "models": ["sbt"]}, models=["cube"])
