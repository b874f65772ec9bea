"""A small run whose artifacts can be replaced by anything and are believed: the hashes in their provenance are forged to fit.

Without the forging every edit is noticed by its hash; with it, only the readers themselves stand between an artifact and a fault.
"""

import json
import shutil
from dataclasses import replace
from pathlib import Path

from small_run import make_small_run

from awescli.artifacts import PROVENANCE, file_hash, write_json
from awescli.stages import STAGES
from awescli.stages.base import Context, Silent
from awescli.stages.plan import read_plan
from awescli.stages.runner import run_plan

READ = (
    "fit-controller/controller.json", "fit-controller/metrics.json", "identify/params.json", "identify/metrics.json",
    "trace-residual/effects.json", "train-hybrid/network.json", "train-hybrid/metrics.json", "simulate/metrics.json",
    "evaluate/metrics.json", "identify/provenance.json",
)  # fmt: skip
"""JSON artifacts that other stages, the report, `verify` or `compare` read."""


class Believed:
    """A run in `folder`, made where it is not there yet, and what evaluate has at hand when it reads the others' artifacts, and its own for
    the figures."""

    def __init__(self, folder: Path):
        from awescli.stages.base import Inputs

        self.plan = read_plan(make_small_run(folder), STAGES)
        run_plan(self.plan, STAGES)
        self.out, self.twin = self.plan.out, folder / "twin"
        shutil.copytree(self.out, self.twin)
        self.inputs = Inputs(self.plan.flight, self.plan.kite, self.plan.split)

    def original(self, artifact: str) -> bytes:
        """What the stage wrote."""
        return (self.twin / artifact).read_bytes()

    def put(self, artifact: str, content: bytes, forge: bool = True) -> None:
        """Another content in the place of an artifact; forge: and its hash in the provenance."""
        file = self.out / artifact
        file.write_bytes(content)
        provenance = file.parent / PROVENANCE
        if forge and file != provenance:
            kept = json.loads((self.twin / file.parent.name / PROVENANCE).read_bytes())
            kept["artifacts"][file.name] = file_hash(file)
            write_json(provenance, kept)

    def restore(self, artifact: str) -> None:
        """The stage's own files again."""
        stage = Path(artifact).parts[0]
        for file in (self.twin / stage).iterdir():
            if file.is_file():
                shutil.copy2(file, self.out / stage / file.name)

    def decide(self) -> list:
        """`awes run --dry-run`: does anything have to run again, and why."""
        return run_plan(self.plan, STAGES, dry_run=True)

    def read(self) -> str:
        """All that reads artifacts, one after the other; the page of the report."""
        from awescli.artifacts import read_arrays, read_json
        from awescli.learning.correction import Correction
        from awescli.reporting.html import page
        from awescli.stages.comparison import compare
        from awescli.stages.controller_artifact import read_controller
        from awescli.stages.nested_models import network
        from awescli.stages.page import gather
        from awescli.stages.verify import verify

        verify(self.out, STAGES)
        compare(self.out, self.twin, STAGES)
        self.decide()
        upstreams = {name: self.out / name for name in ("fit-controller", "identify", "trace-residual", "train-hybrid", "simulate")}
        context = Context(
            flight=self.plan.flight, kite=self.plan.kite, out=self.out, folder=self.out / "evaluate", scratch=self.out, seed=0,
            split=self.plan.split, upstreams=upstreams, progress=Silent(), inputs=self.inputs,
        )  # fmt: skip
        read_controller(upstreams["fit-controller"])
        description, weights = network(upstreams["train-hybrid"])
        Correction.from_arrays(weights, description)
        scores, predictions = read_json(context.folder / "metrics.json"), read_arrays(context.folder / "predictions.npz")
        return page(replace(gather(context, self.inputs.log, self.inputs.parts, scores, predictions), versions={}))
