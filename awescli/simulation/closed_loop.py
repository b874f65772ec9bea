"""A control law as the simulator's `law`: set-points of the surfaces it drives, computed from the simulated state once per sample."""

from collections.abc import Callable
from typing import Protocol

from awescli.control.law import Commands
from awescli.notation.parameters import ParameterTable
from awescli.notation.quantities import STATES, SURFACES
from awescli.physics.declaration import KiteDeclaration
from awescli.physics.flight_model import FlightModel
from awescli.simulation.synthetic import with_effects

LIMITER_LAG = 0.02
"""[s] one sample: the lag that a rate limiter needs to be an effect; shorter than anything the kite does."""


class Steers(Protocol):
    """A law, or what stands in its place (`control.held.Held`)."""

    def deflections(self, z: dict) -> dict:
        """surface -> set-point [rad] at the state z."""
        ...


def loop(law: Steers, kite: FlightModel, wind_direction: float, disturbed: bool = False) -> Callable:
    """Function (x, u, c) -> set-points (SURFACES) for `Simulator`; those that the law does not drive stay as recorded.

    wind_direction: [rad, from], constant over the flight, for features that need it; disturbed: the recorded set-points of the surfaces
    that the law drives are disturbances [rad], added to what it commands.
    """
    line = {name: kite.input_names.index(name) for name in ("tether_length", "reel_out_speed") if name in kite.input_names}
    n_s = len(kite.state_names)

    def setpoints(x, u, c):
        z = dict(zip(STATES, x, strict=False)) | {name: u[i] for name, i in line.items()} | {"wind_direction": wind_direction}
        commanded, recorded = law.deflections(z), dict(zip(SURFACES, x[n_s:], strict=False))
        if disturbed:
            commanded = {surface: value + recorded[surface] for surface, value in commanded.items()}
        return [commanded.get(surface, recorded[surface]) for surface in SURFACES]

    return setpoints


def with_setpoint_dynamics(declaration: KiteDeclaration, law: Commands | None) -> KiteDeclaration:
    """The kite as such a law drives it: a law that was found delayed or limited in rate acts through a delay and a limiter on its surfaces.

    A law is a static map; these belong to the way of its set-points. They are the effects actuator_delay and actuator_lag, so they are
    stepped, differentiated and tested as any effect; where the kite declares one already, delays add up and the lower rate counts.
    """
    delay, rates = getattr(law, "delay_s", 0.0), getattr(law, "rate_limits", {})
    new, values = {}, {}
    for surface in getattr(law, "surfaces", ()):
        if delay > 0:
            key = f"actuator_delay:{surface}"
            if key in declaration.effects:
                values[f"{key}.tau"] = declaration.table()[f"{key}.tau"].value + delay
            else:
                new[key] = {"tau": delay}
        if surface in rates:
            key = f"actuator_lag:{surface}"
            if key in declaration.effects:
                values[f"{key}.rate"] = min(declaration.table()[f"{key}.rate"].value, rates[surface])
            else:
                new[key] = {"tau": LIMITER_LAG, "rate": rates[surface]}
    declaration = with_effects(declaration, new)
    return declaration.with_parameters(declaration.table().with_values(values)) if values else declaration


def without_setpoint_dynamics(driven: KiteDeclaration, declared: KiteDeclaration) -> KiteDeclaration:
    """The kite alone, of one that was fitted as a law drives it: `with_setpoint_dynamics(declared, law)` undone, fitted values kept.

    What belongs to the way of the law's set-points is no part of the kite: a log's set-points hold it already, and whoever flies the law
    adds it again.
    """
    return with_what_was_found(driven, driven, declared)


def with_what_was_found(found: KiteDeclaration, driven: KiteDeclaration, declared: KiteDeclaration) -> KiteDeclaration:
    """`without_setpoint_dynamics` of `driven` with fitted values and further effects."""
    of_law = [key for key in driven.effects if key not in declared.effects]
    added = tuple(f"{key}." for key in of_law)
    held = {row.name: row for row in declared.table().rows if not row.free}
    rows = [held.get(row.name, row) for row in found.table().rows if not row.name.startswith(added)]
    effects = tuple(key for key in found.effects if key not in of_law)
    return found.with_parameters(ParameterTable(rows)).model_copy(update={"effects": effects})
