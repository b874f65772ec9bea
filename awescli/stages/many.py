"""A plan of many flights: the ordinary run of each, into a folder of its own, on several processes; one row of the table for each.

Flights know nothing of each other. One that is refused, or has no answer, is a row that says so, and the others go on. A flight's folder is
that of an ordinary run: what stands there is not made again, and a run that was interrupted goes on where it stopped; of a forced one,
what had ended counts as done until all flights are over.
"""

import os
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import closing
from functools import partial
from pathlib import Path
from typing import Any

from awescli.artifacts import Journal, locked, write_json, write_text
from awescli.notation.errors import AwesError, BadInput
from awescli.stages.base import Stage
from awescli.stages.flight_table import as_csv, as_written, row
from awescli.stages.flights import PAGE, TABLE, TABLE_JSON
from awescli.stages.forced import forget
from awescli.stages.plan import Plan, Plans
from awescli.stages.runner import Result, code_hash, run_plan
from awescli.stages.workers import connected, outcomes, tell

SELDOM = 0.5
"""Seconds between two messages of how far a stage is."""

Hear = Callable[[str, Mapping[str, Any]], None]
"""hear(flight, message): `runs` or `status` with `stage` and `reason`, `doing`, `note`; at the end `row`."""


def run_flights(
    plans: Plans,
    stages: Sequence[Stage],
    workers: int | None = None,
    scheduler: str | None = None,
    begin: str | None = None,
    force: bool = False,
    hear: Hear = lambda flight, message: None,
) -> list[dict[str, Any]]:
    """Run the plan of every flight; gives back their rows (`flight_table.row`), in the order of the plan, and writes the table.

    workers: processes of this machine, default one a core; 0: one flight after the other in this process, without Dask; scheduler: address
    of a Dask scheduler instead, whose workers see the same paths and have the same awes; begin, force: as in `run_plan`.
    Raises BadInput, before anything is written, where there are no workers to be had; what a flight does wrong is in its row.
    """
    if workers is None:
        from awescli.simulation.groups import cores

        workers = cores()
    for plan in plans.by_flight.values():
        if not plan.planned:
            run_plan(plan, stages, dry_run=True)  # refuses, for all flights at once
    cases = {name: (plan.anchored(), tuple(stages), begin, force) for name, plan in plans.by_flight.items()}
    rows: dict[str, dict[str, Any]] = {}
    with connected(min(workers, len(cases)), scheduler) as client:
        if scheduler is not None:
            _of_one_kind(client, scheduler)
        with locked(plans.out):
            work = partial(fly, say=hear) if client is None else fly
            with closing(outcomes(client, work, cases, hear)) as ended:
                for name, outcome in ended:
                    found = _fault(plans.by_flight[name], outcome) if isinstance(outcome, Exception) else outcome
                    rows[name] = as_written(found, plans.by_flight[name])
                    hear(name, {"row": rows[name]})
            for plan in plans.by_flight.values():
                forget(plan.out)
            table = [rows[name] for name in cases]
            write_json(plans.out / TABLE_JSON, {"plan": str(plans.file), "flights": table})
            write_text(plans.out / TABLE, as_csv(table))
            write_text(plans.out / PAGE, _page(plans, table))
    return table


def _page(plans: Plans, table: Sequence[Mapping[str, Any]]) -> str:
    """flights.html, with links to the reports that stand beside it."""
    from awescli.artifacts import versions
    from awescli.reporting.many_flights import Flights, flights_page

    kites = dict.fromkeys(plan.kite.name for plan in plans.by_flight.values())
    reports = {row["flight"]: Path(os.path.relpath(row["report"], plans.out)).as_posix() for row in table if row["report"]}
    return flights_page(Flights(table, reports, plans.file.name, ", ".join(kites), versions()["awes"]))


def fly(name: str, case: tuple[Plan, tuple[Stage, ...], str | None, bool], say: Hear = tell) -> dict[str, Any]:
    """The ordinary run of one flight, and its row. say: where messages go; what is said stands in the log file of the flight's folder too.
    What is no AwesError is left to the caller."""
    plan, stages, begin, force = case
    reported = _Reported(name, say, Journal(plan.out))
    began, error = time.monotonic(), None
    try:
        run_plan(plan, stages, begin=begin, force=force, progress=reported, report=reported.stage_event, among_many=True)
    except AwesError as e:
        error = e
        reported.journal.write([f"error: {e}"])
    except KeyboardInterrupt:
        reported.journal.write(["interrupted"])
        if say is not tell:
            raise
        return row(plan, reported.results, status="interrupted")  # a worker outlives whoever does not wait for it any more
    return row(plan, reported.results, error, time.monotonic() - began)


def _fault(plan: Plan, error: Exception) -> dict[str, Any]:
    """The row of a flight whose run did not come back."""
    if isinstance(error, OSError):  # as the command line has it: paths, permissions, space
        return row(plan, {}, BadInput(f"{error.filename or 'file'}: {error.strerror or error}"))
    what = f"{type(error).__name__}: {error}"
    if type(error).__name__ == "KilledWorker":
        what = "its process died, again and again: killed, or out of memory"
    return row(plan, {}, status="fault", reason=what)


def _of_one_kind(client: Any, scheduler: str) -> None:
    """Raises BadInput where workers have another awes than this one, whose results would be called out of date here."""
    try:
        theirs = client.run(code_hash)
    except ImportError as e:
        raise BadInput(f"the workers there cannot load awes ({e})", f"--scheduler {scheduler}", "Install it on all of them.") from None
    if others := [address for address, digest in theirs.items() if digest != code_hash()]:
        what = f"{len(others)} of {len(theirs)} workers have another awes than this one: {', '.join(others[:3])}"
        raise BadInput(what, f"--scheduler {scheduler}", "Install the same version on all of them.")


class _Reported:
    """The Progress, its tasks, and the report of one flight's run: messages, and lines in the flight's log file.

    results: stage -> its Result, of the stages whose artifacts this run has made or found standing.
    """

    def __init__(self, flight: str, say: Hear, journal: Journal):
        self.flight, self.say, self.journal = flight, say, journal
        self.results: dict[str, Result] = {}
        self.stage, self.doing, self.count, self.total = "", "", 0, None
        self.last = 0.0

    def stage_event(self, stage: str, event: Result | str) -> None:
        self.stage = stage
        if isinstance(event, str):
            self.journal.write([f"{stage}: runs ({event})"])
            self.say(self.flight, {"stage": stage, "runs": event})
            return
        self.journal.write([f"{stage}: {event.status} ({event.reason}), {event.seconds:.1f} s"])
        if event.status == "interrupted":
            return
        if event.status in ("ran", "unchanged"):
            self.results[stage] = event
        self.say(self.flight, {"stage": stage, "status": event.status, "reason": event.reason})

    def task(self, description: str, total: int | None = None) -> "_Reported":
        self.doing, self.count, self.total = description, 0, total
        self.journal.write([f"  {description}"])
        self._tell(now=True)
        return self

    def advance(self, n: int = 1) -> None:
        self.count += n
        self._tell()

    def update(self, text: str) -> None:
        self._tell()

    def note(self, text: str) -> None:
        self.journal.write([f"  {text}"])
        self.say(self.flight, {"stage": self.stage, "note": text})

    def _tell(self, now: bool = False) -> None:
        if now or time.monotonic() - self.last >= SELDOM:
            self.last = time.monotonic()
            steps = f" {self.count}/{self.total}" if self.total else ""
            self.say(self.flight, {"stage": self.stage, "doing": f"{self.doing}{steps}"})
