"""evaluate: what every step was worth, on loops that no stage was fitted to; with a page that shows it, and figures for papers."""

from pydantic import Field

from awescli.stages.base import Need, Seconds, Stage, StageConfig


class EvaluateConfig(StageConfig):
    """Settings of evaluate."""

    horizon: float = Field(5.0, gt=0.2, le=60, description="seconds predicted ahead [s]")
    horizons: tuple[Seconds, ...] = Field((0.5, 1.0, 2.0, 5.0, 10.0), description="further horizons scored on the test loops [s]")
    report: bool = Field(True, description="write report.html, one self-contained page")
    figures: bool = Field(False, description="write every figure of the page as PNG and SVG, and the data behind it as CSV")


class Evaluate(Stage):
    """Score every model of the ladder alike."""

    name = "evaluate"
    help = "Score every model of the ladder on unseen loops; --report writes the page, --figures DIR its figures as files."
    Config = EvaluateConfig
    makes = ("metrics.json", "predictions.npz")

    def needs(self, config):
        return (
            Need("fit-controller", required=False), Need("identify", required=False),
            Need("trace-residual", required=False), Need("train-hybrid", required=False), Need("simulate", required=False),
        )  # fmt: skip

    def run(self, context, config):
        from awescli.artifacts import write_arrays, write_json
        from awescli.stages.flight_parts import flight_parts
        from awescli.stages.ladder import ladder, score_ladder
        from awescli.stages.page import FIGURES, REPORT, gather, write_figures, write_report

        log, parts = flight_parts(context)
        models = ladder(context, log)
        task = context.progress.task("scoring", total=len(models))
        metrics, arrays = score_ladder(models, context, log, parts, config, task)
        write_json(context.folder / "metrics.json", metrics)
        write_arrays(context.folder / "predictions.npz", arrays)
        if config.report or config.figures:
            evidence = gather(context, log, parts, metrics, arrays)
        if config.report:
            write_report(context, evidence)
        if config.figures:
            write_figures(context, evidence)
        errors = {
            model: {
                name: metrics[model]["nrmse"]["test"][name] for name in ("mean", "p_n", "p_e", "p_d", "u", "v", "w", "phi", "theta", "psi")
            }
            for model in models
        }
        summary = {"errors": errors, "noise floor": metrics["noise_floor"]["mean"]}
        if config.report:
            summary["report"] = str(context.out / self.name / REPORT)
        if config.figures:
            summary["figures"] = str(context.out / self.name / FIGURES)
        return summary
