"""Single values that are far off, but within what the signal reaches: found by what their neighbours say, and nothing else is."""

from pathlib import Path

import numpy as np
import pytest

from awescli.flightlog.read import read_flight
from awescli.flightlog.spikes import without_spikes
from awescli.physics.declaration import read_kite

DEMO = Path(__file__).parents[2] / "data" / "km1_demo"
NOISE = {name: std for name, (std, _) in read_kite(DEMO.parent / "kites" / "km1_initial.yaml").noise.channels().items()}
OFF = 15.0
"""Times the noise that the kite file declares."""


@pytest.fixture(scope="module")
def clean():
    log = read_flight(DEMO)
    return {name: np.array(log[name]) for name in ("p_n", "p_d", "v_e", "phi", "psi", "q", "a_x", "V_a")}


def looked_at(signals):
    """signal -> indices of what is taken as missing."""
    size = len(next(iter(signals.values())))
    found, _ = without_spikes(signals, np.arange(size))
    return {name: np.flatnonzero(np.isnan(x)).tolist() for name, x in found.items()}


def test_a_good_flight_has_none(clean):
    assert not any(looked_at(clean).values())


def test_values_that_are_off_are_found_and_nothing_else(clean):
    """A thousandth of the values, 15 standard deviations off, to either side: 0.05 rad of a heading that goes through all."""
    at = np.arange(500, 7000, 811)
    spiked = {name: x.copy() for name, x in clean.items()}
    for i, (name, x) in enumerate(spiked.items()):
        x[at + i] += OFF * NOISE[name] * np.where(np.arange(at.size) % 2, 1, -1)
    found = looked_at(spiked)
    for i, name in enumerate(spiked):
        assert found[name] == (at + i).tolist(), name


def test_a_nearer_one_beside_one_far_off(clean):
    psi = clean["psi"].copy()
    psi[3000] += 1.0
    psi[3002] += 0.12
    assert looked_at({"psi": psi})["psi"] == [3000, 3002]


def test_half_a_turn_off(clean):
    """To either side it is the same."""
    psi = clean["psi"].copy()
    psi[3000] += np.pi
    assert looked_at({"psi": psi})["psi"] == [3000]


def test_steps_and_corners_are_flown(clean):
    """After a gap a signal goes on elsewhere; an accelerometer may turn within a sample."""
    for name, x in clean.items():
        assert not looked_at({name: np.delete(x, slice(3000, 3025))})[name], name
        stepped = x + np.where(np.arange(x.size) >= 3000, 40 * NOISE[name], 0.0)
        assert not looked_at({name: stepped})[name], name
        bent = x + np.maximum(np.arange(x.size) - 3000, 0) * 10 * NOISE[name] * (np.arange(x.size) < 3050)
        assert not looked_at({name: bent[:3050]})[name], name


def test_a_slow_sensor_repeats_what_is_off(clean):
    """10 Hz in rows of 50 Hz: five rows, of which no running median knows."""
    slow = np.repeat(clean["p_n"][::5], 5)[: clean["p_n"].size]
    slow[3000:3005] += 3.0
    assert looked_at({"p_n": slow})["p_n"] == list(range(3000, 3005))


def test_a_log_that_stands_most_of_the_time(clean):
    """Two minutes of flight in an hour of standing: what is usual in flight is not usual in the log."""
    for name, x in clean.items():
        still = x[0] + 0.1 * NOISE[name] * np.random.default_rng(0).normal(size=25 * x.size)
        assert not looked_at({name: np.concatenate([still, x])})[name], name
        spiked = x.copy()
        spiked[3000] += 2 * OFF * NOISE[name]
        assert looked_at({name: np.concatenate([still, spiked])})[name] == [still.size + 3000], name
