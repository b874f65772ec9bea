"""trace-residual: find what the residual still holds, name the missing effect, add it, prove it on unseen loops."""

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from textwrap import shorten
from typing import TYPE_CHECKING, Any

from pydantic import Field

from awescli.notation.errors import BadInput
from awescli.stages.ahead import Surfaces, surfaces_of, unread_controller
from awescli.stages.answers import ANSWER, WIDTH, change, fitting, named, number, sized
from awescli.stages.base import FAILURE, KITE_FILE, Context, Inputs, Names, Need, Seconds, Stage, StageConfig
from awescli.stages.further_flights import FurtherFlight, flights_of, refused_flights, unknown_own
from awescli.stages.per_phase import by_phase_as

if TYPE_CHECKING:
    from awescli.flightlog.log import FlightLog
    from awescli.flightlog.reconstruction.result import SensorError
    from awescli.flightlog.split import Split
    from awescli.physics.declaration import KiteDeclaration
    from awescli.tracing.frame import TracedFlight
    from awescli.tracing.investigate import Finding


class TraceResidualConfig(StageConfig):
    """Settings of trace-residual."""

    horizon: float = Field(5.0, gt=0.2, le=60, description="seconds between re-initialisations [s]")
    curriculum: tuple[Seconds, ...] = Field((1.0, 2.5), description="shorter horizons that are fitted first [s]")
    rounds: int = Field(3, ge=1, le=6, description="most effects that may be accepted one after the other")
    candidates: Names | None = Field(None, description="effects to try; default the whole library that the flight could show")
    outputs: Names | None = Field(None, description="measured channels that count; default those of identify")
    also: tuple[FurtherFlight, ...] = Field((), description="further flights of the same kite: what one cannot show, several can")
    per_flight: tuple[str, ...] = Field(
        (), description="parameters that each flight has for itself, names or patterns: trims, offsets ([dl, C?0]); all others are shared"
    )
    surfaces: Surfaces | None = Field(
        None, description="replay the recorded set-points, or close the loop with the fitted controller; default as identify did"
    )


class TraceResidual(Stage):
    """Screen and re-fit on train, choose on validation, report on test."""

    name = "trace-residual"
    help = "Find what still repeats in the residual, trace it to the effect that the model lacks, add it, prove it on unseen loops."
    Config = TraceResidualConfig
    makes = ("effects.json", "params.json", KITE_FILE, "metrics.json", "residuals.npz")

    def needs(self, config: TraceResidualConfig) -> tuple[Need, ...]:
        return (Need("fit-controller", required=config.surfaces == "controller"), Need("identify"))

    def unread(self, config: TraceResidualConfig, upstreams: Mapping[str, Path]) -> tuple[str, ...]:
        return unread_controller(config.surfaces, upstreams)

    def flights(self, config: TraceResidualConfig) -> tuple[Path, ...]:
        return tuple(f.flight for f in config.also)

    def check(self, inputs: Inputs, config: TraceResidualConfig) -> Iterator[tuple[str, BadInput]]:
        from awescli.notation.errors import BadInput
        from awescli.physics.kite import Kite
        from awescli.stages.flight_parts import too_long, unknown_channels

        for key in config.candidates or ():
            try:
                Kite(inputs.declared, extra=(key,))
            except BadInput as e:
                yield "candidates", e
        yield from unknown_channels(inputs.log, config.outputs)
        yield from too_long(inputs, config.horizon, ("train", "validation", "test"))
        yield from unknown_own(inputs.declared, config)
        yield from refused_flights(inputs, config.also, config.outputs)

    def run(self, context: Context, config: TraceResidualConfig) -> dict[str, Any]:
        from awescli.artifacts import read_json, write_arrays, write_json, write_text
        from awescli.flightlog.loops import find_loops
        from awescli.notation.quantities import MEASURED
        from awescli.physics.declaration import kite_text, read_kite
        from awescli.simulation.closed_loop import with_what_was_found
        from awescli.stages.flight_parts import predicted, scores_of
        from awescli.stages.handed_on import traced_params, with_sources
        from awescli.tracing.flight import trace_flight
        from awescli.tracing.summary import residual_arrays, summary

        identified = read_kite(context.made_by("identify") / KITE_FILE)
        declared = by_phase_as(read_kite(context.kite), identified)
        task = context.progress.task("tracing the residual")

        def progress(text):
            task.advance()
            task.update(text)

        # the prior is what the user declared; the search starts from what identify found
        handed_on = read_json(context.made_by("identify") / "metrics.json")
        surfaces = surfaces_of(context, config.surfaces)
        began = {"start": {n: p.value for n, p in identified.table().items()}, **begun(handed_on, config.horizon, surfaces)}
        closed = surfaces == "controller"
        flown = [traced(context, closed, *flight) for flight in flights_of(context, config.also, declared)]
        log, parts, driven = flown[0].log, flown[0].split, flown[0].declared
        finding = trace_flight(
            driven, log, parts, horizon=config.horizon, curriculum=config.curriculum, rounds=config.rounds, candidates=config.candidates,
            outputs=config.outputs or tuple(n for n in handed_on["outputs"] if n in MEASURED), also=flown[1:], closes=flown[0].closes,
            per_flight=config.per_flight, progress=progress, **began,
        )  # fmt: skip
        progress("scoring on unseen loops")
        models = {"before": finding.before(), "after": finding.after()}
        before = predicted(models["before"], log, parts, config.horizon)
        after = before if finding.model is finding.first else predicted(models["after"], log, parts, config.horizon)
        predictions = {"before": before, "after": after}
        effects = summary(finding, log, config.horizon, *(p["test"] for p in predictions.values()))
        effects["kinematics"] = kinematics(finding.kinematics)
        for seen in effects["kinematics"]:
            context.progress.note(f"Kinematics alone: {seen['sentence']}.")
        for seen in of_instruments(effects):
            context.progress.note(f"Beside gusts and model error: {seen}.")
        effects["residual"], arrays = residual_arrays(log, parts, find_loops(log), models, predictions, config.horizon)
        scores = {which: scores_of(p, config.horizon) for which, p in predictions.items()}
        better = finding.verdict != "not_testable" or finding.by_prediction
        params = traced_params(finding.model, effects) if better else read_json(context.made_by("identify") / "params.json")
        found = with_what_was_found(finding.declaration(), driven, declared)
        kite = with_sources(found, params, log.name) if better else identified
        write_json(context.folder / "effects.json", effects)
        write_json(context.folder / "params.json", params)
        write_text(context.folder / KITE_FILE, kite_text(kite))
        write_arrays(context.folder / "residuals.npz", arrays)
        said = {"outcome": finding.verdict, "surfaces": surfaces, "initial_states": "free"}
        write_json(context.folder / "metrics.json", said | {"before": scores["before"], **scores["after"]})
        error = effects["error"]
        return {
            "verdict": effects["verdict"], "effect": ", ".join(named(e) for e in effects["effects"]) or "-",
            "test NRMSE before": error.get("before", {}).get("mean"), "after": error["after"]["mean"], "noise floor":
            error["noise_floor"]["mean"], **detectable(effects), **seen_alone(effects),
            ANSWER: answer_lines(effects, context.out / self.name / KITE_FILE), **failure(finding),
        }  # fmt: skip


