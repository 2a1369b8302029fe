"""What is read is a regular file, small enough on disk and in what it declares; all else is refused in a sentence."""

import json
import os
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

import posteriors
import spirillum as sp
from spirillum.errors import InputError
from spirillum.files import loaded_netcdf, opened, parse_toml, read_bytes, read_json
from spirillum.files.limits import MOST_LEVELS

WIDE = "biorob2012-wide"
Refused = Callable[..., str]
Soon = Callable[[Callable[[], object]], object]


def sentence(function: Callable[[], object]) -> str:
    with pytest.raises(InputError) as caught:
        function()
    return str(caught.value)


@pytest.mark.parametrize("kind", ["robot", "study", "run", "observations", "video", "posterior"])
def test_nobody_waits_for_a_pipe(pipe: Path, soon: Soon, kind: str) -> None:
    from spirillum.fitted.posterior_file import read_posterior

    read: dict[str, Callable[[], object]] = {
        "robot": lambda: sp.load(pipe.rename(pipe.with_suffix(".toml"))),
        "study": lambda: sp.study(pipe),
        "run": lambda: sp.film(pipe, pipe.with_name("f.mp4")),
        "observations": lambda: sp.calibrate(pipe, WIDE, model="sbt"),
        "video": lambda: _opened_video(pipe),
        "posterior": lambda: read_posterior(pipe),
    }
    assert "is not a regular file" in str(soon(lambda: sentence(read[kind])))


def _opened_video(path: Path) -> object:
    from spirillum.vision.video.frames import open_video

    return open_video(path)


def test_devices_and_links_to_them_are_refused(tmp_path: Path, soon: Soon) -> None:
    (tmp_path / "zero").symlink_to("/dev/zero")
    assert "is not a regular file" in str(soon(lambda: sentence(lambda: read_bytes(tmp_path / "zero", "a file"))))
    (tmp_path / "loop").symlink_to(tmp_path / "loop")
    for path in (tmp_path / "loop", tmp_path / "missing"):
        assert sentence(lambda path=path: read_bytes(path, "a file"))


def test_the_size_is_looked_at_first(tmp_path: Path) -> None:
    path = tmp_path / "huge"
    with path.open("wb") as stream:
        stream.truncate(1 << 40)
    assert "1099511627776 bytes" in sentence(lambda: opened(path, "a file", 1 << 30))


@pytest.mark.parametrize("text", ["a." * 100_000 + "b = 1", '"a" . ' * 50_000 + "b = 1", "[" + "a." * 100_000 + "b]"])
def test_keys_of_many_parts_are_refused_at_once(text: str) -> None:
    assert f"more than {MOST_LEVELS} parts" in sentence(lambda: parse_toml(text, "x", "a file"))


def test_dots_in_texts_and_numbers_are_no_key() -> None:
    text = f"note = \"{'a.' * 100}\"\nother = '{'b . ' * 100}'\nlist = [{'1.5, ' * 100}]\n# {'.' * 200}\na.b.c = 1\n"
    assert parse_toml(text, "x", "a file")["a"] == {"b": {"c": 1}}


def test_json_that_is_nested_deeply_is_damaged(tmp_path: Path) -> None:
    (tmp_path / "a.json").write_text("[" * 100_000)
    assert "is damaged" in sentence(lambda: read_json(tmp_path / "a.json", "a file"))


def declared(path: Path, change: Callable[[h5py.File], None]) -> Path:
    """A NetCDF file with something that its few bytes do not show."""
    with h5py.File(path, "w") as file:
        change(file)
    return path


def _unstored(file: h5py.File) -> None:
    file.create_dataset("time", (1 << 30,), "f8", chunks=(1 << 20,))


def _many_small(file: h5py.File) -> None:
    for number in range(3000):
        file.create_dataset(f"v{number}", (1,), "f8")


