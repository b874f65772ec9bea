"""Run a plan: decide for every stage whether its artifacts still stand, say why, and run those that do not.

A stage's `provenance.json` holds the stamp it was made under (inputs, settings, upstream artifacts, seed, split, code, versions)
and the hashes of what it wrote. A stage is unchanged if today's stamp is the same and its files are intact.
"""

import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime
from functools import cache
from pathlib import Path
from typing import Any

import awescli
from awescli.artifacts import (
    PROVENANCE,
    artifact_hashes,
    file_hash,
    has_checkpoints,
    locked,
    machine,
    refuse_foreign,
    remove,
    scratch_folder,
    scratch_path,
    staged_folder,
    table_hash,
    versions,
    write_json,
)
from awescli.notation.errors import BadInput, NumericalFailure, did_you_mean
from awescli.stages.base import FAILURE, Context, Inputs, Need, Progress, Silent, Stage, StageConfig
from awescli.stages.blas import blas, one_blas_thread
from awescli.stages.changes import changes, flat
from awescli.stages.checking import raise_all, refused, with_warning
from awescli.stages.forced import Forced, forced_run
from awescli.stages.inputs import input_hash, refuse_own_inputs
from awescli.stages.made import made_hash, read_provenance
from awescli.stages.plan import Plan

Stamp = dict[str, Any]
"""What a result was made from, as it stands in provenance.json."""


@dataclass(frozen=True)
class Result:
    """What became of one stage. status: "ran", "unchanged", "would run" (dry run), "skipped" (before --from) or "interrupted" (reason:
    where the same command goes on)."""

    stage: str
    status: str
    reason: str
    seconds: float = 0.0
    summary: Mapping[str, Any] = field(default_factory=dict)


def run_plan(
    plan: Plan, stages: Sequence[Stage], only: Iterable[str] | None = None, begin: str | None = None, force: bool = False,
    dry_run: bool = False, progress: Progress | None = None, report: Callable[[str, Result | str], None] | None = None,
    among_many: bool = False,
) -> list[Result]:  # fmt: skip
    """Run the planned stages (or `only` those named), in the order of `stages`.

    begin: run this stage and all after it, changed or not, and leave those before it as they are; force: run all, changed or not;
    dry_run: decide only. report(stage, event) is called with the reason when a stage begins and with its Result when it is done.
    Artifacts appear stage by stage, so whatever stops this function, the stages done before it are finished. After an interruption the same
    call goes on, a forced one too: stages that it has finished stand, the one that it was in begins at its last checkpoint. among_many: the
    flight is one of many; what is forced of it counts as done until all are over (`forced.forget`).
    """
    names = _chosen(plan, stages, only, begin)
    refuse_own_inputs(plan, stages, names)
    run = _Run(plan, {s.name: s for s in stages}, progress or Silent(), report or (lambda stage, event: None), begin, force)
    if dry_run:
        return [run.dry(name) for name in names]
    with locked(plan.out), forced_run(plan.out, names, force, begin, among_many) as run.forced:
        return [run.one(name) for name in names]


def drawn(plan: Plan, stages: Sequence[Stage], name: str, progress: Progress | None = None) -> Iterable[tuple[str, str | bytes]]:
    """(file name, content) of the figures of a stage that has run: drawn from its artifacts, which stay as they are."""
    run = _Run(plan, {s.name: s for s in stages}, progress or Silent(), lambda stage, event: None, None, False)
    with one_blas_thread():
        yield from run.figures(name)


def _chosen(plan: Plan, stages: Sequence[Stage], only: Iterable[str] | None, begin: str | None) -> list[str]:
    """The stages to look at, in order."""
    known = [s.name for s in stages]
    wanted = list(plan.planned if only is None else only)
    for name in [*wanted, *([begin] if begin else [])]:
        if name not in known:
            raise BadInput(f"there is no stage '{name}'", do=did_you_mean(name, known))
    if not wanted:
        raise BadInput("the plan names no stages", f"{plan.file}: stages", f"List those to run with their settings: {', '.join(known)}.")
    if begin and begin not in wanted:
        raise BadInput(f"stage '{begin}' is not in the plan", "--from", f"In the plan: {', '.join(n for n in known if n in wanted)}.")
    return [name for name in known if name in wanted]


