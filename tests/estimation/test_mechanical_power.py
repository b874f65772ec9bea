"""Mechanical power against integrals that can be written down: energy is the integral of tension over length paid out."""

from dataclasses import replace

import numpy as np
import pytest
from kites import DEVELOPMENT, declared, flight

from awescli.estimation.mechanical_power import mechanical_power
from awescli.estimation.prediction import Prediction
from awescli.estimation.prediction_scores import power_of, scored
from awescli.flightlog.split import Split
from awescli.physics.kite import Kite
from awescli.simulation.rollout import Simulator

DT, PIECE = 0.02, 250
"""Pieces of 5 s; loops of 10 s below."""


def pieces(tension: np.ndarray, first: np.ndarray, factor: float = 1.0, alive: np.ndarray | None = None) -> Prediction:
    """Predictions of PIECE steps that begin at samples `first`, whose tension is the measured one times `factor`."""
    rows = first[:, None] + np.arange(PIECE + 1)[None]
    measured = tension[rows]
    alive = np.full(len(first), PIECE + 1) if alive is None else alive
    how = {"spans": {"tension": 1.0}, "floor": {"tension": 0.0}}
    return Prediction(np.arange(PIECE + 1) * DT, first, {"tension": measured}, {"tension": factor * measured}, alive, **how)


def test_a_constant_tension_and_speed():
    """Guards power and energy: 3 kN at 0.8 m/s are 2.4 kW and 24 kJ in a loop of 10 s; a model that pulls 10 % less says 10 % less, in
    every loop alike, so that its interval has no width."""
    samples, loops = 2001, np.array([[0, 500], [500, 1000], [1000, 1500], [1500, 2000]])
    block = mechanical_power(pieces(np.full(samples, 3000.0), np.arange(0, 2000, PIECE), 0.9), np.full(samples, 0.8), loops)
    assert (block["measured_mean_W"], block["mean_W"]) == (pytest.approx(2400.0), pytest.approx(2160.0))
    assert block["error_share"] == pytest.approx(-0.1) and block["interval_share"] == [pytest.approx(-0.1), pytest.approx(-0.1)]
    assert [row["measured_J"] for row in block["by_loop"]] == pytest.approx([24000.0] * 4)
    assert (block["seconds"], block["loop_seconds"], block["loops"]) == (pytest.approx(40.0), pytest.approx(40.0), 4)
    # loops that are all alike have no range to be measured by
    assert block["energy_per_loop_J"] == {"nrmse": None, "relative_rmse": pytest.approx(0.1), "loops": 4}


def test_energy_is_the_integral_of_tension_over_length():
    """Guards the quadrature and the bounds of loops: T = a + b l gives a (l2 - l1) + b (l2^2 - l1^2) / 2, whatever the speed does; the
    trapezoids of 20 ms are good to 3e-5."""
    time = np.arange(2001) * DT
    speed = 0.8 + 0.5 * np.sin(0.7 * time)
    length = 300 + 0.8 * time + 0.5 / 0.7 * (1 - np.cos(0.7 * time))
    a, b = 500.0, 8.0
    loops = np.array([[0, 430], [430, 1010], [1010, 1600], [1600, 2000]])
    block = mechanical_power(pieces(a + b * length, np.arange(0, 2000, PIECE)), speed, loops)
    ends = np.append(loops[:, 0], 2000)
    l1, l2 = length[ends[:-1]], length[ends[1:]]
    assert [row["measured_J"] for row in block["by_loop"]] == pytest.approx(a * (l2 - l1) + b * (l2**2 - l1**2) / 2, rel=3e-5)
    assert block["error_share"] == pytest.approx(0.0, abs=1e-12) and block["energy_per_loop_J"]["nrmse"] == pytest.approx(0.0, abs=1e-12)
    assert block["measured_mean_W"] == pytest.approx((a * (length[-1] - 300) + b * (length[-1] ** 2 - 300**2) / 2) / 40.0, rel=3e-5)