def _elsewhere(file: h5py.File) -> None:
    file["other"] = h5py.ExternalLink("/etc/passwd", "/")


def _raw_elsewhere(file: h5py.File) -> None:
    file.create_dataset("raw", (10,), "u1", external=[("/etc/passwd", 0, 10)])


def _in_circles(file: h5py.File) -> None:
    group = file.create_group("a")
    group["a"] = file["a"]


def _long_texts(file: h5py.File) -> None:
    texts = file.create_dataset("t", (2000,), h5py.string_dtype())
    texts[:] = "x" * 100_000


@pytest.mark.parametrize("change", [_unstored, _many_small, _elsewhere, _raw_elsewhere, _in_circles, _long_texts])
def test_what_a_netcdf_file_declares_is_held_against_limits(
    tmp_path: Path, refused: Refused, change: Callable[[h5py.File], None]
) -> None:
    path = declared(tmp_path / "run.nc", change)
    assert "allowed: " in sentence(lambda: loaded_netcdf(path, "a run"))
    for command in (
        ["film", str(path), "-o", str(tmp_path / "f.mp4")],
        ["render", WIDE, "--run", str(path), "-o", str(tmp_path / "v.mp4")],
        ["predict", WIDE, "--posterior", str(path)],
        ["suggest", str(path), WIDE],
    ):
        refused(*command)
    assert [item.name for item in tmp_path.iterdir()] == ["run.nc"]


def test_rows_of_parquet_are_counted_before_they_are_read(tmp_path: Path) -> None:
    pa, parquet = pytest.importorskip("pyarrow"), pytest.importorskip("pyarrow.parquet")
    from spirillum.measurement.observations import read_observations

    path = tmp_path / "o.parquet"
    block = pa.table({"wavelength_mm": pa.array(np.zeros(1 << 16))})
    with parquet.ParquetWriter(path, block.schema) as writer:
        for _ in range(20):
            writer.write_table(block)
    assert "1310720 observations; allowed: 1 to 1000000" in sentence(lambda: read_observations(path))
    words = pa.DictionaryArray.from_arrays(np.zeros(4000, np.int32), ["x" * 1_000_000])  # 4 GB as plain text
    long = pa.table({"robot": words})
    parquet.write_table(long, path)
    assert "allowed: short ones" in sentence(lambda: read_observations(path))


