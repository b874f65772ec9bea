"""Each effect does what its row of the table says: sizes and signs against formulae written out here, one instant or a short flight."""

from types import SimpleNamespace

import numpy as np
import pytest
from kites import DEVELOPMENT, at_point, declared, lively, sizes
from oracles import body_to_ned

from awescli.notation.quantities import MEASURED, OUTPUTS, STATES, SURFACES
from awescli.physics.effects.custom_term import FEATURES
from awescli.physics.instant import Line
from awescli.physics.kite import Kite, make_effect
from awescli.simulation.rollout import Simulator

HEIGHTS = (10.0, 100.0, 200.0)


def both(key, values=None, **changes):
    """(instant with the effect, instant without) at the same point."""
    plain, kite = Kite(DEVELOPMENT, HEIGHTS), Kite(DEVELOPMENT, HEIGHTS, (key,))
    kite = kite.with_values({f"{key}.{n}": v for n, v in values.items()} if values else sizes(key))
    return kite.instant(*at_point(kite, **changes)), plain.instant(*at_point(plain, **changes))


def reported(key, **changes):
    """(outputs with the effect, outputs without) by name."""
    plain, kite = Kite(DEVELOPMENT, HEIGHTS), Kite(DEVELOPMENT, HEIGHTS, (key,)).with_values(sizes(key))
    return tuple(dict(zip(OUTPUTS, k.outputs(*at_point(k, **changes)), strict=True)) for k in (kite, plain))


# --- air ---


def test_wind_shear():
    """Guards the exponent: over 10 m, and as the difference to a declared one."""
    with_it, without = both("wind_shear", {"a": 0.1}, p_d=-160.0)
    assert np.divide(with_it.wind[:2], without.wind[:2]) == pytest.approx([16**0.1] * 2)
    power = declared(wind={"law": "power", "exponent": 0.15, "reference_height": 12.0})
    kite = Kite(power, (12.0,), ("wind_shear",))
    assert kite.parameters["wind_shear.a"].value == 0.15
    other = kite.with_values({"wind_shear.a": 0.19})
    stronger = Kite(declared(wind={"law": "power", "exponent": 0.19, "reference_height": 12.0}), (12.0,))
    assert other.instant(*at_point(other)).wind == pytest.approx(stronger.instant(*at_point(stronger)).wind)


def test_wind_veer():
    """Guards its sense: for k > 0 the wind comes from further clockwise higher up."""
    with_it, without = both("wind_veer", {"k": 1e-3}, p_d=-180.0)
    turn = [np.arctan2(-at.wind.e, -at.wind.n) for at in (with_it, without)]
    assert turn[0] - turn[1] == pytest.approx(1e-3 * 80)


def test_wind_offset_and_density():
    """Guards addition in NED, and that a factor on the density is one on the dynamic pressure."""
    with_it, without = both("wind_offset")
    assert np.subtract(with_it.wind, without.wind) == pytest.approx([1.5, -1.0, 0.5, 0.0, 0.0])
    with_it, without = both("air_density")
    assert with_it.dynamic_pressure / without.dynamic_pressure == pytest.approx(1.037)


def test_turbulence_scales_its_input():
    """Guards sigma: the unit series times sigma is added to the wind."""
    with_it, without = both("turbulence", {"sigma": 0.9}, turbulence_n=1.0, turbulence_d=-2.0)
    assert np.subtract(with_it.wind, without.wind) == pytest.approx([0.9, 0.0, -1.8, 0.0, 0.0])


def test_a_roll_gust_rolls_as_the_opposite_roll_rate_would():
    """Guards sign and place: air that rolls at 0.2 rad/s makes the coefficients of a kite that rolls at -0.2 rad/s, and no other load."""
    with_it, still = both("turbulence", {"roll": 0.2}, turbulence_p=1.0)
    _, opposite = both("turbulence", p=still.z.p - 0.2)
    assert with_it.coefficients == pytest.approx(opposite.coefficients) and with_it.coefficients != pytest.approx(still.coefficients)
    assert with_it.V_a == still.V_a and with_it.alpha == still.alpha


