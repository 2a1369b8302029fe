"""The setup says whether the body's cover is opaque or glass; unset it is unknown."""

import tomllib

import pytest

from spirillum.errors import InputError
from spirillum.measurement.setup_template import setup_text
from spirillum.vision.setup import Setup, load_setup


def test_unset_it_is_unknown_and_the_template_offers_it(tmp_path):
    text = setup_text()
    assert Setup.model_validate(tomllib.loads(text)).robot.appearance == "unknown"
    (tmp_path / "a.toml").write_text(text.replace("# appearance", "appearance"))
    assert load_setup(tmp_path / "a.toml")[0].robot.appearance == "glass"


def test_another_word_is_refused(tmp_path):
    (tmp_path / "a.toml").write_text(setup_text().replace('# appearance = "glass"', 'appearance = "clear"'))
    with pytest.raises(InputError, match=r"robot\.appearance = 'clear'.*'opaque'"):
        load_setup(tmp_path / "a.toml")
