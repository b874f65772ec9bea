"""Effects on air, line, body and coefficients do what their row of the table says: against formulae written out here."""

from types import SimpleNamespace

import numpy as np
import pytest
from kites import DEVELOPMENT, at_point, declared, lively
from oracles import body_to_ned
from physics.effect_cases import HEIGHTS, both, flown

from awescli.notation.quantities import STATES
from awescli.physics.effects.around import AROUND, around
from awescli.physics.effects.custom_term import FEATURES
from awescli.physics.instant import Line
from awescli.physics.kite import Kite, make_effect


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
    assert np.subtract(with_it.wind, without.wind) == pytest.approx([1.5, -1.0, 0.5, 0.0, 0.0, 0.0, 0.0])
    with_it, without = both("air_density")
    assert with_it.dynamic_pressure / without.dynamic_pressure == pytest.approx(1.037)


def test_turbulence_scales_its_input():
    """Guards sigma: the unit series times sigma is added to the wind."""
    with_it, without = both("turbulence", {"sigma": 0.9}, turbulence_n=1.0, turbulence_d=-2.0)
    assert np.subtract(with_it.wind, without.wind) == pytest.approx([0.9, 0.0, -1.8, 0.0, 0.0, 0.0, 0.0])


def test_a_roll_gust_rolls_as_the_opposite_roll_rate_would():
    """Guards sign and place: air that rolls at 0.2 rad/s makes the coefficients of a kite that rolls at -0.2 rad/s, and no other load."""
    with_it, still = both("turbulence", {"roll": 0.2}, turbulence_p=1.0)
    _, opposite = both("turbulence", p=still.z.p - 0.2)
    assert with_it.coefficients == pytest.approx(opposite.coefficients) and with_it.coefficients != pytest.approx(still.coefficients)
    assert with_it.V_a == still.V_a and with_it.alpha == still.alpha


@pytest.mark.parametrize("gust, rate", [("gust_p", "p"), ("gust_q", "q"), ("gust_r", "r")])
def test_gradients_of_gusts_act_as_opposite_rates(gust, rate):
    """Guards sign and place of what an estimator integrates out: air that turns with the kite leaves it without damping."""
    kite = Kite(DEVELOPMENT, HEIGHTS)
    still, with_it = kite.instant(*at_point(kite)), kite.instant(*at_point(kite, **{gust: 0.2}))
    opposite = kite.instant(*at_point(kite, **{rate: getattr(still.z, rate) - 0.2}))
    assert with_it.coefficients == pytest.approx(opposite.coefficients) and with_it.coefficients != pytest.approx(still.coefficients)
    assert with_it.V_a == still.V_a and with_it.alpha == still.alpha


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
    """Guards the three that change the line itself: arm, drum and the winch's clock (late stamps: the true length is the later one; half a
    second is two looks of `around` ahead)."""
    with_it, without = both("tether_attachment")
    assert np.subtract(with_it.line.attachment, without.line.attachment) == pytest.approx([0.02, 0.01, 0.03])
    with_it, without = both("winch_length")
    assert with_it.line.length == pytest.approx(1.003 * without.line.length + 1.5) and with_it.line.speed == pytest.approx(1.003 * 0.8)
    later = {"tether_length": 0.4375, "reel_out_speed": 0.15, "reel_out_acceleration": 0.1}
    k = AROUND.index(0.5)
    with_it, without = both("clock_offset:winch", {"tau": 0.5}, **{around(signal)[k]: more for signal, more in later.items()})
    assert np.subtract(with_it.line[:3], without.line[:3]) == pytest.approx([0.4375, 0.15, 0.1])


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
