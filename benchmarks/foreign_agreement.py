"""Does a clean foreign flight follow our equations? From its true states our simulator predicts 5 s open loop, with the same set-points,
wind and line; what is left is the two integrators' and what differs between the two worlds.
"""

from dataclasses import replace

import numpy as np
from foreign_kinds import World
from foreign_names import Scene
from foreign_sensors import Sensors
from foreign_world import Foreign, ForeignFlight, fly

from awescli.flightlog.log import FlightLog
from awescli.notation.quantities import ANGLES, INPUTS, MEASURED, OUTPUTS, STATES
from awescli.physics.declaration import KiteDeclaration, read_kite
from awescli.physics.kite import Kite
from awescli.simulation.rollout import Simulator
from awescli.simulation.segments import observe, wrap

MOST = {"position": 0.002, "attitude": np.deg2rad(0.003)}
"""[m], [rad] to be kept over 5 s before anything else is believed."""
GROUPS = {
    "position": ("p_n", "p_e", "p_d"), "velocity": ("v_n", "v_e", "v_d"), "attitude": ("phi", "theta", "psi"), "rates": ("p", "q", "r"),
    "acceleration": ("a_x", "a_y", "a_z"), "V_a": ("V_a",), "alpha": ("alpha",), "beta": ("beta",), "tension": ("tension",),
}  # fmt: skip


def agreement(flight: ForeignFlight, kite: KiteDeclaration, scene: Scene, horizon: float = 5.0) -> dict[str, float]:
    """Group of outputs -> largest difference [SI, rad] over segments of `horizon` seconds that follow each other through the flight."""
    log = true_log(flight, scene)
    ours = Kite(kite, scene.wind.height)
    steps = round(horizon * flight.rate)
    first = np.arange(0, len(log) - steps, steps)
    starts = np.stack([flight.truth[name][first] for name in STATES], axis=1)
    observed = observe(log, ours, first, steps, MEASURED).starting_at(starts)
    predicted = Simulator(ours, wrt=()).rollout(observed.segments)
    worst = {}
    for group, names in GROUPS.items():
        worst[group] = 0.0
        for name in names:
            error = predicted.outputs[:, :, OUTPUTS.index(name)] - observed.measured[:, :, observed.outputs.index(name)]
            worst[group] = max(worst[group], float(np.abs(wrap(error) if name in ANGLES else error).max()))
    return worst


def true_log(flight: ForeignFlight, scene: Scene) -> FlightLog:
    """The flight as it truly was, with the wind that truly blew, as a log."""
    commanded = {**flight.truth, **flight.setpoints}
    measured, inputs = ({name: commanded[name].copy() for name in names if name in commanded} for names in (MEASURED, INPUTS))
    return FlightLog("truth", 0.0, 1 / flight.rate, flight.time, measured, inputs, np.ones(len(flight.time), bool), scene.wind)


def clean_agreement(family: int = 0) -> dict[str, float]:
    """`agreement` of a minute of the clean flight of a family, without noise."""
    from foreign_flights import KITE, Case, drawn, start_of
    from foreign_kinds import read_kinds

    case, kite = Case("clean_calm", "full", family), read_kite(KITE)
    draw = drawn(case, read_kinds()["clean_calm"])
    scene = replace(draw.scene, duration=60.0)
    foreign = Foreign(kite, World(), {}, scene, Sensors(quiet=True))
    return agreement(fly(foreign, draw.steering, start_of(kite, draw), rate=50, seed=case.seed), kite, scene)
