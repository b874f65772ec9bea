"""Fast logs: what is left of them is what a slower logger would have written, with less noise."""

from dataclasses import replace

import numpy as np
import pytest

from awescli.flightlog.log import FlightLog
from awescli.flightlog.thinning import thinned
from awescli.notation.quantities import MEASURED


def fast_log(rate: float, seconds: float = 20.0, noise: float = 0.0, seed: int = 0) -> FlightLog:
    t = np.arange(int(seconds * rate)) / rate
    random = np.random.default_rng(seed)
    measured = {n: np.sin(0.7 * t + i) + noise * random.normal(size=t.size) for i, n in enumerate(MEASURED[:15])}
    measured["psi"] = (2.5 + 0.4 * t + np.pi) % (2 * np.pi) - np.pi
    inputs = {"rudder": np.floor(t * 50 + 1e-6) / 50, "reel_out_speed": 1 + 0.1 * t}
    return FlightLog("fast", 0.0, 1 / rate, t, measured, inputs, np.ones(t.size, bool))


@pytest.mark.parametrize("rate, left", [(50, 50), (80, 80), (100, 50), (120, 60), (200, 50), (250, 50), (400, 50)])
def test_a_fast_log_has_the_values_of_a_slow_one(rate, left):
    """Guards that nothing moves in time: smooth signals keep their values at their times, headings go through 180 degrees, set-points are
    those of the sample, held as the controller held them."""
    log = thinned(fast_log(rate))
    assert 1 / log.dt == pytest.approx(left) and np.allclose(np.diff(log.time), log.dt) and log.time[0] == 0
    inner = slice(1, -1)
    for i, name in enumerate(MEASURED[:15]):
        if name != "psi":
            assert np.abs(log[name] - np.sin(0.7 * log.time + i))[inner].max() < 2e-5, name
    turned = (2.5 + 0.4 * log.time + np.pi) % (2 * np.pi) - np.pi
    assert np.abs(np.angle(np.exp(1j * (log["psi"] - turned))))[inner].max() < 1e-9
    assert np.allclose(log["rudder"], np.floor(log.time * 50 + 1e-6) / 50)
    assert (thinned(log) is log) and bool(log.notes) == (rate >= 100)


@pytest.mark.parametrize("rate, width", [(200, 3), (250, 5), (400, 7)])
def test_the_noise_falls_and_stays_white(rate, width):
    """Guards means that share no sample: the noise of n samples falls by sqrt(n), and neighbours stay independent."""
    log = thinned(fast_log(rate, 400.0, noise=0.1))
    rest = np.concatenate([(log[n] - np.sin(0.7 * log.time + i))[1:-1] for i, n in enumerate(MEASURED[:15]) if n != "psi"])
    assert rest.std() == pytest.approx(0.1 / np.sqrt(width), rel=0.02)
    assert abs(np.mean(rest[1:] * rest[:-1])) < 0.02 * rest.var()


def test_what_is_not_valid_stays_so_and_slow_sensors_stay_slow():
    """Guards masks: a sample with an invalid one around it is none; a 10 Hz channel of a 400 Hz log is new ten times a second."""
    plain = fast_log(400.0)
    valid = plain.valid.copy()
    valid[803:805] = False  # around sample 800, and no other that is picked
    fresh = {"p_n": np.arange(len(plain)) % 40 == 0}
    log = thinned(replace(plain, valid=valid, fresh=fresh, causes={"gap": np.array([[803, 805]])}))
    assert not log.valid[100] and np.count_nonzero(~log.valid) == 1
    assert log.fresh["p_n"].sum() == pytest.approx(200, abs=1) and (log["p_n"] == plain["p_n"][::8]).all()
