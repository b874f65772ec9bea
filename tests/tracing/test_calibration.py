"""Probabilities of answers against what was the case, by closed forms."""

import numpy as np
import pytest
from calibration import brier, error, lines, reliability, stated
from exact_scoring import Answer

PROBABILITY = {"actuator_lag:rudder": 0.5, "actuator_delay:rudder": 0.2, "actuator_lag:rudder+airspeed_scale": 0.1, "none": 0.05,
               "something_else": 0.15}  # fmt: skip
LAG, DELAY, SCALE = ("actuator_lag", "rudder"), ("actuator_delay", "rudder"), ("airspeed_scale", "report")


@pytest.mark.parametrize(
    "answer, expected",
    [
        (Answer("found", ((LAG,),)), 0.5),
        (Answer("found", ((("actuator_lag", "elevator"),),)), 0.0),
        (Answer("cannot_tell", ((LAG, DELAY),)), 0.7),
        (Answer("found", ((SCALE,), (LAG,))), 0.1),
        (Answer("cannot_tell", ((DELAY, ("Cndr", "parameter")),)), 0.25),
        (Answer("none"), 0.05),
        (Answer("unexplained"), 0.15),
        (Answer("not_testable"), 0.15),
        (Answer("not_deterministic"), 0.2),
    ],
)
def test_an_answer_has_the_probability_of_what_it_names(answer, expected):
    assert stated(answer, PROBABILITY) == pytest.approx(expected)


def test_scores_are_those_of_the_textbook():
    """Guards both scores by worked cases: always 0.9 and right half of the time; always certain and right; nobody answered."""
    half = [(0.9, True), (0.9, False)] * 10
    assert error(half) == pytest.approx(0.4) and brier(half) == pytest.approx((0.01 + 0.81) / 2)
    assert error([(1.0, True)] * 5) == brier([(1.0, True)] * 5) == 0.0
    assert error([(0.95, True), (0.05, True)]) == pytest.approx((0.05 + 0.95) / 2)
    assert error([]) == brier([]) == 0.0 and lines([]) == []


def test_who_is_right_as_often_as_stated_is_calibrated():
    """Guards the binning by simulation: answers right with the probability they state have no error beyond chance, and a Brier score of
    mean p (1 - p)."""
    random = np.random.default_rng(0)
    p = random.uniform(0, 1, 20_000)
    pairs = list(zip(p.tolist(), (random.uniform(0, 1, p.size) < p).tolist(), strict=True))
    assert error(pairs) < 0.02 and brier(pairs) == pytest.approx(1 / 6, abs=0.01)
    assert len(reliability(pairs)) == 10 and sum(count for *_, count in reliability(pairs)) == p.size
    assert "expected calibration error" in "\n".join(lines(pairs))
