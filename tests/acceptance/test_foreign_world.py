"""The foreign world: JSBSim follows our equations where nothing is added; its actuators, sensors, air and line do what the kinds say."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

pytest.importorskip("jsbsim", reason="the foreign world needs jsbsim (extras `campaign` and `test`)")

from foreign_agreement import MOST, agreement, clean_agreement  # noqa: E402
from foreign_faults import with_faults  # noqa: E402
from foreign_flights import KITE, Case, drawn, flight_folder, start_of  # noqa: E402
from foreign_kinds import Actuator, World, read_kinds  # noqa: E402
from foreign_names import Scene  # noqa: E402
from foreign_sensors import BITS, LOADS, STATES, Sensors  # noqa: E402
from foreign_world import Foreign, fly  # noqa: E402

from awescli.flightlog.read import read_flight  # noqa: E402
from awescli.notation.errors import BadInput, NumericalFailure  # noqa: E402
from awescli.notation.frames import rotation_body_to_ned  # noqa: E402
from awescli.notation.quantities import ANGLES  # noqa: E402
from awescli.physics.declaration import read_kite  # noqa: E402
from awescli.simulation.segments import wrap  # noqa: E402

TRUTH = read_kite(KITE)
QUIET = Sensors(quiet=True)
KINDS = read_kinds()


@cache
def conditions():
    """(draw, start): ten seconds of a flight that is drawn as the campaign's are."""
    draw = drawn(Case("clean_calm", "full", 0), KINDS["clean_calm"])
    draw = replace(draw, scene=replace(draw.scene, lead=2.0, duration=10.0))
    return draw, start_of(TRUTH, draw)


def flown(world=None, values=None, sensors=QUIET, *, seed=1, rate=50, turbulence=0.0, **scene):
    draw, start = conditions()
    foreign = Foreign(TRUTH, world or World(), values or {}, replace(draw.scene, **scene), sensors, turbulence)
    return fly(foreign, draw.steering, start, rate=rate, seed=seed)


# --- agreement


@pytest.mark.parametrize("family", [0, 2])
def test_a_clean_flight_follows_our_equations(family):
    """2 mm and 0.003 deg over 5 s open loop, loops to either side: integrators, frames, units, table, line, winch and wind are alike."""
    worst = clean_agreement(family)
    assert worst["position"] < MOST["position"] and worst["attitude"] < MOST["attitude"]
    assert worst["V_a"] < 1e-3 and worst["tension"] < 1.0 and worst["acceleration"] < 5e-3


def test_the_families_of_the_agreement_turn_both_ways():
    assert {drawn(Case("clean_calm", "full", f), KINDS["clean_calm"]).law.pattern.turn for f in (0, 2)} == {-1.0, 1.0}


def test_what_a_world_adds_breaks_the_agreement():
    """Guards the comparison: a hundredth of the drag coefficient is seen."""
    draw, _ = conditions()
    scene: Scene = draw.scene
    assert agreement(flown(), TRUTH, scene)["position"] < MOST["position"]
    assert agreement(flown(World(coefficients={"CD": "0.002"})), TRUTH, scene)["position"] > 10 * MOST["position"]


def test_the_same_seed_is_the_same_flight():
    sensors = Sensors(TRUTH.noise, drift=0.01)
    one, two, other = (flown(sensors=sensors, seed=seed, turbulence=0.6, duration=3.0) for seed in (1, 1, 2))
    for channel in (*STATES, *LOADS):
        assert (one.sensed[channel] == two.sensed[channel]).all() and (one.sensed[channel] != other.sensed[channel]).any(), channel


def test_a_kite_that_departs_is_told():
    with pytest.raises(NumericalFailure, match="leaves its pattern"):
        flown(World(loads={"m_x": "4000"}))


# --- actuators


def acting(actuator: Actuator, **values):
    """(set-point, what acts), (N,) rad, of the rudder, row by row of 400 Hz."""
    flight = flown(World(actuators={"rudder": actuator}), values, rate=400)
    return flight.setpoints["rudder"], flight.truth["acting_rudder"]


def test_a_surface_without_actuator_acts_at_once():
    flight = flown(rate=400)
    assert np.abs(flight.truth["acting_rudder"] - flight.setpoints["rudder"]).max() < 0.003  # the half step that is taken back for a frame
    assert (flight.truth["acting_rudder"] == flight.setpoints["rudder"])[::8].all()