def test_compressed_parts_of_a_study_are_not_inflated(tmp_path: Path) -> None:
    study = {"title": "t", "models": ["sbt"], "robots": [WIDE]}
    whole = sp.study(study)
    parts = tmp_path / "out" / f"parts-{whole.attrs['fingerprint'][:16]}"
    parts.mkdir(parents=True)
    with zipfile.ZipFile(parts / "part-00000.npz", "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("outside.npy", b"\0" * (64 << 20))
    assert (parts / "part-00000.npz").stat().st_size < 1 << 20
    from spirillum.studies.run import stored_answer
    from spirillum.studies.study_loader import load_study
    from spirillum.studies.work import tasks

    task = next(iter(tasks(load_study(study))))
    assert stored_answer(0, task, parts, 4) is None
    os.remove(parts / "part-00000.npz")  # noqa: PTH107
    os.mkfifo(parts / "part-00000.npz")
    assert stored_answer(0, task, parts, 4) is None


@pytest.mark.parametrize("content", [b"[" * 100_000, b"", b"\xff", b"null", b'{"fingerprint": ' + b"1" * 5000 + b"}"])
def test_a_damaged_mark_of_a_study_is_refused(tmp_path: Path, content: bytes) -> None:
    (tmp_path / "study.json").write_bytes(content)
    said = sentence(lambda: sp.study({"title": "t", "models": ["sbt"], "robots": [WIDE]}, output=tmp_path))
    assert "study.json is damaged" in said or "another study" in said


def test_a_mark_that_is_a_pipe_or_a_device_is_refused(tmp_path: Path, soon: Soon) -> None:
    os.mkfifo(tmp_path / "study.json")
    asked = {"title": "t", "models": ["sbt"], "robots": [WIDE]}
    assert "damaged" in str(soon(lambda: sentence(lambda: sp.study(asked, output=tmp_path))))
    (tmp_path / "study.json").unlink()
    (tmp_path / "study.json").symlink_to("/dev/zero")
    assert "damaged" in str(soon(lambda: sentence(lambda: sp.study(asked, output=tmp_path))))


def test_a_pipe_in_the_cache_costs_time_only(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, soon: Soon) -> None:
    from spirillum.fluid.tube import cache

    monkeypatch.setenv("SPIRILLUM_CACHE", str(tmp_path))
    question = (1.0, "a")
    answer = np.ones((13, 13))
    compute = lambda _question: answer  # noqa: E731
    compute.__module__ = "spirillum.fluid.tube.solids"
    assert np.array_equal(cache.cached_or_computed(question, compute), answer)
    (kept,) = (tmp_path / "tube").glob("*.f64")
    kept.unlink()
    os.mkfifo(kept)
    assert np.array_equal(soon(lambda: cache.cached_or_computed(question, compute)), answer)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("settings", "[]"),
        ("settings", '[{"body": {"diameter": 0, "length": 0.04}}]'),
        ("settings", '[{"body": {"diameter": 1e400, "length": 1}}]'),
        ("settings", "[" * 50_000),
        ("channels", "[0]"),
        ("channels", "[-1]"),
        ("channels", "[]"),
        ("channels", "[null]"),
        ("parameters", "[]"),
        ("parameters", '[{"label": "body_drag"}]'),
        ("parameters", '[{"label": "x", "parameter": "body_drag", "channel": 0}]'),
        ("friction", '[{"value": NaN}]'),
        ("friction", '[{"channel_diameter": 0.04, "wavelength": 0, "amplitude": 1, "value": 1, "low": 1, "high": 1}]'),
        ("tails", '[{"seen": {}}]'),
        ("quantities", '["speed"]'),
        ("quantities", '["motor_rate"]'),
        ("model", "cfd"),
        ("friction_reading", "ice"),
        ("converged", 0),
        ("converged", "x"),
    ],
)
def test_forged_posteriors_are_refused(tmp_path: Path, name: str, value: Any) -> None:
    path = posteriors.write(tmp_path / "p.nc", posteriors.attributes() | {name: value})
    assert "allowed: " in sentence(lambda: sp.predict(WIDE, tail_rate="1 Hz", posterior=path))


def test_a_posterior_that_is_whole_is_read_and_one_that_was_changed_is_not(tmp_path: Path) -> None:
    path = posteriors.write(tmp_path / "p.nc")
    assert sp.predict(WIDE, tail_rate="1 Hz", posterior=path).to_dict()["forward_velocity"]["kind"] == "interval"
    for draws in (np.zeros((4, 100)), np.full((4, 100), np.nan), np.full((4, 100), 1e300), np.ones((1, 1))):
        posteriors.write(tmp_path / "q.nc", draws=draws)
        assert sentence(lambda: sp.predict(WIDE, tail_rate="1 Hz", posterior=tmp_path / "q.nc"))
    with h5py.File(path, "r+") as file:
        robots = json.loads(file.attrs["settings"])
        robots[0]["body"]["diameter"] *= 1.01
        file.attrs["settings"] = json.dumps(robots)
    assert "its checksum is another" in sentence(lambda: sp.predict(WIDE, tail_rate="1 Hz", posterior=path))


