"""What effects make of what sensors report: formulae, signs and responses written out here."""

import numpy as np
import pytest
from kites import DEVELOPMENT, at_point
from oracles import body_to_ned
from physics.effect_cases import HEIGHTS, flown, reported
from scipy.spatial.transform import Rotation

from awescli.notation.quantities import MEASURED, OUTPUTS
from awescli.physics.kite import Kite


def test_sensors_report_by_their_formulae():
    """Guards scale, offset and channel of what only the sensors say; nothing else may change."""
    for key, expected in {
        "vane_bias:alpha": {"alpha": lambda y: 1.1 * y + 0.026},
        "vane_bias:beta": {"beta": lambda y: 1.1 * y + 0.026},
        "airspeed_scale": {"V_a": lambda y: 0.95 * y + 0.5},
        "load_cell_scale": {"tension": lambda y: 1.07 * y + 60.0},
        "heading_bias": {"psi": lambda y: y + 0.035},
        "imu_bias:rates": {"p": lambda y: y + 0.02, "q": lambda y: y - 0.03, "r": lambda y: y + 0.3},
        "imu_bias:accelerations": {"a_x": lambda y: y + 0.02, "a_y": lambda y: y - 0.03, "a_z": lambda y: y + 0.3},
    }.items():
        with_it, without = reported(key)
        for name in OUTPUTS:
            formula = expected.get(name, lambda y: y)
            assert with_it[name] == pytest.approx(formula(without[name]), rel=1e-13), (key, name)


def test_a_late_position_is_an_earlier_one(calm):
    """Guards sign and order of the latency: what is reported at t is where the kite was at t - tau, well within the noise of 10 cm."""
    values = {"position_latency.tau": 0.14}
    _, late, _ = flown("position_latency", calm, values)
    _, true, _ = flown("", calm)
    for name in ("p_n", "p_e", "p_d"):
        assert late[name][:, 7:] == pytest.approx(true[name][:, :-7], abs=0.07)
        assert np.abs(late[name] - true[name]).max() > 1.0
    for name in set(MEASURED) - {"p_n", "p_e", "p_d"}:
        assert np.array_equal(late[name], true[name])


def test_a_load_cell_filter_is_first_order(calm):
    """Guards tau dy/dt = T - y: the reported load is the exact response to the true one, from its start on."""
    values = {"load_cell_lag.tau": 0.2}
    _, filtered, _ = flown("load_cell_lag", calm, values)
    _, true, _ = flown("", calm)
    T, y = true["tension"][0], filtered["tension"][0]
    expected, decay = [y[0]], np.exp(-0.02 / 0.2)
    for k in range(len(T) - 1):
        slope = (T[k + 1] - T[k]) / 0.02  # exact for a load that runs linearly between samples
        expected.append(T[k + 1] - slope * 0.2 + (expected[-1] - T[k] + slope * 0.2) * decay)
    # the load jumps with the held set-points: a sample's jump times 10 % of the filter's memory
    assert np.abs(y - expected).max() < 0.02 * np.ptp(T) and np.abs(y - T).max() > 0.1 * np.ptp(T)


def test_a_pitot_behind_tubes_is_first_order(calm):
    """Guards tau dy/dt = V_a - y: the reported airspeed is the exact response to the true one, from a start that has been running as it
    does (a start at the airspeed itself would be off by tau times its rate, 2 m/s)."""
    values = {"airspeed_lag.tau": 0.3}
    _, lagging, segments = flown("airspeed_lag", calm, values)
    _, true, _ = flown("", calm)
    V, y, h = true["V_a"][0], lagging["V_a"][0], segments.dt
    expected, decay = [y[0]], np.exp(-h / 0.3)
    for k in range(len(V) - 1):
        slope = (V[k + 1] - V[k]) / h
        expected.append(V[k + 1] - slope * 0.3 + (expected[-1] - V[k] + slope * 0.3) * decay)
    assert np.abs(y - expected).max() < 2e-3 * np.ptp(V) and np.abs(y - V).max() > 0.1 * np.ptp(V)
    assert y[0] == pytest.approx(V[0] - 0.3 * (V[1] - V[0]) / h, abs=0.2)


def test_a_pitot_in_disturbed_flow():
    """Guards the three terms: 3 % more per 0.1 rad of angle of attack, as much to either side for sideslip, and 1 % per 0.1 rad of it."""
    kite = Kite(DEVELOPMENT, HEIGHTS, ("pitot_position_error",))
    kite = kite.with_values({"pitot_position_error.k_a": 0.3, "pitot_position_error.k_b": 0.1, "pitot_position_error.k_bb": 1.0})
    factors = []
    for v in (5.0, -5.0):
        still = {"wind_speed_0": 0.0, "wind_speed_1": 0.0, "wind_speed_2": 0.0, "v": v, "u": 40.0, "w": 4.0}
        point = at_point(kite, **still)
        factors.append(dict(zip(OUTPUTS, kite.outputs(*point), strict=True))["V_a"] / np.sqrt(40**2 + 4**2 + 5**2))
    alpha, beta = np.arctan2(4, 40), np.arctan2(5, np.hypot(40, 4))
    even = 1 + 0.3 * alpha + beta**2
    assert factors == pytest.approx([even + 0.1 * beta, even - 0.1 * beta]) and 0.02 < even - 1 < 0.06


