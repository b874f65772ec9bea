"""RUN or KITE.yaml -> the model that `awes export` hands out: which of its models, from where it starts, who moves its surfaces."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from awescli.artifacts import PROVENANCE, file_hash, read_json, versions
from awescli.notation.errors import BadInput, did_you_mean
from awescli.notation.present import present
from awescli.stages.base import KITE_FILE, Split, Stage
from awescli.stages.nested_models import MADE_BY, network

if TYPE_CHECKING:
    import numpy as np

    from awescli.export.model import ExportedModel, Start
    from awescli.flightlog.log import FlightLog
    from awescli.physics.flight_model import FlightModel

MODELS = ("newest", "initial", *MADE_BY)
SURFACES_BY = ("inputs", "controller")
LONGEST_STEP = 0.01
"""[s] of the integration, as `awes simulate` has it; shorter where the kite's poles ask for it."""
START_IN_THE_AIR = {"p_n": 150.0, "p_d": -100.0, "u": 20.0}
"""[m], [m/s] where no flight tells a start: a place in the air, of no other meaning."""


def model_to_export(
    source: Path, stages: Sequence[Stage], label: str = "newest", surfaces: str = "inputs", flight: Path | None = None
) -> "ExportedModel":
    """The `export.ExportedModel` of a run's folder, or of a kite file. flight: a log that tells wind heights, start and sample interval;
    default: the run's own. Raises BadInput for what is not there."""
    for option, value, known in (("--model", label, MODELS), ("--surfaces", surfaces, SURFACES_BY)):
        if value not in known:
            raise BadInput(f"there is no '{value}'", option, did_you_mean(value, known))
    if source.is_dir():
        return _of_run(source, stages, label, surfaces, flight)
    if not source.is_file():
        raise BadInput("there is no such folder or file", str(source), "Name the folder of a run (`out` in its plan), or a kite file.")
    if label not in ("newest", "initial") or surfaces != "inputs":
        what = f"a kite file holds no {'controller' if surfaces != 'inputs' else f'model {label!r}'}"
        raise BadInput(what, str(source), "Name the folder of a run instead.")
    return _model("initial", source, None, flight, None, {})


def _of_run(run: Path, stages: Sequence[Stage], label: str, surfaces: str, flight: Path | None) -> "ExportedModel":
    """The model of a run's folder."""
    made = {s.name: run / s.name for s in stages if (run / s.name / PROVENANCE).is_file()}
    if not made:
        inner = f" Did you mean {run / 'out'}?" if any((run / "out" / s.name / PROVENANCE).is_file() for s in stages) else ""
        raise BadInput("no results of awes are here", str(run), f"Name the folder of a run (`out` in its plan).{inner}")
    kept = read_json(list(made.values())[-1] / PROVENANCE)
    paths, stamp = kept.get("paths", {}), kept.get("stamp", {})
    files = {"initial": Path(str(paths.get("kite")))} | {m: made[s] / KITE_FILE for m, s in MADE_BY.items() if s in made}
    label = list(files)[-1] if label == "newest" else label
    if label not in files:
        raise BadInput(f"this run has no model '{label}'", str(run), f"Make it: awes {MADE_BY[label]}; it has {', '.join(files)}.")
    if surfaces == "controller" and "fit-controller" not in made:
        raise BadInput("this run has no controller", str(run), "Make it: awes fit-controller; or leave --surfaces controller out.")
    recorded = stamp.get("inputs", {}).get("flight") if flight is None else None
    flight = flight or Path(str(paths.get("flight")))
    if not flight.exists():
        raise BadInput("the flight of this run is not there any more", str(flight), "Say where it is: --flight LOG.")
    rows = _rows(made, label)
    controller = made["fit-controller"] if surfaces == "controller" else None
    return _model(label, files[label], controller, flight, stamp.get("split"), rows, recorded)


def _rows(made: Mapping[str, Path], label: str) -> Mapping[str, Any]:
    """What the fit of a model says of its parameters: rows of params.json."""
    fits = {"identified": ["identify"], "with_effects": ["trace-residual"], "hybrid": ["trace-residual", "identify"]}.get(label, [])
    file = next((made[s] / "params.json" for s in fits if s in made and (made[s] / "params.json").is_file()), None)
    return read_json(file)["parameters"] if file else {}


