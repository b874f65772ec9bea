"""How large an injected effect must be: such that 3 s predictions change by a given number of times their floor. Computed, not set.

What changes is the residual, measured less simulated by the declared model, from the same starts: of commands and of the kite file the
simulation changes, of a sensor the measurement. It is counted in standard deviations of the sensors' noise, as the kite file has them, in
the channel where it is largest (root mean square over all unseen 3 s).
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from injection import Kind

from awescli.flightlog.log import FlightLog
from awescli.flightlog.split import segments
from awescli.notation.angles import wrap
from awescli.notation.errors import NumericalFailure
from awescli.notation.quantities import ANGLES, OUTPUTS
from awescli.physics.declaration import KiteDeclaration
from awescli.physics.kite import Kite
from awescli.simulation.rollout import Simulator
from awescli.simulation.segments import Observed, observe

AHEAD = 3.0
"""[s]"""
ROUNDS, NEAR = 12, 0.02
"""Steps towards a size, and the relative distance from the wanted change that will do."""
TOWARDS = 4.0
"""Times by which a size changes in one step at most: the change is not linear in a dead band or an effectiveness."""


@dataclass(frozen=True)
class Residual:
    """error: (K, N+1, n) measured less simulated; alive: (K, N+1) before divergence; observed: of it."""

    error: np.ndarray
    alive: np.ndarray
    observed: Observed


def residual(
    log: FlightLog, kite: KiteDeclaration, first: np.ndarray, starts: np.ndarray | None = None, extra: Sequence[str] = (),
    values: Mapping[str, float] | None = None,
) -> Residual:  # fmt: skip
    """Of the declared kite over `AHEAD` from the samples `first`; starts: (K, 12) where not the measured ones; extra, values: effects
    beside the declared ones, and their parameters."""
    simulator = Simulator(Kite(kite, log.wind.height, extra), ())
    observed = observe(log, simulator.kite, first, int(round(AHEAD / log.dt)), tuple(log.measured))
    cut = observed.segments if starts is None else observed.segments.starting_at(starts)
    flown = simulator.rollout(cut, values)
    error = observed.measured - flown.outputs[:, :, [OUTPUTS.index(n) for n in observed.outputs]]
    alive = np.arange(error.shape[1])[None] < flown.alive[:, None]
    return Residual(error, alive, observed)


def change(before: Residual, after: Residual) -> dict[str, float]:
    """Channel -> root mean square of what a residual changed by, in standard deviations of the channel's noise."""
    both = before.alive & after.alive
    found = {}
    for i, name in enumerate(before.observed.outputs):
        d, sigma = after.error[..., i] - before.error[..., i], before.observed.sigma[..., i]
        d = wrap(d) if name in ANGLES else d
        seen = both & np.isfinite(sigma)
        found[name] = float(np.sqrt(np.mean((d[seen] / sigma[seen]) ** 2))) if seen.any() else 0.0
    return found


def starts_in(log: FlightLog, ranges) -> np.ndarray:
    """Samples from which `AHEAD` can be predicted in the sample `ranges`, one after the other."""
    steps = int(round(AHEAD / log.dt))
    return segments(ranges, steps, stride=steps, valid=log.valid)


def sized(kind: Kind, log: FlightLog, kite: KiteDeclaration, ranges, floors: float) -> tuple[float, float]:
    """(value to put in, change that it makes in floors). The two agree with what was asked unless the value ends at a limit of its kind.
    Raises NumericalFailure("unmoved") where the injection changes nothing."""
    first = starts_in(log, ranges)
    before = residual(log, kite, first)
    starts = before.observed.segments.starts
    strength, reached, low, high = 1.0, 0.0, 0.0, np.inf
    for _ in range(ROUNDS):
        value = kind.at(strength)
        reached = max(change(before, residual(*kind.inject(log, kite, value), first, starts)).values())
        if reached == 0.0:
            raise NumericalFailure("unmoved", f"a {kind.parameter} of {value:g} changes no prediction of flight '{log.name}'")
        if abs(reached / floors - 1) < NEAR:
            break
        strength = kind.strength(value)
        low, high = (strength, high) if reached < floors else (low, strength)
        strength *= float(np.clip(floors / reached, 1 / TOWARDS, TOWARDS))
        if not low < strength < high:
            # the change is not linear, and the next step would lead back to where it has been
            strength = (low + high) / 2
        if kind.at(strength) == value:
            break
    return value, reached
