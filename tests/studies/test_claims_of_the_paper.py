"""Verdicts: undecidable without observed rates, decided with them, never invented."""

import tomllib
from collections import Counter
from importlib.resources import files
from typing import Any

import pytest

import spirillum as sp
from spirillum.papers.biorob2012.claims_predicted import claims_of_study
from spirillum.papers.claim import Claim
from spirillum.papers.registry import claims_of


@pytest.fixture(scope="module")
def unobserved() -> list[Claim]:
    """Claims of the paper's study without observations."""
    return claims_of_study(sp.study())


@pytest.fixture(scope="module")
def brief() -> dict[str, Any]:
    """The paper's study without its curves against assumed motor rates, which take longest and decide no claim."""
    settings = tomllib.loads(files("spirillum.papers.biorob2012").joinpath("study.toml").read_text(encoding="utf-8"))
    return {name: value for name, value in settings.items() if name != "assumed_motor_rates"}


def by_words(claims: list[Claim], words: str) -> Claim:
    """The one claim that contains the words."""
    found = [claim for claim in claims if words in claim.claim]
    assert len(found) == 1, [claim.claim for claim in found]
    return found[0]


def test_statements_about_lost_rates_are_undecidable(unobserved: list[Claim]) -> None:
    for words in (
        "Reynolds number, wide",
        "Reynolds number, narrow",
        "lowest velocity decrease",
        "largest velocity decrease",
        "Forward velocity increases with wavelength",
        "Forward velocity decreases with amplitude",
        "Motor rates are identical",
        "motor's rate decreases with amplitude",
        "body rotation rates within 1 to 50 %",
        "B_eff depends mostly on the amplitude",
        "SBT predicts forward velocities better",
    ):
        claim = by_words(unobserved, words)
        assert claim.verdict == "undecidable", claim
        assert "observed rates are lost" in claim.reason


def test_friction_free_bound_exceeds_the_stated_reynolds_numbers(unobserved: list[Claim]) -> None:
    """2.9 to 4.3 times, as an independent evaluation of the models found."""
    factors = []
    for channel in ("wide", "narrow"):
        words = by_words(unobserved, f"Reynolds number, {channel}").computed.rsplit("factor of ", 1)[1]
        factors += [float(word.split()[1]) for word in words.split(", ")]
    assert (min(factors), max(factors)) == (2.9, 4.3)


def test_global_drop_is_judged_without_the_rates(unobserved: list[Claim]) -> None:
    """With equal motor rates the global loss is a weighted mean of single losses, whatever the weights."""
    assert by_words(unobserved, "wide to narrow, by SBT").verdict == "agrees"
    assert by_words(unobserved, "wide to narrow, by RFT").verdict == "disagrees"


def test_every_claim_is_complete(unobserved: list[Claim]) -> None:
    assert len(unobserved) > 20
    for claim in unobserved:
        assert all(claim.to_dict().values()), claim
    verdicts = Counter(claim.verdict for claim in unobserved)
    assert set(verdicts) == {"agrees", "disagrees", "undecidable"}


def test_synthetic_observations_decide(planted, brief: dict[str, Any]) -> None:
    """Speeds made by SBT: SBT then explains them best, and statements about them are decided."""
    claims = claims_of_study(sp.study(brief, observations=planted(brief, "sbt", "rotor", 1e-5)))
    assert by_words(claims, "SBT predicts forward velocities better").verdict == "agrees"
    assert by_words(claims, "Reynolds number, wide").verdict == "disagrees"
    assert by_words(claims, "largest velocity decrease").verdict == "disagrees"
    assert by_words(claims, "B_eff depends mostly on the amplitude").verdict in ("agrees", "disagrees")
    assert by_words(claims, "body rotation rates within 1 to 50 %").verdict in ("agrees", "disagrees")
    swapped = claims_of_study(sp.study(brief, observations=planted(brief, "rft", "rotor", 1e-5)))
    assert by_words(swapped, "SBT predicts forward velocities better").verdict == "disagrees"


@pytest.mark.parametrize("columns", ["forward_velocity_mm_s,tail_rate_Hz,body_rate_Hz", "forward_velocity_mm_s"])
def test_a_few_tails_decide_nothing_about_all_of_them(
    tmp_path, columns: str, unobserved: list[Claim], brief: dict[str, Any]
) -> None:
    """Synthetic rows of two wide tails: statements about all tails stay open, and say what is missing."""
    path = tmp_path / "observations.csv"
    values = "1.0,1.2,-0.1"[: 3 if "," not in columns else None]
    rows = [f"40,25,{amplitude},{values}" for amplitude in ("2.5", "3.5")]
    path.write_text("\n".join([f"channel_diameter_mm,wavelength_mm,amplitude_mm,{columns}", *rows]) + "\n")
    claims = claims_of_study(sp.study(brief, observations=path))
    assert [claim.claim for claim in claims] == [claim.claim for claim in unobserved]
    for few, none in zip(claims, unobserved, strict=True):
        assert "nan" not in few.computed
        if "Reynolds number, wide" not in few.claim:
            assert few.verdict == none.verdict, few
    assert "of 2 of 32 robots" in by_words(claims, "largest velocity decrease").reason


def test_other_studies_make_no_claims(small: dict[str, object]) -> None:
    assert claims_of(sp.study(small)) == []


def test_paper_study_without_a_named_tail_leaves_its_claim_open(small: dict[str, object]) -> None:
    claims = claims_of_study(sp.study({**small, "claims": "biorob2012"}))
    assert by_words(claims, "lowest velocity decrease").computed == "this study has no such tail"
