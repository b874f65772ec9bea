"""identify: estimate the free parameters of the kite from the flight (Rositani eq. 11)."""

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from pydantic import Field

from awescli.notation.errors import BadInput
from awescli.notation.former_names import formerly
from awescli.stages.ahead import AheadConfig, Surfaces
from awescli.stages.answers import ANSWER, change, number, plural, sized
from awescli.stages.base import KITE_FILE, Context, Inputs, Names, Need, Progress, Seconds, Stage
from awescli.stages.further_flights import FurtherFlight, flights_of, refused_flights, unknown_own
from awescli.stages.per_phase import by_phase, phases_fitted, phases_of, refused_phases

if TYPE_CHECKING:
    from awescli.estimation.fitted import Fit
    from awescli.estimation.problem import EstimationProblem
    from awescli.estimation.staged_fit import Flight
    from awescli.flightlog.log import FlightLog
    from awescli.physics.declaration import KiteDeclaration
    from awescli.simulation.rollout import Simulator


class IdentifyConfig(AheadConfig):
    """Settings of identify."""

    horizon: float = Field(5.0, gt=0.2, le=60, description="seconds between re-initialisations [s]")
    curriculum: tuple[Seconds, ...] = Field((1.0, 2.5), description="shorter horizons that are fitted first, one after the other [s]")
    surfaces: Surfaces = Field(
        "recorded", description="replay the recorded set-points, or close the loop with the fitted controller (Rositani eq. 11d)"
    )
    weights: Annotated[Literal["noise", "range"], formerly(seed="range")] = Field(
        "noise", description="what an error of a channel is counted in: its noise, or its range (Rositani eq. 11a)"
    )
    outputs: Names | None = Field(
        None, description="channels that count, in closed loop also surfaces; default all of the log, by range those of Rositani eq. 11a"
    )
    prior: bool = Field(True, description="weigh deviations from the declared values by their prior standard deviations")
    also: tuple[FurtherFlight, ...] = Field((), description="further flights of the same kite, fitted together with the plan's")
    per_flight: tuple[str, ...] = Field(
        (), description="parameters that each flight has for itself, names or patterns: trims, offsets ([dl, C?0]); all others are shared"
    )
    per_phase: tuple[str, ...] = Field(
        (),
        description="parameters with a value of their own in each phase of the cycles that are fitted, names or patterns ([CD0]); "
        "needs split.of: cycles",
    )
    air: Literal["calm", "gusts"] = Field(
        "calm",
        description="what is random from the beginning: model error alone, and gusts where they show beside it; or gusts, also those that "
        "turn the kite, the line's length and model error at once, for derivatives from measured flight under an autopilot that answers "
        "gusts",
    )
    starts: int = Field(1, ge=1, le=100, description="fits from so many starts: the declared values, then draws of the prior")


