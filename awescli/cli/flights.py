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
        if self.bars:
            doing = message.get("doing") or message.get("runs") or message.get("note") or message.get("status", "")
            self.bars.update(self.lines[flight], description=printable(f"{flight}: {message['stage']}: {doing}")[: self.screen.width - 12])

    def _end(self, flight: str, row: Mapping[str, Any]) -> None:
        self.ended += 1
        if self.bars and flight in self.lines:
            self.bars.remove_task(self.lines[flight])
        self.screen.finished.append(flight)
        what = row["verdict"] or ""
        if effects := effects_said(row, short=True):
            what += f", {effects}"
        if row["status"] != "done":
            what = row["reason"].partition("\n")[0] or what
        self.screen.line(f"[{self.ended}/{self.count}] {flight}: {row['status']}{f': {what}' if what else ''} ({row['seconds']:.0f} s)")


def show_table(screen: Screen, rows: Sequence[Mapping[str, Any]], files: Sequence[str]) -> None:
    """The table over flights."""
    screen.section("flights", {row["flight"]: _columns(row) for row in rows})
    screen.line(f"table: {', '.join(files)}")


def _columns(row: Mapping[str, Any]) -> dict[str, str]:
    error, power = row["error"], row["power"]
    changed = f"{number(error['before'])} -> {number(error['after'])} -> {number(error['noise'])}" if error else "-"
    shares = [power["error_share"], *(power["interval_share"] or ())] if power and power["error_share"] is not None else []
    share, *between = (f"{100 * value:+.1f} %" for value in shares) if shares else ("-",)
    return {
        "status": row["status"], "verdict": row["verdict"] or "-", "error -> after -> noise": changed,
        "power error": f"{share} [{', '.join(between)}]" if between else share, "effects": effects_said(row) or "-",
    }  # fmt: skip


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
