"""Prediction of unseen flight: a perfect model scores at the noise, and nothing from the future is used."""

from dataclasses import replace

import numpy as np
import pytest
from kites import declared, flight, lively, truly

from awescli.estimation.prediction import SCORED, predict
from awescli.estimation.prediction_scores import scored
from awescli.flightlog.log import FlightLog
from awescli.flightlog.split import Split
from awescli.notation.quantities import STATES
from awescli.physics.kite import Kite
from awescli.simulation.rollout import Simulator
from awescli.simulation.scores import error, rmse

RANGES = [(300, 1500)]


@pytest.fixture(scope="module")
def noisy():
    return flight(seed=1, duration=40.0, noise=True)


def of(campaign):
    """The kite as it is, with no error of the recorded wind but what the station makes."""
    return Simulator(Kite(campaign.flown, campaign.log.wind.height), ())


def test_a_perfect_model_scores_near_the_noise_floor(noisy):
    """Guards prediction, warm-up and floor together: the true kite predicts 5 s of noisy loops at the sensors' noise. Above it are the
    station's error of the wind and of the start, below it the chance of some thousand samples."""
    prediction = predict(of(noisy), noisy.log, RANGES, 5.0)
    mean, floor = prediction.nrmse()["mean"], prediction.noise_floor()["mean"]
    assert 0.95 * floor < mean < 1.15 * floor and mean < 0.006 and prediction.diverged == 0
    assert set(STATES) <= set(prediction.simulated) <= set(SCORED)


def test_a_biased_heading_is_in_the_velocity_of_the_log_and_of_the_model():
    """Guards derived channels: u, v, w of a log are formed with the reported heading, and so are those of a model that knows its bias of
    3 deg. Beside the noise, the flight scores as one without a bias does."""
    biased = flight(seed=1, duration=40.0, noise=True, effects=(("heading_bias", (("b", np.radians(3.0)),)),))
    above = {}
    for name, campaign in (("clean", flight(seed=1, duration=40.0, noise=True)), ("biased", biased)):
        prediction = predict(of(campaign), campaign.log, RANGES, 5.0)
        above[name] = {n: prediction.nrmse()[n] / prediction.noise_floor()[n] for n in ("mean", "u", "v", "w")}
    assert above["biased"]["mean"] == pytest.approx(above["clean"]["mean"], rel=0.1)
    for n in "uvw":
        assert above["biased"][n] == pytest.approx(above["clean"][n], rel=0.1), n


def test_the_floor_is_what_noise_makes(noisy, calm):
    """Guards the noise floor by its meaning: NRMSE between the noisy and the noise-free log of the same flight."""
    prediction = predict(of(noisy), noisy.log, RANGES, 2.0)
    part = slice(*RANGES[0])
    for name in ("p_n", "v", "psi", "q", "tension", "V_a"):
        true_floor = rmse(error(noisy.log[name][part], calm.log[name][part], name)) / prediction.spans[name]
        # 1200 samples know a standard deviation to 2 %
        assert prediction.floor[name] == pytest.approx(true_floor, rel=0.08), name


def altered(log: FlightLog, after: int) -> FlightLog:
    """The log with everything measured changed from sample `after` on."""
    measured = {n: np.where(np.arange(len(log)) >= after, s + 0.3, s) for n, s in log.measured.items()}
    return replace(log, measured=measured)


def test_nothing_measured_later_is_used(noisy):
    """Guards against a start that peeks: what is measured after a prediction has begun leaves it unchanged to the last bit."""
    simulator = of(noisy)
    before = predict(simulator, noisy.log, [(300, 620)], 5.0)
    begin = int(before.first[0])
    # the smoothed first guess of a start reaches 0.15 s ahead of the warm-up's beginning, not of its end
    after = predict(simulator, altered(noisy.log, begin + 1), [(300, 620)], 5.0)
    for name in STATES:
        assert np.array_equal(before.simulated[name][0], after.simulated[name][0]), name
        assert not np.array_equal(before.measured[name][0], after.measured[name][0])


