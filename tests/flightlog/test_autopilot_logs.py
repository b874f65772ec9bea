"""Logs of autopilots: a flight whose truth is known, in the formats of three recorders, written by hand from their public descriptions."""

import sys
from dataclasses import replace

import numpy as np
import pytest
from free_flight import dataflash_bytes, free_flight, messages_of, topics_of, ulog_bytes, umn_struct
from scipy.io import savemat

from awescli.flightlog.ardupilot_bin import read_ardupilot
from awescli.flightlog.autopilot import Channel, euler_angles_of, local_ned
from awescli.flightlog.loops import find_loops
from awescli.flightlog.phases import phases
from awescli.flightlog.px4_ulog import read_px4
from awescli.flightlog.quality import data_quality
from awescli.flightlog.read import missing_for_model, read_flight
from awescli.flightlog.resample import RawFlight, uniform_log
from awescli.flightlog.wind_triangle import wind_triangle
from awescli.notation.errors import BadInput
from awescli.physics.kite import Kite
from awescli.simulation.segments import observe, wrap

STATES = ("p_n", "p_e", "p_d", "v_n", "v_e", "v_d", "phi", "theta", "psi", "p", "q", "r")
WIND_NORTH, WIND_EAST = -6.0 * np.cos(4.5), -6.0 * np.sin(4.5)


@pytest.fixture(scope="module")
def truth():
    return free_flight(seconds=90.0, noise=False)


@pytest.fixture
def umn(tmp_path, truth):
    """(folder, struct): to change the struct and write it again."""
    return tmp_path, umn_struct(truth)


def written(folder, struct, name="flight.mat"):
    savemat(folder / name, {"flight_data": {k: v for k, v in struct.items()}, "flight_info": {"aircraft": "Thor"}})
    return folder


def apart(log, truth, name, at, late=0.0):
    """(rms difference of a signal from the truth, the truth's own standard deviation) at samples `at`, in the truth's time."""
    there = np.interp(log.time[at] + late, truth.time, np.unwrap(truth[name]) if name in ("phi", "psi") else truth[name])
    difference = log[name][at] - there
    return float(np.sqrt(np.mean((wrap(difference) if name in ("phi", "theta", "psi") else difference) ** 2))), float(there.std())


def test_umn_flights_come_back(umn, truth):
    """Guards fields, units, signs and frames of the Minnesota format: what was flown is read, with the ground cut off, the sticks where the
    pilot flies, specific force made kinematic, and the motor's own clock placed by its throttle."""
    folder, struct = umn
    log = read_flight(written(folder, struct))
    assert log.dt == 0.02 and not log.on_line and log.valid.all() and missing_for_model(log, ("throttle", "motor_speed")) == []
    late = truth.time[-1] - log.time[-1]
    everywhere = log.time + late > 0.1
    for name in (*STATES, "a_x", "a_y", "a_z", "V_a", "alpha", "beta", "aileron", "elevator", "rudder", "throttle"):
        error, size = apart(log, truth, name, everywhere, late)
        assert error < 0.02 * size + 1e-6, (name, error, size)
    error, size = apart(log, truth, "throttle", everywhere, late)
    new = log.is_new("motor_speed") & (log.time > 5) & (log.time < 70)
    assert new.sum() == pytest.approx(2 * 65, abs=2)
    assert np.corrcoef(log["motor_speed"][new], 4000 + 1000 * log["throttle"][new])[0, 1] > 0.98
    assert any("recorder runs -7." in n for n in log.notes) and any("on the ground, were cut off" in n for n in log.notes)
    assert log.wind.density[0] == pytest.approx(98000 / (287.05 * (288.15 - 0.0065 * 305)), rel=0.005)


def test_wind_is_found_from_the_triangle(umn):
    """Guards the wind of a log that has none: airspeed against velocity, with a pitot that reads 5 % low told apart."""
    folder, struct = umn
    struct["ias"] = 0.95 * struct["ias"]
    log = read_flight(written(folder, struct))
    seen = wind_triangle(log)
    assert abs(seen.north - WIND_NORTH) < 3 * seen.std + 0.1 and abs(seen.east - WIND_EAST) < 3 * seen.std + 0.1 and seen.std < 1
    assert seen.scale == pytest.approx(0.95, abs=0.01)
    assert float(log.wind.speed[0, 0]) == pytest.approx(np.hypot(seen.north, seen.east))
    without = {k: v for k, v in struct.items() if k != "ias"}
    (folder / "b").mkdir()
    still = read_flight(written(folder / "b", without))
    assert still.wind.speed.max() == 0.0 and any("std: 5" in n for n in still.notes)


