"""fit-controller: identify the flight controller from the log."""

from collections.abc import Iterator
from typing import Any, Literal

from pydantic import Field

from awescli.notation.errors import BadInput
from awescli.stages.answers import ANSWER, number, plural
from awescli.stages.base import Context, Inputs, Names, Stage, StageConfig


class FitControllerConfig(StageConfig):
    """Settings of fit-controller."""

    kind: Literal["gaussian", "network", "linear"] = Field("gaussian", description="class of approximator")
    method: Literal["best", "greedy", "convex"] = Field(
        "best", description="terms of a gaussian law: greedy, by linear programmes alone (sparse, bounded), or the better of greedy ones"
    )
    features: str | Names = Field(
        "auto", description="what the law sees: a named set (state, state_ned, invariant, curvature, heading), names of features, or auto"
    )
    surfaces: tuple[Literal["aileron", "elevator", "rudder", "flaps", "throttle"], ...] | None = Field(
        None, description="surfaces the law drives; default all that move in the log"
    )
    folds: int = Field(4, ge=2, le=20, description="folds of whole loops for cross-validation")
    few_loops: Literal["fewer", "blocks", "refuse"] = Field(
        "fewer", description="fewer loops than folds in the training part: fewer folds, or folds of blocks of time, and said; or an error"
    )
    most_nonzeros: int = Field(79, ge=1, le=2000, description="most Gaussians the law may keep")
    closed_loop_time: float = Field(60.0, gt=0, le=600, description="seconds that the law must fly the declared model in closed loop")
    winch: bool = Field(False, description="fit the law of the winch too: how fast it pays out for the load, phase by phase")
    compare: bool = Field(False, description="fit all kinds, and the convex law, and report them in one table")


class FitController(Stage):
    """Fit the law on train, choose on validation, report on test."""

    name = "fit-controller"
    help = "Identify the flight controller from the log: a law from measured states to surface set-points."
    Config = FitControllerConfig
    makes = ("controller.json", "controller.safetensors", "metrics.json")
    reads = ("flight", "kite")

    def check(self, inputs: Inputs, config: FitControllerConfig) -> Iterator[tuple[str, BadInput]]:
        from awescli.control.features import check_features
        from awescli.controller_fit.config import too_few_loops
        from awescli.controller_fit.features import FEATURE_SETS
        from awescli.controller_fit.samples import gather, loops_flown
        from awescli.notation.errors import BadInput, did_you_mean

        named = isinstance(config.features, str)
        if named and config.features not in (known := [*FEATURE_SETS, "auto"]):
            yield "features", BadInput(f"unknown feature set '{config.features}'", do=did_you_mean(str(config.features), known))
        for name in () if named else config.features:
            try:
                check_features([name])
            except BadInput as e:
                yield "features", e
        parts, _ = inputs.parts, inputs.declared
        if config.winch and (lacks := [n for n in ("tension", "reel_out_speed") if n not in inputs.log]):
            what = f"the flight '{inputs.log.name}' has no {' and no '.join(lacks)}: its winch says nothing"
            yield "winch", BadInput(what, do="Drop this key.")
        try:
            samples = gather(inputs.log, parts.train, parts.validation, config.surfaces)
        except BadInput as e:
            yield "surfaces", e
            return
        if few := too_few_loops(loops_flown(samples), config.folds, config.few_loops):
            yield "folds", few

    def run(self, context: Context, config: FitControllerConfig) -> dict[str, Any]:
        from awescli.artifacts import write_json
        from awescli.controller_fit.config import ControllerConfig
        from awescli.controller_fit.fit import fit_controller
        from awescli.controller_fit.winch import fit_winch
        from awescli.physics.declaration import read_kite
        from awescli.simulation.survival import flies, gain_margin, loop_gain
        from awescli.stages.controller_artifact import wind_direction, write_controller
        from awescli.stages.flight_parts import flight_parts

        log, parts = flight_parts(context)
        kite = read_kite(context.kite)
        direction, known = wind_direction(log), (*parts.train, *parts.validation)
        task = context.progress.task(f"fitting a {config.kind} law", total=3)

        def fly(law) -> float:
            """Choices are made by flights from states of the train and validation parts only."""
            task.update(f"flying a {law.kind} law of {len(law.features)} features")
            return flies(kite, law, log, direction, config.closed_loop_time, known)["share"]

        settings: dict[str, Any] = config.model_dump(exclude={"closed_loop_time", "winch"}) | {"seed": context.seed}
        fitted = fit_controller(log, parts.train, parts.validation, ControllerConfig(**settings), fly)
        task.advance()
        task.update("flying it in closed loop")
        proof = flies(kite, fitted.law, log, direction, config.closed_loop_time)
        task.advance()
        gains = loop_gain(kite, fitted.law, log, direction)
        gain = {s: g | {"plant_gain": gains[s]} for s, g in fitted.report.get("gain", {}).items()}
        task.advance()
        rows = {}
        if config.compare:
            for name, law in fitted.laws.items():
                task.update(f"{name}: how much gain may be missing")
                fitted.report["comparison"][name]["gain_margin"] = gain_margin(kite, law, log, direction)
            rows = {name: row_of(line) for name, line in fitted.report["comparison"].items()}
        winch = {phase: law.described() for phase, law in fit_winch(log, parts).items()} if config.winch else {}
        metrics = fitted.report | {"outcome": "converged", "closed_loop": proof, "gain": gain} | ({"winch": winch} if config.winch else {})
        if config.winch and not winch:
            context.progress.note("no phase of a cycle lasts in train and validation loops: the law of the winch is not fitted")
        write_controller(context.folder, fitted.law)
        write_json(context.folder / "metrics.json", metrics)
        if config.few_loops == "blocks" and fitted.report["folds_of"] == "blocks":
            context.progress.note("fewer loops than folds: the law was chosen on blocks of time")
        elif (folds := fitted.report["folds"]) < config.folds:
            context.progress.note(f"fewer loops than folds: the law was chosen on {folds} folds of one loop")
        for kind, line in fitted.report["comparison"].items():
            if not line["nonzeros"]:
                context.progress.note(f"the {kind} law is zero everywhere")
        test = fitted.report["nrmse"].get("test", {})
        summary = {f"test NRMSE {surface}": value for surface, value in test.items()}
        summary |= {"laws": rows} if rows else {}
        answer = [*answer_lines(fitted.report, proof), *winch_lines(winch)]
        return summary | {"non-zeros": fitted.report["nonzeros"], "closed loop": proof["outcome"], ANSWER: answer}


