"""TOML as people write it: a path with backslashes, typographic signs and bare units get a sentence with the remedy."""

from pathlib import Path

import pytest

from spirillum import InputError
from spirillum.files import parse_toml
from spirillum.robot.load import load, parse_setting
from spirillum.vision.setup import load_setup


@pytest.mark.parametrize(
    "path",
    [
        r"C:\Users\me\robot.toml",  # \U begins a code point
        r"C:\data\robot.toml",  # \d is no escape
        r"..\robots\new.toml",  # \r and \n are characters
        r"C:\temp\new.toml",
        r"robots\new.toml",
        r"my robots\film 1.mp4",
        r"..\new\robots",
        r"new\robots",
        r"\\server\new\robot.toml",
        "D:\\robots\\",
    ],
)
@pytest.mark.parametrize("line", ['file = "{}"', 'file="{}"  # mine', "robot.file = [ \"{}\", 'x' ]"])
def test_backslashes_get_a_word_on_slashes_and_quotes(path: str, line: str) -> None:
    text = f'[camera]\nview = "top"\n{line.format(path)}\n'
    with pytest.raises(InputError, match=r"line 3.*backslashes, which TOML reads as escapes") as caught:
        parse_toml(text, "setup.toml", "a setup file")
    sentence = str(caught.value)
    assert f'forward slashes, "{path.replace(chr(92), "/")}", or single quotes, ' in sentence
    right = path.replace("\\", "/")
    assert parse_toml(text.replace(path, right), "setup.toml", "a setup file")


@pytest.mark.parametrize(
    "line",
    [
        r'x = "C:\\Users\\new\\robot.toml"',
        r"x = 'C:\Users\new\robot.toml'",
        r'description = "first line\nsecond line."',
        r'name = "a\tb"',
        r'# file = "C:\Users\new.toml"',
        r"""x = 'the text "a\nb.toml"'""",
        'x = """\na\\nb.toml\n"""',
        r'x = "a \"quoted\" word"',
    ],
)
def test_what_is_right_stays(line: str) -> None:
    parse_toml(f"{line}\n", "setup.toml", "a setup file")


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("file = “robot.toml”", "quotation marks are typographic"),
        ("x = \u22120.5", "a minus sign is a dash of Unicode; allowed: -"),
        ("x = 0,5", "decimal comma; allowed: 0.5"),
        ("height = 210 mm", 'is text; allowed: height = "210 mm"'),
        ("x = 1.2.3", "allowed: a setup file"),
    ],
)
def test_other_mistakes(line: str, words: str) -> None:
    with pytest.raises(InputError) as caught:
        parse_toml(f"a = 1\n{line}\n", "setup.toml", "a setup file")
    assert "at line 2" in str(caught.value)
    assert words in str(caught.value)


def test_every_reader_says_so(tmp_path: Path) -> None:
    path = tmp_path / "x.toml"
    path.write_text('[robot]\nfile = "..\\robots\\new.toml"\n')
    for reader in (load, load_setup):
        with pytest.raises(InputError, match=r"x.toml, line 2: .* forward slashes"):
            reader(path)
    with pytest.raises(InputError, match="forward slashes"):
        parse_setting('name = "C:\\new\\x.toml"', "--set", "name=a")