# --- line ---


def test_tether_drag():
    """Guards the added coefficient, and a lateral part against the sideways flow of the size of the whole drag times v_r / V_a."""
    with_it, _ = both("tether_drag", {"dC": 0.3, "lateral": 0.0})
    assert with_it.line.drag_coefficient == pytest.approx(1.34)
    with_it, without = both("tether_drag", {"dC": 0.0, "lateral": 1.0})
    drag = 1.22 * 0.004 * 1.04 * without.line.length * without.V_a**2 / 8
    side = with_it.applied.force[1] - without.applied.force[1]
    assert side == pytest.approx(-drag * without.air_velocity[1] / without.V_a)


def test_tether_weight_hangs_down():
    """Guards half the line's weight, downwards; the line is slack and does not run here, so that nothing answers."""
    with_it, without = both("tether_weight", {"mu": 0.0074}, tether_length=400.0, reel_out_speed=0.0)
    force = body_to_ned(without.z.phi, without.z.theta, without.z.psi) @ np.subtract(with_it.applied.force, without.applied.force)
    assert force == pytest.approx([0, 0, 0.0074 * 400 * 9.80665 / 2], abs=1e-9) and with_it.tension == 0


def test_tether_elasticity_is_a_spring_and_damper():
    """Guards T = EA strain + zeta rate in place of the constraint."""
    at, _ = both("tether_elasticity", {"EA": 6e5, "zeta": 120.0}, tether_length=265.0)
    rate = np.dot(at.p_hat, at.v_ned) - 0.8
    assert at.tension == pytest.approx(6e5 * (at.distance - 265.8) / 265.0 + 120 * rate)


def test_tether_sag_takes_length():
    """Guards w^2 l^3 / (24 T^2): the sag of a parabola lets the spring pull as if the line were that much shorter."""
    with_it, without = both("tether_sag", {"w": 0.3})
    rate = np.dot(without.p_hat, without.v_ned) - 0.8
    pull = without.tension - 8000 * 0.02 - 900 * rate  # F_1, of which the spring and the damper are free
    sag = 0.3**2 * without.line.length**3 / (24 * pull**2)
    assert with_it.tension - without.tension == pytest.approx(8000 * sag)


def test_a_line_that_hardly_pulls_sags_as_much_as_it_weighs_against_the_pull():
    """Guards against one kite's forces in generic code: a kite whose line is pulled by 20 N has the sag of 20 N, not of the 50 N that were
    the least of any line; down to the weight of the line, where a parabola ends."""
    for F_1, w, length in ((20.0, 0.07, 100.0), (5.0, 0.03, 60.0)):
        line = Line(length, 0.0, 0.0, 1.1, 0.0, (0.0, 0.0, 0.0), 0.0, 0.0, w)
        tether = make_effect("tether", DEVELOPMENT)
        tether.pull = lambda at, f, m, F_1=F_1: F_1
        at = SimpleNamespace(distance=length, p_hat=(0.0, 0.0, -1.0), v_ned=(0.0, 0.0, 0.0), applied=SimpleNamespace(force=(0.0, 0.0, 0.0)))
        pulled = tether._tension(at, {"dl": 0.0, "k_v": 100.0, "c_v": 0.0}, line, 50.0)
        assert pulled == pytest.approx(F_1 + 100.0 * w**2 * length**3 / (24 * F_1**2))


def test_attachment_winch_and_clock():
    """Guards the three that change the line itself: arm, drum and the winch's clock (late stamps: the true length is the later one)."""
    with_it, without = both("tether_attachment")
    assert np.subtract(with_it.line.attachment, without.line.attachment) == pytest.approx([0.02, 0.01, 0.03])
    with_it, without = both("winch_length")
    assert with_it.line.length == pytest.approx(1.003 * without.line.length + 1.5) and with_it.line.speed == pytest.approx(1.003 * 0.8)
    with_it, without = both("clock_offset:winch", {"tau": 0.5})
    assert with_it.line.length - without.line.length == pytest.approx(0.5 * 0.8 + 0.3 * 0.125) and with_it.line.speed == pytest.approx(0.95)


