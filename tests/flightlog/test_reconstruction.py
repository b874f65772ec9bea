"""Flight-path reconstruction against truth: flights known exactly, sensors of known noise, drift and errors; dense algebra as oracle."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from kites import flight
from scipy.ndimage import uniform_filter1d
from scipy.signal import lfilter
from scipy.spatial.transform import Rotation
from sensors import ACCELERATION, ATTITUDE, POSITION, RATES, VELOCITY, Sensors, wander

from awescli.flightlog.read import read_flight
from awescli.flightlog.reconstruction.flight_path import reconstruct
from awescli.flightlog.reconstruction.gauss_markov import FAR, BandedLikelihood, Law, Series
from awescli.flightlog.reconstruction.levels import Known, estimate_levels
from awescli.flightlog.reconstruction.motion_of import motion_of, turn, turned_by
from awescli.flightlog.reconstruction.solve import thinned
from awescli.flightlog.reconstruction.tables import error_table, noise_table, said
from awescli.notation.angles import wrap

DEG = np.pi / 180
SHARED = Path(__file__).parents[2].parent / "shared" / "flights"


def short_series(random, n=60, restart_at=35):
    """Two channels, an Ornstein-Uhlenbeck process in one, a random walk in both, two shapes; uneven times, gaps, a restart."""
    time = np.cumsum(random.uniform(0.05, 0.3, n))
    restart = np.zeros(n, bool)
    restart[[0, restart_at]] = True
    H = np.zeros((n, 2, 2))
    H[:, 0, 0], H[:, 0, 1], H[:, 1, 1] = 1.0, 1.0, np.cos(time)
    X = np.stack([np.stack([time, 0 * time + 1], 1), np.stack([np.sin(time), time**2], 1)], axis=2)
    seen = random.random((n, 2)) < 0.8
    return Series(random.normal(0, 1, (n, 2)), X, H, seen, restart, time, ("a", "b"), np.array([np.inf, 2.0]))


def dense(series, white, laws):
    """(beta, covariance, restricted deviance, white noise of what is seen) from the covariance of all samples at once, as textbooks write
    generalised least squares."""
    n, m, s = series.H.shape
    stretch = np.cumsum(series.restart)
    apart = np.abs(series.time[:, None] - series.time)
    P = np.zeros((n, s, n, s))
    for law in laws:
        for i in law.states:
            if law.walks:
                first = np.array([series.time[series.restart][k - 1] for k in stretch])
                since = np.minimum(series.time[:, None], series.time) - first[:, None]
                K = FAR**2 + law.level**2 * since
            else:
                K = law.level**2 * np.exp(-apart / law.memory)
            P[:, i, :, i] = np.where(stretch[:, None] == stretch, K, 0.0)
    V = np.einsum("nas,nsmt,mbt->namb", series.H, P, series.H).reshape(n * m, n * m) + np.diag(np.tile(np.array(white) ** 2, n))
    keep = series.seen.ravel()
    V, y, X = V[np.ix_(keep, keep)], series.y.ravel()[keep], series.X.reshape(n * m, -1)[keep]
    inverse = np.linalg.inv(V)
    A = X.T @ inverse @ X + np.diag(1 / series.prior**2)
    beta = np.linalg.solve(A, X.T @ inverse @ y)
    left = y - X @ beta
    quadratic = left @ inverse @ left + (beta**2 / series.prior**2).sum()
    white_noise = np.tile(np.array(white) ** 2, n)[keep] * (inverse @ left)
    return beta, np.linalg.inv(A), quadratic + np.linalg.slogdet(V)[1] + np.linalg.slogdet(A)[1], white_noise


@pytest.mark.parametrize("shared", [True, False], ids=["a state that both see", "a state of each"])
def test_the_banded_likelihood_is_generalised_least_squares(shared):
    """Values, covariance, differences of the deviance between two sets of levels, and what smoothing leaves, against dense algebra."""
    random = np.random.default_rng(1)
    series = short_series(random)
    series.H[:, 0, 1] *= shared
    banded = BandedLikelihood(series)
    sets = []
    for white, drift, memory, walk in (((0.5, 0.8), 0.7, 2.0, 0.3), ((1.1, 0.4), 0.2, 5.0, 0.9)):
        laws = (Law("drift", (0,), drift, memory), Law("walk", (1,), walk))
        found, (beta, covariance, deviance, left) = banded.at(np.array(white), laws, smooth=True), dense(series, white, laws)
        np.testing.assert_allclose(found.beta, beta, rtol=1e-5, atol=1e-7)
        np.testing.assert_allclose(found.covariance, covariance, rtol=1e-5, atol=1e-8)
        np.testing.assert_allclose(found.left[series.seen], left, rtol=1e-4, atol=1e-6)
        sets.append((found.deviance, deviance))
    # FAR loses six digits of the dense inverse, not of the banded one
    assert sets[0][0] - sets[1][0] == pytest.approx(sets[0][1] - sets[1][1], abs=1e-3)


def test_levels_return_within_their_intervals():
    """Known processes, 40 draws: white level, drift level and memory lie in their 95 % intervals about as often as these say."""
    inside = []
    for seed in range(40):
        random = np.random.default_rng(seed)
        n, dt = 1500, 0.1
        y = wander(random, n, dt, 0.5, 3.0)[:, None] + random.normal(0, 0.3, (n, 1))
        restart = np.arange(n) == 0
        one, time = np.ones((n, 1, 1)), np.arange(n) * dt
        series = Series(y, one, one, one[:, :, 0] > 0, restart, time, ("mean",), np.array([np.inf]))
        known = [Known(0.2, 2), Known(0.3, 2), Known(5, 2)]
        levels = estimate_levels(BandedLikelihood(series), [0.2], (Law("drift", (0,), 0.3, 5.0),), known)
        found = np.array([levels.white[0], levels.laws[0].level, levels.laws[0].memory])
        inside.append(np.abs(np.log(found / [0.3, 0.5, 3.0])) < 1.96 * levels.spread)
    assert (np.mean(inside, axis=0) >= 0.85).all(), np.mean(inside, axis=0)


def test_turn_and_back():
    vectors = np.random.default_rng(0).normal(0, 0.7, (50, 3))
    np.testing.assert_allclose(turned_by(turn(vectors)), vectors, atol=1e-12)
    np.testing.assert_allclose(turn(np.array([[0, 0, np.pi / 2]]))[0] @ [1, 0, 0], [0, 1, 0], atol=1e-12)


def test_integrals_are_of_fourth_order():
    """Half the step, a sixteenth of the error; of the cubic itself none."""
    log = flight(3, 40.0).log
    motion = motion_of(log)
    errors = []
    for dt in (0.2, 0.1):
        t = np.arange(0, 20, dt)
        part = replace(motion, log=replace(log, dt=dt), rows=np.arange(len(t)), restart=np.arange(len(t)) == 0, good=np.ones(len(t), bool))
        errors.append(np.abs(part.run(part.steps(np.cos(t))) - np.sin(t))[5:-5].std())
    assert errors[0] / errors[1] > 12


@pytest.fixture(scope="module")
def true():
    """150 s of loops as they truly were."""
    return flight(3, 150.0).log


def noise_of(path):
    return {n.channel: n for n in path.noise}


def errors_of(path):
    return {(e.name, e.acts_on[0]): e for e in path.errors}


@pytest.mark.parametrize("factor", [0.5, 2.0])
def test_white_levels_within_ten_percent(true, factor):
    sensors = Sensors(factor=factor)
    path = reconstruct(sensors.record(true, int(10 * factor)))
    noise = noise_of(path)
    for channel in (*POSITION, *VELOCITY, *ATTITUDE, *RATES, *ACCELERATION, "V_a"):
        assert noise[channel].white.value == pytest.approx(factor * sensors.white[channel], rel=0.1), channel
    assert not path.findings
    assert all(noise[c].drift is None for c in (*POSITION, *ATTITUDE, "V_a"))


@pytest.mark.parametrize("stride", [2, 5])
def test_levels_at_25_and_10_hz(true, stride):
    """Every n-th row of the log: the same levels."""
    log = Sensors(attitude=(0.6 * DEG, 5.0)).record(true, 5)
    rows = slice(None, None, stride)
    slow = replace(
        log, time=log.time[rows], dt=log.dt * stride, valid=log.valid[rows], measured={k: s[rows] for k, s in log.measured.items()},
        inputs={k: s[rows] for k, s in log.inputs.items()},
    )  # fmt: skip
    noise = noise_of(reconstruct(slow))
    for channel in (*POSITION, *VELOCITY, *ATTITUDE, "V_a"):
        assert noise[channel].white.value == pytest.approx(Sensors().white[channel], rel=0.12), channel
    assert noise["phi"].drift.value == pytest.approx(0.6 * DEG, rel=0.3)


def test_a_slow_gps_counts_where_it_is_new(true):
    log = Sensors().record(true, 6)
    fresh = np.arange(len(log)) % 5 == 0
    held = {n: log[n][np.arange(len(log)) // 5 * 5] for n in POSITION}
    path = reconstruct(replace(log, measured={**log.measured, **held}, fresh={n: fresh for n in POSITION}))
    assert noise_of(path)["p_n"].white.value == pytest.approx(0.1, rel=0.1)
    assert abs(errors_of(path)["position_latency", "p_n"].size) < 0.005


def test_drift_is_colour_and_no_bias(true):
    """Levels of drift within 25 %, and nothing is found: an inertial system that wanders by a degree has no error of a sensor's."""
    path = reconstruct(Sensors(attitude=(1.0 * DEG, 5.0), position=(0.5, 6.0), gusts=(0.8, 4.0)).record(true, 2))
    noise = noise_of(path)
    assert noise["phi"].drift.value == pytest.approx(1.0 * DEG, rel=0.25) and noise["psi"].drift.value == pytest.approx(1.0 * DEG, rel=0.25)
    assert noise["p_n"].drift.value == pytest.approx(0.5, rel=0.25) and noise["V_a"].drift.value == pytest.approx(0.8, rel=0.25)
    assert not path.findings, path.findings
    for channel in (*POSITION, *ATTITUDE, *VELOCITY):
        assert noise[channel].white.value == pytest.approx(Sensors().white[channel], rel=0.1), channel


