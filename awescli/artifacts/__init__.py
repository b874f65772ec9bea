"""Floor 1: what stages leave behind: the only room of awes that writes files, and the readers of what it wrote.

`files.py`: one file, whole or not at all; `folders.py`: a stage's folder, whole or not at all, and nothing lost that awes did not make;
`journal.py`: the log file; `forms.py`: what each JSON artifact must hold (checked by `form_check.py`); `origins.py`: hashes, versions,
machine.
"""

from awescli.artifacts.files import (
    cannot_write,
    read_arrays,
    read_json,
    read_tensors,
    write_arrays,
    write_content,
    write_json,
    write_tensors,
    write_text,
)
from awescli.artifacts.folders import (
    copied_folder,
    foreign_files,
    has_checkpoints,
    locked,
    new_folder,
    own_path,
    put_beside,
    refuse_foreign,
    remove,
    scratch_folder,
    scratch_path,
    staged_folder,
)
from awescli.artifacts.journal import Journal
from awescli.artifacts.origins import (
    PROVENANCE,
    artifact_hashes,
    file_hash,
    machine,
    table_hash,
    versions,
)

__all__ = [
    "Journal",
    "PROVENANCE",
    "artifact_hashes",
    "cannot_write",
    "copied_folder",
    "file_hash",
    "foreign_files",
    "has_checkpoints",
    "locked",
    "machine",
    "new_folder",
    "own_path",
    "put_beside",
    "read_arrays",
    "read_json",
    "read_tensors",
    "refuse_foreign",
    "remove",
    "scratch_folder",
    "scratch_path",
    "staged_folder",
    "table_hash",
    "versions",
    "write_arrays",
    "write_content",
    "write_json",
    "write_tensors",
    "write_text",
]
