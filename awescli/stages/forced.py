"""A run that was forced (--force, --from) and interrupted: the same command finds out what it has done, and goes on from there."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

from awescli.artifacts import own_path, read_json, remove, table_hash, write_json
from awescli.notation.errors import BadInput

MARK = "forced.json"
"""Among awes' own files in the folder of results (`artifacts.own_path`), from the beginning of a forced run to its end."""


@dataclass
class Forced:
    """One forced run. file: its mark; command: what was asked; done: stage -> digest of what it was made from, of the stages that this run
    has finished; running: the stage whose checkpoints are of this run; among_many: it is the run of one flight of many, whose mark stays
    until all of them are over (`forget`)."""

    file: Path
    command: str
    done: dict[str, str] = field(default_factory=dict)
    running: str = ""
    among_many: bool = False

    @classmethod
    def begin(cls, out: Path, names: Sequence[str], force: bool, start: str | None, among_many: bool = False) -> "Forced | None":
        """The run that this command was interrupted in, else a new one; None where nothing is forced. What another command left is
        forgotten: whoever types something else in between has given that run up."""
        command = table_hash(
            {"stages": " ".join(names), "force": str(force), "from": start or "", "flights": "many" if among_many else "one"}
        )
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
                return cls(file, command, {str(k): str(v) for k, v in done.items()}, running, among_many)
        return cls(file, command, among_many=among_many)

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
        """The run is over, or has failed: the same command is a new one. One among many waits for the others."""
        if not self.among_many:
            remove(self.file)

    def _write(self) -> None:
        write_json(self.file, {"command": self.command, "done": self.done, "running": self.running})


@contextmanager
def forced_run(out: Path, names: Sequence[str], force: bool, start: str | None, among_many: bool) -> Iterator[Forced | None]:
    """A run of stages that may be forced: see `Forced.begin`. Its mark goes as it ends, with an error too; an interruption leaves it."""
    forced = Forced.begin(out, names, force, start, among_many)
    try:
        yield forced
    except Exception:  # an interruption is none
        if forced is not None:
            forced.end()
        raise
    if forced is not None:
        forced.end()


def forget(out: Path) -> None:
    """Of a flight of many: all of them are over, so that the same command is a new one."""
    remove(own_path(out, MARK))