def traced(context: Context, closed: bool, log: "FlightLog", parts: "Split", declared: "KiteDeclaration", label: str) -> "TracedFlight":
    """A flight as tracing takes it; closed: the fitted controller moves its surfaces."""
    from awescli.stages.flight_parts import closing_upstream
    from awescli.tracing.frame import TracedFlight

    driven, closes = closing_upstream(context, declared, log) if closed else (declared, None)
    return TracedFlight(log, parts, driven, label, closes)


def kinematics(errors: Sequence["SensorError"]) -> list[dict]:
    """What the sensors of a flight contradict each other in, without any model of forces: a witness beside the verdict, not part of it.
    Each as the effect of the library that it is, or by its own name where there is none, with size and standard deviation [SI]."""
    from awescli.flightlog.reconstruction.tables import said

    return [
        {
            "name": e.name, "acts_on": e.target or "", "channels": list(e.acts_on), "size": e.size, "std": e.std, "unit": e.unit,
            "sentence": said(e),
        }
        for e in errors
    ]  # fmt: skip


def seen_alone(effects: dict) -> dict:
    """The line of the summary that says what kinematics alone has seen."""
    return {"kinematics alone": "; ".join(e["sentence"] for e in effects["kinematics"])} if effects.get("kinematics") else {}


def of_instruments(effects: dict) -> list[str]:
    """What a flight without a verdict clearly says of its sensors and actuators, a sentence each."""
    return [e["sentence"] for e in effects.get("instruments", ()) if e["found"]]


def begun(identified: dict, horizon: float, surfaces: str) -> dict:
    """Where identify ended: levels of processes and noise, and the error that the declared model must reach again. identified: its
    metrics.json; levels are missing where it weighed channels by their range or had other surfaces, the error where it predicted another
    horizon, or from other states."""
    from awescli.estimation.processes import PROCESSES
    from awescli.tracing.frame import Levels

    found, processes = {}, identified.get("processes")
    alike = identified["surfaces"] == surfaces
    if processes and alike and identified["method"] == "filter error":
        # models are compared with what is always there as it was declared: what they lack must not hide in it
        estimated = {name: p for name, p in processes.items() if not PROCESSES[p["process"]].certain}
        levels, memories = ({name: p[what] for name, p in estimated.items() if p[what]} for what in ("level", "memory_s"))
        found["levels"] = Levels(levels, memories, identified["noise_factors"])
    if alike and identified["horizon_s"] == horizon and identified.get("initial_states", "free") == "free":
        found["identified_error"] = identified["nrmse"]["validation"]["mean"]
    return found