# --- body ---


def test_mass_offset():
    """Guards the centre of mass: forces divide by the new mass, moments are taken about the new point, weight has no arm."""
    with_it, without = both("mass_offset", {"dm": 0.0, "dx": 0.03, "dz": -0.02})
    weight = 50 * 9.80665 * np.array(without.R[2])
    surface = np.array(without.applied.force) - weight
    moment = np.array(without.applied.moment) - np.cross([0.03, 0, -0.02], surface)
    expected = Kite._about_centre_of_mass(with_it)
    assert with_it.applied.force == pytest.approx(without.applied.force) and expected == pytest.approx(moment, abs=1e-9)
    heavier, _ = both("mass_offset", {"dm": 5.0, "dx": 0.0, "dz": 0.0}, tether_length=400.0)
    light = both("mass_offset", {"dm": 0.0, "dx": 0.0, "dz": 0.0}, tether_length=400.0)[0]
    aero = np.array(light.applied.force) - 50 * 9.80665 * np.array(light.R[2])
    change = np.subtract(heavier.derivative[3:6], light.derivative[3:6])
    assert change == pytest.approx(aero / 55 - aero / 50, abs=1e-9)  # gravity accelerates all masses alike


def test_added_mass():
    """Guards that only the acceleration along body z is divided by more mass."""
    with_it, without = both("added_mass", {"m_a": 2.0})
    change = np.subtract(with_it.derivative, without.derivative)
    assert np.flatnonzero(change).tolist() == [STATES.index("w")]
    assert change[5] == pytest.approx(without.applied.force[2] * (1 / 52 - 1 / 50))


# --- coefficients ---


@pytest.mark.parametrize(
    "key, coefficient, change",
    [
        ("parasitic_drag", "CD", lambda at: 0.09 + 0.2 * abs(at.beta)),
        ("sideslip_drag", "CD", lambda at: 2.0 * at.beta**2),
        ("lift_stall", "CL", lambda at: -20.0 * max(at.alpha - 0.09, 0.0) ** 2),
        ("pitch_curvature", "Cm", lambda at: -0.7 * at.alpha**2),
        ("aeroelastic_twist", "CL", lambda at: -5e-5 * at.dynamic_pressure * 5.73 * at.alpha),
        ("surface_bias:roll", "Cl", lambda at: 0.002),
        ("surface_bias:pitch", "Cm", lambda at: 0.002),
        ("surface_bias:yaw", "Cn", lambda at: 0.002),
    ],
)
def test_coefficients(key, coefficient, change):
    """Guards formula and sign of every aerodynamic effect, and that it touches one coefficient only."""
    for changes in ({"v": -6.0}, {"w": 9.0}):
        with_it, without = both(key, **changes)
        for name in ("CD", "CY", "CL", "Cl", "Cm", "Cn"):
            expected = change(without) if name == coefficient else 0.0
            assert getattr(with_it.coefficients, name) - getattr(without.coefficients, name) == pytest.approx(expected, abs=1e-14), name


def test_a_custom_term_is_a_coefficient_of_its_channel():
    """Guards qbar S (b or c): a term's k counts as a moment or force coefficient. The airspeed counts in units of the kite's own: 2.5 times
    that at which a lift coefficient of 1 carries 50 kg on 3 m2."""
    unit = 2.5 * np.sqrt(2 * 50 * 9.80665 / (1.225 * 3.0))
    for channel, arm in (("f_x", 1.0), ("f_z", 1.0), ("m_x", 7.4), ("m_y", 0.405), ("m_z", 7.4)):
        with_it, without = both(f"custom_term:{channel}*alpha*V_a", {"k": 0.02}, tether_length=400.0)
        change = np.concatenate([np.subtract(getattr(with_it.applied, n), getattr(without.applied, n)) for n in ("force", "moment")])
        expected = np.zeros(6)
        expected[("f_x", "f_y", "f_z", "m_x", "m_y", "m_z").index(channel)] = (
            0.02 * without.dynamic_pressure * 3.0 * arm * without.alpha * without.V_a / unit
        )
        assert change == pytest.approx(expected, abs=1e-9)


