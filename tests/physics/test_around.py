"""What a winch's record says before and after now: a cubic through what was looked at, against the record itself."""

from dataclasses import replace

import numpy as np
import pytest
from kites import DEVELOPMENT, flight

from awescli.physics.effects.around import AROUND, LOOKED_AT, ahead, around
from awescli.physics.kite import Kite
from awescli.simulation.rollout import inputs_of


def reeled(t):
    """(length, speed, acceleration) of a winch whose speed swings with a period of 8 s."""
    w, t = 2 * np.pi / 8.0, np.asarray(t)
    return 300 + 0.8 * t - 0.4 / w * np.cos(w * t), 0.8 + 0.4 * np.sin(w * t), 0.4 * w * np.cos(w * t)


def looked_at(now: float) -> dict[str, float]:
    of_now, moments = reeled(now), reeled(now + np.array(AROUND))
    inputs = dict(zip(LOOKED_AT, of_now, strict=True))
    return inputs | {
        n: v - then for signal, then, values in zip(LOOKED_AT, of_now, moments, strict=True)
        for n, v in zip(around(signal), values, strict=True)
    }  # fmt: skip


@pytest.mark.parametrize("tau", [0.5, 0.13, -0.02, -1.9, 2.4, 3.99, -7.3, 10.0])
def test_the_cubic_follows_the_record(tau):
    """Guards the choice of the two looks, Hermite's polynomial and its slope: against the record tau ahead."""
    errors = np.max([
        np.abs(np.subtract(ahead(looked_at(now), tau), np.subtract(reeled(now + tau), reeled(now)))) for now in np.arange(0, 8, 0.7)
    ], axis=0)  # fmt: skip
    near = abs(tau) <= 2
    assert (errors < ((1e-5, 1e-5, 3e-4) if near else (1e-3, 1e-3, 1e-2))).all(), errors


def test_nothing_ahead_of_now_is_nothing_to_the_last_bit():
    assert ahead(looked_at(3.3), 0.0) == (0.0, 0.0, 0.0)


def test_a_log_is_looked_at_around_every_sample_and_goes_on_beyond_its_ends():
    """Guards the inputs that a simulator reads: the record tau later where there is one, the speed of the ends beyond."""
    log, kite = flight(duration=61.0).log, Kite(DEVELOPMENT, extra=("clock_offset:winch",))
    length, speed, _ = reeled(log.time)
    log = replace(log, inputs={**log.inputs, "tether_length": length, "reel_out_speed": speed})
    rows = inputs_of(log, kite)
    more = {n: rows[:, kite.input_names.index(around(n)[AROUND.index(4.0)])] for n in ("tether_length", "reel_out_speed")}
    assert more["tether_length"][:-200] == pytest.approx(length[200:] - length[:-200], abs=1e-9)
    assert more["reel_out_speed"][:-200] == pytest.approx(speed[200:] - speed[:-200], abs=1e-9)
    assert more["tether_length"][-1] == pytest.approx(4.0 * speed[-1]) and more["reel_out_speed"][-1] == pytest.approx(0.0)