def test_what_predictions_do_not_cover_is_said():
    """Guards loops that end between two predictions: seconds are told, means are of the covered ones; a loop of which most is missing is
    not compared, one of which a part is missing counts with what it would be as a whole."""
    samples, loops = 2001, np.array([[0, 500], [500, 1000], [1000, 1400], [1400, 2000]])
    first = np.array([0, 250, 500, 750, 1000, 1400])  # 5 of the third loop's 8 s are predicted, 5 of the fourth's 12 s
    T = np.where(np.arange(samples) < 1000, 2000.0, 4000.0)
    block = mechanical_power(pieces(T, first, 1.1), np.full(samples, 0.5), loops)
    assert [row["seconds"] for row in block["by_loop"]] == pytest.approx([10.0, 10.0, 5.0, 5.0])
    assert (block["seconds"], block["loop_seconds"]) == (pytest.approx(30.0), pytest.approx(40.0))
    assert block["measured_mean_W"] == pytest.approx((20 * 1000 + 10 * 2000) / 30, rel=1e-3)
    # measured 10, 10 and 16 kJ, each predicted a tenth too large
    assert block["energy_per_loop_J"]["loops"] == 3
    assert block["energy_per_loop_J"]["nrmse"] == pytest.approx(np.sqrt(np.mean(np.square([1.0, 1.0, 1.6]))) / 6, rel=1e-3)
    assert mechanical_power(pieces(T, np.array([1600])), np.full(samples, 0.5), loops[:3]) is None


def test_a_prediction_that_diverged_goes_on_with_its_last_error():
    """Guards against power from numbers that are none, and against leaving a model's failures out."""
    samples, loops = 501, np.array([[0, 500]])
    found = pieces(np.full(samples, 3000.0), np.array([0, 250]), 1.2, alive=np.array([PIECE + 1, 100]))
    found.simulated["tension"][1, 100:] = 1e9
    block = mechanical_power(found, np.full(samples, 1.0), loops)
    assert block["mean_W"] == pytest.approx(3600.0) and block["error_share"] == pytest.approx(0.2)
    assert block["interval_share"] is None  # one loop says nothing of another


def test_the_share_does_not_need_power_of_one_sign():
    """Guards reeling in: a loop that costs energy counts against those that yield it."""
    samples, loops = 1001, np.array([[0, 500], [500, 1000]])
    speed = np.where(np.arange(samples) < 500, 1.0, -0.25)
    block = mechanical_power(pieces(np.full(samples, 3000.0), np.arange(0, 1000, PIECE), 0.9), speed, loops)
    assert block["by_loop"][1]["measured_J"] < 0 < block["measured_mean_W"] and block["error_share"] == pytest.approx(-0.1)


@pytest.fixture(scope="module")
def noisy():
    return flight(seed=1, duration=40.0, noise=True)


PARTS = Split(((100, 700),), ((700, 1100),), ((1100, 1900),), (1, 1, 2), "loops")
LOOPS = np.array([[1100, 1500], [1500, 1900]])


def test_a_true_model_predicts_the_power_of_unseen_loops(noisy):
    """Guards the way from a flight to the block: the true kite's power is right to 1 %; one that drags by 0.03 more is paid less, and
    says so beyond its interval's width."""
    kite = Kite(noisy.flown, noisy.log.wind.height)
    block, _ = scored(Simulator(kite, ()), noisy.log, PARTS, LOOPS, 5.0, ())
    T, v = noisy.log["tension"], noisy.log["reel_out_speed"]
    assert abs(block["power"]["error_share"]) < 0.01
    # 15 of 16 s are predicted: three pieces of 5 s
    assert block["power"]["seconds"] == pytest.approx(15.0)
    assert block["power"]["measured_mean_W"] == pytest.approx(np.mean((T * v)[1100:1850]), rel=0.01)
    slow = Kite(declared(CD0=DEVELOPMENT.parameters["CD0"].value + 0.03), noisy.log.wind.height)
    worse, _ = scored(Simulator(slow, ()), noisy.log, PARTS, LOOPS, 5.0, ())
    assert worse["power"]["error_share"] < -0.05


def test_only_what_predicts_its_tension_has_a_power(noisy):
    """Guards against a score that is none: no load cell, no line, or a model that is given the load cell's tension."""
    given = noisy.flown.model_copy(update={"tether": noisy.flown.tether.model_copy(update={"tension": "measured"})})
    without = replace(noisy.log, measured={n: s for n, s in noisy.log.measured.items() if n != "tension"})
    for flown, log in ((given, noisy.log), (noisy.flown, without)):
        block, _ = scored(Simulator(Kite(flown, log.wind.height), ()), log, PARTS, LOOPS, 1.0, ())
        assert "power" not in block
    aloft = Kite(noisy.flown.model_copy(update={"effects": ("gravity", "aerodynamics")}))
    assert power_of(aloft, pieces(noisy.log["tension"], np.array([1100])), noisy.log, LOOPS) is None