KINDS = {
    "late position": ({"late": {POSITION: 0.24}}, "position_latency", "p_n", 0.24),
    "early position": ({"late": {POSITION: -0.1}}, "position_latency", "p_n", -0.1),
    "late attitude": ({"late": {ATTITUDE: 0.06}}, "attitude_latency", "phi", 0.06),
    "very late attitude": ({"late": {ATTITUDE: 0.25}}, "attitude_latency", "phi", 0.25),
    "late velocity": ({"late": {VELOCITY: 0.1}}, "velocity latency", "v_n", 0.1),
    "very late velocity": ({"late": {VELOCITY: 0.5}}, "velocity latency", "v_n", 0.5),
    "velocity": ({"bias": {"v_d": -0.8}}, "velocity bias", "v_d", -0.8),
    "late rates": ({"late": {RATES: 0.06}}, "rate latency", "p", 0.06),
    "late acceleration": ({"late": {ACCELERATION: 0.1}}, "acceleration latency", "a_x", 0.1),
    "pitch gyro": ({"bias": {"q": 2.5 * DEG}}, "imu_bias", "q", 2.5 * DEG),
    "accelerometer": ({"bias": {"a_z": 0.8}}, "imu_bias", "a_z", 0.8),
    "airspeed": ({"scale": 0.93}, "airspeed_scale", "V_a", -0.07),
    "slow airspeed": ({"lag": 0.8}, "airspeed_lag", "V_a", 0.8),
    "heading": ({"bias": {"psi": 3 * DEG}}, "heading_bias", "psi", 3 * DEG),
    "vane": ({"vanes": True, "bias": {"alpha": 3.5 * DEG}}, "vane_bias", "alpha", 3.5 * DEG),
}
AIR = {
    "calm": {},
    # trial A9: gusts, drifting attitude, some outliers, a gap
    "rough": {"gusts": (0.3, 3.0), "attitude": (0.2 * DEG, 2.0), "outliers": 0.003, "gap": 1.5},
}


