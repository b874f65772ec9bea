"""A run that was forced (--force, --from) and interrupted: the same command finds out what it has done, and goes on from there."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

from awescli.artifacts import own_path, read_json, remove, table_hash, write_json
from awescli.notation.errors import BadInput

MARK = "forced.json"
"""Among awes' own files in the folder of results (`artifacts.own_path`), from the beginning of a forced run to its end."""


@dataclass
class Forced:
    """One forced run. file: its mark; command: what was asked; done: stage -> digest of what it was made from, of the stages that this run
    has finished; running: the stage whose checkpoints are of this run."""

    file: Path
    command: str
    done: dict[str, str] = field(default_factory=dict)
    running: str = ""

    @classmethod
    def begin(cls, out: Path, names: Sequence[str], force: bool, start: str | None) -> "Forced | None":
        """The run that this command was interrupted in, else a new one; None where nothing is forced. What another command left is
        forgotten: whoever types something else in between has given that run up."""
        command = table_hash({"stages": " ".join(names), "force": str(force), "from": start or ""})
        file = own_path(out, MARK)
        if not (force or start):
            remove(file)
            return None
        try:
            kept = read_json(file)
        except BadInput:
            kept = None
        if isinstance(kept, dict) and kept.get("command") == command:
            done, running = kept.get("done"), kept.get("running")
            if isinstance(done, dict) and isinstance(running, str):
                return cls(file, command, {str(k): str(v) for k, v in done.items()}, running)
        return cls(file, command)

    def starts(self, stage: str) -> bool:
        """A stage is about to run. Is it the one that was interrupted, so that its checkpoints are of this run?"""
        continued = self.running == stage
        self.running = stage
        self._write()
        return continued

    def finished(self, stage: str, digest: str) -> None:
        """A stage has run, made from what `digest` tells."""
        self.done[stage], self.running = digest, ""
        self._write()

    def end(self) -> None:
        """The run is over, or has failed: the same command is a new one."""
        remove(self.file)

    def _write(self) -> None:
        write_json(self.file, {"command": self.command, "done": self.done, "running": self.running})