@pytest.mark.parametrize("feature", ["V_a", "tether_length", "tension"])
def test_features_of_a_custom_term_do_not_know_how_large_a_kite_is(feature):
    """Guards against one kite's sizes in generic code: a kite of twice the length (8 times the mass, sqrt(2) times the speed, a line twice
    as long, 8 times the pull) has the same features."""
    small, large = Kite(DEVELOPMENT), Kite(declared(m=400.0, S=12.0, b=14.8, c=0.81))
    line = {"p_n": 200.0, "p_e": 40.0, "p_d": -150.0, "tension": 3000.0, "v": 0.0, "w": 0.0, "wind_speed_0": 0.0, "u": 38.0}
    twice = {n: (2.0 if n[0] == "p" else 8.0 if n == "tension" else np.sqrt(2.0)) * v for n, v in line.items()}
    at, scaled = small.instant(*at_point(small, **line)), large.instant(*at_point(large, **twice))
    scaled.inputs["tether_length"] = 2 * at.inputs["tether_length"]
    assert FEATURES[feature](scaled) == pytest.approx(FEATURES[feature](at), rel=1e-9)
    assert 0.3 < FEATURES[feature](at) < 3


# --- surfaces ---


def test_surface_effectiveness_counts_less_beyond_the_threshold():
    """Guards both signs: 0.12 rad beyond 0.03 at one half are 0.075."""
    for deflection in (0.12, -0.12, 0.02):
        with_it, _ = both("surface_effectiveness:rudder", rudder=deflection)
        expected = np.sign(deflection) * (min(abs(deflection), 0.03) + 0.5 * max(abs(deflection) - 0.03, 0.0))
        assert with_it.deflections["rudder"] == pytest.approx(expected) and with_it.deflections["aileron"] == 0.01


def test_a_dead_band_loses_small_deflections():
    """Guards both signs: of 0.12 rad a band of 0.01 leaves 0.11, of 0.006 nothing."""
    for deflection in (0.12, -0.12, 0.006):
        with_it, _ = both("surface_dead_band:rudder", rudder=deflection)
        expected = np.sign(deflection) * max(abs(deflection) - 0.01, 0.0)
        assert with_it.deflections["rudder"] == pytest.approx(expected, abs=1e-15)


def test_the_air_blows_a_surface_back():
    """Guards the balance of a spring and a hinge moment: at 50 m/s (1531 Pa) 2.8e-4 per Pa lose 30 % of a deflection, at half the speed a
    quarter of that moment loses 10 %; both signs, one surface only."""
    for speed, rudder in ((50.0, 0.12), (50.0, -0.12), (25.0, 0.12)):
        still = {"wind_speed_0": 0.0, "wind_speed_1": 0.0, "wind_speed_2": 0.0, "u": speed, "v": 0.0, "w": 0.0, "density": 1.225}
        with_it, without = both("hinge_blowback:rudder", {"k": 2.8e-4}, rudder=rudder, **still)
        moment = 2.8e-4 * 1.225 / 2 * speed**2
        assert with_it.deflections["rudder"] == pytest.approx(rudder / (1 + moment)) and without.deflections["rudder"] == rudder
        assert 1 - 1 / (1 + moment) == pytest.approx(0.3 if speed == 50 else 0.097, abs=0.01)
        assert with_it.deflections["aileron"] == 0.01


def flown(key, calm, values=None, seconds=2.0, setpoint=None, step=0.005):
    """(kite, trajectories, segments) of the kite with an effect on a lively segment; setpoint: of the rudder, (N+1,)."""
    from dataclasses import replace

    kite = Kite(DEVELOPMENT, calm.log.wind.height, (key,) if key else ())
    segments = lively(kite, calm.log, count=2, seconds=seconds).segments
    if setpoint is not None:
        setpoints, inputs = segments.setpoints.copy(), segments.inputs.copy()
        setpoints[:, :, SURFACES.index("rudder")] = setpoint
        inputs[:, :, kite.input_names.index("rudder_rate")] = np.gradient(setpoint, segments.dt)
        segments = replace(segments, setpoints=setpoints, inputs=inputs)
    result = Simulator(kite, (), step=step).rollout(segments, values)
    assert not result.diverged.any()
    return kite, result, segments