def test_a_receiver_counts_where_it_is_new(umn, truth):
    """Guards rates of their own: a GNSS of 1 Hz measures once a second, whatever stands in between, and `observe` weighs it so."""
    folder, struct = umn
    written(folder, struct)
    (folder / "flight.yaml").write_text("format: umn\nnavigation: gnss\n")
    log = read_flight(folder)
    late = truth.time[-1] - log.time[-1]
    new = log.is_new("v_n")
    assert new.sum() == pytest.approx(len(log) * log.dt, abs=2) and log.is_new("p").all()
    for name in ("p_n", "v_n", "v_d"):
        error, size = apart(log, truth, name, new & (log.time + late > 1), late)
        assert error < 0.02 * size, name
    from free_flight import THOR

    observed = observe(log, Kite(THOR, log.wind.height), np.array([100]), 100, ("v_n", "p"))
    assert np.isfinite(observed.sigma[0, :, 1]).all()
    assert np.array_equal(np.isfinite(observed.sigma[0, :, 0]), new[100:201]) and new[100:201].sum() in (2, 3)


def test_what_the_filter_did_not_know_is_not_measured(umn):
    """Guards navValid: two seconds without navigation are invalid, and so is what stands before the first fix."""
    folder, struct = umn
    struct["navValid"][2500:2600] = 1.0
    struct["navlat"][:100] = 0.0
    log = read_flight(written(folder, struct))
    gap = [c for c in log.causes if c == "p_n missing"]
    assert gap and int((~log.valid).sum()) == 100


@pytest.mark.parametrize("name", ["dr_in", "phi", "navlat", "time"])
def test_a_missing_field_is_named(umn, name):
    folder, struct = umn
    del struct[name]
    with pytest.raises(BadInput, match=f"'{name}' is missing"):
        read_flight(written(folder, struct))


def test_left_and_right_are_mixed_as_declared(umn):
    """Guards `mix`: channels of the struct, in declared shares; an unknown channel is named."""
    folder, struct = umn
    struct["df_l"], struct["df_r"] = np.full(struct["time"].size, 0.1), np.full(struct["time"].size, 0.3)
    written(folder, struct)
    (folder / "flight.yaml").write_text(
        "format: umn\nmix:\n  flaps: {of: {df_l: 0.25, df_r: 0.75}, offset: -5, unit: deg}\n  aileron: {of: {da_r: 1.0}, unit: rad}\n"
    )
    log = read_flight(folder)
    assert np.allclose(log["flaps"], np.deg2rad(0.25 * 0.1 + 0.75 * 0.3 - 5)) and 0.1 in log["aileron"]
    (folder / "flight.yaml").write_text("format: umn\nmix: {flaps: {of: {df_m: 1}, unit: rad}}\n")
    with pytest.raises(BadInput, match="no channel 'df_m'"):
        read_flight(folder)


READERS = {
    "px4": (read_px4, "log.ulg", lambda log: ulog_bytes(topics_of(log)), 5.0),
    "ardupilot": (read_ardupilot, "log.BIN", lambda log: dataflash_bytes(messages_of(log)), 5.0),
}


@pytest.mark.parametrize("kind", READERS)
def test_flights_of_px4_and_ardupilot_come_back(tmp_path, truth, kind):
    """Guards both readers: every channel at its own rate, new where it is new; quaternions, degrees, specific force, shares of travel;
    the wind that the estimator logged."""
    _, name, content, _ = READERS[kind]
    (tmp_path / name).write_bytes(content(truth))
    log = read_flight(tmp_path)
    assert missing_for_model(log, ("throttle",)) == [] and not log.on_line and log.valid.all()
    slowest = {"px4": 10, "ardupilot": 10}[kind]
    assert log.is_new("p_n").sum() == pytest.approx(slowest * len(log) * log.dt, rel=0.02) and log.is_new("p").all()
    late = truth.time[-1] - log.time[-1] if log.time[-1] > truth.time[-1] else 0.0
    for signal in (*STATES, "V_a", "aileron", "elevator", "throttle"):
        errors = [apart(log, truth, signal, log.is_new(signal) & (log.time > 1) & (log.time < 80), d + late) for d in (0.0, 0.01, -0.01)]
        error, size = min(errors)
        assert error < 0.03 * size + 1e-3, (signal, error, size)
    for signal in ("a_x", "a_y", "a_z"):
        error, size = apart(log, truth, signal, (log.time > 1) & (log.time < 80))
        assert error < 0.35 * size, (signal, error, size)  # a step of a surface lies between two samples
    assert float(np.median(log.wind.speed)) == pytest.approx(6.0, abs=0.01)
    assert float(np.median(np.mod(log.wind.direction, 2 * np.pi))) == pytest.approx(4.5, abs=0.01)