def test_a_lag_has_the_time_constant_that_is_asked():
    """Guards the time step that flight-control components are loaded with: a lag of 0.15 s became 0.018 s."""
    setpoint, position = acting(Actuator(lag="tau"), tau=0.15)
    expected, step = np.empty_like(position), np.exp(-1 / 400 / 0.15)
    expected[0] = position[0]
    for k in range(1, len(position)):
        expected[k] = setpoint[k] + (expected[k - 1] - setpoint[k]) * step
    assert np.abs(position - expected).max() < 2e-4 and np.ptp(setpoint) > 0.05


def test_a_delay_is_a_delay():
    setpoint, position = acting(Actuator(delay="tau"), tau=0.1)
    assert np.abs(position[40:] - setpoint[:-40]).max() < 1e-12


def test_a_rate_limit_limits_the_rate():
    _, position = acting(Actuator(rate_limit="limit"), limit=0.1)
    rate = np.abs(np.diff(position)) * 400
    assert rate.max() < 0.1 + 1e-9 and (rate > 0.099).mean() > 0.1


def test_backlash_holds_the_surface_where_the_set_point_turns_back():
    setpoint, position = acting(Actuator(hysteresis_width="width"), width=0.03)
    assert np.abs(position - setpoint).max() < 0.015 + 1e-9
    still = np.diff(position) == 0
    assert (still & (np.diff(setpoint) != 0)).sum() > 5 and np.abs(position - setpoint)[1:][~still].min() > 0.0149


def test_a_dead_band_takes_half_its_width_on_either_side():
    setpoint, position = acting(Actuator(deadband_width="width"), width=0.03)
    expected = np.sign(setpoint) * np.maximum(np.abs(setpoint) - 0.015, 0.0)
    assert np.abs(position - expected).max() < 1e-12 and (position == 0).any() and (position != 0).any()


def test_a_bias_is_added():
    setpoint, position = acting(Actuator(bias="bias"), bias=0.02)
    assert np.allclose(position[::8], setpoint[::8] + 0.02)  # between set-points half a step is taken back for a frame


# --- sensors


@pytest.mark.parametrize("factor", [1.0, 2.0])
def test_sensors_have_the_noise_that_is_declared_times_a_factor(factor):
    flight = flown(sensors=Sensors(TRUTH.noise, factor), duration=40.0)
    for channel in (*STATES, *LOADS):
        std, share = TRUTH.noise.channels()[channel]
        error = flight.sensed[channel] - flight.truth[channel]
        white = (wrap(error) if channel in ANGLES else error) / (std + share * flight.truth[channel])
        assert white.std() == pytest.approx(factor, rel=0.06), channel
        assert abs(white.mean()) < 4 * factor / np.sqrt(len(white)), channel  # quantisation is no bias
        assert abs(np.corrcoef(white[1:], white[:-1])[0, 1]) < 0.1, channel


def test_sensors_quantise():
    flight = flown(sensors=Sensors(TRUTH.noise), duration=2.0)
    for channel, (bits, low, high) in BITS.items():
        steps = (flight.sensed[channel] - low) / ((high - low) / 2**bits)
        assert np.abs(steps - np.rint(steps)).max() < 1e-3, channel


def test_a_wandering_attitude_has_the_level_and_the_memory_that_are_asked():
    sensors = Sensors(TRUTH.noise, factor=1e-3, drift=0.01, memory=2.0)
    draw, _ = conditions()
    flight = flown(sensors=sensors, duration=200.0, reel_out=replace(draw.scene.reel_out, speed=0.3))
    wander = np.array([wrap(flight.sensed[c] - flight.truth[c]) for c in ("phi", "theta", "psi")])
    assert np.sqrt((wander**2).mean()) == pytest.approx(0.01, rel=0.15)
    apart = 100  # 2 s
    assert (wander[:, apart:] * wander[:, :-apart]).mean() / (wander**2).mean() == pytest.approx(np.exp(-1), abs=0.12)
    assert np.abs(flight.sensed["p"] - flight.truth["p"]).max() < 1e-3


