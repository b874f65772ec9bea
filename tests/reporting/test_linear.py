"""What is said of models beside the linear baseline."""

import pytest
from reporting.small_evidence import evidence

from awescli.reporting.html import page
from awescli.reporting.linear import beside_linear, briefly

MODELS = ("initial", "identified", "with_effects", "hybrid")


def scored(mean: float) -> dict:
    return {"horizon_s": 3.0, "nrmse": {"test": {"mean": mean}}}


def scores(outcome: str = "fitted", **not_beaten) -> dict:
    means = {"linear": 0.0623, "initial": 0.2, "identified": 0.11, "with_effects": 0.12, "hybrid": 0.05}
    baseline = {"outcome": outcome, "order": 2, "step_s": 0.1, "not_beaten": not_beaten}
    return {m: scored(mean) for m, mean in means.items()} | {"baseline": baseline}


@pytest.mark.parametrize(
    ("not_beaten", "said"),
    [
        (
            {"initial": ["3"], "identified": ["1", "3"]},
            "identified does not beat a linear model of the same inputs (ARX, 2 lags of 0.1 s) 1 and 3 s ahead: "
            "0.110 against 0.0623 at 3 s",
        ),
        (
            {"initial": ["3"], "identified": ["3"], "with_effects": ["3"], "hybrid": []},
            "identified and with_effects do not beat a linear model of the same inputs (ARX, 2 lags of 0.1 s) 3 s ahead: "
            "0.110 and 0.120 against 0.0623 at 3 s; hybrid beats it: 0.0500 against 0.0623 at 3 s",
        ),
        (
            {"initial": ["3"], "identified": ["1"]},
            "identified does not beat a linear model of the same inputs (ARX, 2 lags of 0.1 s) 1 s ahead; at 3 s it does, "
            "0.110 against 0.0623",
        ),
        (
            {"initial": ["3"]},
            "initial does not beat a linear model of the same inputs (ARX, 2 lags of 0.1 s) 3 s ahead: 0.200 against 0.0623 at 3 s",
        ),
    ],
)
def test_who_does_not_beat_it_is_said_in_plain_words(not_beaten, said):
    """Guards the sentence: which models, at which horizons, with both numbers; the declared one counts only where it stands alone."""
    assert beside_linear(scores(**not_beaten), tuple(not_beaten)) == said


def test_a_line_for_the_terminal_says_who_does_not_beat_it():
    """Guards evaluate's closing line: in 80 columns, for the numbers stand above it."""
    two = scores(initial=["3"], identified=["1", "3"], with_effects=["1", "3"], hybrid=["1"])
    assert briefly(two, ["identified"]) == "identified does not beat a linear model (ARX) 1 and 3 s ahead"
    assert briefly(two, MODELS) == (
        "identified and with_effects do not beat a linear model (ARX) 1 and 3 s ahead; hybrid does not beat a linear model (ARX) 1 s ahead"
    )
    none = scores(initial=["3"], identified=[], with_effects=[], hybrid=[])
    assert briefly(none, MODELS) == "identified, with_effects and hybrid beat a linear model (ARX) at every horizon"
    assert briefly(none, ["identified"]) == "identified beats a linear model (ARX) at every horizon"
    assert max(map(len, (briefly(two, ["identified"]), briefly(none, MODELS)))) <= 80
    assert "ARX, unstable" in briefly(scores("unstable", identified=["1"]), MODELS)


def test_what_went_wrong_with_it_is_said():
    assert "unstable, its predictions that run away are counted" in beside_linear(scores("unstable", identified=[]), ["identified"])
    assert beside_linear({"baseline": {"outcome": "too_short"}}, ()).startswith("There is no linear model") and beside_linear({}, ()) == ""


def test_it_is_on_the_page_and_is_none_of_the_nested_models():
    """Guards the report: tile, nested models, table of horizons and the sentence; the best model is still one of ours."""
    shown = evidence()
    text = page(shown)
    assert text.count("linear (ARX)") >= 4 and "Identified does not beat a linear model of the same inputs" in text
    assert shown.best == "hybrid" and "linear" not in shown.models and shown.compared[-1] == "linear"