@pytest.mark.parametrize("kind", READERS)
def test_single_values_that_are_far_off_are_missing(tmp_path, truth, kind):
    """Once in ten seconds a heading and a pitch angle that leap: gone, and what was flown is there instead."""
    _, name, content, _ = READERS[kind]
    at = np.arange(200, 4000, 500)
    theta, psi = truth["theta"].copy(), truth["psi"].copy()
    theta[at] += 0.5
    psi[at] += 2.0
    logs = []
    for flown in (truth, replace(truth, measured={**truth.measured, "theta": theta, "psi": psi})):
        (tmp_path / name).write_bytes(content(flown))
        logs.append(read_flight(tmp_path))
    clean, spiked = logs
    assert clean.counters["spikes"] == 0 and spiked.counters["spikes"] >= 2 * at.size
    for signal in ("theta", "psi"):
        assert np.abs(wrap(spiked[signal] - clean[signal])).max() < 0.02, signal


def test_a_ulg_without_surface_outputs_is_refused(tmp_path, truth):
    """Guards the one clear error: what it has, and how to say what drives what; servos need a mix, and then they do."""
    topics = topics_of(truth)
    commands = topics.pop("actuator_controls_0")
    (tmp_path / "log.ulg").write_bytes(ulog_bytes(topics))
    with pytest.raises(BadInput, match="no surface outputs") as told:
        read_flight(tmp_path)
    assert "mix" in told.value.do
    servos = {"control[0]": commands[1]["control[0]"], "control[1]": -commands[1]["control[0]"]}
    (tmp_path / "log.ulg").write_bytes(ulog_bytes(topics | {"actuator_servos": (50, servos)}))
    with pytest.raises(BadInput, match="actuator_servos"):
        read_flight(tmp_path)
    mix = "format: px4\nmix: {aileron: {of: {'actuator_servos.control[0]': 12.5, 'actuator_servos.control[1]': -12.5}, unit: deg}}\n"
    (tmp_path / "flight.yaml").write_text(mix)
    log = read_flight(tmp_path)
    assert np.abs(log["aileron"]).max() == pytest.approx(np.abs(truth["aileron"]).max(), rel=0.05)
    assert missing_for_model(log, ("throttle",)) == ["throttle"]


def test_servo_outputs_of_ardupilot_are_mixed(tmp_path, truth):
    """Guards RCOU: pulse lengths become angles by the declared factor and offset."""
    messages = messages_of(truth)
    del messages["AETR"]
    take = np.interp(np.arange(0.0, truth.time[-1], 1 / 25), truth.time, truth["elevator"])
    messages["RCOU"] = 25, "ff", {"C1": 1500 + 500 / 0.4 * take, "C2": 1500 + 0 * take}
    (tmp_path / "log.bin").write_bytes(dataflash_bytes(messages))
    with pytest.raises(BadInput, match="no surface outputs that awes knows; it has RCOU"):
        read_flight(tmp_path)
    (tmp_path / "flight.yaml").write_text("format: ardupilot\nmix: {elevator: {of: {RCOU.C1: 0.0008}, offset: -1.2, unit: rad}}\n")
    log = read_flight(tmp_path)
    error, size = min(apart(log, truth, "elevator", log.is_new("elevator") & (log.time < 80), d) for d in (0.0, 0.01, 0.02, -0.01))
    assert error < 0.05 * size


