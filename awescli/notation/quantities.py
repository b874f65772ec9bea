"""The quantities of a flight: names, units, and which of them are the 12 states.

Frames: inertial NED with its origin at the winch; body FRD (x forward, y right, z down). SI and radians throughout.
"""

from typing import Literal, get_args

STATES: tuple[str, ...] = ("p_n", "p_e", "p_d", "u", "v", "w", "phi", "theta", "psi", "p", "q", "r")
"""z of docs/equations.md (1) to (4): position NED [m], velocity over ground in body axes [m/s], Euler angles [rad], rates [rad/s]."""

ControlSurface = Literal["aileron", "elevator", "rudder", "flaps"]
CONTROL_SURFACES: tuple[ControlSurface, ...] = get_args(ControlSurface)
"""Control surfaces [rad], signs as the kite's aerodynamic table wants them (the kite file states the log's sign)."""

SURFACES: tuple[str, ...] = (*CONTROL_SURFACES, "throttle")
"""All set-points that a kite flies with: the control surfaces, and the throttle [-], 0 to 1. What moves nothing stays at zero."""

UNITS = {
    "p_n": "m", "p_e": "m", "p_d": "m",
    "u": "m/s", "v": "m/s", "w": "m/s",
    "v_n": "m/s", "v_e": "m/s", "v_d": "m/s",
    "phi": "rad", "theta": "rad", "psi": "rad",
    "p": "rad/s", "q": "rad/s", "r": "rad/s",
    "a_x": "m/s2", "a_y": "m/s2", "a_z": "m/s2",
    "V_a": "m/s", "alpha": "rad", "beta": "rad", "tension": "N",
    "aileron": "rad", "elevator": "rad", "rudder": "rad", "flaps": "rad",
    "throttle": "-", "tether_length": "m", "reel_out_speed": "m/s", "motor_speed": "1/s",
}  # fmt: skip

IN_WORDS = {
    "p_n": "position north of the winch", "p_e": "position east of the winch", "p_d": "position below the winch (down)",
    "u": "velocity forward", "v": "velocity to the right", "w": "velocity down in body axes",
    "v_n": "velocity over ground, north", "v_e": "velocity over ground, east", "v_d": "velocity over ground, down",
    "phi": "roll angle, right wing down positive", "theta": "pitch angle, nose up positive",
    "psi": "heading of the nose, clockwise from north",
    "p": "roll rate", "q": "pitch rate", "r": "yaw rate",
    "a_x": "acceleration forward", "a_y": "acceleration to the right", "a_z": "acceleration down in body axes",
    "V_a": "airspeed", "alpha": "angle of attack", "beta": "angle of sideslip", "tension": "pull of the line",
    "aileron": "aileron command", "elevator": "elevator command", "rudder": "rudder command", "flaps": "flap command",
    "throttle": "throttle command, 0 to 1", "motor_speed": "revolutions of the propeller per second",
    "tether_length": "length of line paid out", "reel_out_speed": "speed of reeling out, out positive",
}  # fmt: skip
"""What a quantity is, and which way it counts."""

MEASURED: tuple[str, ...] = (
    "p_n", "p_e", "p_d", "v_n", "v_e", "v_d", "phi", "theta", "psi", "p", "q", "r",
    "a_x", "a_y", "a_z", "V_a", "alpha", "beta", "tension",
)  # fmt: skip
"""What sensors report: a model may be compared with these and must never touch them. (a_x, a_y, a_z) is the kinematic
acceleration R^T d2p/dt2 in body axes, gravity neither added nor removed."""

INPUTS: tuple[str, ...] = (*SURFACES, "tether_length", "reel_out_speed", "motor_speed")
"""What was commanded or set from outside: a model may be driven by these. motor_speed: logged revolutions of a propeller per second."""

OF_LINE: tuple[str, ...] = ("tension", "tether_length", "reel_out_speed")
"""What only a kite on a line has; a log without any of them is of a free flight."""

OUTPUTS: tuple[str, ...] = (*MEASURED, *SURFACES)
"""What a simulation gives back: what the sensors would report, and the set-points that were flown."""

ANGLES: tuple[str, ...] = ("phi", "theta", "psi", "alpha", "beta")
"""Quantities whose differences are wrapped to (-pi, pi] before they enter a cost or a score."""
