"""What the person sees: lines, bars, tables; and the Progress that stages report to."""

import os
import shlex
import shutil
import sys
import time
from collections.abc import Callable, Mapping
from typing import Any

from awescli.cli.tables import printable, table_lines, text_of, wrapped
from awescli.stages.answers import ANSWER, lines_of


class Screen:
    """What the person sees: bars and colours on a terminal, plain lines in a pipe; with --json all of it on stderr.

    It is also the `Progress` that stages report to.
    """

    def __init__(self, as_json: bool = False, quiet: bool = False):
        self.as_json, self.quiet = as_json, quiet
        self.stream = sys.stderr if as_json else sys.stdout
        self.fancy = not quiet and self.stream.isatty() and os.environ.get("TERM") != "dumb"
        self.bars: Any = None
        self.running, self.goes_on = "", ""
        self.finished: list[str] = []
        self.journal: Any = None
        self._console: Any = None

    @property
    def width(self) -> int:
        """Columns that a line may have: the terminal's; of a pipe COLUMNS, else 80."""
        return max(shutil.get_terminal_size((80, 24)).columns, 40)

    @property
    def console(self) -> Any:
        if self._console is None:
            from rich.console import Console

            options = {} if self.fancy else {"color_system": None, "force_terminal": False, "width": self.width}
            self._console = Console(file=self.stream, highlight=False, **options)
        return self._console

    # lines

    def line(self, text: str) -> None:
        self.log(text)
        if not self.quiet:
            self.console.print(printable(text), markup=False, soft_wrap=True)

    def log(self, text: str) -> None:
        """Into the log file, where there is one: also what --quiet does not show."""
        if self.journal is not None:
            self.journal.write([printable(text)])

    def keep_log(self, journal: Any) -> None:
        """From here on all lines go into a log file too (`artifacts.Journal`)."""
        self.journal = journal
        self.log(f"$ {shlex.join(['awes', *sys.argv[1:]])}")

    def paragraph(self, text: str, indent: str = "") -> None:
        """A sentence in lines that fit, the further ones indented."""
        for line in wrapped(printable(text), self.width, indent, f"{indent}  "):
            self.line(line)

    def table(self, content: Mapping[str, Any]) -> None:
        """Rows of columns, or names and values."""
        for line in table_lines(content, self.width):
            self.line(line)

    def error(self, text: str) -> None:
        self.close()
        self.log(text)
        print(printable(text), file=sys.stderr)

    def answer(self, obj: Any) -> None:
        """The machine-readable answer, with --json."""
        if self.as_json:
            import json

            print(json.dumps(obj, indent=2, allow_nan=False))

    # progress of the runner

    def stage_event(self, stage: str, event: Any) -> None:
        """A stage begins (event: why) or has ended (event: its Result)."""
        if isinstance(event, str):
            self.running = stage
            self.line(f"{stage}: runs ({event})")
            return
        self._end_task()
        if event.status == "interrupted":
            self.goes_on = event.reason
            return
        self.running = ""
        self.finished.append(stage)
        if event.status == "ran":
            self.line(f"{stage}: done in {event.seconds:.1f} s")
        elif event.status == "unchanged":
            self.line(f"{stage}: skipped, unchanged")
        else:
            self.line(f"{stage}: {event.status} ({event.reason})")
        if event.status in ("ran", "unchanged"):
            self.summary(stage, event.summary)

    def interrupted(self) -> str:
        """What became of an interrupted command, and what the same command will do."""
        kept = f"Finished and kept: {', '.join(self.finished)}." if self.finished else "Results from before are as they were."
        if not self.running:
            return f"interrupted\n  {kept} The same command goes on after them." if self.finished else f"interrupted\n  {kept}"
        goes_on = f"The same command goes on with {self.running}, {self.goes_on or 'from its beginning'}."
        return f"interrupted during {self.running}\n  {kept} {goes_on}"

    # Progress, for stages

    def task(self, description: str, total: int | None = None) -> "_Bar | _PlainTask":
        self._end_task()
        if not self.fancy:
            return _PlainTask(self.line, description, total)
        from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

        columns = [TextColumn("  {task.description}", markup=False), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn()]
        columns += [TextColumn("left"), TimeRemainingColumn(compact=True)] if total else []
        self.bars = Progress(*columns, TextColumn("{task.fields[text]}", markup=False), console=self.console, transient=True)
        self.bars.start()
        logged = _PlainTask(self.log, description, total)
        return _Bar(self.bars, self.bars.add_task(printable(description), total=total, text=""), logged)

    def note(self, text: str) -> None:
        self.line(f"  {text}")

    def _end_task(self) -> None:
        if self.bars is not None:
            self.bars.stop()
            self.bars = None

    def close(self) -> None:
        self._end_task()

    # summaries

    def summary(self, stage: str, summary: Mapping[str, Any]) -> None:
        """A stage's summary: a table for every mapping of mappings, then its answer, or the numbers where it has none."""
        for title, content in summary.items():
            if isinstance(content, Mapping):
                self.section(f"{stage}: {title}", content)
        numbers = {k: v for k, v in summary.items() if not isinstance(v, Mapping)}
        answer = numbers.pop(ANSWER, None)
        if answer:
            for line in lines_of(stage, answer, self.width):
                self.line(line)
        elif numbers:
            self.line(f"{stage}: " + ", ".join(f"{k} {text_of(v)}" for k, v in numbers.items()))

    def section(self, title: str, content: Any) -> None:
        """A table of rows of columns, a table of values, a list, or one value."""
        if isinstance(content, Mapping) and content:
            self.line(title)
            self.table(content)
        elif isinstance(content, (list, tuple)):
            self.line(f"{title}:" + ("" if content else " none"))
            for item in content:
                self.line(f"  {text_of(item)}")
        else:
            self.line(f"{title}: {text_of(content)}")


class _Bar:
    """A task with a bar, on a terminal; logged: what the log file has of it."""

    def __init__(self, bars: Any, task: Any, logged: "_PlainTask"):
        self.bars, self.id, self.logged = bars, task, logged

    def advance(self, n: int = 1) -> None:
        self.bars.advance(self.id, n)
        self.logged.advance(n)

    def update(self, text: str) -> None:
        self.bars.update(self.id, text=printable(text))
        self.logged.update(text)


class _PlainTask:
    """A task in a pipe or a log file: a line when it begins, then at most one every ten seconds."""

    def __init__(self, say: Callable[[str], None], description: str, total: int | None):
        self.say, self.description, self.total = say, description, total
        self.count, self.text, self.began = 0, "", time.monotonic()
        self.last = self.began
        say(f"  {description}")

    def advance(self, n: int = 1) -> None:
        self.count += n
        self._tell()

    def update(self, text: str) -> None:
        self.text = text
        self._tell()

    def _tell(self) -> None:
        if time.monotonic() - self.last >= 10:
            self.last = time.monotonic()
            steps = f" {self.count}/{self.total}" if self.total else f" {self.count}" if self.count else ""
            left = (self.last - self.began) / self.count * (self.total - self.count) if self.total and self.count else None
            rest = f" (about {left:.0f} s left)" if left else ""
            self.say(f"  {self.description}{steps}{rest} {self.text}".rstrip())
