"""A control law as the simulator's `law`: set-points of the surfaces it drives, computed from the simulated state once per sample."""

from collections.abc import Callable

from awescli.control.law import Law
from awescli.notation.quantities import STATES, SURFACES
from awescli.physics.kite import Kite


def loop(law: Law, kite: Kite, wind_direction: float) -> Callable:
    """Function (x, u, c) -> four set-points for `Simulator`; surfaces that the law does not drive keep the recorded set-point.

    wind_direction: [rad, from], constant over the flight, for features that need it.
    """
    line = {name: kite.input_names.index(name) for name in ("tether_length", "reel_out_speed")}
    n_s = len(kite.state_names)

    def setpoints(x, u, c):
        z = dict(zip(STATES, x, strict=False)) | {name: u[i] for name, i in line.items()} | {"wind_direction": wind_direction}
        commanded = law.deflections(z)
        return [commanded.get(surface, x[n_s + i]) for i, surface in enumerate(SURFACES)]

    return setpoints