IN_CALM = ("late position", "late attitude", "pitch gyro", "airspeed", "vane")
"""One kind for each sort of sensor. All kinds are flown in rough air, where each is harder to tell."""


@pytest.mark.parametrize("kind, air", [*((kind, "rough") for kind in KINDS), *((kind, "calm") for kind in IN_CALM)])
def test_each_error_is_found_and_no_other(true, kind, air):
    how, name, channel, size = KINDS[kind]
    path = reconstruct(Sensors(**how, **AIR[air]).record(true, 7))
    assert [(e.name, e.acts_on[0]) for e in path.findings] == [(name, channel)], path.findings
    (found,) = path.findings
    assert abs(found.size - size) < max(4 * found.std, 0.02 * abs(size))
    assert found.size == pytest.approx(size, rel=0.25)


@pytest.mark.parametrize("late", [0.35, 0.8])
def test_a_receiver_that_is_very_late_is_told_as_such(true, late):
    """Guards positions and velocities 0.35 s late and more, of which an accelerometer was said to read 12 to 23 % low."""
    found = reconstruct(Sensors(late={(*POSITION, *VELOCITY): late}).record(true, 7)).findings
    assert [e.name for e in found] == ["velocity latency", "position_latency"], found
    assert all(abs(e.size - late) < 0.02 for e in found), found


