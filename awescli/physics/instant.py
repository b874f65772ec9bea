"""What is known at one instant, in the order in which it becomes known; every letter may be a float, array, tensor or recorded scalar."""

from dataclasses import dataclass, field
from types import SimpleNamespace
from typing import Any, NamedTuple

from awescli.notation.scalars import Scalar


class Wind(NamedTuple):
    """Air at the kite: velocity NED [m/s], density [kg/m3], and the gusts' gradients [rad/s] along span and fuselage, which turn the kite
    as rates of minus that would (MIL-F-8785C's p_g, q_g, r_g)."""

    n: Scalar
    e: Scalar
    d: Scalar
    density: Scalar
    roll: Scalar = 0.0
    pitch: Scalar = 0.0
    yaw: Scalar = 0.0


class Body(NamedTuple):
    """Rigid body: mass [kg], extra apparent mass along body z [kg], inertia [kg m2], centre of mass from the reference point [m, FRD]."""

    mass: Scalar
    added_z: Scalar
    Jx: Scalar
    Jy: Scalar
    Jz: Scalar
    Jxz: Scalar
    cg: tuple[Scalar, Scalar, Scalar]


class Coefficients(NamedTuple):
    """Aerodynamic coefficients in wind axes (C_D, C_Y, C_L) and of moments in body axes; CL_alpha_part is C_L(alpha) - C_L(0)."""

    CD: Scalar
    CY: Scalar
    CL: Scalar
    Cl: Scalar
    Cm: Scalar
    Cn: Scalar
    CL_alpha_part: Scalar = 0.0


class Line(NamedTuple):
    """The line as the tether law sees it.

    length [m], speed [m/s] and acceleration [m/s2] paid out by the winch, drag coefficient C_tD, share of the drag's lateral part (0 or 1),
    attachment from the reference point [m, FRD], axial stiffness EA [N] (0: inextensible) with damping [N s/m], sag weight [N/m].
    """

    length: Scalar
    speed: Scalar
    acceleration: Scalar
    drag_coefficient: Scalar
    lateral_drag: Scalar
    attachment: tuple[Scalar, Scalar, Scalar]
    stiffness: Scalar
    damping: Scalar
    sag_weight: Scalar


class Load(NamedTuple):
    """Force [N] and moment about the reference point [N m], body axes; and what answers the kite's own acceleration: the mass [kg] that
    moves with it across the line, but not along it. It resists, and weighs nothing (its weight, if any, is part of `force`)."""

    force: tuple[Scalar, Scalar, Scalar]
    moment: tuple[Scalar, Scalar, Scalar]
    mass_across: Scalar = 0.0


@dataclass
class Instant:
    """One instant, filled from top to bottom by `kite.Kite`; effects read what stands above their place.

    z: the 12 states; R: rows of body-to-NED; v_ned [m/s]; inputs: the exogenous inputs by name; values: all parameters by name;
    received: key of an effect -> what stood at its place before it acted; loads: what each effect adds to `applied`, by its key. What has
    no value here has none before its place is filled (AttributeError); `line` never has one on a kite that flies free, whose tension is 0.
    """

    z: SimpleNamespace
    R: tuple
    v_ned: tuple
    inputs: dict[str, Scalar]
    values: dict[str, Scalar]
    setpoints: dict[str, Scalar]
    distance: Scalar
    p_hat: tuple
    states: dict[str, Scalar] = field(default_factory=dict)
    received: dict[str, Any] = field(default_factory=dict)
    deflections: dict[str, Scalar] = field(default_factory=dict)
    wind: Wind = field(init=False, repr=False)
    V_a: Scalar = field(init=False, repr=False)
    alpha: Scalar = field(init=False, repr=False)
    beta: Scalar = field(init=False, repr=False)
    air_velocity: tuple[Scalar, Scalar, Scalar] = field(init=False, repr=False)
    dynamic_pressure: Scalar = field(init=False, repr=False)
    body: Body = field(init=False, repr=False)
    coefficients: Coefficients = field(init=False, repr=False)
    line: Line = field(init=False, repr=False)
    applied: Load = field(init=False, repr=False)
    loads: dict[str, Load] = field(default_factory=dict)
    tension: Scalar = 0.0
    acceleration: tuple = ()
    derivative: tuple = ()
