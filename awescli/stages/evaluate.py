"""evaluate: what every step was worth, on loops that no stage was fitted to; with a page that shows it, and figures for papers."""

from collections.abc import Iterator
from typing import Any, Literal

from pydantic import Field

from awescli.notation.errors import BadInput
from awescli.stages.ahead import HandedOnConfig
from awescli.stages.answers import ANSWER, fitting, number
from awescli.stages.base import Context, Inputs, Need, Seconds, Stage

SHOWN = ("mean", "p_n", "p_e", "p_d", "u", "v", "w", "phi", "theta", "psi", "p", "q", "r", "V_a", "alpha", "beta", "tension")
"""Channels in the terminal's table; `mean` is that of the 12 states."""

DIGIT = 0.001
"""Share of the measured power that is a digit of the line on power."""


class EvaluateConfig(HandedOnConfig):
    """Settings of evaluate."""

    initial_states: Literal["free", "measured", "filtered"] = Field(
        "free",
        description="where a prediction begins: a state fitted to the second before, the measured one (Rositani 11c), or the state, gusts, "
        "line and model error that a filter over that second sees; these then fade with their memories",
    )
    horizon: float = Field(5.0, gt=0.2, le=60, description="seconds predicted ahead [s]")
    horizons: tuple[Seconds, ...] = Field((0.5, 1.0, 2.0, 5.0, 10.0), description="further horizons scored on the test loops [s]")
    wind_profile: bool = Field(True, description="tell the wind against height that the last fitted kite needs, beside the station")
    report: bool = Field(True, description="write report.html, one self-contained page, and summary.pdf, one sheet of it")
    thesis: bool = Field(False, description="print the numbers that Rositani (2025) published beside these (another flight)")
    figures: bool = Field(False, description="write every figure of the page as PNG and SVG, and the data behind it as CSV")


class Evaluate(Stage):
    """Score every model of a run alike."""

    name = "evaluate"
    help = "Score every model of the run on unseen loops; --report writes the page, --figures DIR its figures as files."
    Config = EvaluateConfig
    makes = ("metrics.json", "predictions.npz")

    def needs(self, config: EvaluateConfig) -> tuple[Need, ...]:
        return (
            Need("fit-controller", required=config.surfaces == "controller"), Need("identify", required=False),
            Need("trace-residual", required=False), Need("train-hybrid", required=False), Need("simulate", required=False),
        )  # fmt: skip

    def check(self, inputs: Inputs, config: EvaluateConfig) -> Iterator[tuple[str, BadInput]]:
        from awescli.stages.flight_parts import too_long

        if config.too_long == "refuse":
            yield from too_long(inputs, config.horizon, ("train", "validation", "test"))

    def figures(self, context: Context, config: EvaluateConfig) -> Iterator[tuple[str, bytes]]:
        from awescli.artifacts import read_arrays, read_json
        from awescli.reporting.paper import figure_files
        from awescli.stages.flight_parts import flight_parts
        from awescli.stages.page import gather

        metrics, arrays = read_json(context.folder / "metrics.json"), read_arrays(context.folder / "predictions.npz")
        return figure_files(gather(context, *flight_parts(context), metrics, arrays))

    def run(self, context: Context, config: EvaluateConfig) -> dict[str, Any]:
        from awescli.artifacts import write_arrays, write_json
        from awescli.reporting.linear import briefly
        from awescli.reporting.published import beside_thesis
        from awescli.stages.ahead import horizon_within
        from awescli.stages.baseline import score_baseline
        from awescli.stages.flight_parts import flight_parts
        from awescli.stages.nested_models import nested_models, score_models
        from awescli.stages.page import FIGURES, REPORT, gather, write_figures, write_report
        from awescli.stages.wind_profile import wind_line, wind_seen

        log, parts = flight_parts(context)
        config = config.model_copy(update={"horizon": horizon_within(context, config, config.horizon, [(log, parts)])})
        closed = config.closes_the_loop(context)
        models = nested_models(context, log, closed)
        task = context.progress.task("scoring", total=len(models) + 1)
        metrics, arrays = score_models(models, context, log, parts, config, task)
        score_baseline(metrics, arrays, context, log, parts, config, closed, task)
        if config.wind_profile and (seen := wind_seen(context, models, log)):
            metrics["wind_profile"] = seen
        metrics |= {"surfaces": "controller" if closed else "recorded", "initial_states": config.initial_states}
        left = {stage: left_by(context, stage) for stage in ("fit-controller", "identify", "trace-residual", "train-hybrid")}
        metrics["outcomes"] = {stage: found["outcome"] for stage, found in left.items() if found and found.get("outcome")}
        if config.thesis:
            metrics["beside_thesis"] = beside_thesis(metrics, left["fit-controller"], left["train-hybrid"])
        write_json(context.folder / "metrics.json", metrics)
        write_arrays(context.folder / "predictions.npz", arrays)
        if config.report or config.figures:
            evidence = gather(context, log, parts, metrics, arrays)
        if config.report:
            write_report(context, evidence)
        if config.figures:
            write_figures(context, evidence)
        scored = [*models, *(["linear"] if "linear" in metrics else [])]
        errors = {model: {n: e for n, e in metrics[model]["nrmse"]["test"].items() if n in SHOWN} for model in scored}
        errors["noise alone"] = {n: metrics["noise_floor"][n] for n in SHOWN if n in metrics["noise_floor"]}
        means = [f"{model} {number(metrics[model]['nrmse']['test']['mean'])}" for model in scored]
        ahead = f"{config.horizon:g} s ahead{', loop closed' if closed else ''}"
        answer = [f"error on unseen loops, {ahead}: {', '.join(means)} (noise alone {number(metrics['noise_floor']['mean'])})"]
        answer.append(briefly(metrics, models))
        beside = {
            row["channel"]: {k.replace("_", ", "): "-" if v is None else v for k, v in row.items() if k != "channel"}
            for row in metrics.get("beside_thesis", [])
        }
        published = {"beside the thesis (another flight)": beside} if beside else {}
        summary = {"errors": errors, **published, "noise floor": metrics["noise_floor"]["mean"]}
        if (ended := metrics["outcomes"].get("identify", "converged")) != "converged":
            answer.append(f"identify has not converged ({ended}): its parameters are no estimates")
        powers = {
            model: block["power"] | {"diverged": block["diverged_predictions"]} for model in models if "power" in (block := metrics[model])
        }
        if power := power_line(powers):
            summary["power"] = power
        if held := {model: b["inside"]["all"] for model in models if "inside" in (b := metrics[model]["bands"])}:
            summary["inside 90 % bands"] = ", ".join(f"{model} {100 * share:.0f} %" for model, share in held.items())
        if "wind_profile" in metrics:
            summary["wind"] = wind_line(metrics["wind_profile"]["rows"])
        for wanted, key, place in ((config.report, "report", REPORT), (config.figures, "figures", FIGURES)):
            if wanted:
                summary[key] = str(context.out / self.name / place)
        pages = [f"{key}: {summary[key]}" for key in ("report", "figures") if key in summary]
        last = dict([*powers.items()][-1:])
        summary[ANSWER] = fitting(self.name, [[*answer, *power_sentence(said), *pages] for said in (powers, last)])
        return summary