def deflection(kite, result, segments, values) -> np.ndarray:
    """(N+1,) true rudder of the first segment."""
    kite = kite.with_values(values)
    c = [float(v) for v in kite.parameters.vector()]
    return kite.instant(list(result.states[0].T), list(segments.inputs[0].T), c).deflections["rudder"]


def test_an_actuator_lag_is_first_order(calm):
    """Guards the step response 1 - exp(-t / tau), and its rate limit."""
    step = np.where(np.arange(101) >= 10, 0.1, 0.0)
    values = {"actuator_lag:rudder.tau": 0.2}
    case = flown("actuator_lag:rudder", calm, values, setpoint=step)
    time = 0.02 * np.maximum(np.arange(101) - 10, 0)
    found = deflection(*case, values)[11:]
    assert found == pytest.approx(0.1 * (1 - np.exp(-time / 0.2))[11:], abs=3e-4)  # the start's rate is a gradient over the step
    values["actuator_lag:rudder.rate"] = 0.2
    limited = deflection(*flown("actuator_lag:rudder", calm, values, setpoint=step), values)
    assert np.diff(limited[11:20]) == pytest.approx(0.2 * 0.02, rel=1e-6)  # 0.1 / 0.2 s would be 0.5 rad/s


def test_an_actuator_lag_of_second_order(calm):
    """Guards the step response of lags of a = 0.2 s and b = 0.1 s in a row, 1 - (a e^(-t/a) - b e^(-t/b)) / (a - b)."""
    step = np.where(np.arange(101) >= 10, 0.1, 0.0)
    values = {"actuator_lag:rudder.tau": 0.3, "actuator_lag:rudder.inertia": 0.2 * 0.1 / 0.3**2}
    case = flown("actuator_lag:rudder", calm, values, setpoint=step)
    t = 0.02 * np.maximum(np.arange(101) - 10, 0)
    response = 1 - (0.2 * np.exp(-t / 0.2) - 0.1 * np.exp(-t / 0.1)) / 0.1
    assert deflection(*case, values)[11:] == pytest.approx(0.1 * response[11:], abs=1e-3)


@pytest.mark.parametrize("key", ["actuator_lag:rudder", "actuator_delay:rudder", "unsteady_lift", "load_cell_lag", "airspeed_lag"])
def test_a_lag_comes_out_of_null_without_a_step(calm, key):
    """Guards the lags that are too short to be stepped through: what a flight reports moves in proportion to the lag, from null past the
    shortest one (a step there is a wall for a fit: nothing that it tries beyond is better)."""
    from awescli.physics.effects.lag import SHORTEST

    setpoint = 0.05 * np.sin(3.0 * 0.02 * np.arange(101))
    taus = SHORTEST * np.array([0.0, 0.5, 1.0 - 1e-9, 1.0 + 1e-9, 1.5])
    runs = [flown(key, calm, {f"{key}.tau": tau}, setpoint=setpoint)[1].outputs[0] for tau in taus]
    # the first ten samples are the start's own transient
    moved = np.array([np.abs(run - runs[0])[10:].max(axis=0) for run in runs])
    seen = moved[-1] > 1e-6
    assert seen.any()
    assert moved[3, seen] == pytest.approx(moved[2, seen], rel=1e-4)
    assert (moved[1, seen] / moved[2, seen]) == pytest.approx(0.5, abs=0.25)
    assert (moved[4, seen] / moved[2, seen]) == pytest.approx(1.5, abs=0.25)