def _model(
    label: str, file: Path, controller: Path | None, flight: Path | None, split: Any, rows: Mapping[str, Any], recorded: str | None = None
) -> "ExportedModel":
    """The model of one kite file, with the network beside it where it is a hybrid. recorded: hash of the flight, as the run knows it."""
    from awescli.export.model import ExportedModel
    from awescli.flightlog.read import read_flight
    from awescli.learning.correction import HybridKite, kite_from_artifact
    from awescli.physics.declaration import read_kite
    from awescli.physics.kite import STATION, Kite
    from awescli.simulation.closed_loop import loop, with_setpoint_dynamics
    from awescli.stages.controller_artifact import read_controller, wind_direction

    log = read_flight(flight) if flight else None
    law = read_controller(controller) if controller else None
    declaration = read_kite(file)
    driven = with_setpoint_dynamics(declaration, law) if law else declaration
    heights = log.wind.height if log is not None and log.wind is not None else STATION
    kite = kite_from_artifact(*network(file.parent), driven, heights) if label == "hybrid" else Kite(driven, heights)
    values = kite.parameters
    fitted = {n: row for n, row in rows.items() if n in values and abs(values[n].value - row["value"]) <= 1e-9 * abs(row["value"])}
    start, dt, longest, ranges = _flown(kite, log, split)
    made_from = {"awes": versions()["awes"], "model": label, "kite file": f"{file.name}, sha256 {file_hash(file)}"}
    if law and controller:
        made_from["controller"] = f"{law.kind}, sha256 {file_hash(controller / 'controller.json')}"
    if label == "hybrid":
        learned = isinstance(kite, HybridKite)
        made_from["network"] = f"sha256 {file_hash(file.parent / 'network.safetensors')}" if learned else "none: training kept none"
    if log is not None:
        made_from["flight"] = log.name + (f", sha256 {recorded}" if recorded else "")
    bound = loop(law, kite, wind_direction(present(log, "the flight"))) if law else None
    return ExportedModel(label, kite, start, dt, longest, bound, law, fitted, ranges, made_from)


def _flown(kite: "FlightModel", log: "FlightLog | None", split: Any) -> "tuple[Start, float, float, dict[str, tuple[float, float]]]":
    """(start, sample interval [s], longest step [s], flown ranges) of a flight, or what stands for them where there is none."""
    import numpy as np

    from awescli.export.model import Start
    from awescli.notation.quantities import STATES, SURFACES
    from awescli.simulation.rollout import inputs_of, setpoints_of
    from awescli.simulation.segments import smooth_states
    from awescli.simulation.stepping import PROBES, longest_step

    if log is None:
        states = dict.fromkeys(STATES, 0.0) | START_IN_THE_AIR
        length = float(np.linalg.norm([states[n] for n in ("p_n", "p_e", "p_d")]))
        inputs = {n: {"density": 1.225, "tether_length": length}.get(n, 0.0) for n in kite.input_names}
        start = Start(states, dict.fromkeys(SURFACES, 0.0), inputs, "a place in the air, of no other meaning: no flight was named")
        return start, 1 / kite.declaration.set_point_rate, LONGEST_STEP, {}
    z, u, sp = smooth_states(log), inputs_of(log, kite), setpoints_of(log)
    first = _first(log, split)
    named = lambda names, row: dict(zip(names, map(float, row), strict=True))  # noqa: E731
    origin = f"{log.time[first]:.2f} s into the flight '{log.name}'"
    start = Start(named(STATES, z[first]), named(SURFACES, sp[first]), named(kite.input_names, u[first]), origin)
    good = np.flatnonzero(log.valid)
    probes = good[:: max(1, len(good) // PROBES)]
    longest = min(LONGEST_STEP, longest_step(kite, z[probes], sp[probes], u[probes]))
    return start, log.dt, longest, _ranges(kite, z[good], sp[good], u[good])


def _first(log: "FlightLog", split: Any) -> int:
    """The sample of the start: where the run's test part begins, as `awes simulate` sets out; without a split the first good one."""
    import numpy as np

    if split is None:
        return int(np.flatnonzero(log.valid)[0])
    from awescli.flightlog.cycles import pieces
    from awescli.flightlog.split import split as dealt

    asked = Split(**split)
    return int(dealt(pieces(log, asked.of), **asked.model_dump(exclude={"of"})).test[0][0])


def _ranges(kite: "FlightModel", z: "np.ndarray", sp: "np.ndarray", u: "np.ndarray") -> dict[str, tuple[float, float]]:
    """alpha, beta [rad], V_a [m/s] between which the middle 99 % of a flight lies, of the model's own air data."""
    import numpy as np

    c = [float(v) for v in kite.parameters.vector()]
    own = [np.zeros(len(z))] * (len(kite.state_names) - 12)
    with np.errstate(all="ignore"):
        at = kite.instant([*z.T, *own, *sp.T], list(u.T), c)
    found = {}
    for name in ("alpha", "beta", "V_a"):
        low, high = np.nanpercentile(np.broadcast_to(np.asarray(getattr(at, name), float), (len(z),)), (0.5, 99.5))
        found[name] = (float(low), float(high))
    return found
