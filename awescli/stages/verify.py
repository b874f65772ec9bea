"""Is a folder of results still what its provenance says? Hashes of every artifact, of the inputs and of the stages upstream."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from awescli.artifacts import PROVENANCE, artifact_hashes, read_json, table_hash
from awescli.notation.errors import BadInput
from awescli.stages.base import Stage
from awescli.stages.runner import input_hash


@dataclass(frozen=True)
class Verified:
    """What was compared: stage -> number of files whose hashes were taken; and every mismatch, one line each."""

    files: Mapping[str, int]
    mismatches: tuple[str, ...]


def verify(run: Path, stages: Sequence[Stage]) -> Verified:
    """Compare the results in `run`, the `out` folder of a plan, with their provenance. Raises BadInput where there is none."""
    found = [s.name for s in stages if (run / s.name / PROVENANCE).exists()]
    if not found:
        raise BadInput("no results of awes are here", str(run), "Name the folder of a run (`out` in its plan).")
    files, lines = {}, []
    for name in found:
        now = artifact_hashes(run / name)
        files[name] = len(now)
        lines += _of_stage(run, name, now)
    return Verified(files, tuple(lines))


def _of_stage(run: Path, name: str, now: Mapping[str, str]) -> Iterator[str]:
    """The mismatches of one stage. now: file -> hash as they lie there."""
    file = run / name / PROVENANCE
    kept = _provenance(file)
    if kept is None:
        yield f"{file}: not readable as provenance"
        return
    for artifact, digest in kept["artifacts"].items():
        if now.get(artifact) != digest:
            yield f"{run / name / artifact}: {'changed since it was written' if artifact in now else 'missing'}"
    yield from (f"{run / name / artifact}: not one of the stage's artifacts" for artifact in now if artifact not in kept["artifacts"])
    for key, digest in kept["stamp"]["inputs"].items():
        path = Path(str(kept["paths"].get(key)))
        if not path.exists():
            yield f"{path}: the {key} that {name} was made from is not there"
        elif input_hash(path, run) != digest:
            yield f"{path}: the {key} changed since {name} was made from it"
    for upstream, digest in kept["stamp"]["upstream"].items():
        if digest is not None and table_hash(artifact_hashes(run / upstream)) != digest:
            yield f"{run / upstream}: not what {name} was made from"


def _provenance(file: Path) -> dict[str, Any] | None:
    """The provenance, if it has the parts that are compared."""
    try:
        kept = read_json(file)
    except BadInput:
        return None
    tables = isinstance(kept, dict) and all(isinstance(kept.get(key), dict) for key in ("stamp", "artifacts", "paths"))
    return kept if tables and all(isinstance(kept["stamp"].get(key), dict) for key in ("inputs", "upstream")) else None
