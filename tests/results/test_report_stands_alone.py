"""The report is one well-formed page with its pictures inside, every claim in it, and nothing from elsewhere."""

import base64
import json
import tomllib
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import pytest

import spirillum as sp
from spirillum.notes import note_attributes
from spirillum.papers import biorob2012
from spirillum.papers.claim import Claim
from spirillum.results.page import draw_pictures
from spirillum.results.study import write_report
from spirillum.results.study_content import FRICTION_MEANINGS
from spirillum.robot.tables import FrictionModel
from spirillum.view.figures.sheet import Picture
from spirillum.view.figures.style import new_figure

VOID = {"meta", "img", "br", "link", "hr", "input"}
STUDY = Path(biorob2012.__file__).with_name("study.toml")
HOSTILE = "<script>alert(1)</script>"


class Page(HTMLParser):
    """Checks nesting and collects what the tests look at."""

    def __init__(self, text: str) -> None:
        super().__init__(convert_charrefs=True)
        self.open: list[str] = []
        self.tags: list[tuple[str, dict[str, str | None]]] = []
        self.words: list[str] = []
        self.ids: list[str] = []
        self.feed(text)
        self.close()
        assert self.open == []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append((tag, dict(attrs)))
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        if not self.open or self.open[-1] != "style":
            self.words.append(data)

    @property
    def text(self) -> str:
        return " ".join(" ".join(self.words).split())

    def all(self, tag: str) -> list[dict[str, str | None]]:
        return [attributes for name, attributes in self.tags if name == tag]


def small_study(**more: Any) -> Any:
    grid = {"channels": {"wide": "biorob2012-wide"}, "wavelengths": ["25 mm"], "amplitudes": ["2 mm", "2.5 mm"]}
    return sp.study({"title": "Small", "grid": grid, **more})


def written(dataset: Any, folder: Path, *, vector: bool = False) -> Page:
    write_report(dataset, folder, lambda *_: None, vector=vector)
    return Page((folder / "report.html").read_text(encoding="utf-8"))


@pytest.fixture
def blank(monkeypatch: pytest.MonkeyPatch) -> None:
    """Empty sheets in place of the figures, where only the page's words are looked at."""
    monkeypatch.setattr(Picture, "figure", lambda _picture: new_figure(1.0, 1.0))


@pytest.fixture(scope="module")
def paper(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Page, Any]:
    """The report of the paper's study, with one of its four wavelengths and two of its four amplitudes."""
    folder = tmp_path_factory.mktemp("paper")
    study = tomllib.loads(STUDY.read_text("utf-8"))
    study["grid"] |= {"wavelengths": ["25 mm"], "amplitudes": ["2.5 mm", "3.5 mm"]}
    dataset = sp.study(study)
    with pytest.MonkeyPatch.context() as patch:  # what is drawn is no matter of the report
        patch.setattr(Picture, "figure", lambda _picture: new_figure(1.0, 1.0))
        return folder, written(dataset, folder, vector=True), dataset


def test_folder_holds_the_results_and_nothing_half_written(paper: tuple[Path, Page, Any]) -> None:
    folder = paper[0]
    assert sorted(path.name for path in folder.iterdir()) == ["claims.json", "figures", "ranking.csv", "report.html"]
    names = ["bound", "drop", "fig5-wide", "fig6-narrow", "ranking", "robot"]
    assert sorted(path.name for path in (folder / "figures").iterdir()) == sorted(
        f"{name}.{suffix}" for name in names for suffix in ("png", "svg")
    )


def test_pictures_are_inside_and_described(paper: tuple[Path, Page, Any]) -> None:
    folder, page, _ = paper
    images = page.all("img")
    assert len(images) == 6
    for image in images:
        kind, _, data = (image["src"] or "").partition(";base64,")
        assert kind == "data:image/svg+xml"
        assert base64.b64decode(data, validate=True).startswith(b"<?xml")
        assert len(image["alt"] or "") > 40
    first = (images[0]["src"] or "").partition(";base64,")[2]
    assert base64.b64decode(first) == (folder / "figures" / "ranking.svg").read_bytes()


def test_page_needs_nothing_from_elsewhere(paper: tuple[Path, Page, Any]) -> None:
    folder, page, _ = paper
    for tag, attributes in page.tags:
        assert tag not in {"script", "link", "iframe", "object", "base"}
        for name in ("src", "href", "srcset", "data", "action"):
            value = attributes.get(name)
            if value is None or value.startswith(("data:image/", "#")):
                continue
            assert ":" not in value
            assert not value.startswith("/")
            assert value == "dataset.nc" or (folder / value).is_file()
    assert "url(" not in (folder / "report.html").read_text(encoding="utf-8").split("</style>")[0]


def test_anchors_lead_somewhere(paper: tuple[Path, Page, Any]) -> None:
    page = paper[1]
    ids = {attributes["id"] for _, attributes in page.tags if "id" in attributes}
    wanted = [(link["href"] or "")[1:] for link in page.all("a") if (link["href"] or "").startswith("#")]
    assert wanted
    assert set(wanted) <= ids


def test_page_is_readable_everywhere(paper: tuple[Path, Page, Any]) -> None:
    folder, page, _ = paper
    text = (folder / "report.html").read_text(encoding="utf-8")
    assert page.all("html")[0]["lang"] == "en"
    assert any(meta.get("name") == "viewport" for meta in page.all("meta"))
    assert "prefers-color-scheme: dark" in text
    assert "@media print" in text


