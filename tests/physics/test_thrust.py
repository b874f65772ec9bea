"""The propeller against closed forms, momentum theory's energy balance, its own power balance, and signs that hands on a motor feel."""

import numpy as np
import pytest
from kites import DEVELOPMENT, POWERED, PROPELLER, at_point, inputs_of_one_for
from pydantic import ValidationError

from awescli.notation.errors import BadInput, BadInputs
from awescli.physics.declaration import KiteDeclaration, kite_text, read_kite
from awescli.physics.effects.thrust import balanced, polynomial
from awescli.physics.kite import Kite, needed_by, surfaces_used
from awescli.physics.propeller import Propeller, SpeedLaw

FREE = POWERED.model_copy(update={"effects": ("gravity", "aerodynamics", "thrust")})
"""The powered development kite without its line."""
BARE = POWERED.model_copy(update={"effects": ("gravity", "aerodynamics")})

APC_12X6 = Propeller(
    diameter=0.3048, hub=(0.297, 0.0, 0.046), CT=(0.0604, 0.1089, -0.896, 1.08, -0.4314), CP=(0.0223, 0.01664, 0.0412, -0.5304, 0.5054),
    speed=SpeedLaw(shaft_power=(-4.39, 70.135, 174.46)), inertia=1.3e-4,
)  # fmt: skip
"""The published propeller of the University of Minnesota's Ultra Stick 25e (UASLab/OpenFlight, UltraStick25e_config.m)."""


def with_propeller(**changes) -> KiteDeclaration:
    return FREE.model_copy(update={"propellers": (PROPELLER.model_copy(update=changes),)})


def pushed(declaration: KiteDeclaration, **changes):
    """(instant, force, moment) of what the propeller adds, in still air at `at_point`."""
    kite, bare = Kite(declaration), Kite(BARE)
    x, u, c = at_point(Kite(POWERED), **changes)
    u = [0.0 if n.startswith("wind_speed") else v for n, v in zip(Kite(POWERED).input_names, u, strict=True)]
    with_it = kite.instant(x, inputs_of_one_for(kite, Kite(POWERED), u), kite.parameters.vector())
    without = bare.instant(x, inputs_of_one_for(bare, Kite(POWERED), u), bare.parameters.vector())
    difference = [np.subtract(getattr(with_it.applied, n), getattr(without.applied, n)) for n in ("force", "moment")]
    return with_it, *difference


def revolutions(propeller: Propeller, power: float, speed: float, density: float = 1.2) -> float:
    free = max(speed / (propeller.free_advance * propeller.diameter), 0.5)
    return float(balanced(propeller, power, speed, free, density))


@pytest.mark.parametrize("propeller", [APC_12X6, PROPELLER], ids=["APC 12x6", "large"])
@pytest.mark.parametrize("speed", [0.0, 1.0, 8.0, 17.0, 30.0, 45.0])
def test_the_shaft_power_is_what_the_propeller_takes(propeller, speed):
    """Guards the balance that gives the speed: C_P rho n^3 D^5 is the power, to rounding, from idle to full throttle, and more power
    turns faster."""
    found = []
    for power in np.array([0.001, 0.01, 0.1, 0.4, 1.0]) * polynomial(propeller.speed.shaft_power, 1.0):
        n = revolutions(propeller, power, speed)
        taken = polynomial(propeller.power_polynomial, speed / (n * propeller.diameter)) * 1.2 * n**3 * propeller.diameter**5
        assert taken == pytest.approx(power, rel=1e-9)
        found.append(n)
    assert (np.diff(found) > 0).all()


def test_power_goes_into_thrust_and_losses():
    """Guards the bookkeeping of C_T and C_P: what the shaft gives is thrust times speed and a loss, which is at least what momentum theory
    asks of an ideal disc of the same thrust, T v_i with v_i = -V/2 + sqrt(V^2/4 + T/(2 rho A)) (Beard & McLain, ch. 4.3)."""
    area = np.pi * APC_12X6.diameter**2 / 4
    for speed in (6.0, 10.0, 14.0):
        for throttle in (0.5, 0.8, 1.0):
            power = polynomial(APC_12X6.speed.shaft_power, throttle)
            n = revolutions(APC_12X6, power, speed)
            thrust = polynomial(APC_12X6.thrust_polynomial, speed / (n * APC_12X6.diameter)) * 1.2 * n**2 * APC_12X6.diameter**4
            induced = -speed / 2 + np.sqrt(speed**2 / 4 + thrust / (2 * 1.2 * area))
            assert thrust > 0 and power > thrust * (speed + induced)
            assert thrust * speed / power > 0.3  # and no more than a propeller may lose