@pytest.mark.parametrize("bias", [0.0, 5.0])
def test_a_heading_that_errs_with_itself_is_no_accelerometer(true, bias):
    """Guards against wrong names: iron near the compass turns it by 3 deg to either side in each loop, and the acceleration with it, whose
    mean was an accelerometer 0.7 m/s2 off. What it is off by everywhere, beside, is the bias of the heading."""
    log = Sensors().record(true, 7)
    iron = wrap(log["psi"] + 3 * DEG * np.sin(log["psi"] + 2.3) + bias * DEG)
    path = reconstruct(replace(log, measured={**log.measured, "psi": iron}))
    assert [e.name for e in path.findings] == (["heading_bias"] if bias else []) + ["compass_deviation"], path.findings
    assert all(abs(e.size - bias * DEG) < 4 * e.std for e in path.errors if e.name == "heading_bias"), path.errors


def test_a_box_that_is_turned_is_nothing_else(true):
    """Guards against wrong names: an IMU 2 deg off the axes of the attitude was a gyro, an accelerometer and a compass off, and a velocity
    that is 30 ms late."""
    log = Sensors().record(true, 7)
    box = Rotation.from_rotvec(np.array([-1.5, 2.0, 1.0]) * DEG).as_matrix()
    turned = {names: box @ np.array([log[n] for n in names]) for names in (RATES, ACCELERATION)}
    path = reconstruct(replace(log, measured={**log.measured, **{n: x for of, xs in turned.items() for n, x in zip(of, xs, strict=True)}}))
    assert not path.findings, path.findings


def test_slow_motion_that_alone_is_late_is_no_late_acceleration(true):
    """Guards against a wrong name: what drifts with slow motion went for a delay of all of it, known to 3 ms."""
    log = Sensors().record(true, 7)
    slow = {n: uniform_filter1d(log[n], int(2.0 / log.dt), mode="nearest") for n in ACCELERATION}
    late = {n: log[n] + np.interp(log.time - 0.2, log.time, x) - x for n, x in slow.items()}
    path = reconstruct(replace(log, measured={**log.measured, **late}))
    assert not path.findings, path.findings