@dataclass
class _Run:
    """One call of `run_plan`: the plan, which stages have run in it so far, and hashes of the input files with what was read of them."""

    plan: Plan
    stages: Mapping[str, Stage]
    progress: Progress
    report: Callable[[str, Result | str], None]
    begin: str | None
    force: bool
    ran: list[str] = field(default_factory=list)
    forced: Forced | None = None
    read: tuple[tuple[str, str], Inputs] | None = None

    def dry(self, name: str) -> Result:
        """What would become of a stage."""
        if self._before_begin(name):
            return self._leave(name)
        upstreams = self._upstreams(name, dry=True)
        if reason := self._why(name, self._stamp(name, upstreams), upstreams):
            self.ran.append(name)
            return self._done(Result(name, "would run", reason))
        return self._done(Result(name, "unchanged", "unchanged"))

    def one(self, name: str) -> Result:
        """Run a stage, or say why not."""
        if self._before_begin(name):
            return self._leave(name)
        upstreams = self._upstreams(name)
        stamp = self._stamp(name, upstreams)
        reason = self._why(name, stamp, upstreams)
        if not reason:
            kept = self._provenance(name) or {}
            return self._stood(Result(name, "unchanged", "unchanged", summary=kept.get("summary", {})))
        self.report(name, reason)
        began = time.monotonic()
        try:
            summary = self._run(name, upstreams, stamp)
        except KeyboardInterrupt:
            saved = has_checkpoints(self.plan.out, name)
            self.report(name, Result(name, "interrupted", "at its last checkpoint" if saved else "from its beginning"))
            raise
        self.ran.append(name)
        if self.forced is not None:
            self.forced.finished(name, _digest(stamp))
        return self._stood(Result(name, "ran", reason, time.monotonic() - began, summary))

    def _stood(self, result: Result) -> Result:
        """A result whose artifacts stand. Raises NumericalFailure where they say that there is none."""
        self._done(result)
        if failure := result.summary.get(FAILURE):
            raise NumericalFailure(failure["outcome"], failure["what"], str(self._folder(result.stage)), failure["do"])
        return result

    def _done(self, result: Result) -> Result:
        self.report(result.stage, result)
        return result

    def _before_begin(self, name: str) -> bool:
        order = list(self.stages)
        return self.begin is not None and order.index(name) < order.index(self.begin)

    def _leave(self, name: str) -> Result:
        return self._done(Result(name, "skipped", f"before --from {self.begin}"))

    # --- running ---------------------------------------------------------------------------------------------------------

    def _run(self, name: str, upstreams: Mapping[str, Path], stamp: Stamp) -> Mapping[str, Any]:
        """Run a stage in a folder of its own that takes the old one's place when all is written."""
        stage, plan, folder = self.stages[name], self.plan, self._folder(name)
        checkpoints = scratch_path(plan.out, name)
        if self.forced is not None and not self.forced.starts(name):
            remove(checkpoints)  # asked for anew: only checkpoints of this very run are trusted
        refuse_foreign(folder, stage.makes)
        inputs = self._inputs()
        with one_blas_thread():  # the log is read here
            raise_all(refused(stage, inputs, plan))
        started, began = datetime.now(UTC), time.monotonic()
        scratch = scratch_folder(plan.out, name, _digest(stamp))
        with staged_folder(folder) as staged, one_blas_thread():
            context = Context(
                flight=plan.flight,
                kite=plan.kite,
                out=plan.out,
                folder=staged,
                scratch=scratch,
                seed=plan.seed,
                split=plan.split,
                upstreams=upstreams,
                progress=self.progress,
                stamp=stamp,
                inputs=inputs,
            )
            try:
                summary = with_warning(stage.run(context, plan.settings[name]) or {}, inputs, plan)
            except Exception:
                # a failure would only be repeated from its own checkpoints; an interruption (no Exception) keeps them
                remove(checkpoints)
                raise
            if missing := [file for file in stage.makes if not (staged / file).is_file()]:
                raise RuntimeError(f"stage {name} did not write {', '.join(missing)}")
            if changed := changes(stamp, self._stamp(name, upstreams)):
                remove(checkpoints)
                raise BadInput(f"{'; '.join(changed)} while {name} was running: its result is of neither", str(folder), "Run it again.")
            provenance = {
                "stage": name,
                "versions": versions(),
                "stamp": stamp,
                "paths": {key: path.resolve() for key, path in (("flight", plan.flight), ("kite", plan.kite), ("plan", plan.file))},
                "machine": {**machine(), "blas": blas()},
                "artifacts": artifact_hashes(staged),
                "summary": _finite(summary),
                "timing": {"started": started.isoformat(timespec="seconds"), "duration_s": round(time.monotonic() - began, 3)},
            }
            write_json(staged / PROVENANCE, provenance)
        remove(checkpoints)
        return summary

    def figures(self, name: str) -> Iterable[tuple[str, str | bytes]]:
        """The figures of a stage, from what it left in its folder."""
        stage, plan, upstreams = self.stages[name], self.plan, self._upstreams(name)
        kept = self._provenance(name) or {}
        context = Context(
            plan.flight, plan.kite, plan.out, self._folder(name), scratch_path(plan.out, name), plan.seed, plan.split, upstreams,
            self.progress, Inputs(plan.flight, plan.kite, plan.split), kept.get("stamp", {}),
        )  # fmt: skip
        return stage.figures(context, plan.settings[name])

    def _folder(self, name: str) -> Path:
        return self.plan.out / name

    def _from_here(self, name: str) -> bool:
        return self.begin is not None and not self._before_begin(name)

    # --- deciding --------------------------------------------------------------------------------------------------------

    def _why(self, name: str, stamp: Stamp, upstreams: Mapping[str, Path]) -> str:
        """Why a stage has to run; empty if it need not."""
        asked = "--force" if self.force else f"--from {self.begin}" if self._from_here(name) else ""
        # what this very run had done before it was interrupted stands as if nothing were forced
        if asked and not (self.forced is not None and self.forced.done.get(name) == _digest(stamp)):
            return asked
        if not self._folder(name).is_dir():
            return "first run"
        kept = self._provenance(name)
        if kept is None:
            return f"{PROVENANCE} missing or not readable"
        ran = [s for s in self._read(name, upstreams) if s in self.ran]
        if ran:
            return f"upstream {', '.join(ran)} ran"
        if changed := changes(kept["stamp"], stamp):
            return "; ".join(changed)
        if damaged := self._damaged(name, kept):
            return f"artifact {damaged}"
        return ""

    def _needs(self, name: str) -> tuple[Need, ...]:
        return self.stages[name].needs(self.plan.settings[name])

    def _read(self, name: str, upstreams: Mapping[str, Path]) -> list[str]:
        """The upstream stages that a stage takes something from, by what those that have run (stage -> folder) say."""
        unread = self.stages[name].unread(self.plan.settings[name], upstreams)
        return [need.stage for need in self._needs(name) if need.stage not in unread]

    def _provenance(self, name: str) -> dict[str, Any] | None:
        """What a stage was made from; None if it has not run, or not readably."""
        return read_provenance(self._folder(name))

    def _damaged(self, name: str, kept: Mapping[str, Any]) -> str:
        """The first artifact that is not what the stage wrote, and how; empty if all are."""
        now = artifact_hashes(self._folder(name))
        for file, digest in kept["artifacts"].items():
            if now.get(file) != digest:
                return f"{file} {'changed since it was written' if file in now else 'missing'}"
        return next((f"{file} missing" for file in self.stages[name].makes if file not in now), "")

    def _stamp(self, name: str, upstreams: Mapping[str, Path]) -> Stamp:
        """What a stage would be made from today."""
        stage, plan = self.stages[name], self.plan
        settings = plan.settings[name]
        inputs = {"flight": plan.flight, "kite": plan.kite}
        return {
            "inputs": {key: input_hash(key, inputs[key]) for key in stage.reads},
            "seed": plan.seed,
            "split": plan.split.model_dump(),
            "settings": _settings(settings),
            "upstream": {s: self._hash(s) if s in upstreams else None for s in self._read(name, upstreams)},
            "code": code_hash(),
            "versions": versions(),
        }

    # --- upstream --------------------------------------------------------------------------------------------------------

    def _inputs(self) -> Inputs:
        """Flight and kite, read once by all stages of a call as long as their files stay as they are."""
        plan = self.plan
        files = input_hash("flight", plan.flight), input_hash("kite", plan.kite)
        if self.read is None or self.read[0] != files:
            self.read = files, Inputs(plan.flight, plan.kite, plan.split)
        return self.read[1]

    def _upstreams(self, name: str, dry: bool = False) -> dict[str, Path]:
        """Folders of the upstream stages to take from, in the order of the stages table."""
        needs = {need.stage: need for need in self._needs(name)}
        ahead = [s for s in self.stages if s in needs]
        missing_of = {s: "" if dry and s in self.ran else self._unusable(s) for s in ahead}
        found = {s: self._folder(s) for s in ahead if not missing_of[s]}
        read = self._read(name, found)
        for upstream in (s for s in ahead if s in read and not (dry and s in self.ran)):
            missing = missing_of[upstream]
            if missing and needs[upstream].required:
                where, cure = str(self._folder(upstream)), f"Make it first: {self.command(upstream)}"
                raise BadInput(f"{name} needs the result of {upstream}: {missing}", where, cure)
            if missing and self._folder(upstream).is_dir():
                self.progress.note(f"{name} does without {upstream}: {missing}. To use it: {self.command(upstream)}")
            if not missing and (changed := self._outdated(upstream)):
                self.progress.note(f"{upstream} was made before {'; '.join(changed)}. To bring it up to date: {self.command(upstream)}")
        return {s: folder for s, folder in found.items() if s in read}

    def command(self, name: str) -> str:
        """What to type to run a stage."""
        at = "" if str(self.plan.file) == "stages.yaml" else f" --stages {self.plan.file}"
        return f"awes {name}{at}{f' --flight {self.plan.name}' if self.plan.name else ''}"

    def _unusable(self, name: str) -> str:
        """Why the artifacts of a stage must not be used; empty if they may."""
        if not self._folder(name).is_dir():
            return "it has not run"
        kept = self._provenance(name)
        if kept is None:
            return f"its {PROVENANCE} is missing or not readable"
        if damaged := self._damaged(name, kept):
            return damaged
        for upstream, digest in kept["stamp"]["upstream"].items():
            if upstream in self.stages and digest != self._usable_hash(upstream):
                return f"{upstream} has changed since {name} ran"
        return ""

    def _usable_hash(self, name: str) -> str | None:
        return None if self._unusable(name) else self._hash(name)

    def _hash(self, name: str) -> str:
        return made_hash(self._folder(name))

    def _outdated(self, name: str) -> list[str]:
        """Changes of the plan since an upstream stage ran, that this run was not asked to act on."""
        if name in self.ran:
            return []
        kept = self._provenance(name) or {}
        today = {**self._stamp(name, {}), "upstream": {}, "code": "", "versions": {}}
        return changes({**kept["stamp"], "upstream": {}, "code": "", "versions": {}}, today)


