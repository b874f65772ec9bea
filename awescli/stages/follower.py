"""The built-in law that follows the circle of a log."""

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from awescli.control.path_following import PathFollowing
    from awescli.flightlog.log import FlightLog
    from awescli.physics.declaration import KiteDeclaration


def follower_of(log: "FlightLog", declaration: "KiteDeclaration") -> "PathFollowing":
    """The path-following law on the circle that the log flies, other surfaces at their medians there."""
    import numpy as np

    from awescli.control.law import state_mapping
    from awescli.control.path_following import PathFollowing
    from awescli.controller_fit.pattern import fit_pattern
    from awescli.notation.quantities import SURFACES

    rudder = declaration.surfaces.get("rudder")
    trims = {name: float(np.median(log[name])) for name in SURFACES if name in log.inputs and name != "rudder"}
    limit = min(-rudder.lower, rudder.upper) if rudder else 0.5
    span = declaration.parameters["b"].value
    return PathFollowing(fit_pattern(state_mapping(log), log.valid), semi_span=span / 2, limit=limit, trims=trims)