def test_predictions_stay_inside_their_ranges(noisy):
    """Guards the split: warm-up included, no prediction touches a sample outside the part it is scored on."""
    ranges = [(200, 560), (900, 1300)]
    prediction = predict(of(noisy), noisy.log, ranges, 3.0)
    samples = prediction.first[:, None] + np.arange(-50, len(prediction.time))[None]
    inside = np.zeros(len(noisy.log) + 1, bool)
    for a, b in ranges:
        inside[a - 50 : b] = True  # the warm-up may begin before the part: only its measurements are used, never scored
    assert inside[samples].all() and len(prediction.first) >= 2
    compared = prediction.first[:, None] + np.arange(len(prediction.time))[None]
    part = np.zeros(len(noisy.log) + 1, bool)
    for a, b in ranges:
        part[a:b] = True
    assert part[compared].all()


def test_invalid_samples_are_left_out(noisy):
    """Guards `valid`: no prediction spans a fault."""
    valid = np.ones(len(noisy.log), bool)
    valid[700:705] = False
    prediction = predict(of(noisy), replace(noisy.log, valid=valid), RANGES, 3.0)
    samples = prediction.first[:, None] + np.arange(-50, len(prediction.time))[None]
    assert len(prediction.first) and valid[samples].all()


def test_divergence_is_counted_and_scored_with_a_number(noisy):
    """Guards a wild model: its predictions end, are counted, and the score is finite."""
    simulator = Simulator(Kite(declared(Cmq=4e4), noisy.log.wind.height), ())
    prediction = predict(simulator, noisy.log, RANGES, 2.0)
    assert prediction.diverged == len(prediction.first) and all(np.isfinite(v) for v in prediction.nrmse().values())


def test_scores_per_horizon_loop_and_step_agree_with_the_predictions(noisy):
    """Guards the table of scores: what is said per loop adds up to what is said per part, and one step is one step."""
    loops = np.array([[200, 700], [700, 1000], [1000, 1300]])
    parts = Split(((200, 700),), ((700, 1000),), ((1000, 1300),), (1, 1, 1), "loops")
    block, predictions = scored(of(noisy), noisy.log, parts, loops, 3.0, (1.0, 2.0, 50.0))
    assert set(block["by_horizon"]) == {"1", "2"}  # no range holds 50 s
    assert block["nrmse"]["test"] == predictions["test"].nrmse()
    assert [(row["loop"], row["part"]) for row in block["by_loop"]] == [(1, "train"), (2, "validation"), (3, "test")]
    for row in block["by_loop"]:
        assert row["nrmse"] == pytest.approx(block["nrmse"][row["part"]])
    alone = predict(of(noisy), noisy.log, parts.test, 1.0)
    assert block["by_horizon"]["1"]["nrmse"] == alone.nrmse() and block["by_horizon"]["1"]["predictions"] == len(alone.first)
    assert block["one_step"]["horizon_s"] == noisy.log.dt and block["one_step"]["predictions"] > 10
    assert block["divergence_rate"] == {"train": 0.0, "validation": 0.0, "test": 0.0}
    e, measured = predictions["test"].errors("u"), predictions["test"].measured["u"]
    assert block["rmse"]["u"] == np.sqrt(np.mean(e**2)) and block["r2"]["u"] == 1 - np.sum(e**2) / np.sum((measured - measured.mean()) ** 2)


def test_the_rate_of_divergence_is_told(noisy):
    simulator = Simulator(Kite(declared(Cmq=4e4), noisy.log.wind.height), ())
    parts = Split(((200, 700),), ((700, 1000),), ((1000, 1300),), (1, 1, 1), "loops")
    block, _ = scored(simulator, noisy.log, parts, np.array([[200, 700]]), 2.0, (1.0,))
    assert block["divergence_rate"]["test"] == 1.0 and "diverged" in block["outcome"]
    assert block["by_horizon"]["1"]["diverged_predictions"] > 0


def test_a_simulated_truth_is_observed_as_it_is(kite, calm):
    """Guards the helper of these tests: what `truly` measures of a simulator has no residual against it."""
    simulator = Simulator(kite, ())
    observed = truly(lively(kite, calm.log, count=2, seconds=1.0), simulator)
    assert (observed.residual(simulator.rollout(observed.segments)) == 0).all()