def test_a_damaged_dataset_of_a_study_is_computed_anew(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("spirillum.results.study.write_report", lambda *_, **__: None)
    study = {"title": "t", "models": ["sbt"], "robots": [WIDE]}
    whole = sp.study(study, output=tmp_path)
    path = tmp_path / "dataset.nc"
    for name in ("settings", "claims", "warnings"):
        with h5py.File(path, "r+") as file:
            del file.attrs[name]
        assert sp.study(study, output=tmp_path).identical(whole)
    with h5py.File(path, "r+") as file:
        file["forward_velocity"][...] *= 2.0
    assert sp.study(study, output=tmp_path).identical(whole)
    before = path.stat().st_mtime_ns
    assert sp.study(study, output=tmp_path).identical(whole)
    assert path.stat().st_mtime_ns == before  # what is whole is taken as it is


@pytest.fixture(scope="module")
def small_film(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A film of a few frames."""
    path = tmp_path_factory.mktemp("film") / "a.mp4"
    return sp.render(WIDE, path, trial={"duration": 0.3}, camera={"size": "64x64", "fps": 10.0}).path


@pytest.mark.parametrize("name", ["12:30.mp4", "subfile,,start,0,end,100,,:a.mp4", "http:", "concat:a.mp4|b.mp4"])
def test_names_of_films_are_names_and_no_protocols(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, small_film: Path, name: str
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("a.mp4").write_bytes(small_film.read_bytes())
    Path("b.mp4").write_bytes(small_film.read_bytes())
    from spirillum.vision.video.frames import open_video

    assert "does not exist" in sentence(lambda: open_video(name))
    Path(name).write_bytes(small_film.read_bytes())
    assert open_video(name).size == (64, 64)


def test_a_playlist_opens_no_other_film(tmp_path: Path, small_film: Path) -> None:
    from spirillum.vision.video.frames import open_video

    film = tmp_path / "a.mp4"
    film.write_bytes(small_film.read_bytes())
    head = "#EXTM3U\n#EXT-X-TARGETDURATION:1\n#EXTINF:1,\n"
    for name, text in {
        "list.m3u8": f"{head}{film}\n#EXT-X-ENDLIST\n",
        "list.mp4": f"{head}{film}\n#EXT-X-ENDLIST\n",
        "list.ffconcat": f"ffconcat version 1.0\nfile {film.name}\n",
    }.items():
        (tmp_path / name).write_text(text)
        assert "cannot be read as a film" in sentence(lambda name=name: open_video(tmp_path / name))


def test_images_are_measured_before_they_are_decoded(tmp_path: Path) -> None:
    from PIL import Image

    from spirillum.vision.video.pictures import read_image

    Image.new("1", (20_000, 20_000)).save(tmp_path / "bomb.png")
    assert "more than 50 million pixels" in sentence(lambda: read_image(tmp_path / "bomb.png"))
    (tmp_path / "no.png").write_bytes(b"\x89PNG\r\n")
    assert read_image(tmp_path / "no.png") is None


@pytest.mark.parametrize("name", ["a\0b", "\udcff.csv", "x" * 5000, ""])
def test_names_that_are_none_get_a_sentence(name: str) -> None:
    for call in (
        lambda: sp.measure(name, "s.toml"),
        lambda: sp.measure("a.mp4", name),
        lambda: sp.measure("a.mp4", "s.toml", marks=name),
        lambda: sp.study(observations=name),
        lambda: sp.calibrate(name, WIDE, model="sbt"),
        lambda: sp.export(WIDE, f"{name}.stl"),
        lambda: sp.study({"title": "t", "robots": [WIDE]}, output=name),
        lambda: sp.virtual_experiment(output=name),
    ):
        if name or call.__code__.co_names[-1] != "export":
            assert sentence(call)


def test_a_loop_of_links_is_no_video(tmp_path: Path) -> None:
    (tmp_path / "a.mp4").symlink_to(tmp_path / "b.mp4")
    (tmp_path / "b.mp4").symlink_to(tmp_path / "a.mp4")
    (tmp_path / "s.toml").write_text("")
    with pytest.raises(InputError):
        sp.measure(tmp_path / "a.mp4", tmp_path / "s.toml")
