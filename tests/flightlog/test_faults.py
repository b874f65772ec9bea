"""Known faults put into a clean flight are found where they are, and nothing is found in a clean one."""

import numpy as np
import pytest
from flightlog.synthetic import circle

from awescli.flightlog.faults import find_faults, mark_faults
from awescli.flightlog.quality import data_quality, white_noise


def spoiled(log, **signals):
    return type(log)(log.name, log.start, log.dt, log.time, {**log.measured, **signals}, log.inputs, log.valid, log.wind, log.groups)


@pytest.fixture(scope="module")
def log():
    return circle(noise=0.01)


def test_a_clean_flight_has_no_faults(log):
    assert find_faults(log) == [] and mark_faults(log) is log
    quality = data_quality(log)
    # its nose points along the way over ground, and its wind does not grow with height
    poor = [c.name for c in quality.checks if not c.ok and not c.name.startswith(("airspeed", "nose", "wind against"))]
    assert poor == [] and quality.loop_count == 7


def test_stuck_saturated_and_dead_sensors(log):
    pitot, load, gyro = log["V_a"].copy(), np.minimum(log["tension"], 2300.0), np.zeros(len(log)) + 0.3
    pitot[1000:1200] = pitot[1000]
    marked = mark_faults(spoiled(log, V_a=pitot, tension=load, q=gyro))
    kinds = {f.signal: f.kind for f in find_faults(spoiled(log, V_a=pitot, tension=load, q=gyro))}
    assert kinds == {"V_a": "stuck", "tension": "saturated", "q": "dead"}
    assert not marked.valid[1000:1200].any() and not marked.valid[load == 2300.0].all() and "q" not in marked
    assert (~marked.valid).sum() <= 202 + (load == 2300.0).sum()
    assert not next(c for c in data_quality(marked).checks if c.name == "sensor faults").ok


@pytest.mark.parametrize("many", [3, 6, 12])
@pytest.mark.parametrize("rows", [lambda n: slice(0, n), lambda n: slice(-n, None)], ids=["first", "last"])
def test_a_recorder_that_runs_before_or_after_its_sensors(log, many, rows):
    """Guards logs whose first rows are zeros: a leap stands on one side of them alone, and they were flown. One or two are spikes."""
    zeros = {name: x.copy() for name, x in log.measured.items()}
    for x in zeros.values():
        x[rows(many)] = 0.0
    marked = mark_faults(spoiled(log, **zeros))
    assert not marked.valid[rows(many)].any() and (~marked.valid).sum() <= many + 1


def test_contradictions_are_found(log):
    checks = {c.name: c for c in data_quality(log).checks}
    assert checks["position against velocity"].ok and checks["acceleration against velocity"].ok

    lag = 10
    late = spoiled(log, **{n: np.concatenate([np.full(lag, log[n][0]), log[n][:-lag]]) for n in ("p_n", "p_e", "p_d")})
    found = {c.name: c for c in data_quality(late).checks}
    assert not found["position lag"].ok and abs(found["position lag"].value - 0.2) < 0.02
    wrong_sign = {c.name: c for c in data_quality(spoiled(log, r=-log["r"])).checks}
    assert not wrong_sign["attitude against rates"].ok
    gravity = spoiled(log, **{n: x for n, x in zip(("a_x", "a_y", "a_z"), _specific_force(log), strict=True)})
    assert "minus gravity" in next(c for c in data_quality(gravity).checks if c.name == "acceleration against velocity").sentence


def test_white_noise_is_measured():
    t = np.arange(5000) * 0.02
    noisy = 100 * np.sin(0.7 * t) + 0.1 * np.random.default_rng(4).standard_normal(t.size)
    assert abs(white_noise(noisy) / 0.1 - 1) < 0.05 and white_noise(noisy[:20]) is None


def _specific_force(log):
    from awescli.notation.frames import rotate_back, rotation_body_to_ned

    R = rotation_body_to_ned(log["phi"], log["theta"], log["psi"])
    g = rotate_back(R, (0 * log.time, 0 * log.time, np.full(len(log), 9.80665)))
    return [log[n] - x for n, x in zip(("a_x", "a_y", "a_z"), g, strict=True)]