@pytest.mark.parametrize("kind", READERS)
def test_without_its_library_a_reader_names_the_extra(tmp_path, truth, kind, monkeypatch):
    read, name, content, _ = READERS[kind]
    (tmp_path / name).write_bytes(b"x")
    monkeypatch.setitem(sys.modules, {"px4": "pyulog", "ardupilot": "pymavlink"}[kind], None)
    with pytest.raises(BadInput, match="needs py") as told:
        read(tmp_path / name)
    assert f"awes[{kind}]" in told.value.do


@pytest.mark.parametrize("kind", READERS)
def test_damaged_files_are_bad_input(tmp_path, kind, capfd):
    """Guards the border to foreign libraries: cut, flipped and foreign bytes end in BadInput or in a flight, never in a traceback, and
    nothing is printed."""
    read, name, content, _ = READERS[kind]
    whole = content(free_flight(seconds=20.0, noise=False))
    random = np.random.default_rng(1)
    path = tmp_path / name
    ended = []
    for k in range(40):
        damaged = bytearray(whole)
        if k < 12:
            damaged = damaged[: int(random.integers(0, len(whole)))]
        else:
            for at in random.integers(0, len(damaged) if k % 2 else 3000, 8):
                damaged[at] = int(random.integers(0, 256))
        path.write_bytes(bytes(damaged))
        try:
            read(path)
            ended.append("read")
        except BadInput as e:
            assert name in str(e)
            ended.append("refused")
    for nothing in (b"", b"\x00" * 100, b"hello, world\n" * 50):
        path.write_bytes(nothing)
        with pytest.raises(BadInput):
            read(path)
    assert {"read", "refused"} <= set(ended) and capfd.readouterr() == ("", "")


def test_a_log_that_never_leaves_the_ground_says_so(umn):
    folder, struct = umn
    for name in ("navvn", "navve", "navvd", "ias", "p", "q", "r"):
        struct[name] = 0.01 * np.random.default_rng(0).standard_normal(struct["time"].size)
    struct["navalt"] = np.full(struct["time"].size, 245.0)
    struct["navlat"] = np.full(struct["time"].size, 0.7911)
    struct["navlon"] = np.full(struct["time"].size, -1.6272)
    log = read_flight(written(folder, struct))
    (told,) = missing_for_model(log, ("throttle",))
    assert "never leaves the ground" in told and data_quality(log).missing == (told,)


def test_a_motor_on_another_clock_is_told(umn):
    """Guards recorded revolutions: six seconds behind the throttle they are refused, with the line that moves them."""
    folder, struct = umn
    log = read_flight(written(folder, struct))
    assert missing_for_model(log, ("motor_speed",)) == []
    from dataclasses import replace

    shifted = np.interp(log.time - 6.0, log.time, log["motor_speed"])
    (told,) = missing_for_model(replace(log, inputs={**log.inputs, "motor_speed": shifted}), ("motor_speed",))
    late = float(told.partition(" s late")[0].rpartition(" ")[2])
    assert late == pytest.approx(6.0, abs=0.2) and f"clocks: {{motor: {late:.1f}}}" in told
    # a recorder whose throttle agrees with nothing cannot be placed
    struct["motor_throttle"] = np.random.default_rng(0).uniform(1.2, 1.8, struct["motor_time"].size)
    (folder / "b").mkdir()
    log = read_flight(written(folder / "b", struct))
    assert missing_for_model(log, ("motor_speed",)) == ["motor_speed"] and any("does not place" in n for n in log.notes)


def test_free_flights_are_cut_into_blocks(truth):
    """Guards what takes the place of loops: blocks of 20 s at most, and phases without a winch."""
    assert set(phases(truth)) == {"flight"}
    blocks = find_loops(truth)
    assert blocks.kind == "blocks" and blocks.sentence == "no tether: 8 blocks of 11.3 s"
    lengths = (blocks.bounds[:, 1] - blocks.bounds[:, 0]) * truth.dt
    assert np.ptp(lengths) <= 0.02 + 1e-9
    assert find_loops(free_flight(seconds=240.0, noise=False)).sentence == "no tether: 12 blocks of 20 s"