class Identify(Stage):
    """Fit on train; validation and test are only predicted."""

    name = "identify"
    help = "Estimate the free parameters of the kite from the flight, or from several flights."
    Config = IdentifyConfig
    makes = ("params.json", KITE_FILE, "metrics.json")

    def needs(self, config: IdentifyConfig) -> tuple[Need, ...]:
        return (Need("fit-controller"),) if config.surfaces == "controller" else ()

    def flights(self, config: IdentifyConfig) -> tuple[Path, ...]:
        return tuple(f.flight for f in config.also)

    def check(self, inputs: Inputs, config: IdentifyConfig) -> Iterator[tuple[str, BadInput]]:
        from awescli.stages.flight_parts import too_long, unknown_channels

        closed = config.surfaces == "controller"
        yield from unknown_channels(inputs.log, config.outputs, closed=closed)
        if config.too_long == "refuse":
            yield from too_long(inputs, config.horizon, ("train", "validation", "test"))
        if config.air == "gusts" and config.weights == "range":
            do = "Set identify.weights to noise: errors that are weighed by ranges have no likelihood in which gusts could be found."
            yield "air", BadInput("gusts need errors that are weighed by their noise", do=do)
        yield from unknown_own(inputs.declared, config)
        yield from refused_phases(inputs.declared, config.per_phase, inputs.log, inputs.parts)
        yield from refused_flights(inputs, config.also, config.outputs, closed)

    def run(self, context: Context, config: IdentifyConfig) -> dict[str, Any]:
        from awescli.artifacts import write_json, write_text
        from awescli.estimation.identifiability import describe
        from awescli.estimation.several_starts import fit_without_outliers, spread_of
        from awescli.estimation.staged_fit import fit_output_error, unaided
        from awescli.physics.declaration import kite_text, read_kite
        from awescli.simulation.closed_loop import without_setpoint_dynamics
        from awescli.stages.flight_parts import flight_parts
        from awescli.stages.handed_on import with_sources

        declared = by_phase(read_kite(context.kite), config.per_phase, phases_fitted(*flight_parts(context)))
        asked, config = config.horizon, within(context, config)
        flights = flown(context, config, declared)
        task = context.progress.task("Gauss-Newton")
        words = ""

        def on_start(i):
            nonlocal words
            words = f"start {i + 1} of {config.starts}, " if config.starts > 1 else ""

        def on_iteration(horizon: float, i: int, cost: float) -> None:
            task.advance()
            task.update(f"{words}{horizon:g} s, iteration {i}: cost {cost:.6g}")

        (fitted, problems, optima), flights, left_out = fit_without_outliers(
            flights, [h for h in config.curriculum if h < config.horizon], config.starts, context.seed, on_start=on_start,
            per_flight=config.per_flight, prior=config.prior, in_gusts=config.air == "gusts", on_iteration=on_iteration,
        )  # fmt: skip
        if left_out:
            said = ", ".join(f"{many} of {channel}" for channel, many in left_out.items())
            context.progress.note(f"left out, for no model could follow them: {said}")
        method = "filter error" if problems[0].processes else "output error"
        good = fitted.ended and better_than_declared(problems[0], fitted.flights[0], config.horizon, config.known_starts)
        if problems[0].processes and not good and config.air == "calm":
            method = "output error"
            context.progress.note(
                "model error leaves the parameters little to say on this flight; they are fitted without it (output error)"
            )
            words = "output error, "
            fitted, problems = fit_output_error(
                flights, [h for h in config.curriculum if h < config.horizon], per_flight=config.per_flight, prior=config.prior,
                on_iteration=on_iteration,
            )  # fmt: skip
        flight_of, record = owners(flights, config.per_flight)
        answer = describe(fitted, record, flight_of, phases_of(fitted.names))
        scored = [scores(*each, config.horizon, config.known_starts) for each in zip(problems, fitted.flights, strict=True)]
        chi2 = unaided(problems[0], fitted.flights[0])
        metrics = {
            "outcome": fitted.solution.outcome, "method": method, "chi2": chi2, "chi2_with_processes": fitted.chi2,
            "outputs": list(problems[0].outputs), "kkt_residual": fitted.solution.kkt,
            "cost_history": list(fitted.solution.history), "surfaces": config.surfaces,
            "initial_states": config.initial_states, "weights": config.weights, "horizon_asked_s": asked, "outliers": left_out,
            **scored[0],
        }  # fmt: skip
        if len(flights) > 1:
            metrics["flights"] = {f.label or f.problem.log.name: s for f, s in zip(flights, scored, strict=True)}
        if config.starts > 1:
            metrics["starts"] = spread_of(optima, fitted)
        identified = held(problems[0], fitted.flights[0])
        write_json(context.folder / "params.json", answer)
        kite = with_sources(without_setpoint_dynamics(identified.kite.declare(()), declared), answer, names_of(flights))
        write_text(context.folder / KITE_FILE, kite_text(kite))
        write_json(context.folder / "metrics.json", metrics)
        tell(context.progress, answer, metrics)
        return {
            "outcome": fitted.solution.outcome, "chi2": chi2,
            "test NRMSE before": metrics["initial"]["nrmse"]["test"]["mean"], "after": metrics["nrmse"]["test"]["mean"],
            "noise floor": metrics["noise_floor"]["mean"], "parameters": {name: shown(row) for name, row in answer["parameters"].items()},
            ANSWER: answer_lines(answer, metrics, context.out / self.name / KITE_FILE),
        }  # fmt: skip


