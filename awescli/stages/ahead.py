"""What all stages that predict have in common: how far ahead, from which states, and who moves the surfaces. One meaning for all of them:
the same model has one score per (surfaces, initial states, horizon, part)."""

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from pydantic import Field

from awescli.notation.errors import BadInput
from awescli.stages.base import Context, StageConfig

if TYPE_CHECKING:
    from awescli.flightlog.log import FlightLog
    from awescli.flightlog.split import Split

Surfaces = Literal["recorded", "controller"]
"""recorded: the log's set-points are replayed; controller: the fitted law computes them from the simulated state (Rositani eq. 11d)."""
SHORTEST = 0.2
"""[s] a prediction shorter than this says nothing."""


class AheadConfig(StageConfig):
    """Settings of a stage that predicts."""

    too_long: Literal["refuse", "shorten"] = Field(
        "refuse", description="a horizon that does not fit into the flight's loops: an error, or shortened to what fits, and said"
    )
    initial_states: Literal["free", "measured"] = Field(
        "free", description="where a prediction begins: a state fitted to the measurements around it, or the measured one (Rositani 11c)"
    )

    @property
    def known_starts(self) -> bool:
        return self.initial_states == "measured"


class HandedOnConfig(AheadConfig):
    """Settings of a stage behind identify."""

    surfaces: Surfaces | None = Field(
        None, description="replay the recorded set-points, or close the loop with the fitted controller; default as identify did"
    )

    def closes_the_loop(self, context: Context) -> bool:
        return surfaces_of(context, self.surfaces) == "controller"


def surfaces_of(context: Context, asked: Surfaces | None) -> Surfaces:
    """Who moves the surfaces: as asked, else as identify did, else the log."""
    return asked or surfaces_of_identify(context.upstreams)


def surfaces_of_identify(upstreams: Mapping[str, Path]) -> Surfaces:
    """Who moved the surfaces when the parameters were fitted; the log where they were not."""
    from awescli.artifacts import read_json

    file = upstreams["identify"] / "metrics.json" if "identify" in upstreams else None
    return read_json(file).get("surfaces", "recorded") if file and file.is_file() else "recorded"


def unread_controller(asked: Surfaces | None, upstreams: Mapping[str, Path]) -> tuple[str, ...]:
    """fit-controller where the recorded set-points are replayed: what is fitted to it then does not depend on it."""
    try:
        closed = (asked or surfaces_of_identify(upstreams)) == "controller"
    except BadInput:  # a dry run looks at what is to be made again, too; the stage itself refuses what it cannot read
        return ()
    return () if closed else ("fit-controller",)


def longest_ahead(log: "FlightLog", parts: "Split", before: float) -> float:
    """Seconds that can be predicted in every part of a flight, after a warm-up of `before` [s] that may lie in the part before it."""
    from awescli.flightlog.log import runs_of

    first = int(round(before / log.dt))
    found = []
    for part in ("train", "validation", "test"):
        ranges = [(max(a - first, 0), b) for a, b in getattr(parts, part)]
        runs = [length for a, b in ranges for length in (runs_of(log.valid[a:b]) @ (-1, 1)).tolist()]
        found.append(max(runs, default=0) - 1 - first)
    return min(found) * log.dt


def horizon_within(context: Context, config: AheadConfig, horizon: float, flights: "Iterable[tuple[FlightLog, Split]]") -> float:
    """`horizon` [s], shortened to what fits into the flights ((log, parts), ...) where the settings allow that, and said. Raises
    NumericalFailure("too_short") where nothing can be predicted."""
    from awescli.flightlog.split import WARM_UP
    from awescli.notation.errors import NumericalFailure

    fits = min(longest_ahead(log, parts, WARM_UP) for log, parts in flights)
    if config.too_long == "refuse" or horizon <= fits:
        return horizon
    if fits < SHORTEST:
        what = "no part of a second in a row fits into the train, validation and test loops of the flight"
        raise NumericalFailure("too_short", what, do="Use a longer flight; `awes check` lists what was left out and why.")
    # downwards, in whole samples
    shorter = int(fits * 10) / 10
    context.progress.note(f"horizon shortened from {horizon:g} s to {shorter:g} s: no more fits into the loops of every part")
    return shorter
