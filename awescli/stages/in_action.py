"""What each traced effect does while the model flies: one quantity, with the effect at null and as fitted, at the same simulated states."""

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import numpy as np

    from awescli.flightlog.log import FlightLog
    from awescli.flightlog.split import Split
    from awescli.physics.effects.base import Effect
    from awescli.physics.flight_model import FlightModel
    from awescli.reporting.evidence import Action
    from awescli.simulation.rollout import Simulator

WORDS = {
    "n": ("wind towards north", "m/s"), "e": ("wind towards east", "m/s"), "d": ("wind down", "m/s"), "density": ("air density", "kg/m3"),
    "roll": ("roll gust", "rad/s"), "pitch": ("pitch gust", "rad/s"), "yaw": ("yaw gust", "rad/s"),
    "CD": ("drag coefficient", "-"), "CY": ("side force coefficient", "-"), "CL": ("lift coefficient", "-"),
    "Cl": ("roll moment coefficient", "-"), "Cm": ("pitch moment coefficient", "-"), "Cn": ("yaw moment coefficient", "-"),
    "force_x": ("force forward", "N"), "force_y": ("force right", "N"), "force_z": ("force down", "N"), "moment_x": ("roll moment", "N m"),
    "moment_y": ("pitch moment", "N m"), "moment_z": ("yaw moment", "N m"), "acceleration_x": ("acceleration forward", "m/s2"),
    "acceleration_y": ("acceleration right", "m/s2"), "acceleration_z": ("acceleration down", "m/s2"),
    "rotation_x": ("roll acceleration", "rad/s2"), "rotation_y": ("pitch acceleration", "rad/s2"),
    "rotation_z": ("yaw acceleration", "rad/s2"),
}  # fmt: skip
"""Quantity that an effect changes -> (in words, unit); of a line or a body, which are constants, what they do to the kite."""
LINES = {"actuate": ("set-point", "deflection, inferred"), "report": ("true", "as the sensor reports it")}
"""Place -> what the lines without the effect and with it are called."""
FIRST, FELT = "tension", 1e-3
"""What is shown of an effect on the line where it changes it by this share: everybody knows what a load cell shows."""
NOTHING = 1e-9
"""Share of a quantity below which an effect does not change it."""


def actions(effects: Mapping[str, Any] | None, folder: Path | None, log: "FlightLog", parts: "Split") -> tuple:
    """(`reporting.evidence.Action`, ...) of the effects that the trace in `folder` found, on predictions of the test loops; none where it
    found none, or where no prediction fits in."""
    from awescli.notation.errors import BadInput
    from awescli.stages.base import KITE_FILE
    from awescli.stages.nested_models import model_of

    if not effects or not effects["effects"] or folder is None or effects["verdict"] not in ("found", "cannot_tell"):
        return ()
    simulator = model_of("with_effects", folder / KITE_FILE, log)
    named = {(e["name"], e.get("acts_on", "")) for e in effects["effects"]}
    found = [e for e in simulator.kite.effects if (e.name, e.acts_on) in named and not e.always]
    if not found:
        return ()
    try:
        flown = _flown(simulator, log, parts, effects["error"]["horizon_s"])
    except BadInput:
        return ()
    return tuple(action for effect in found if (action := _action(simulator.kite, effect, *flown, log)) is not None)


def _flown(simulator: "Simulator", log: "FlightLog", parts: "Split", horizon: float) -> "tuple[np.ndarray, np.ndarray, np.ndarray]":
    """(first (K,) samples, states (K, N, n_x), inputs (K, N, n_u)) of predictions of the test loops, starts by their warm-up."""
    from awescli.estimation.prediction import warmed_up
    from awescli.flightlog.split import WARM_UP, prediction_starts
    from awescli.notation.errors import BadInput
    from awescli.notation.quantities import MEASURED
    from awescli.simulation.segments import observe

    before, ahead = int(round(WARM_UP / log.dt)), int(round(horizon / log.dt))
    begin = prediction_starts(log, parts.test, horizon)
    if not begin.size:
        raise BadInput("no prediction fits into the test loops")
    observed = observe(log, simulator.kite, begin, before + ahead, MEASURED)
    segments = warmed_up(simulator, observed, before)
    flown = simulator.rollout(segments)
    whole = flown.alive > before + ahead
    return (begin + before)[whole], flown.states[whole, before:], segments.inputs[whole, before:]


def _action(
    kite: "FlightModel", effect: "Effect", first: "np.ndarray", states: "np.ndarray", inputs: "np.ndarray", log: "FlightLog"
) -> "Action | None":
    """What an effect changes most, in relation to its size; None where it changes nothing."""
    import numpy as np

    from awescli.reporting.evidence import Action

    if not len(first):
        return None
    null = kite.with_values({p.name: p.value for p in effect.rows()})
    (without, units), (fitted, _) = (_quantities(k, effect.place, states, inputs) for k in (null, kite))
    share = {n: _rms(fitted[n] - without[n]) / (_rms(fitted[n]) + 1e-12) for n in fitted}
    most = FIRST if share.get(FIRST, 0.0) > FELT else max(share, key=lambda n: share[n])
    if share[most] < NOTHING:
        return None
    words, unit = units[most]
    received, made = LINES.get(effect.place, ("without the effect", "with it"))
    time = log.time[0] + (first[:, None] + np.arange(states.shape[1])[None]) * log.dt
    return Action(effect.key, words, unit, received, made, time, without[most], fitted[most])


def _rms(values: "np.ndarray") -> float:
    import numpy as np

    return float(np.sqrt(np.mean(values * values)))


def _quantities(
    kite: "FlightModel", place: str, states: "np.ndarray", inputs: "np.ndarray"
) -> "tuple[dict[str, np.ndarray], dict[str, tuple[str, str]]]":
    """(quantity -> (K, N) values, quantity -> (in words, unit)) of what effects at a place change, all of them at work."""
    import numpy as np

    from awescli.notation.quantities import OUTPUTS, UNITS
    from awescli.reporting.words import channel

    shape = states.shape[:2]
    x, u = list(np.moveaxis(states, -1, 0)), list(np.moveaxis(inputs, -1, 0))
    c = list(kite.parameters.vector())
    if place == "report":
        found = dict(zip(OUTPUTS, kite.outputs(x, u, c), strict=True))
    else:
        at = kite.instant(x, u, c)
        found = {
            "actuate": lambda: at.deflections, "airflow": lambda: at.wind._asdict(), "coefficients": lambda: at.coefficients._asdict(),
            "line": lambda: {"tension": at.tension, "moment": at.applied.moment},
            "body": lambda: {"acceleration": at.acceleration, "rotation": at.derivative[9:12]},
            "load": lambda: {"force": at.applied.force, "moment": at.applied.moment},
        }[place]()  # fmt: skip
    flat = {}
    for name, value in found.items():
        vector = isinstance(value, tuple)
        flat |= {f"{name}_{axis}": v for axis, v in zip("xyz", value, strict=True)} if vector else {name: value}
    flat.pop("CL_alpha_part", None)
    values = {name: np.broadcast_to(np.asarray(value, dtype=float), shape) for name, value in flat.items()}
    return values, {name: WORDS[name] if name in WORDS else (channel(name), UNITS[name]) for name in values}