def test_thrust_and_torque_are_those_of_the_coefficients():
    """Guards T, Q, hub and axis in body axes against the formulas, with the speed of the air along the axis at the hub, rates included."""
    at, force, moment = pushed(FREE)
    axis, hub = np.array(PROPELLER.direction), np.array(PROPELLER.hub)
    omega = np.array([at.z.p, at.z.q, at.z.r])
    speed = axis @ (np.array(at.air_velocity) + np.cross(omega, hub))
    n = revolutions(PROPELLER, polynomial(PROPELLER.speed.shaft_power, 0.6), speed, 1.22)
    J, D = speed / (n * PROPELLER.diameter), PROPELLER.diameter
    T = polynomial(PROPELLER.thrust_polynomial, J) * 1.22 * n**2 * D**4
    Q = polynomial(PROPELLER.power_polynomial, J) * 1.22 * n**2 * D**5 / (2 * np.pi)
    h = 2 * np.pi * n * PROPELLER.inertia * axis
    assert force == pytest.approx(T * axis, rel=1e-9)
    assert moment == pytest.approx(np.cross(hub, T * axis) - Q * axis - np.cross(omega, h), rel=1e-9)
    assert 2 * np.pi * n * Q == pytest.approx(polynomial(PROPELLER.speed.shaft_power, 0.6), rel=1e-9)


def test_the_kite_rolls_against_its_propeller_and_swings_as_a_gyroscope():
    """Guards both signs: a propeller that turns clockwise seen from behind rolls the kite left, and a pitch up swings the nose right
    (every pilot of a tail dragger: tail up, nose left); the other sense does the opposite."""
    straight = {"axis": (1.0, 0.0, 0.0), "hub": (0.5, 0.0, 0.0)}
    still = dict(p=0.0, q=0.0, r=0.0)
    clockwise, other = with_propeller(**straight), with_propeller(**straight, turns="counterclockwise")
    roll, against = (pushed(d, **still)[2][0] for d in (clockwise, other))
    assert roll < 0 < against and roll == pytest.approx(-against)
    for declaration, sign in ((clockwise, 1.0), (other, -1.0)):
        yaw = pushed(declaration, **(still | {"q": 0.5}))[2][2] - pushed(declaration, **still)[2][2]
        assert yaw * sign > 0


def test_at_zero_throttle_it_windmills():
    """Guards the drag of a motor that is off: no torque, a drag like that of the coefficient at C_P = 0, growing with V^2."""
    drag = []
    for u in (20.0, 40.0):
        at, force, moment = pushed(with_propeller(axis=(1.0, 0.0, 0.0), hub=(0.0, 0.0, 0.0), inertia=0.0), throttle=0.0, u=u)
        assert np.abs(moment).max() < 1e-9 and force[1] == force[2] == 0.0
        n = at.air_velocity[0] / (PROPELLER.free_advance * PROPELLER.diameter)
        expected = polynomial(PROPELLER.thrust_polynomial, PROPELLER.free_advance) * 1.22 * n**2 * PROPELLER.diameter**4
        assert force[0] == pytest.approx(expected, rel=1e-6) and force[0] < 0
        drag.append(force[0] / at.air_velocity[0] ** 2)
    assert drag[0] == pytest.approx(drag[1], rel=1e-6)


def test_the_other_laws_of_speed():
    """Guards proportional and recorded: revolutions are full times throttle, or the log's, and not less than the air makes."""
    proportional = with_propeller(speed=SpeedLaw(law="proportional", full=150.0))
    recorded = with_propeller(speed=SpeedLaw(law="recorded"))
    assert needed_by(proportional) == ("throttle",) and needed_by(recorded) == ("motor_speed",)
    axis, hub = np.array(PROPELLER.direction), np.array(PROPELLER.hub)
    for declaration, n, changes in ((proportional, 90.0, {"throttle": 0.6}), (recorded, 80.0, {})):
        kite = Kite(declaration)
        x, u, c = at_point(Kite(POWERED), **changes)
        u = [u[Kite(POWERED).input_names.index(name)] if name != "motor_speed" else 80.0 for name in kite.input_names]
        at = kite.instant(x, u, kite.parameters.vector())
        bare = Kite(BARE)
        without = bare.instant(x, inputs_of_one_for(bare, kite, u), bare.parameters.vector())
        speed = axis @ (np.array(at.air_velocity) + np.cross([at.z.p, at.z.q, at.z.r], hub))
        T = polynomial(PROPELLER.thrust_polynomial, speed / (n * PROPELLER.diameter)) * 1.22 * n**2 * PROPELLER.diameter**4
        assert np.subtract(at.applied.force, without.applied.force) == pytest.approx(T * axis, rel=1e-9)