def test_kinds_of_sensors_report_what_they_say():
    """Late positions, lagging load, scaled airspeed, biased compass: against the truth of the same flight."""
    late = flown(KINDS["position_latency"].world, {"tau": 0.1}, rate=400)
    assert np.abs(late.sensed["p_n"][40:] - late.truth["p_n"][:-40]).max() < 1e-9
    lag = flown(KINDS["load_cell_lag"].world, {"tau": 0.2}, rate=400)
    rate = np.gradient(lag.sensed["tension"], 1 / 400)
    rest = (lag.sensed["tension"] + 0.2 * rate - lag.truth["tension"])[400:]
    assert np.abs(rest).max() < 0.02 * np.ptp(lag.truth["tension"])
    scaled = flown(KINDS["airspeed_scale"].world, {"k": -0.05})
    assert np.allclose(scaled.sensed["V_a"], 0.95 * scaled.truth["V_a"], atol=1e-6)
    compass = flown(KINDS["heading_bias"].world, {"bias": 0.05})
    assert np.allclose(wrap(compass.sensed["psi"] - compass.truth["psi"]), 0.05, atol=1e-9)


def test_rows_of_a_log_belong_together():
    """The slower log is every so manyth row of the faster one, loads and states alike."""
    fast, slow = flown(rate=100), flown(rate=20)
    for channel in (*STATES, *LOADS):
        assert np.allclose(fast.sensed[channel][::5][: len(slow.time)], slow.sensed[channel], rtol=0, atol=1e-9), channel
        assert np.allclose(wrap(fast.sensed[channel] - fast.truth[channel]) if channel in ANGLES
                           else fast.sensed[channel] - fast.truth[channel], 0.0, atol=1e-6), channel  # fmt: skip


# --- air and line


def test_turbulence_has_the_level_that_is_asked():
    """MIL-F-8785C below 1000 ft: sigma_w, and sigma_u = sigma_w / (0.177 + 0.000823 h)^0.4 with h in ft, over several seeds."""
    vertical, horizontal, height = [], [], []
    for seed in range(6):
        flight = flown(turbulence=0.6, duration=60.0, seed=seed)
        calm = np.array([np.interp(flight.truth["p_d"], *profile) for profile in [sorted_profile(flight)]])
        vertical.append((flight.truth["wind_d"] ** 2).mean())
        horizontal.append(np.var(np.hypot(flight.truth["wind_n"], flight.truth["wind_e"]) - calm[0]))
        height.append(-flight.truth["p_d"].mean())
    feet = np.mean(height) / 0.3048
    assert np.sqrt(np.mean(vertical)) == pytest.approx(0.6, rel=0.25)
    assert np.sqrt(np.mean(horizontal)) == pytest.approx(0.6 / (0.177 + 0.000823 * feet) ** 0.4, rel=0.3)


def sorted_profile(flight):
    """(p_d ascending, recorded speed there) of the scene's wind, at its mean over time."""
    wind = conditions()[0].scene.wind
    return -wind.height[::-1], wind.speed.mean(axis=0)[::-1]


def test_the_line_keeps_its_length():
    """The constraint holds through loops and reeling: the spring is stretched by centimetres."""
    flight = flown(duration=30.0)
    assert np.abs(flight.truth["distance"] - flight.truth["line_length"] - TRUTH.parameters["dl"].value)[100:].max() < 0.1


def test_a_heavy_line_pulls_down_and_resists():
    """mu l g / 2 hangs on the kite and mu l / 3 moves with it across the line: taken into account, the air gives the same force to a kite
    with such a line as to one without, in the same state (the first 20 ms from the same start)."""
    world = World(line={"weight": "mu"})
    heavy, light = (flown(world, {"mu": mu}, rate=400, lead=0.0, duration=0.02) for mu in (0.022, 0.0))
    m, g = TRUTH.parameters["m"].value, TRUTH.parameters["g"].value

    def tangent(flight, of_down):
        """(3, N) acceleration times mass across the line and up the sphere, less weight: what aerodynamics and line drag give [N]."""
        t = flight.truth
        R = np.array(rotation_body_to_ned(t["phi"], t["theta"], t["psi"]))
        a = np.einsum("ijn,jn->in", R, np.array([t["a_x"], t["a_y"], t["a_z"]]))
        hat = np.array([t["p_n"], t["p_e"], t["p_d"]]) / t["distance"]
        carried, moved = of_down(t)
        force = (m + moved) * (a - (a * hat).sum(0) * hat) - (m * g + carried) * (np.array([[0], [0], [1]]) - hat[2] * hat)
        return force

    line = tangent(heavy, lambda t: (0.022 * t["line_length"] * g / 2, 0.022 * t["line_length"] / 3))
    air = tangent(light, lambda t: (0.0, 0.0))
    without = tangent(heavy, lambda t: (0.0, 0.0))
    assert np.linalg.norm(line - air, axis=0)[2:4].max() < 0.05 * np.linalg.norm(without - air, axis=0)[2:4].min()