def test_a_lagging_surface_is_behind_from_the_start(calm):
    """Guards the start of a lag's state: a set-point that has been running at a steady rate is already tau times that rate ahead."""
    ramp = 0.05 + 0.2 * 0.02 * np.arange(51)
    values = {"actuator_lag:rudder.tau": 0.15}
    found = deflection(*flown("actuator_lag:rudder", calm, values, seconds=1.0, setpoint=ramp), values)
    # held set-points are half a sample late on average
    assert found == pytest.approx(ramp - 0.2 * (0.15 + 0.01), abs=0.2 * 0.02)
    assert found[0] == pytest.approx(0.05 - 0.2 * 0.15)


@pytest.mark.parametrize("tau", [0.03, 0.12])
def test_an_actuator_delay_is_a_pure_delay(calm, tau):
    """Guards phase and amplitude of the Pade form: a swinging rudder arrives tau later, as large, from the first sample on."""
    time = 0.02 * np.arange(101)
    values = {"actuator_delay:rudder.tau": tau}
    swing = lambda t: 0.1 * np.sin(2 * np.pi * 0.7 * t)  # noqa: E731
    case = flown("actuator_delay:rudder", calm, values, setpoint=swing(time))
    # set-points are held: they are half a sample late themselves, and their steps pass at once; between two steps stands the mean
    kite, result, segments = case
    rudder = len(kite.state_names) + SURFACES.index("rudder")
    result.states[0, 1:, rudder] = (result.states[0, 1:, rudder] + result.states[0, :-1, rudder]) / 2
    assert deflection(*case, values)[25:] == pytest.approx(swing(time - tau - 0.01)[25:], abs=2e-3)


@pytest.mark.parametrize("tau", [0.02, 0.04, 0.08])
def test_a_short_delay_is_flown_as_it_is_fitted(calm, tau):
    """Guards the poles of the Pade form: with steps of 20 ms, as fits take them, a step of the set-point goes the way that it goes with
    steps of 5 ms (poles of a shorter delay did not, and a lag explained flights with a short delay better than a delay)."""
    step, values = np.where(np.arange(101) >= 10, 0.1, 0.0), {"actuator_delay:rudder.tau": tau}
    fine, coarse = (deflection(*flown("actuator_delay:rudder", calm, values, setpoint=step, step=h), values) for h in (0.005, 0.02))
    assert coarse == pytest.approx(fine, abs=0.005)


def test_unsteady_lift_lags(calm):
    """Guards tau dC_L/dt = C_L,steady - C_L along a flight: the state obeys its equation to the integrator's accuracy."""
    values = {"unsteady_lift.tau": 0.1}
    kite, result, segments = flown("unsteady_lift", calm, values)
    lagging = kite.with_values(values)
    c = [float(v) for v in lagging.parameters.vector()]
    at = lagging.instant(list(result.states[0].T), list(segments.inputs[0].T), c)
    CL, steady = at.coefficients.CL, at.received["unsteady_lift"].CL
    middle = (np.diff(CL) / 0.02 - ((steady - CL)[1:] + (steady - CL)[:-1]) / 2 / 0.1) * 0.1
    assert np.abs(middle[5:]).max() < 0.01 * np.ptp(steady)  # trapezoidal rule; set-points jump in between


# --- sensors ---


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
    """Guards the two terms: 3 % more per 0.1 rad of angle of attack, and as much to either side for sideslip."""
    kite = Kite(DEVELOPMENT, HEIGHTS, ("pitot_position_error",))
    kite = kite.with_values({"pitot_position_error.k_a": 0.3, "pitot_position_error.k_b": 1.0})
    factors = []
    for v in (5.0, -5.0):
        still = {"wind_speed_0": 0.0, "wind_speed_1": 0.0, "wind_speed_2": 0.0, "v": v, "u": 40.0, "w": 4.0}
        point = at_point(kite, **still)
        factors.append(dict(zip(OUTPUTS, kite.outputs(*point), strict=True))["V_a"] / np.sqrt(40**2 + 4**2 + 5**2))
    expected = 1 + 0.3 * np.arctan2(4, 40) + np.arctan2(5, np.hypot(40, 4)) ** 2
    assert factors == pytest.approx([expected, expected]) and 0.02 < expected - 1 < 0.06


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


