"""Is a folder of results still what its provenance says? Hashes of every artifact, of the inputs and of the stages upstream."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from awescli.artifacts import PROVENANCE, artifact_hashes
from awescli.notation.errors import BadInput
from awescli.stages.base import Stage
from awescli.stages.inputs import input_hash
from awescli.stages.made import made_hash, read_provenance


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
        lines += _of_stage(run, name, now, [s.name for s in stages])
    return Verified(files, tuple(lines))


def _of_stage(run: Path, name: str, now: Mapping[str, str], stages: Sequence[str]) -> Iterator[str]:
    """The mismatches of one stage. now: file -> hash as they lie there; stages: names that a stage upstream may have."""
    file = run / name / PROVENANCE
    kept = read_provenance(run / name)
    if kept is None:
        yield f"{file}: not readable as provenance"
        return
    for artifact, digest in kept["artifacts"].items():
        if now.get(artifact) != digest:
            yield f"{run / name / artifact}: {'changed since it was written' if artifact in now else 'missing'}"
    yield from (f"{run / name / artifact}: not one of the stage's artifacts" for artifact in now if artifact not in kept["artifacts"])
    for key, digest in kept["stamp"]["inputs"].items():
        path = Path(str(kept.get("paths", {}).get(key)))
        if not path.exists():
            yield f"{path}: the {key} that {name} was made from is not there"
            continue
        try:
            same = input_hash(key, path) == digest
        except BadInput as e:
            yield f"{path}: the {key} that {name} was made from cannot be compared: {e.what}"
        else:
            if not same:
                yield f"{path}: the {key} changed since {name} was made from it"
    for upstream, digest in kept["stamp"]["upstream"].items():
        if digest is None:
            continue
        if upstream not in stages:
            yield f"{file}: '{upstream}' is no stage"
        elif made_hash(run / upstream) != digest:
            yield f"{run / upstream}: not what {name} was made from"