def names_of(flights: "Sequence[Flight]") -> str:
    """The flights of a fit, for people."""
    return " and ".join(dict.fromkeys(f.label or f.problem.log.name for f in flights))


def shown(row: dict) -> dict:
    """One parameter in the terminal's table."""
    said = (
        ("at its bound", row["at_bound"]), ("hardly seen, near its prior", row["determined"] == "hardly"),
        ("poorly determined", row["determined"] == "poorly"), (f"with {', '.join(row['partners'])}", row["partners"]),
        (row.get("flight", ""), "flight" in row), (row.get("phase", ""), "phase" in row),
    )  # fmt: skip
    return {
        "value": row["value"], "std": row["std"], "unit": row["unit"], "prior": row["prior"],
        "": "; ".join(words for words, holds in said if holds),
    }  # fmt: skip


def answer_lines(answer: dict, metrics: dict, kite_file: Path) -> list[str]:
    """The answer of the stage, in a few lines."""
    rows = answer["parameters"]
    seen, bounded = (sum(row[flag] for row in rows.values()) for flag in ("excited", "at_bound"))
    lines = [
        f"{metrics['outcome']}: {plural(len(rows), 'parameter')}, {seen} seen, {bounded} at a bound, chi-square {number(metrics['chi2'])}",
        change(
            metrics["initial"]["nrmse"]["test"]["mean"],
            metrics["nrmse"]["test"]["mean"],
            metrics["noise_floor"]["mean"],
            metrics["horizon_s"],
        ),
    ]
    if moved := sorted((n for n in rows if rows[n]["excited"]), key=lambda n: -abs(rows[n]["shift_in_prior_std"]))[:2]:
        lines += [f"moved far: {n} {number(rows[n]['prior'])} -> {sized(rows[n])} (95 %)" for n in moved]
    return [*lines, f"kite file: {kite_file}; next: awes trace-residual"]


def within(context: Context, config: IdentifyConfig) -> IdentifyConfig:
    """The settings with the horizon that all flights of the fit can be predicted ahead."""
    from awescli.stages.ahead import horizon_within
    from awescli.stages.flight_parts import flight_parts

    flights = [flight_parts(context, folder) for folder in (context.flight, *(f.flight for f in config.also))]
    return config.model_copy(update={"horizon": horizon_within(context, config, config.horizon, flights)})


def flown(context: Context, config: IdentifyConfig, declared: "KiteDeclaration") -> list:
    """The flights of the fit: the plan's, then those of `also`, each with its own simulator (wind record, control law)."""
    from awescli.estimation.problem import build, simulator_of
    from awescli.estimation.staged_fit import Flight
    from awescli.stages.controller_artifact import read_controller
    from awescli.stages.flight_parts import driven_upstream

    flights = []
    for log, parts, kite, label in flights_of(context, config.also, declared):
        law, driven = None, ()
        if config.surfaces == "controller":
            kite, law = driven_upstream(context, kite, log)
            told_apart(declared, kite)
            moved = getattr(read_controller(context.made_by("fit-controller")), "surfaces", ())
            driven = tuple(s for s in moved if s in log.inputs)
        simulator = simulator_of(kite, log, law=law)
        how = {"by_range": config.weights == "range", "known_starts": config.known_starts}
        problem = build(simulator, log, parts, config.horizon, outputs_of(log, config, driven), **how)
        flights.append(Flight(problem, label))
    return flights