def test_drag_falls_with_the_reynolds_number():
    """Guards the exponent, of kite and line together: at n = 0.17 the drag coefficient of both falls by 10 % from 30 to 55 m/s, and no
    other does; at the kite's crosswind speed (41 m/s) it is as declared."""
    whole = {}
    for speed in (30.0, 55.0, 2.5 * np.sqrt(2 * 50 * 9.80665 / (1.225 * 3.0))):
        still = {"wind_speed_0": 0.0, "wind_speed_1": 0.0, "wind_speed_2": 0.0, "u": speed, "v": 0.0, "w": 0.0}
        with_it, without = both("reynolds_drag", {"n": 0.17}, **still)
        line = 1.04 * 0.004 * without.line.length / (4 * 3.0)
        whole[speed] = (with_it.coefficients.CD + line) / (without.coefficients.CD + line)
        assert with_it.coefficients._replace(CD=0) == without.coefficients._replace(CD=0)
    slow, fast, own = whole.values()
    assert fast / slow == pytest.approx((55 / 30) ** -0.17) == pytest.approx(0.9, abs=0.005) and own == pytest.approx(1.0)


def test_downwash_that_comes_late_is_a_moment_with_the_rate_of_alpha(calm):
    """Guards size and sign of C_m_alphadot: along a lively flight the added coefficient is C_m_alphadot c / (2 V_a) times dalpha/dt
    as it was one time constant ago, from the first sample on."""
    values = {"downwash_lag.Cm_adot": -20.0, "downwash_lag.arm": 4.0}
    kite, result, segments = flown("downwash_lag", calm, values)
    plain, late = (kite.with_values({**values, "downwash_lag.Cm_adot": k}) for k in (0.0, -20.0))
    at, without = (k.instant(list(result.states[0].T), list(segments.inputs[0].T), list(k.parameters.vector())) for k in (late, plain))
    added, rate = at.coefficients.Cm - without.coefficients.Cm, np.gradient(at.alpha, 0.02)
    tau = 4.0 * 0.405 / at.V_a
    time = 0.02 * np.arange(len(rate))
    expected = -20.0 * 0.405 / (2 * at.V_a) * np.interp(time - tau, time, rate)
    error = np.abs(added - expected)
    assert np.abs(added).max() > 0.01 and error[5:-5].max() < 0.15 * np.abs(added).max() and np.median(error) < 0.03 * np.abs(added).max()
    assert added[0] == pytest.approx(-20.0 * 0.405 / (2 * at.V_a[0]) * rate[0], abs=0.15 * np.abs(added).max())


def test_lift_drifts_and_steps_by_the_flights_clock(calm):
    """Guards rate and onset: 100 s at -4e-4 per s cost 4 % of lift, a step of -5 % at 60 s is whole two seconds later and absent two
    seconds before; a segment of a log flies on the log's clock."""
    for time, step in ((0.0, 0.0), (58.0, 0.0), (60.0, -0.025), (62.0, -0.05), (100.0, -0.05)):
        with_it, without = both("lift_drift", {"rate": -4e-4, "step": -0.05, "at": 60.0}, time=time)
        assert with_it.coefficients.CL / without.coefficients.CL - 1 == pytest.approx(-4e-4 * time + step, abs=1e-3)
        assert with_it.coefficients._replace(CL=0) == without.coefficients._replace(CL=0)
    kite = Kite(DEVELOPMENT, calm.log.wind.height)
    segments = lively(kite, calm.log, count=3).segments
    time = segments.inputs[:, :, kite.input_names.index("time")]
    assert time[:, 0] == pytest.approx(calm.log.time[segments.first]) and np.diff(time, axis=1) == pytest.approx(0.02)


def play(setpoint, width, start):
    """The play operator on samples: the surface is pushed along when the set-point leaves +-width/2 of it."""
    path = [start]
    for s in setpoint[1:]:
        path.append(min(max(path[-1], s - width / 2), s + width / 2))
    return np.array(path)


