"""Three small stages shaped like the real ones, and a folder with a plan for them."""

import time
from pathlib import Path
from typing import Literal

from pydantic import Field
from typer.testing import CliRunner

from awescli import artifacts
from awescli.cli import build_app
from awescli.notation.errors import NumericalFailure
from awescli.stages.base import FAILURE, KITE_FILE, Need, Stage, StageConfig


class FitConfig(StageConfig):
    horizon: float = Field(5.0, gt=0, description="seconds between re-initialisations")
    law: Literal["thesis", "exact"] = Field("thesis", description="tether law")
    end: Literal["good", "diverge", "fault", "interrupt", "no answer", "wait"] = Field("good", description="how the stage ends")
    weights: Path | None = Field(None, description="a file")


class TraceConfig(StageConfig):
    count: int = Field(3, ge=1, description="effects to try")


class JudgeConfig(StageConfig):
    report: bool = Field(False, description="also write report.html")
    figures: bool = Field(False, description="also write figures")


class Fit(Stage):
    name, help, Config, makes = "identify", "Estimate parameters.", FitConfig, ("params.json", KITE_FILE)

    def run(self, context, config):
        task = context.progress.task("fitting", total=3)
        checkpoint = context.scratch / "steps"
        steps = int(checkpoint.read_text()) if checkpoint.is_file() else 0
        context.progress.note(f"from step {steps}")
        for step in range(steps, 3):
            artifacts.write_text(checkpoint, str(step + 1))
            task.advance()
            if step == 1 and config.end == "diverge":
                raise NumericalFailure("diverged", "the cost is infinite", "identify", "Start closer.")
            if step == 1 and config.end == "fault":
                raise ZeroDivisionError("division by zero")
            if step == 1 and config.end == "interrupt":
                raise KeyboardInterrupt
        while config.end == "wait" and not (context.flight.parent / f"{context.flight.name}.go").is_file():
            time.sleep(0.02)
            task.advance(0)
        artifacts.write_json(context.folder / "params.json", {"horizon": config.horizon, "seed": context.seed})
        artifacts.write_text(context.folder / KITE_FILE, f"from: identify {config.horizon}\n")
        if config.end == "no answer":
            return {"outcome": "stalled", FAILURE: {"outcome": "stalled", "what": "the fit stalled", "do": "Start closer."}}
        return {"test error": 0.0361, "outcome": "converged"}


class Trace(Stage):
    name, help, Config, makes = "trace-residual", "Search missing effects.", TraceConfig, ("effects.json", KITE_FILE)

    def needs(self, config):
        return (Need("identify"),)

    def run(self, context, config):
        artifacts.write_json(context.folder / "effects.json", {"kite": context.model_kite().read_text()})
        artifacts.write_text(context.folder / KITE_FILE, f"from: trace-residual {config.count}\n")
        return {}


class Judge(Stage):
    name, help, Config, makes = "evaluate", "Errors of every model.", JudgeConfig, ("metrics.json",)

    def needs(self, config):
        return (Need("identify", required=False), Need("trace-residual", required=False))

    def figures(self, context, config):
        kite = artifacts.read_json(context.folder / "metrics.json", any_form=True)["kite"]
        yield "one.png", f"PNG of {kite}".encode()

    def run(self, context, config):
        artifacts.write_json(context.folder / "metrics.json", {"kite": context.model_kite().read_text()})
        if config.report:
            artifacts.write_text(context.folder / "report.html", "<p>")
        if config.figures:
            artifacts.write_content(context.folder / "figures" / "one.png", b"PNG")
        return {"errors": {"initial": {"mean": 0.1}, "identified": {"mean": 0.0361}}, "report": config.report}


DUMMIES: tuple[Stage, ...] = (Fit(), Trace(), Judge())

PLAN = """flight: flight
kite: kite.yaml
stages:
  identify: {horizon: 5.0}
  trace-residual:
  evaluate: {}
"""


def make_folder(folder: Path) -> Path:
    """A folder with a flight, a kite and a stages.yaml; returns the latter."""
    (folder / "flight").mkdir(parents=True)
    (folder / "flight" / "kite.csv").write_text("1,2\n")
    (folder / "kite.yaml").write_text("from: declared\n")
    (folder / "stages.yaml").write_text(PLAN)
    return folder / "stages.yaml"


APP = build_app(DUMMIES)


def awes(*arguments):
    result = CliRunner().invoke(APP, list(arguments))
    assert result.exception is None or isinstance(result.exception, SystemExit), result.exception
    return result