def row_of(line: dict) -> dict:
    """One law in the terminal's table. gain: factors on its gain with which it still flies."""
    margin = line["gain_margin"]
    return {
        "terms": line["nonzeros"], "condition": line["condition"], **{f"NRMSE {s}": e for s, e in line["nrmse"].get("test", {}).items()},
        "flown": line["survival"], "gain": "-" if margin["lower"] is None else f"{margin['lower']:g} to {margin['upper']:g}",
    }  # fmt: skip


def answer_lines(report: dict, proof: dict) -> list[str]:
    """The answer of the stage, in a few lines."""
    test, noise = (report[key].get("test", {}) for key in ("nrmse", "noise_nrmse"))
    errors = ", ".join(f"{s} {number(e)} (noise alone {number(noise.get(s))})" for s, e in test.items())
    return [
        f"{report['kind']} law for {', '.join(report['surfaces'])}, {plural(report['nonzeros'], 'term')}, "
        f"{plural(len(report['features']['chosen']), 'feature')}",
        f"error on unseen loops, share of the range: {errors or '-'}",
        f"in closed loop on its own it {proof['outcome'].replace('_', ' ')} ({100 * proof['share']:.0f} % of {proof['asked_s']:g} s flown)",
    ]


def winch_lines(winch: dict) -> list[str]:
    """The winch's law, phase by phase, in a line; empty without one."""
    said = []
    for phase, law in winch.items():
        v, kv, k, low, high = (law["parameters"].get(n, {}).get("value") for n in ("v", "kv", "k", "f_low", "f_high"))
        parts = [number(v) if v is not None else "", f"{number(kv)} sqrt(T)" if kv is not None else ""]
        parts += [f"{number(k)} per N {side} {number(f)}" for side, f in (("above", high), ("below", low)) if f is not None]
        error = law["nrmse"].get("test", law["nrmse"]["validation"])
        said.append(f"{phase} {' + '.join(p for p in parts if p)} m/s (error {number(error)})")
    return [f"winch: {'; '.join(said)}"] if said else []