def test_a_fast_sensor_does_not_fold_its_vibration():
    """Guards the average over a sample interval: a gyro of 400 Hz with the propeller's 130 Hz reads the motion on a 50 Hz clock."""
    fast = np.arange(0.0, 10.0, 1 / 400)
    motion = 0.5 * np.sin(2 * np.pi * 0.7 * fast)
    clock = np.arange(0.0, 9.9, 0.02)
    raw = RawFlight("x", 0.0, clock, {"p": motion + 0.3 * np.sin(2 * np.pi * 130.0 * fast)}, "x", own_stamps={"p": fast})
    log = uniform_log(raw)
    error = log["p"] - 0.5 * np.sin(2 * np.pi * 0.7 * clock)
    assert np.sqrt(np.mean(error[5:-5] ** 2)) < 0.05 and log.is_new("p").all()


def test_angles_and_places():
    """Guards the quaternion against the rotation it stands for, and local positions against great circles (1 m in 10 km)."""
    phi, theta, psi = euler_angles_of(*(np.array([x]) for x in (np.cos(0.2), np.sin(0.2), 0.0, 0.0)))
    assert (phi[0], theta[0], psi[0]) == pytest.approx((0.4, 0.0, 0.0))
    phi, theta, psi = euler_angles_of(*(np.array([x]) for x in (np.cos(0.2), 0.0, 0.0, np.sin(0.2))))
    assert (phi[0], theta[0], psi[0]) == pytest.approx((0.0, 0.0, 0.4))
    n, e, d = local_ned(np.array([0.8001]), np.array([0.1]), np.array([120.0]), (0.8, 0.1, 100.0))
    assert n[0] == pytest.approx(0.0001 * 6378137 * (1 - 0.00669438) / (1 - 0.00669438 * np.sin(0.80005) ** 2) ** 1.5, abs=0.1)
    assert e[0] == pytest.approx(0.0) and d[0] == pytest.approx(-20.0)
    assert Channel(np.array([0.0, 1.0]), np.array([0.0, 2.0])).at(np.array([0.25])) == pytest.approx([0.5])


def test_columns_of_a_csv_are_mixed(tmp_path, truth):
    """Guards `mix` in any CSV: ailerons left and right become one, a throttle in percent a share; unknown columns and units are named."""
    rows = ["t,da_l,da_r,thr,n,e,d,vn,ve,vd"]
    for k in range(0, 2000, 2):
        position = ",".join(f"{truth[n][k]:.6f}" for n in ("p_n", "p_e", "p_d", "v_n", "v_e", "v_d"))
        a = np.rad2deg(truth["aileron"][k])
        rows.append(f"{truth.time[k]:.3f},{1 - a:.6f},{1 + a:.6f},{100 * truth['throttle'][k]:.4f},{position}")
    (tmp_path / "log.csv").write_text("\n".join(rows) + "\n")
    mapping = """
time: {column: t, unit: s}
position: {columns: [n, e, d], unit: m}
velocity: {columns: [vn, ve, vd], unit: m/s}
mix:
  aileron: {of: {da_r: 0.5, da_l: -0.5}, unit: deg}
  flaps: {of: {da_r: 0.5, da_l: 0.5}, unit: deg}
signals: {throttle: {column: thr, unit: "%"}}
"""
    (tmp_path / "flight.yaml").write_text(mapping)
    log = read_flight(tmp_path)
    there = np.interp(log.time + log.start, truth.time, truth["aileron"])
    assert np.abs(log["aileron"] - there).max() < 1e-6 and np.allclose(log["flaps"], np.deg2rad(1.0))
    assert np.abs(log["throttle"] - np.interp(log.time + log.start, truth.time, truth["throttle"])).max() < 1e-5
    for wrong, told in (("da_r: 0.5", "da_x: 0.5"), ("unit: deg}", "unit: kg/m3}")):
        (tmp_path / "flight.yaml").write_text(mapping.replace(wrong, told, 1))
        with pytest.raises(BadInput, match="da_x|unit of angle"):
            read_flight(tmp_path)


def test_noise_is_told_of_new_values_only(umn):
    """Guards `awes check`: between the fixes of a slow receiver stands a line, which has no noise."""
    folder, struct = umn
    size = struct["vn"].size
    struct["vn"] = struct["vn"] + 0.5 * np.repeat(np.random.default_rng(0).standard_normal(size // 50 + 1), 50)[:size]
    written(folder, struct)
    (folder / "flight.yaml").write_text("format: umn\nnavigation: gnss\n")
    (told,) = [c for c in data_quality(read_flight(folder)).channels if c.name == "v_n"]
    assert told.noise > 0.25