def failure(finding: "Finding") -> dict:
    """What the runner reports as a numerical failure, where the flight is not testable and nothing predicts better."""
    if finding.verdict != "not_testable" or finding.by_prediction:
        return {}
    do = "See identify's metrics.json; free fewer parameters, or begin with shorter horizons (identify.curriculum)."
    return {FAILURE: {"outcome": "not_testable", "what": f"there is no model to trace: {finding.reason}", "do": do}}


def detectable(effects: dict) -> dict:
    """The least sizes that the flight would have shown, as a table, where nothing was found."""
    if effects["verdict"] != "none" or not effects["detectable"]:
        return {}
    units = effects["detectable_units"]
    return {"would have been seen from": {key: {"size": size, **units[key]} for key, size in effects["detectable"].items()}}


def answer_lines(effects: dict, kite_file: Path) -> list[str]:
    """The answer of the stage, in a few lines: all sizes where they fit, else the first of each effect, else the effects' names."""
    error, verdict = effects["error"], effects["verdict"]
    before, after = error.get("before", {}).get("mean"), error["after"]["mean"]
    left = effects["left"] or {}
    share = f", {100 * left['share']:.0f} % of what was missing" if left.get("share") else ""
    rest = effects["unexplained"]
    empirical = [shorten(f"empirical: {rest['expression']}", 120, placeholder=" ...")] if rest and rest["expression"] else []
    # what else was seen (of bounds; of instruments; by a second witness, which asks no model of forces): in full, or in a line each
    bounds, told_alone = effects["outside_bounds"], [f"kinematics alone: {seen}" for seen in seen_alone(effects).values()]
    told = [f"beside gusts and model error: {'; '.join(said)}"] if (said := of_instruments(effects)) else []
    further = [shorten(of["sentence"], 200, placeholder=" ...")] if (of := effects.get("unnamed")) else []
    alone = [*further, *(o["sentence"] for o in bounds.values()), *told, *(shorten(t, 120, placeholder=" ...") for t in told_alone)]
    briefly = [*([f"outside their bounds: {', '.join(bounds)}"] if bounds else []), *told, *told_alone]
    briefly = [shorten(t, WIDTH - 4, placeholder=" ...") for t in briefly]
    end = [
        change(before, after, error["noise_floor"]["mean"], error["horizon_s"]),
        f"left: chi-square {number(left.get('chi2'))} (1: noise alone){share}",
        f"kite file: {kite_file}; report: awes evaluate --report",
    ]
    if verdict == "not_testable":
        better = effects.get("by_prediction")
        better = [f"predicts unseen flight better: {_said(e, 1)}" for e in better["effects"]] if better else []
        first = [*better, *end[: len(better[:1])]]
        why = f"{verdict}: {effects['reason']}"
        versions = [[why, *first, *seen, *end[-1:]] for seen in (alone, briefly)]
        brief = [shorten(text, 120, placeholder=" ...") for text in (why, *better[:1])]
        return fitting(TraceResidual.name, [*versions, [*brief, *first[-1:], *briefly, *end[-1:]]])
    if not effects["effects"]:
        says = shorten(f"{verdict}: {effects['reason'] or SAYS[verdict]}", 200, placeholder=" ...")
        short = [shorten(e, WIDTH - 4, placeholder=" ...") for e in empirical]
        brief = shorten(says, 120, placeholder=" ...")
        versions = [[says, *empirical, *alone, *end], [says, *empirical, *alone, *end[::2]]]
        return fitting(TraceResidual.name, [*versions, *([brief, *terms, *briefly, *end[::2]] for terms in (short, []))])
    found = [[_said(e, most) for e in effects["effects"]] for most in (9, 1, 0)]
    # sizes before the long form of what else was seen
    sized_so = [(found[0], alone), *((sizes, briefly) for sizes in found)]
    versions = [[f"{verdict}: {first}", *(f"and {e}" for e in others), *empirical, *seen, *end] for (first, *others), seen in sized_so]
    names, few = (shorten(f"{verdict}: {', '.join(named(e) for e in effects['effects'])}", most, placeholder=" ...") for most in (200, 120))
    return fitting(TraceResidual.name, [*versions, [names, *empirical, *briefly, *end[::2]], [few, *briefly, *end[::2]]])


def _said(effect: dict, most: int) -> str:
    """An effect with `most` of its sizes, their 95 % intervals, and its rivals."""
    sizes = list(effect["parameters"].items())[:most]
    others = [named(r) for r in effect["rivals"]]
    rivals = f"; or {others[0]}{f' and {len(others) - 1} more' if len(others) > 1 else ''}" if others else ""
    return f"{named(effect)}{''.join(f', {name} {sized(size)}' for name, size in sizes)}{' (95 %)' if sizes else ''}{rivals}"


SAYS = {
    "none": "nothing is missing that this flight could show at its noise",
    "cannot_tell": "several explanations do equally well on this flight",
    "unexplained": "something is left that no effect of the library explains",
    "not_deterministic": "what is left does not repeat from loop to loop, and no effect helps",
    "found": "an effect explains what the model lacks",
}
"""The verdicts in words."""
