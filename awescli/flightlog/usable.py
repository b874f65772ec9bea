"""Which stretches of a flight a model can learn from: those with enough valid samples, a taut line, and surfaces that move."""

from dataclasses import dataclass

import numpy as np

from awescli.flightlog.log import FlightLog
from awescli.notation.quantities import CONTROL_SURFACES

MOST_INVALID = 0.5
"""Share of a stretch that may be invalid: of the rest, segments still pick what is whole."""

TAUT = 0.02
"""Share of the flight's high tension (95th percentile) below which the line hangs: its own drag and weight then make the load."""

MOST_SLACK = 0.2
"""Share of a stretch in which the line may hang: the model's tether is a spring that pulls."""

LEAST_MOTION = np.deg2rad(0.1)
"""Standard deviation of the surface that moves most, below which a stretch says nothing about control."""


@dataclass(frozen=True)
class LeftOut:
    """A stretch that is not used: half-open sample range, the reason in a word or two, and a sentence with its numbers."""

    first: int
    last: int
    reason: str
    sentence: str


def usable(log: FlightLog, bounds: np.ndarray) -> tuple[np.ndarray, tuple[LeftOut, ...]]:
    """(those of the ranges (K, 2) that are fit for use, (M, 2); the others, with reasons)."""
    high = float(np.percentile(log["tension"], 95)) if "tension" in log else 0.0
    out = [found for first, last in bounds.tolist() if (found := _reason(log, first, last, high))]
    bad = {(o.first, o.last) for o in out}
    return np.array([b for b in bounds.tolist() if tuple(b) not in bad], int).reshape(-1, 2), tuple(out)


def _reason(log: FlightLog, first: int, last: int, high: float) -> LeftOut | None:
    """Why a range is not used; None if it is."""
    part = slice(first, last)
    if (invalid := float((~log.valid[part]).mean())) > MOST_INVALID:
        return LeftOut(first, last, "invalid samples", f"{100 * invalid:.0f} % of its samples are invalid: {_causes(log, first, last)}")
    if high > 0 and (slack := float((log["tension"][part] < TAUT * high).mean())) > MOST_SLACK:
        return LeftOut(first, last, "slack line", f"the line is slack for {100 * slack:.0f} % of its time")
    surfaces = [name for name in CONTROL_SURFACES if name in log]
    if surfaces and (motion := max(float(log[name][part].std()) for name in surfaces)) < LEAST_MOTION:
        return LeftOut(first, last, "no excitation", f"no control surface moves (by {np.rad2deg(motion):.2f} deg at most)")
    return None


def _causes(log: FlightLog, first: int, last: int) -> str:
    """What made samples of a range invalid, the longest first."""
    inside = {
        cause: int(np.clip(np.minimum(bounds[:, 1], last) - np.maximum(bounds[:, 0], first), 0, None).sum())
        for cause, bounds in log.causes.items()
    }
    named = sorted((cause for cause, n in inside.items() if n), key=lambda cause: -inside[cause])
    return ", ".join(named[:3]) or "unknown"