def told_apart(declared: "KiteDeclaration", driven: "KiteDeclaration") -> None:
    """Raise BadInput where a free parameter of the kite and the controller's own delay or rate limit stand in one."""
    from awescli.notation.errors import BadInput

    after = driven.table()
    for row in declared.table().rows:
        if row.free and after[row.name].value != row.value:
            what = f"'{row.name}' is free, and the fitted controller's set-points are delayed or limited themselves"
            do = f"In closed loop only both together show: declare {row.name} with free: false, or set identify.surfaces to recorded."
            raise BadInput(what, "identify.surfaces", do)


def better_than_declared(problem: "EstimationProblem", fit: "Fit", horizon: float, known_starts: bool) -> bool:
    """Does a fit predict the validation loops better than what was declared?"""
    from awescli.estimation.prediction import predict

    after, before = (
        predict(s, problem.log, problem.split.validation, horizon, known_starts=known_starts).nrmse()["mean"]
        for s in (held(problem, fit), problem.simulator)
    )
    return after < before


def owners(flights: "Sequence[Flight]", per_flight: Sequence[str]) -> tuple[dict[str, str], set[str]]:
    """(unknown -> the flight that it belongs to, where there are several flights; unknowns that are errors of a wind record)."""
    from awescli.estimation.levels_in_turn import own_names

    flight_of, record = {}, set()
    for flight in flights:
        for name in own_names(flight.problem, per_flight):
            unknown = f"{name}@{flight.label}" if flight.label else name
            flight_of[unknown] = flight.label or flight.problem.log.name
            if name in flight.problem.kite.record:
                record.add(unknown)
    return (flight_of if len(flights) > 1 else {}), record


def held(problem: "EstimationProblem", fit: "Fit") -> "Simulator":
    """A flight's simulator with its fitted values, the wind record's error taken out."""
    from awescli.estimation.problem import without_record

    return problem.simulator.holding(without_record(problem.kite, fit.parameters))


def scores(problem: "EstimationProblem", fit: "Fit", horizon: float, known_starts: bool = False) -> dict:
    """Errors of one flight before and after, and what it says of processes and noise."""
    from awescli.estimation.problem import levels_found
    from awescli.stages.flight_parts import score_parts

    before, after = (score_parts(s, problem.log, problem.split, horizon, known_starts) for s in (problem.simulator, held(problem, fit)))
    return {"processes": levels_found(problem), "noise_factors": dict(problem.factors), "initial": before, **after}


def tell(progress: Progress, answer: dict, metrics: dict) -> None:
    """What the person should know of the answer."""
    if bounded := [name for name, row in answer["parameters"].items() if row["at_bound"]]:
        progress.note(f"at their bounds: {', '.join(bounded)}")
    if active := [row["constraint"] for row in answer["constraints"] if row["active"]]:
        progress.note(f"constraints that hold the fit back: {'; '.join(active)}")
    for factor in answer["common_factors"]:
        progress.note(f"{factor['says']}; the prior sets the factor")
    if starts := metrics.get("starts"):
        from awescli.estimation.several_starts import SAME_OPTIMUM

        ends = zip(starts["outcomes"], starts["cost_above_best"], strict=True)
        others = sum(outcome == "converged" and cost >= SAME_OPTIMUM for outcome, cost in ends)
        progress.note(f"{starts['same_optimum']} of {starts['starts']} starts led to the best optimum, {others} to others that are worse")


def outputs_of(log: "FlightLog", config: IdentifyConfig, driven: tuple[str, ...] = ()) -> tuple[str, ...]:
    """The channels that count: those asked for, else all measured ones; weighed by their range those of Rositani eq. (11a): position,
    attitude, tension, and the surfaces `driven` by the law in the loop, without velocities and rates."""
    from awescli.notation.quantities import MEASURED

    if config.outputs is not None:
        return config.outputs
    if config.weights == "range":
        return (*(n for n in ("p_n", "p_e", "p_d", "phi", "theta", "psi", "tension") if n in log.measured), *driven)
    return tuple(n for n in MEASURED if n in log)