MISREAD = {
    "rates in deg/s": lambda log: {n: np.degrees(log[n]) for n in ("p", "q", "r")},
    "roll and pitch rate swapped": lambda log: {"p": log["q"], "q": log["p"]},
    "yaw rate of the wrong sign": lambda log: {"r": -log["r"]},
    "velocity in knots": lambda log: {n: log[n] / 0.514444 for n in VELOCITY},
}


@pytest.mark.parametrize("how", MISREAD)
def test_channels_that_are_misread_are_no_delay(true, how):
    """Guards against a wrong name: what is left of a misread channel goes with its rate by chance, and some delay takes a little of it."""
    log = Sensors().record(true, 7)
    path = reconstruct(replace(log, measured={**log.measured, **MISREAD[how](log)}))
    assert not [e for e in path.findings if e.unit == "s"], path.findings


@pytest.mark.parametrize("channel", ["psi", "p_d"])
def test_one_late_channel_is_no_late_attitude_and_no_late_position(true, channel):
    """Guards against a wrong name: a heading by a slow compass, a height by a barometer."""
    path = reconstruct(Sensors(late={(channel,): 0.25}).record(true, 7))
    assert not [e for e in path.findings if e.unit == "s"], path.findings


@pytest.mark.parametrize("channels, every", [(POSITION, 25), (VELOCITY, 10), (ATTITUDE, 5)])
def test_values_that_a_recorder_holds_are_no_late_sensor(true, channels, every):
    """Guards against a wrong name: a receiver of 2 to 10 Hz in rows of 50 Hz, each value held until the next, is late on average."""
    log = Sensors().record(true, 7)
    held = {n: np.repeat(log[n][::every], every)[: len(log)] for n in channels}
    path = reconstruct(replace(log, measured={**log.measured, **held}))
    assert not [e for e in path.findings if e.unit == "s"], path.findings
    (note,) = path.notes
    assert note.startswith(", ".join(channels)) and "held" in note


def test_gaps_and_restarts_change_little(true):
    """A log in three pieces says what the whole one says."""
    log = Sensors(bias={"q": 2.5 * DEG}, late={POSITION: 0.24}).record(true, 8)
    valid = log.valid.copy()
    valid[2500:2560] = valid[5000:5100] = False
    valid[1000:1002] = False  # bridged
    path = reconstruct(replace(log, valid=valid))
    assert path.stretches == 3
    assert errors_of(path)["imu_bias", "q"].size == pytest.approx(2.5 * DEG, rel=0.05)
    assert errors_of(path)["position_latency", "p_n"].size == pytest.approx(0.24, abs=0.002)


def test_logs_without_noise_or_motion_end_in_numbers(true):
    """A simulated log without noise, and one that stands still in the air: nothing is found, nothing fails."""
    level = {"v_n": 30.0, "V_a": 30.0, "p_d": -100.0}
    for log in (true, replace(true, measured={k: 0 * s + level.get(k, 0.0) for k, s in true.measured.items()})):
        path = reconstruct(log)
        assert not path.findings, path.findings
        json.dumps(path.as_dict(), allow_nan=False)


def test_too_little_flight_says_so(true):
    path = reconstruct(true.between(0, 300))
    assert not path.noise and not path.errors and path.notes


def test_what_a_log_lacks_is_left_out(true):
    log = Sensors(bias={"q": 2.5 * DEG}).record(true, 9)
    poor = replace(log, measured={k: v for k, v in log.measured.items() if k not in ("a_x", "V_a")}, wind=None)
    path = reconstruct(poor)
    of_attitude = {"imu_bias", "attitude_bias", "imu_misalignment", "attitude_latency"}
    assert {e.name for e in path.errors} == {*of_attitude, "velocity bias", "position_latency"}
    assert [e.acts_on for e in path.findings] == [("q",)]


def test_without_a_wind_record_flying_around_tells_the_scale(true):
    path = reconstruct(replace(Sensors(scale=0.9).record(true, 11), wind=None))
    scale = errors_of(path)["airspeed_scale", "V_a"]
    assert abs(scale.size + 0.1) < 3 * scale.std and scale.std < 0.04