def test_page_says_that_nothing_is_measured_and_what_is_assumed(paper: tuple[Path, Page, Any]) -> None:
    _, page, dataset = paper
    before = page.text.split("The robot")[0]
    assert "Nothing in this report is measured" in before
    assert " ".join(dataset.attrs["note"].split()) in before


def test_page_holds_settings_versions_and_references(paper: tuple[Path, Page, Any]) -> None:
    _, page, dataset = paper
    for wanted in (dataset.attrs["fingerprint"], dataset.attrs["versions"], "Lighthill", "Table III", "open_dataset"):
        assert wanted in page.text
    assert "1.95" in page.text
    assert "0.6" in page.text


def test_every_friction_reading_has_a_meaning() -> None:
    assert set(FRICTION_MEANINGS) == set(FrictionModel.__args__)


@pytest.mark.usefixtures("blank")
def test_page_and_file_hold_every_claim(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    stated = [
        Claim("a & b", "1 < 2", "computed so", "agrees", "since"),
        Claim("second", "p", "c", "disagrees", "because"),
        Claim(HOSTILE, "p", "c", "undecidable", "no rates"),
    ]
    monkeypatch.setattr("spirillum.results.study.claims_of", lambda _dataset: stated)
    page = written(small_study(), tmp_path)
    for claim in stated:
        for value in claim.to_dict().values():
            assert value in page.text
    assert json.loads((tmp_path / "claims.json").read_text()) == [claim.to_dict() for claim in stated]
    classes = [attributes.get("class") or "" for attributes in page.all("span")]
    for verdict in ("agrees", "disagrees", "undecidable"):
        assert f"verdict {verdict}" in classes


@pytest.mark.usefixtures("blank")
def test_study_without_claims_has_an_empty_list(tmp_path: Path) -> None:
    page = written(small_study(), tmp_path)
    assert json.loads((tmp_path / "claims.json").read_text()) == []
    assert "Verdict" not in page.text


@pytest.mark.usefixtures("blank")
def test_hostile_words_stay_words(tmp_path: Path) -> None:
    dataset = small_study(title=HOSTILE, note='" onload="x" <b>')
    dataset.attrs |= note_attributes([HOSTILE])
    page = written(dataset, tmp_path)
    assert not page.all("script")
    assert not page.all("b")
    assert page.text.count(HOSTILE) >= 3


@pytest.mark.usefixtures("blank")
def test_hostile_channel_names_stay_in_the_folder(tmp_path: Path) -> None:
    grid = {
        "channels": {"../x": "biorob2012-wide", "a/b": "biorob2012-narrow"},
        "wavelengths": ["25 mm"],
        "amplitudes": ["2 mm"],
    }
    folder = tmp_path / "study"
    folder.mkdir()
    written(sp.study({"grid": grid}), folder)
    assert [path.name for path in tmp_path.iterdir()] == ["study"]
    assert all(path.is_file() for path in (folder / "figures").iterdir())


@pytest.mark.usefixtures("blank")
def test_observations_file_is_named(tmp_path: Path) -> None:
    path = tmp_path / "synthetic.csv"
    path.write_text(
        "# synthetic\nchannel_diameter_mm,wavelength_mm,amplitude_mm,forward_velocity_mm_s,tail_rate_Hz\n"
        "40,25,2.5,1,1.2\n"
    )
    grid = {"channels": {"wide": "biorob2012-wide"}, "wavelengths": ["25 mm"], "amplitudes": ["2.5 mm"]}
    page = written(sp.study({"grid": grid}, observations=path), tmp_path)
    assert "Measured: the observations file synthetic.csv" in page.text
    assert "Nothing in this report is measured" not in page.text


@pytest.mark.usefixtures("blank")
def test_progress_runs_to_its_end(tmp_path: Path) -> None:
    steps: list[tuple[str, int, int]] = []
    write_report(small_study(), tmp_path, lambda what, done, total: steps.append((what, done, total)))
    assert [done for _, done, _ in steps] == list(range(len(steps)))
    assert steps[-1][1] == steps[-1][2]
    assert all(what for what, _, _ in steps)


def test_a_study_without_figures_gets_them_by_a_rerun(tmp_path: Path) -> None:
    study = {"robots": ["biorob2012-wide"], "models": ["rft"]}
    sp.study(study, output=tmp_path / "out", figures=False)
    assert {path.name for path in (tmp_path / "out").iterdir()} >= {"dataset.nc", "claims.json", "ranking.csv"}
    assert not (tmp_path / "out" / "report.html").exists()
    sp.study(study, output=tmp_path / "out")
    assert (tmp_path / "out" / "report.html").exists()


def test_a_figure_that_is_removed_while_the_report_is_written_gets_a_sentence(tmp_path: Path) -> None:
    """As by somebody who tidies up the folder."""
    pictures = {name: Picture.of(name, "", name, lambda: new_figure(2.0, 1.0)) for name in ("first", "second")}

    def tidy_up(name: str, _done: int) -> None:
        if name == "second":
            (tmp_path / "figures" / "first.png").unlink()

    with pytest.raises(sp.InputError, match=r"first\.png was removed while the report was written; allowed: to leave"):
        draw_pictures(pictures, tmp_path, tidy_up)