def _settings(config: StageConfig) -> dict[str, Any]:
    """The settings as plain JSON values. A path counts by its content where there is one: moving a file changes nothing."""

    def plain(key: str, value: Any) -> Any:
        if isinstance(value, Path):
            return input_hash(key, value) if value.exists() else str(value)
        if isinstance(value, dict):
            return {str(k): plain(str(k), v) for k, v in value.items()}
        if isinstance(value, (list, tuple)):
            return [plain(key, v) for v in value]
        return value if value is None or isinstance(value, (bool, int, float, str)) else str(value)

    return plain("", config.model_dump(by_alias=True))


def _finite(summary: Mapping[str, Any]) -> dict[str, Any]:
    """The summary as it can be kept: infinities and NaN as text."""

    def plain(value: Any) -> Any:
        if isinstance(value, Mapping):
            return {str(k): plain(v) for k, v in value.items()}
        if hasattr(value, "item") and getattr(value, "ndim", 1) == 0:
            value = value.item()
        if isinstance(value, float) and (value != value or value in (float("inf"), float("-inf"))):
            return str(value)
        return value if value is None or isinstance(value, (bool, int, float, str, list)) else str(value)

    return plain(summary)


def _digest(stamp: Stamp) -> str:
    return table_hash({key: repr(value) for key, value in flat(stamp).items()})


@cache
def code_hash() -> str:
    """Of all files of awes' own package, the page's script and style included: other code may give other results."""
    package = Path(awescli.__file__).parent
    return table_hash({str(p.relative_to(package)): file_hash(p) for p in sorted(package.rglob("*")) if _is_code(p, package)})


def _is_code(path: Path, package: Path) -> bool:
    """Not what Python, an editor or a version control system leaves beside the code, nor the demo that a wheel holds."""
    code = path.is_file() and path.suffix != ".pyc" and not path.name.startswith(".") and not path.name.endswith("~")
    return code and not path.is_relative_to(package / "demo")