def test_thinning_keeps_what_is_seen():
    series = short_series(np.random.default_rng(3), n=200)
    thin = thinned(series, 50)
    assert len(thin.y) <= 50 and thin.seen.any(1).all() and thin.restart.sum() == 2 and thin.restart[0]


def test_words_and_tables(true):
    path = reconstruct(Sensors(factor=2.0, late={POSITION: 0.24}, attitude=(1 * DEG, 5.0)).record(true, 12))
    (found,) = path.findings
    assert said(found).startswith("position late by 0.24") and " s +- 0.0" in said(found)
    rows = noise_table(path, {"p_n": 0.1, "phi": 0.4 * DEG})
    assert rows["p_n"][""] == "2 x declared" and rows["p_e"][""] == "not declared" and rows["phi"]["unit"] == "deg"
    assert rows["phi"][""].startswith("as declared, drifts") and " in " in rows["phi"]["drift"]
    table = error_table(path)
    assert table["position_latency"][""] == "FOUND" and table["imu_bias q"][""] == "none"
    json.dumps(path.as_dict(), allow_nan=False)


REST = ("d01", "d03", "d05", "d06", "d09")
"""Development flights with nothing that kinematics could see, as d02, d04 and d08."""


@pytest.mark.skipif(not (SHARED / "dev" / "KEY.json").is_file(), reason="the development flights (../shared/flights/dev) are not here")
@pytest.mark.parametrize("name", ["d02", "d04", "d07", "d08", "d10", *(pytest.param(n, marks=pytest.mark.campaign) for n in REST)])
def test_the_development_flights(name):
    """Sensor errors of the key are found, with their sizes, and nothing else is."""
    path = reconstruct(read_flight(SHARED / "dev" / name))
    key = json.loads((SHARED / "dev" / "KEY.json").read_text())[name]["effects"]
    expected = {e for e in key if e in ("position_latency", "airspeed_scale")}
    assert {e.name for e in path.findings} == expected, path.findings
    if name == "d10":
        assert path.findings[0].size == pytest.approx(0.16, abs=0.002)
    if name == "d07":
        assert path.findings[0].size == pytest.approx(-0.07 + 0.8 / 38, abs=0.01)


AP2 = SHARED / "ampyx-ap2"


@pytest.mark.skipif(not AP2.is_dir(), reason="the measured flight of the Ampyx AP2 (../shared/flights/ampyx-ap2) is not here")
def test_errors_put_into_a_measured_record():
    """Trial A15: what kinematics can tell of the six gross errors; of the untouched record nothing."""
    log = read_flight(AP2)
    assert not (as_it_is := reconstruct(log)).findings
    late = {n: np.interp(log.time - 0.24, log.time, log[n]) for n in POSITION}
    turned = {n: np.interp(log.time - 0.15, log.time, np.unwrap(log[n])) for n in ATTITUDE}
    a = np.exp(-log.dt / 0.6)
    untouched = {(e.name, e.acts_on[0]): e for e in as_it_is.errors}
    for change, name, channel, size in (
        ({"q": log["q"] + 2.5 * DEG}, "imu_bias", "q", 2.5 * DEG),
        (late, "position_latency", "p_n", 0.24),
        (turned, "attitude_latency", "phi", 0.15),
        ({"V_a": 0.9 * log["V_a"]}, "airspeed_scale", "V_a", -0.1),
        ({"V_a": lfilter([1 - a], [1, -a], log["V_a"], zi=[a * log["V_a"][0]])[0]}, "airspeed_lag", "V_a", 0.6),
    ):
        (found,) = reconstruct(replace(log, measured={**log.measured, **change})).findings
        assert (found.name, found.acts_on[0]) == (name, channel)
        before = untouched[name, channel]
        assert abs(found.size - before.size - size) < 3 * np.hypot(found.std, before.std)
    for how in ("yaw rate of the wrong sign", "velocity in knots"):
        path = reconstruct(replace(log, measured={**log.measured, **MISREAD[how](log)}))
        assert not [e for e in path.findings if e.unit == "s"], path.findings