# --- files


def test_a_flight_folder_is_read_as_it_was_sensed(tmp_path):
    """Units, signs and clocks of kite.csv, written from the format's description, by awes' own reader."""
    case = Case("clean_short", "full", 0)
    folder = flight_folder(case, tmp_path)
    log, again = read_flight(folder), flight_folder(case, tmp_path)
    assert again == folder and {p.name for p in folder.iterdir()} == {"kite.csv", "wind.csv", "kite.yaml", "passport.json"}
    from foreign_flights import flown as made

    _, flight = made(case, KINDS["clean_short"], TRUTH)
    assert log.dt == pytest.approx(0.02) and len(log) == len(flight.time) and log.valid.all()
    for channel in (*STATES, "a_x", "a_y", "a_z", "V_a", "tension"):
        error = log[channel] - flight.sensed[channel]
        assert np.abs(wrap(error) if channel in ANGLES else error).max() < 1e-3, channel
    for surface, setpoints in flight.setpoints.items():
        assert np.abs(log[surface] - setpoints).max() < 1e-5, surface
    assert np.abs(log["tether_length"] - flight.truth["tether_length"]).max() < 1e-3
    assert read_kite(folder / "kite.yaml").parameters["m"].value == TRUTH.parameters["m"].value


def test_a_flight_with_vanes_is_read_through_its_mapping(tmp_path):
    case = replace(Case("vane_bias", "full", 0))
    log = read_flight(flight_folder(case, tmp_path))
    assert {"alpha", "beta"} <= set(log.measured) and log.wind.height.tolist() == [10.0]
    declared = read_kite(flight_folder(case, tmp_path) / "kite.yaml")
    assert declared.wind.law == "power" and declared.wind.exponent > 0


def test_bounds_that_are_to_miss_the_truth_do(tmp_path):
    kite = read_kite(flight_folder(Case("narrow_bounds", "full", 0), tmp_path) / "kite.yaml")
    outside = [n for n, row in kite.parameters.items() if row.free and not row.lower <= TRUTH.parameters[n].value <= row.upper]
    assert len(outside) == 2
    clean = read_kite(flight_folder(Case("clean_short", "full", 0), tmp_path) / "kite.yaml")
    assert all(row.lower <= TRUTH.parameters[n].value <= row.upper for n, row in clean.parameters.items() if row.free)


def test_field_conditions_are_those_of_the_kind_with_its_own_sensors():
    """Another rate, noise, drift, turbulence and faults; vanes and a pitot stay where the kind needs them."""
    field = KINDS["clean_field"].conditions
    for kind, family in (("actuator_lag", 3), ("airspeed_scale", 3), ("vane_bias", 3)):
        case = Case(kind, "full", family, air="field")
        found = case.registered()
        assert found.conditions.faults and found.conditions.rates == field.rates and found.world == KINDS[kind].world
        assert found.conditions.vanes == KINDS[kind].conditions.vanes
    pitots = [Case("airspeed_scale", "full", f, air="field").registered().conditions.pitot for f in range(8)]
    without = [Case("actuator_lag", "full", f, air="field").registered().conditions.pitot for f in range(8)]
    assert all(pitots) and any(without) and not all(without)
    assert Case("actuator_lag", "full", 3).registered() == KINDS["actuator_lag"]


