"""Many flights on the terminal: a line for each while they run, and the table over them at the end."""

from collections.abc import Mapping, Sequence
from typing import Any

from awescli.cli.screen import Screen
from awescli.cli.tables import printable
from awescli.notation.errors import AwesError, BadInput, NumericalFailure
from awescli.stages.answers import number
from awescli.stages.flight_table import effects_said

SHOWN = 10
"""Flights that an error names one by one."""


class Fault(AwesError):
    """A run that ended in a fault of awes (exit code 1)."""

    exit_code = 1


class FlightLines:
    """What the person sees of flights that run: on a terminal one moving line for each that runs now, and one that stays for each that has
    ended; in a pipe a line when a flight begins and one when it has ended."""

    def __init__(self, screen: Screen, count: int):
        self.screen, self.count, self.ended = screen, count, 0
        self.lines: dict[str, Any] = {}
        self.bars: Any = None
        if screen.fancy:
            from rich.progress import Progress, SpinnerColumn, TextColumn, TimeElapsedColumn

            self.bars = Progress(SpinnerColumn(), TextColumn("{task.description}", markup=False), TimeElapsedColumn(),
                                 console=screen.console, transient=True)  # fmt: skip
            screen.bars = self.bars  # the screen ends it before it says an error
            self.bars.start()

    def hear(self, flight: str, message: Mapping[str, Any]) -> None:
        """A message of `stages.many.Hear`."""
        if "row" in message:
            return self._end(flight, message["row"])
        if flight not in self.lines:
            self.lines[flight] = self.bars.add_task(printable(flight), total=None) if self.bars else None
            (self.screen.log if self.bars else self.screen.line)(f"{flight}: begun")
            self._running()
        if self.bars:
            doing = message.get("doing") or message.get("runs") or message.get("note") or message.get("status", "")
            self.bars.update(self.lines[flight], description=printable(f"{flight}: {message['stage']}: {doing}")[: self.screen.width - 12])

    def _end(self, flight: str, row: Mapping[str, Any]) -> None:
        self.ended += 1
        if self.bars and flight in self.lines:
            self.bars.remove_task(self.lines[flight])
        self.screen.finished.append(flight)
        self._running()
        what = row["verdict"] or ""
        if effects := effects_said(row, short=True):
            what += f", {effects}"
        if row["status"] != "done":
            what = row["reason"].partition("\n")[0] or what
        self.screen.line(f"[{self.ended}/{self.count}] {flight}: {row['status']}{f': {what}' if what else ''} ({row['seconds']:.0f} s)")

    def _running(self) -> None:
        """What the screen says of an interruption."""
        self.screen.running = ", ".join(name for name in self.lines if name not in self.screen.finished)
        self.screen.goes_on = "after their last finished stages, at their checkpoints"


def show_table(screen: Screen, rows: Sequence[Mapping[str, Any]], files: Sequence[str]) -> None:
    """The table over flights."""
    screen.section("flights", {row["flight"]: _columns(row) for row in rows})
    screen.line(f"table: {', '.join(files)}")


def _columns(row: Mapping[str, Any]) -> dict[str, str]:
    """The cells of a flight; intervals of power stand in the files, effects in a line of their own."""
    error = row["error"] or {}
    share = (row["power"] or {}).get("error_share")
    errors = {f"{'error ' if key == 'before' else ''}{key}": number(error.get(key)) for key in ("before", "after", "noise")}
    power = "-" if share is None else f"{100 * share:+.1f} %"
    return {"status": row["status"], "verdict": row["verdict"] or "-", **errors, "power error": power, "effects": effects_said(row)}


def raise_for(rows: Sequence[Mapping[str, Any]]) -> None:
    """What the exit code of all flights is: of a fault 1, else 2 where one was refused, else 3 where one has no answer."""
    for status, kind in (("fault", Fault), ("refused", BadInput), ("no answer", None)):
        of = [row for row in rows if row["status"] == status]
        if not of:
            continue
        # the first line says what and where, and stands in the table's `reason` with what to do
        named = [f"{row['flight']}: {row['reason']}".replace("\n", "\n  ") for row in of[:SHOWN]]
        more = [f"and {len(of) - SHOWN} more"] if len(of) > SHOWN else []
        what = f"{len(of)} of {len(rows)} flights: {status}"
        do = "\n  ".join([*named, *more])
        raise kind(what, do=do) if kind else NumericalFailure("no_answer", what, do=do)