def test_a_table_is_read_as_its_polynomial():
    """Guards UIUC's form: rows of (J, CT) give the same propeller as the polynomial that they lie on; a table that no smooth propeller
    has is refused."""
    J = np.linspace(0.0, 0.8, 17)
    rows = {n: tuple((float(j), float(polynomial(p, j))) for j in J)
            for n, p in (("CT", APC_12X6.thrust_polynomial), ("CP", APC_12X6.power_polynomial))}  # fmt: skip
    table = Propeller(diameter=0.3048, hub=(0.0, 0.0, 0.0), speed=SpeedLaw(shaft_power=(0.0, 240.0)), **rows)
    assert table.thrust_polynomial == pytest.approx(APC_12X6.thrust_polynomial, abs=1e-9)
    assert table.free_advance == pytest.approx(APC_12X6.free_advance, rel=1e-9)
    zigzag = tuple((float(j), 0.1 * (-1) ** k) for k, j in enumerate(J))
    with pytest.raises(ValidationError, match="not smooth"):
        Propeller(diameter=0.3, hub=(0.0, 0.0, 0.0), CT=zigzag, CP=rows["CP"], speed=SpeedLaw(shaft_power=(0.0, 1.0)))


def test_what_makes_no_sense_is_refused(tmp_path):
    """Guards one clear message each: no propeller, no law of speed, no axis, a propeller that nothing stops."""
    good = dict(diameter=0.3, hub=(0.0, 0.0, 0.0), CT=(0.1, -0.2), CP=(0.05, -0.06))
    for bad, told in (
        ({"speed": {"law": "power"}}, "shaft_power"), ({"speed": {"law": "proportional"}}, "full"),
        ({"speed": {"law": "recorded"}, "axis": (0.0, 0.0, 0.0)}, "no direction"),
        ({"speed": {"law": "recorded"}, "CP": (0.05, 0.01)}, "windmill"), ({"speed": {"law": "recorded"}, "CP": (0.0, 0.01)}, "J = 0"),
    ):  # fmt: skip
        with pytest.raises(ValidationError, match=told):
            Propeller(**(good | bad))
    (tmp_path / "kite.yaml").write_text(kite_text(DEVELOPMENT).replace("- aerodynamics\n", "- aerodynamics\n- thrust\n"))
    with pytest.raises(BadInput, match="no propeller"):
        read_kite(tmp_path / "kite.yaml")


def test_a_free_kite_is_a_declaration_of_its_own(tmp_path):
    """Guards flight without a tether: no parameter of a line is asked for, none of its inputs read, and the file comes back the same."""
    of_line = {"d_t", "CtD", "rtx", "rty", "rtz", "k_v", "c_v", "dl"}
    rows = {n: r for n, r in FREE.parameters.items() if n not in of_line}
    free = FREE.model_copy(update={"parameters": rows, "tether": KiteDeclaration.model_fields["tether"].default})
    (tmp_path / "kite.yaml").write_text(kite_text(free))
    assert read_kite(tmp_path / "kite.yaml") == free and "tether" not in (tmp_path / "kite.yaml").read_text()
    kite = Kite(free)
    assert not {"tether_length", "reel_out_speed", "tension"} & set(kite.input_names)
    assert needed_by(free) == ("throttle",) and needed_by(DEVELOPMENT) == ("tether_length", "reel_out_speed")
    assert "throttle" in surfaces_used(free) and "throttle" not in surfaces_used(DEVELOPMENT)
    x, u, c = at_point(Kite(POWERED))
    u = inputs_of_one_for(kite, Kite(POWERED), u)
    assert not hasattr(kite.instant(x, u, kite.parameters.vector()), "line")
    assert kite.outputs(x, u, list(kite.parameters.vector()))[18] == 0.0  # no line, no load
    (tmp_path / "lost.yaml").write_text(kite_text(free.model_copy(update={"effects": (*free.effects, "tether")})))
    with pytest.raises(BadInputs, match="parameter 'k_v' is not declared"):
        read_kite(tmp_path / "lost.yaml")
    (tmp_path / "sag.yaml").write_text(kite_text(free.model_copy(update={"effects": (*free.effects, "tether_sag")})))
    with pytest.raises(BadInput, match="acts on a line"):
        read_kite(tmp_path / "sag.yaml")
    with pytest.raises(BadInput, match="act on a line"):
        Kite(free, extra=("load_cell_scale",))
