"""Single values that are far off, but within what the signal reaches: found by what their neighbours say, and nothing else is."""

from pathlib import Path

import numpy as np
import pytest
from scipy.signal import lfilter

from awescli.flightlog.read import read_flight
from awescli.flightlog.spikes import without_spikes
from awescli.physics.declaration import read_kite

DEMO = Path(__file__).parents[2] / "data" / "km1_demo"
NOISE = {name: std for name, (std, _) in read_kite(DEMO.parent / "kites" / "km1_initial.yaml").noise.channels().items()}
OFF = 20.0
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


@pytest.mark.parametrize("every", [811, 97])
def test_values_that_are_off_are_found_and_nothing_else(clean, every):
    """A thousandth and a hundredth of the values, 20 standard deviations off, to either side: 0.07 rad of a heading that goes through all.
    One in a hundred puts a twentieth of all values off what their neighbours say."""
    at = np.arange(500, 7000, every)
    spiked = {name: x.copy() for name, x in clean.items()}
    for i, (name, x) in enumerate(spiked.items()):
        x[at + i] += OFF * NOISE[name] * np.where(np.arange(at.size) % 2, 1, -1)
    found = looked_at(spiked)
    for i, name in enumerate(spiked):
        assert set(found[name]) <= set(at + i) and len(found[name]) >= 0.99 * len(at) - 1, name


def test_a_nearer_one_beside_one_far_off(clean):
    psi = clean["psi"].copy()
    psi[3000] += 1.0
    psi[3002] += 0.12
    assert looked_at({"psi": psi})["psi"] == [3000, 3002]


@pytest.mark.parametrize("far, near, side", [(-175.0, 6.4, -1), (-175.0, 6.4, 1), (60.0, 12.0, -1), (300.0, -5.0, 1)])
def test_two_in_a_row_of_different_size(clean, far, near, side):
    """Guards a flight of JSBSim that was `not_testable` (family 43, a GNSS antenna): a velocity 175 m/s off was taken out, and the one
    beside it, 6 m/s off, was left, for the place of the first was filled from it."""
    v, psi = clean["v_e"].copy(), clean["psi"].copy()
    v[3000] += far
    v[3000 + side] += near
    psi[[2, -2]] += 1.0  # next to an end there is nobody to ask
    found = looked_at({"v_e": v, "psi": psi})
    assert found["v_e"] == sorted((3000, 3000 + side))
    assert set(found["psi"]) <= {2, psi.size - 2}


@pytest.mark.parametrize("first, second", [(0.32, -0.25), (0.3, 0.3), (-0.2, -0.35), (-0.25, 0.15)])
def test_two_in_a_row(clean, first, second):
    """Guards another one (family 43, a line's drag): a roll of +18 and -15 deg, one after the other, of which each vouched for the other.
    The noise of the whole flight was three times what it is, and the answer `unexplained`."""
    phi = clean["phi"].copy()
    phi[3000:3002] += first, second
    assert looked_at({"phi": phi})["phi"] == [3000, 3001]


@pytest.mark.parametrize("at", [0, -1])
@pytest.mark.parametrize("far", [1000.0, 60.0])
def test_the_first_and_the_last_value(clean, at, far):
    """Guards a flight of JSBSim in the field whose first velocity was 317 m/s off (family 44, a wind offset): it vouched for itself, no
    model came near the flight, and each of its fits was looked for in vain."""
    spiked = {name: x.copy() for name, x in clean.items()}
    for name, x in spiked.items():
        x[at] += min(far * NOISE[name], 1.5) if name in ("phi", "psi") else far * NOISE[name]
    assert looked_at(spiked) == {name: [range(x.size)[at]] for name, x in spiked.items()}


@pytest.mark.parametrize("at", [0, -1])
def test_the_first_and_the_last_set_point(at):
    rudder = 0.1 * np.sin(np.arange(3000) / 40)
    rudder[at] += 2.0
    assert looked_at({"rudder": rudder}) == {"rudder": [range(rudder.size)[at]]}


@pytest.mark.parametrize("at", [1, -2, 2, -3])
def test_one_beside_an_end_is_not_the_end(clean, at):
    psi = clean["psi"].copy()
    psi[at] += 0.4
    assert looked_at({"psi": psi})["psi"] in ([range(psi.size)[at]], [])


def test_half_a_turn_off(clean):
    """To either side it is the same."""
    psi = clean["psi"].copy()
    psi[3000] += np.pi
    assert looked_at({"psi": psi})["psi"] == [3000]


def test_corners_without_noise_are_flown(clean):
    """A simulator has none: where straight stretches meet, both go through the corner, and the cubic does not."""
    for name, x in clean.items():
        bent = np.interp(np.arange(4 * x.size) / 4, np.arange(x.size), np.unwrap(x) if name in ("phi", "psi") else x)
        assert not looked_at({name: bent})[name], name


def test_steps_and_corners_are_flown(clean):
    """After a gap a signal goes on elsewhere; an accelerometer may turn within a sample."""
    for name, x in clean.items():
        assert not looked_at({name: np.delete(x, slice(3000, 3025))})[name], name
        stepped = x + np.where(np.arange(x.size) >= 3000, 40 * NOISE[name], 0.0)
        assert not looked_at({name: stepped})[name], name
        bent = x + np.maximum(np.arange(x.size) - 3000, 0) * 10 * NOISE[name] * (np.arange(x.size) < 3050)
        assert not looked_at({name: bent[:3050]})[name], name


@pytest.mark.parametrize("rate", [10, 25, 50])
def test_a_manoeuvre_in_quiet_flight_is_flown(rate):
    """Doublets of the ailerons in five minutes of straight flight, through a roll mode of 0.17 s: what is rare is not off."""
    random, time = np.random.default_rng(rate), np.arange(0, 300, 0.01)
    moment = sum(0.4 * sign * ((time >= t) & (time < t + w)) for t, w, sign in ((100, 0.3, 1), (100.3, 0.3, -1), (200, 1, 1), (201, 1, -1)))
    p = lfilter([0, 0.06], [1, -0.94], moment)
    signals = {"p": p, "phi": 0.01 * np.cumsum(p)}
    sampled = {n: x[:: 100 // rate] for n, x in signals.items()}
    sampled = {n: x + NOISE[n] * random.normal(size=x.size) for n, x in sampled.items()}
    assert not any(looked_at(sampled).values())


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