def test_a_late_attitude_is_an_earlier_one(calm):
    """Guards sign and both orders of the latency: what is reported at t is how the kite stood at t - tau, to a tenth of the noise
    of 3.5 mrad in the median (every surface moves, and set-points jump from sample to sample); the rate alone is twice as far off."""
    tau, late_by = 0.04, 2
    _, late, _ = flown("attitude_latency", calm, {"attitude_latency.tau": tau})
    _, true, _ = flown("", calm)
    for name in ("phi", "theta", "psi"):
        then, now, said = true[name][0, :-late_by], true[name][0, late_by:], late[name][0, late_by:]
        first = now - tau * np.gradient(true[name][0], 0.02)[late_by:]
        error, of_first = (np.median(np.abs(x - then)) for x in (said, first))
        assert error < 3.5e-4 and of_first > 2 * error and np.abs(now - then).max() > 0.01, name
    for name in set(MEASURED) - {"phi", "theta", "psi"}:
        assert np.array_equal(late[name], true[name])


def test_a_box_that_is_turned_reports_along_its_own_axes():
    """Guards sign and channels of a misalignment: to first order what a rotation matrix says, of rates and accelerations alike."""
    turned, (away, straight) = np.array([-0.02, 0.035, 0.015]), reported("imu_misalignment")
    box = Rotation.from_rotvec(-turned).as_matrix()
    for channels in (("p", "q", "r"), ("a_x", "a_y", "a_z")):
        there, found = (np.array([of[n] for n in channels]) for of in (straight, away))
        assert found == pytest.approx(box @ there, abs=2e-3 * np.linalg.norm(there)) and np.abs(found - there).max() > 1e-3
    assert all(away[n] == straight[n] for n in set(MEASURED) - {"p", "q", "r", "a_x", "a_y", "a_z"})


def test_accelerometers_away_from_the_reference_point():
    """Guards all terms of the lever arm of accelerations: they are the rate at which the velocity of the box changes beside the kite's."""
    kite, plain = Kite(DEVELOPMENT, HEIGHTS, ("imu_arm",)), Kite(DEVELOPMENT, HEIGHTS)
    arm = np.array([0.35, -0.1, 0.05])
    kite = kite.with_values(dict(zip(("imu_arm.x", "imu_arm.y", "imu_arm.z"), arm.tolist(), strict=True)))
    (x, u, c), (x0, u0, c0) = at_point(kite), at_point(plain)
    found = np.subtract(kite.outputs(x, u, c), plain.outputs(x0, u0, c0))
    rate, h = np.array(plain.derivative(x0, u0, c0)[:12]), 1e-5
    moves = [body_to_ned(*z[6:9]) @ np.cross(z[9:12], arm) for z in (np.array(x0[:12]) - h * rate, np.array(x0[:12]) + h * rate)]
    a = [OUTPUTS.index(n) for n in ("a_x", "a_y", "a_z")]
    assert found[a] == pytest.approx(body_to_ned(*x0[6:9]).T @ (moves[1] - moves[0]) / (2 * h), abs=1e-6)
    assert np.abs(found[a]).min() > 1e-3 and not np.delete(found, a).any()


def test_an_antenna_away_from_the_reference_point():
    """Guards both lever arms: of position by the rotation alone, of velocity by omega x arm, whose derivative in time the first one is."""
    kite, plain = Kite(DEVELOPMENT, HEIGHTS, ("antenna_arm",)), Kite(DEVELOPMENT, HEIGHTS)
    kite = kite.with_values({"antenna_arm.x": 0.4, "antenna_arm.z": -0.3})
    (x, u, c), (x0, u0, c0) = at_point(kite), at_point(plain)
    away = lambda x: np.subtract(kite.outputs(list(x), u, c), plain.outputs(list(x), u0, c0))  # noqa: E731
    arm, R, omega = np.array([0.4, 0.0, -0.3]), body_to_ned(*x[6:9]), np.array(x[9:12])
    found = away(x)
    assert found[:3] == pytest.approx(R @ arm) and found[3:6] == pytest.approx(R @ np.cross(omega, arm)) and not found[6:].any()
    # the attitude a hundredth of a millisecond on
    rate, h = np.array(plain.derivative(x0, u0, c0)), 1e-5
    later = np.array(x)
    later[:12] += h * rate[:12]
    assert (away(later)[:3] - found[:3]) / h == pytest.approx(found[3:6], abs=1e-4)
