"""What a stage left in its folder, as its provenance tells it."""

from pathlib import Path
from typing import Any

from awescli.artifacts import PROVENANCE, artifact_hashes, read_json, table_hash
from awescli.notation.errors import BadInput


def read_provenance(folder: Path) -> dict[str, Any] | None:
    """What the stage in `folder` was made from; None where that is not stated, or not readably."""
    try:
        return read_json(folder / PROVENANCE)
    except BadInput:
        return None


def made_hash(folder: Path) -> str:
    """Of the artifacts that the stage made, as they lie there now; files that somebody put beside them do not count."""
    made = (read_provenance(folder) or {}).get("artifacts", {})
    return table_hash({name: digest for name, digest in artifact_hashes(folder).items() if name in made})