def test_faults_are_rows_and_values_that_are_missing_or_far_off():
    time = np.arange(0, 100, 0.02)
    columns = {"epoch_ms": (1000 * time).astype(int), **{c: np.sin(time + i) for i, c in enumerate("abcd")}, "rudder_sp": 0.1 * time}
    found = with_faults(columns, list("abcd"), 50.0, seed=1)
    kept = np.isin(columns["epoch_ms"], found["epoch_ms"])
    assert 2 * 5 <= (~kept).sum() <= 2 * 30 and len({len(values) for values in found.values()}) == 1
    assert np.array_equal(found["rudder_sp"], columns["rudder_sp"][kept])
    silent = {c: int(np.isnan(found[c]).sum()) for c in "abcd"}
    assert sum(n > 0 for n in silent.values()) == 3 and all(n <= 75 for n in silent.values())
    off = {c: np.abs(found[c] - columns[c][kept]) for c in "abcd"}
    assert 4 < sum(np.count_nonzero(o > 0) for o in off.values()) < 50
    assert min(o[o > 0].min() for o in off.values() if (o > 0).any()) > 5 * np.median(np.abs(np.diff(columns["a"])))
    assert all(np.array_equal(found[c], again, equal_nan=True) for c, again in with_faults(columns, list("abcd"), 50.0, seed=1).items())


def test_a_flight_with_faults_is_read_as_what_was_sensed(tmp_path):
    """What the reader calls valid is what the sensor saw, but for its noise: nothing far off is left."""
    from foreign_flights import flown as made

    case = Case("actuator_lag", "full", 0, air="field")
    log, (_, flight) = read_flight(flight_folder(case, tmp_path)), made(case, case.registered(), TRUTH)
    assert log.counters["spikes"] > 20 and 0.9 < log.valid.mean() < 1.0
    at = np.rint((log.time - log.time[0]) * flight.rate).astype(int)
    for channel, (std, share) in TRUTH.noise.channels().items():
        if channel in log:
            error = log[channel] - flight.sensed[channel][at]
            error = np.abs(wrap(error) if channel in ANGLES else error)[log.valid] / (std + share * 5000.0)
            assert error.max() < 20 and (error > 1e-2).mean() < 0.02, channel


# --- registry


def test_half_of_the_kinds_are_outside_and_all_are_told():
    groups = [kind.group for kind in KINDS.values()]
    assert groups.count("library") >= 20 and groups.count("outside") >= groups.count("library") and groups.count("clean") >= 8
    assert len({kind.lacks for kind in KINDS.values()}) == len(KINDS)


def test_strengths_scale_and_shapes_stay():
    stall, limit = KINDS["lift_stall"], KINDS["rate_limit"]
    assert stall.values("quarter") == {"k": stall.strengths["k"] / 4, "alpha_0": stall.shapes["alpha_0"]}
    assert limit.values("half") == {"limit": 2 * limit.strengths["limit"]}


@cache
def flown_clean(lagging):
    """Without an effect; lagging: surfaces that are not taken back by half a step, here with an actuator that does nothing."""
    return flown(World(actuators={surface: Actuator(deadband_width="0") for surface in lagging}))


@pytest.mark.parametrize("name", [n for n, kind in KINDS.items() if kind.strengths])
def test_every_kind_changes_what_is_sensed(name):
    """And no kind does anything at null. Most show at once; some only from some time on, or in a part of the loop."""
    kind = KINDS[name]
    clean = flown_clean(tuple(s for s, actuator in kind.world.actuators.items() if actuator.bias is None))
    there = flown(kind.world, kind.values("full"))
    filters = [a.lag or a.rate_limit for a in kind.world.actuators.values()] + [s.lag for s in kind.world.sensors.values()]
    filters += [s.law == "lag" and s.tau in kind.strengths for s in kind.world.signals.values()]
    null = {**dict.fromkeys(kind.strengths, 0.0), **kind.shapes}
    gone = clean if any(filters) else flown(kind.world, null)  # a filter has no null
    rows = slice(50, None)

    def apart(flight):
        return max(
            np.abs((wrap if c in ANGLES else np.asarray)(flight.sensed[c] - clean.sensed[c]))[rows].max() / (std + share * 5000.0)
            for c, (std, share) in TRUTH.noise.channels().items()
        )

    late = name == "clock_offset"  # the log's winch columns alone
    assert late or apart(there) > 0.3, apart(there)
    assert apart(gone) < 1e-3, apart(gone)


def test_names_that_are_taken_are_refused():
    """Guards a kind whose number is called `b`: it was the kite's span."""
    with pytest.raises(BadInput, match="taken: b"):
        flown(World(sensors={"psi": {"reads": "psi + b"}}), {"b": 0.05})
