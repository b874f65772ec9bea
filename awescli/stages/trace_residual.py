"""trace-residual: find what the residual still holds, name the missing effect, add it, prove it on unseen loops."""

from pydantic import Field

from awescli.stages.base import KITE_FILE, Names, Need, Seconds, Stage, StageConfig


class TraceResidualConfig(StageConfig):
    """Settings of trace-residual."""

    horizon: float = Field(5.0, gt=0.2, le=60, description="seconds between re-initialisations [s]")
    curriculum: tuple[Seconds, ...] = Field((1.0, 2.5), description="shorter horizons that are fitted first [s]")
    rounds: int = Field(3, ge=1, le=6, description="most effects that may be accepted one after the other")
    candidates: Names | None = Field(None, description="effects to try; default the whole library that the flight could show")
    outputs: Names | None = Field(None, description="measured channels that count; default all of the log")


class TraceResidual(Stage):
    """Screen and re-fit on train, choose on validation, report on test."""

    name = "trace-residual"
    help = "Find what still repeats in the residual, trace it to the effect that the model lacks, add it, prove it on unseen loops."
    Config = TraceResidualConfig
    makes = ("effects.json", KITE_FILE, "metrics.json", "residuals.npz")

    def needs(self, config):
        return (Need("identify"),)

    def run(self, context, config):
        from awescli.artifacts import write_arrays, write_json, write_text
        from awescli.flightlog.loops import find_loops
        from awescli.physics.declaration import kite_text, read_kite
        from awescli.stages.flight_parts import flight_parts, known_channels, score_parts
        from awescli.tracing.account import account, residual_arrays
        from awescli.tracing.flight import trace_flight

        log, parts = flight_parts(context)
        known_channels(log, config.outputs or (), "trace-residual.outputs")
        declared = read_kite(context.kite)
        identified = read_kite(context.upstream("identify") / KITE_FILE)
        task = context.progress.task("tracing the residual")

        def progress(text):
            task.advance()
            task.update(text)

        # the prior is what the user declared; the search starts from what identify found
        started = {n: p.value for n, p in identified.table().items()}
        settings = config.model_dump(exclude={"report"})
        finding, before = trace_flight(declared, log, parts, start=started, progress=progress, **settings)
        progress("scoring on unseen loops")
        after = finding.after()
        scores = {"before": score_parts(before, log, parts, config.horizon), "after": score_parts(after, log, parts, config.horizon)}
        effects = account(finding, log, parts, config.horizon, before, after)
        effects["residual"], arrays = residual_arrays(log, parts, find_loops(log), before, after, config.horizon)
        write_json(context.folder / "effects.json", effects)
        write_text(context.folder / KITE_FILE, kite_text(finding.declaration()))
        write_arrays(context.folder / "residuals.npz", arrays)
        write_json(context.folder / "metrics.json", {"outcome": finding.verdict, "before": scores["before"], **scores["after"]})
        names = ", ".join(e["name"] + (f" on {e['acts_on']}" if e["acts_on"] else "") for e in effects["effects"]) or "-"
        error = effects["error"]
        return {
            "verdict": effects["verdict"], "effect": names,
            "test NRMSE before": error["before"]["mean"], "after": error["after"]["mean"], "noise floor": error["noise_floor"]["mean"],
        }  # fmt: skip