def left_by(context: Context, stage: str) -> dict | None:
    """metrics.json of an upstream stage, where it has run."""
    from awescli.artifacts import read_json

    folder = context.upstream(stage)
    file = folder / "metrics.json" if folder else None
    return read_json(file) if file and file.is_file() else None


def power_line(powers: dict[str, dict]) -> str:
    """Measured mean power of the test loops, and every model's error of it, the last one's with the interval of what is known of the model
    (90 %), where that is not known over loops; empty where there is none. The interval is about what the model says in the wind as its fit
    found it and with what the other loops take off, which is said where it is not what it says by itself."""
    if not powers:
        return ""
    errors = [
        (model, _diverged(p) or (p["error_share"] is not None and f"{100 * p['error_share']:+z.1f} %")) for model, p in powers.items()
    ]
    said = [f"{model} {error}" for model, error in errors if error]
    *_, last = powers.values()
    if _diverged(last):
        return f"{last['measured_mean_W'] / 1000:.3g} kW measured; {', '.join(said)}"
    known = [w / last["measured_mean_W"] - 1 for w in last["interval_W"]] if last.get("interval_W") else None
    interval = known or last["interval_share"]
    between = " ({:+z.1f} to {:+z.1f})".format(*sorted(100 * share for share in interval)) if interval else ""
    if known and said and abs((middle := sum(known) / 2) - last["error_share"]) > DIGIT:
        between = f", {100 * middle:+z.1f} % as other loops correct it{between}"
    return "; ".join([f"{last['measured_mean_W'] / 1000:.3g} kW measured", *([f"{', '.join(said)}{between}"] if said else [])])


def power_sentence(powers: dict[str, dict]) -> list[str]:
    """Power, and energy where the flight has cycles, as a sentence of the answer; none where there is no power."""
    lines = [line for line in (power_line(powers), cycle_line(powers)) if line]
    return [f"mean power on test loops: {'; energy of cycles: '.join(lines)}"] if lines else []


def cycle_line(powers: dict[str, dict]) -> str:
    """Measured energy of all cycles together and the error of every model; empty for a flight without cycles."""
    of = {model: [row["measured_J"] for row in p["by_cycle"]] for model, p in powers.items() if p.get("by_cycle")}
    if not of:
        return ""
    measured = sum(next(iter(of.values())))
    predicted = {model: sum(row["predicted_J"] for row in powers[model]["by_cycle"]) for model in of}
    errors = {
        model: _diverged(powers[model]) or (f"{100 * (E / measured - 1):+z.1f} %" if measured else "") for model, E in predicted.items()
    }
    said = ", ".join(f"{model} {error}" for model, error in errors.items() if error)
    return "; ".join([f"{measured / 1000:.3g} kJ measured in {len(next(iter(of.values())))}", *([said] if said else [])])


def _diverged(power: dict) -> str:
    """Said in place of an error of power where predictions diverged, which has no meaning then."""
    return "diverged" if sum(power.get("diverged", {}).values()) else ""