def test_backlash_is_the_play_operator(calm):
    """Guards memory: against the operator on samples, a swinging rudder that reverses inside and outside the play; a reversal is late by
    12 ms, which at 0.4 rad/s is 5 mrad. Small swings do nothing, large ones arrive half a width late."""
    width, time = 0.03, 0.02 * np.arange(201)
    setpoint = 0.1 * np.sin(2 * np.pi * 0.6 * time) * np.where(time < 2.5, 1.0, 0.12)
    case = flown("surface_backlash:rudder", calm, {"surface_backlash:rudder.width": width}, seconds=4.0, setpoint=setpoint)
    found = deflection(*case, {"surface_backlash:rudder.width": width})
    expected = play(setpoint, width, setpoint[0] - width / 2)
    assert np.abs(found - expected).max() < 6e-3 and np.median(np.abs(found - expected)) < 1e-3
    assert np.abs(setpoint - found).max() == pytest.approx(width / 2, abs=1e-4)
    # the small swing of the end is lost for the most part, the large one is not
    assert np.ptp(found[160:]) < 0.1 * np.ptp(setpoint[160:]) + 2e-3 and np.ptp(found[:100]) > 0.8 * np.ptp(setpoint[:100])


def wound(calm, speed, values):
    """(paid-out speed, length behind the reference) (N+1,) along a segment on which the winch is asked for `speed` (N+1,)."""
    kite = Kite(DEVELOPMENT, calm.log.wind.height, ("winch_tracking",))
    values = {f"winch_tracking.{n}": v for n, v in values.items()}
    segments = lively(kite, calm.log, count=1, seconds=4.0).segments
    at = {n: kite.input_names.index(n) for n in ("tether_length", "reel_out_speed", "reel_out_acceleration")}
    length = segments.inputs[0, 0, at["tether_length"]] + np.concatenate([[0], np.cumsum((speed[1:] + speed[:-1]) / 2 * segments.dt)])
    asked = np.stack([length, speed, np.gradient(speed, segments.dt)], axis=1)[None]
    segments = segments.with_inputs(list(at.values()), asked)
    flown = Simulator(kite, (), step=0.005).rollout(segments, values)
    assert not flown.diverged.any()
    kite = kite.with_values(values)
    line = kite.instant(list(flown.states[0].T), list(segments.inputs[0].T), list(kite.parameters.vector())).line
    return line.speed, length - line.length


def test_a_winch_follows_its_reference_late(calm):
    """Guards lag, length and limits: a reference that rises steadily at 0.2 m/s2 is followed 0.5 s behind, 0.1 m/s slower, and the line is
    behind by tau v, as after a whole reel-out from rest; a torque limit of 0.1 m/s2 makes the speed a ramp, a speed limit ends it."""
    time = 0.02 * np.arange(201)
    ramp = 0.5 + 0.2 * time
    v, behind = wound(calm, ramp, {"tau": 0.5})
    assert v == pytest.approx(ramp - 0.1, abs=1e-6) and behind == pytest.approx(0.5 * v, abs=1e-4)
    step = np.where(time < 1.0, 0.5, 1.0)
    v, _ = wound(calm, step, {"tau": 0.5})
    # the input runs up to its step over one sample
    assert v[55:] == pytest.approx(1.0 - 0.5 * np.exp(-(time[55:] - 0.99) / 0.5), abs=2e-3)
    v, _ = wound(calm, step, {"tau": 0.5, "a_max": 0.1})
    assert v[60:150] == pytest.approx(0.5 + 0.1 * (time[60:150] - 0.99), abs=2e-3)
    v, _ = wound(calm, step, {"tau": 0.2, "v_max": 0.8})
    assert v[:49] == pytest.approx(0.5, abs=1e-9) and v[-1] == pytest.approx(0.8, abs=1e-6)
    # a drum at its limit does not wind up: once it is asked for less it slows down at once
    v, _ = wound(calm, np.where((time < 1.0) | (time > 3.0), 0.5, 3.0), {"tau": 0.2, "v_max": 0.8})
    assert v[149] == pytest.approx(0.8, abs=1e-3) and v[160] < 0.7
