"""What the flights of the tracing campaign lack: effects at their largest size, effects outside the library, other forms, pairs."""

import math

import numpy as np

DEG = math.pi / 180

LARGE = {
    "wind_shear": {"a": 0.05},
    "wind_veer": {"k": -4.4e-4},
    "wind_offset": {"dN": 1.2, "dE": -0.8, "dD": -0.5},
    "tether_drag": {"lateral": 1.0},
    "tether_weight": {"mu": 0.03},
    "tether_elasticity": {"EA": 6e5, "zeta": 120.0},
    "winch_length": {"s": 0.01},
    "clock_offset:winch": {"tau": 1.0},
    "mass_offset": {"dm": 2.5, "dz": 0.04},
    "parasitic_drag": {"k": 0.12},
    "sideslip_drag": {"k": 2.5},
    "lift_stall": {"k": 25.0, "alpha_0": 0.08},
    "unsteady_lift": {"tau": 0.15},
    "aeroelastic_twist": {"k": 1e-4},
    "surface_bias:yaw": {"b": 0.001},
    "surface_effectiveness:rudder": {"s": 0.5, "threshold": 0.1},
    "actuator_lag:rudder": {"tau": 0.2},
    "actuator_delay:rudder": {"tau": 0.14},
    "airspeed_scale": {"s": 0.94},
    "load_cell_scale": {"s": 1.08},
    "load_cell_lag": {"tau": 0.3},
    "position_latency": {"tau": 0.15},
    "heading_bias": {"b": 3 * DEG},
    "compass_deviation": {"b": 3 * DEG, "c": -2 * DEG},
    "attitude_bias:theta": {"b": 3 * DEG},
    "rate_feedback:rudder": {"k": -0.15, "tau": 1.5},
    "imu_bias:rates": {"bx": 0.01, "by": -0.006, "bz": 0.008},
}
"""Largest size of each effect, taken from the typical sizes of the library's sources."""

OUTSIDE = {
    "roll moment with heading": {"custom_term:m_x*sin_heading": {"k": 0.004}},
    "pitch moment with alpha and airspeed": {"custom_term:m_y*alpha*V_a": {"k": 0.3}},
    "side force with elevation": {"custom_term:f_y*elevation": {"k": 0.03}},
    "yaw moment with elevation": {"custom_term:m_z*elevation": {"k": 0.004}},
    "drag with roll rate": {"custom_term:f_x*p": {"k": -0.05}},
}
"""Effects that the library does not hold: forcings with a form of their own."""

FORMS = {
    "drag with the fourth power of sideslip": ("sideslip_drag", {}, {"CD": {"beta^4": ("CDb4", 250.0)}}),
    "pitch moment with the cube of alpha": ("pitch_curvature", {}, {"Cm": {"alpha^3": ("Cma3", -30.0)}}),
    "lift with the cube of alpha": ("lift_stall", {}, {"CL": {"alpha^3": ("CLa3", -100.0)}}),
    "lift with the fourth power of alpha": ("lift_stall", {}, {"CL": {"alpha^4": ("CLa4", -700.0)}}),
    "rudder that works less the farther it goes": ("surface_effectiveness:rudder", {}, {"Cn": {"rudder^3": ("Cndr3", -0.45)}}),
    "second-order lag": ("actuator_lag:rudder", {"actuator_lag:rudder": {"tau": 0.24, "inertia": 0.25}}, {}),
    "lag with a rate limit": ("actuator_lag:rudder", {"actuator_lag:rudder": {"tau": 0.12, "rate": 0.5}}, {}),
    "servo with a damping ratio of 0.7": ("actuator_lag:rudder", {"actuator_lag:rudder": {"tau": 0.14, "inertia": 0.51}}, {}),
}
"""Effects whose form is not exactly the library's first one: the name that is right, and effects or aerodynamic terms that are flown."""

GROSS: dict[str, dict[str, tuple[float, ...]]] = {
    "airspeed_scale": {"s": (0.9, 0.8)},
    "load_cell_scale": {"s": (0.85,)},
    "position_latency": {"tau": (0.24, 0.45)},
    "attitude_latency": {"tau": (0.1,)},
    "heading_bias": {"b": (0.1,)},
    "compass_deviation": {"b": (7 * DEG,)},
    "attitude_bias:phi": {"b": (5 * DEG,)},
    "attitude_bias:theta": {"b": (5 * DEG,)},
    "imu_bias:rates": {"by": (2.5 * DEG, 8 * DEG)},
    "imu_bias:accelerations": {"bz": (1.0,)},
    "actuator_delay:rudder": {"tau": (0.14, 0.3)},
    "actuator_lag:rudder": {"tau": (0.3,)},
    "surface_effectiveness:rudder": {"s": (0.4,)},
    "clock_offset:winch": {"tau": (0.5, 2.0)},
    "winch_length": {"s": (0.01, 0.03)},
    "mass_offset": {"dm": (8.0,)},
}
"""Gross errors of sensors, actuators and declaration, put into the record of a flight (injection.py): effect -> parameter -> values."""

LENGTHS = (0.25, 4.0)
"""Kites so many times as long, of the same density: 0.8 kg on 1.8 m of span, 3.2 t on 30 m."""

BOUNDED = ("CLa", "Clp", "Cmq", "Cndr", "CYb", "CD0")
"""Parameters of which two are declared with bounds that do not hold the truth, in the set "wrong bounds"."""

PAIRS = (("actuator_lag:rudder", "airspeed_scale"), ("sideslip_drag", "position_latency"), ("wind_offset", "load_cell_scale"),
         ("load_cell_lag", "heading_bias"))  # fmt: skip


def sized(key: str, share: float) -> dict:
    """An effect at a share of its largest size: strengths scale from null, shapes stay, a stiffness scales inversely."""
    from awescli.physics.effects import EFFECTS

    effect = EFFECTS[key.partition(":")[0]]
    null = {p.name: p.value for p in effect.parameters}
    values = {}
    for name, value in LARGE[key].items():
        if name in effect.shapes:
            values[name] = value
        else:
            values[name] = value / share if effect.abrupt else null[name] + share * (value - null[name])
    return values


def resized(key: str, length: float) -> dict:
    """An effect at its largest size, on a kite `length` times as long: as large beside that kite, and as late beside its loops."""
    from awescli.physics.effects import EFFECTS
    from awescli.simulation.campaign_flights import lengthened

    units = {p.name: p.unit for p in EFFECTS[key.partition(":")[0]].parameters}
    by = {name: length**0.5 if unit == "s" else lengthened(unit, length) for name, unit in units.items()}
    return {name: value * by[name] for name, value in LARGE[key].items()}


def at_once(several: int, seed: int, family: int) -> list[str]:
    """So many effects of LARGE, drawn without a look at whether they can be told apart."""
    keys, rng = list(LARGE), np.random.default_rng([seed, family])
    return [keys[k] for k in sorted(rng.choice(len(keys), several, replace=False))]
