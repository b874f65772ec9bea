"""Gather what the stages left behind, and write report.html and the figures for papers beside evaluate's numbers."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

from awescli.stages.base import Context

if TYPE_CHECKING:
    import numpy as np

    from awescli.flightlog.log import FlightLog
    from awescli.flightlog.split import Split
    from awescli.reporting.evidence import Evidence

OWN = "evaluate"
"""The stage whose page this is."""
UPSTREAM = ("fit-controller", "identify", "trace-residual", "train-hybrid", "simulate")


REPORT, SUMMARY, FIGURES = "report.html", "summary.pdf", "figures"
"""The page, its sheet of paper, and the folder of its figures as files."""


def write_report(context: Context, evidence: "Evidence") -> None:
    """report.html and summary.pdf in the stage's folder."""
    from awescli.artifacts import write_content, write_text
    from awescli.reporting.html import page
    from awescli.reporting.one_page import one_page

    write_text(context.folder / REPORT, page(evidence))
    write_content(context.folder / SUMMARY, one_page(evidence))


def write_figures(context: Context, evidence: "Evidence") -> None:
    """Every figure of the page as PNG, SVG and CSV."""
    from awescli.artifacts import write_content
    from awescli.reporting.paper import figure_files

    task = context.progress.task("drawing figures")
    for name, content in figure_files(evidence):
        write_content(context.folder / FIGURES / name, content)
        task.advance()


def gather(context: Context, log: "FlightLog", parts: "Split", metrics: dict, arrays: dict) -> "Evidence":
    """The evidence: what of the upstream stages is there. metrics, arrays: evaluate's own, which are not yet in place."""
    from awescli.artifacts import PROVENANCE, versions
    from awescli.flightlog.loops import find_loops
    from awescli.flightlog.phases import phases
    from awescli.reporting.evidence import Evidence
    from awescli.stages.in_action import actions

    law, identified, traced, trained, simulated = (context.upstream(stage) for stage in UPSTREAM)
    labels, effects = phases(log), _json(traced, "effects.json")
    records = {stage: _json(context.upstream(stage), PROVENANCE) for stage in UPSTREAM} | {OWN: {"stamp": context.stamp}}
    return Evidence(
        log=log, loops=find_loops(log, labels), phases=labels, quality=context.inputs.quality, parts=parts,
        scores=metrics, predictions=arrays,
        controller=_json(law, "metrics.json"), commanded=_commanded(law, log),
        identify=_json(identified, "metrics.json"), params=_json(identified, "params.json"),
        effects=effects, actions=actions(effects, traced, log, parts), traced_params=_json(traced, "params.json"),
        residuals=_arrays(traced, "residuals.npz"),
        hybrid=_json(trained, "metrics.json"), network=_json(trained, "network.json"), correction=_arrays(trained, "correction.npz"),
        flown=_json(simulated, "metrics.json"), trajectory=_arrays(simulated, "trajectory.npz"),
        provenance={stage: record for stage, record in records.items() if record}, versions=versions(),
    )  # fmt: skip


def _commanded(folder: Path | None, log: "FlightLog") -> dict:
    """What the fitted law commands at the measured states; nothing where there is no law."""
    if folder is None:
        return {}
    from awescli.control.law import deflections_of_log
    from awescli.stages.controller_artifact import read_controller, wind_direction

    law = read_controller(folder)
    commanded = deflections_of_log(law, log, wind_direction(log))
    return {surface: commanded[surface] for surface in law.surfaces}


def _json(folder: Path | None, name: str) -> Any:
    from awescli.artifacts import read_json

    return read_json(folder / name) if folder and (folder / name).is_file() else None


def _arrays(folder: Path | None, name: str) -> "dict[str, np.ndarray] | None":
    from awescli.artifacts import read_arrays

    return read_arrays(folder / name) if folder and (folder / name).is_file() else None
