"""From a flight to an untrained correction: what its inputs range over, and how large its outputs may have to be."""

from collections.abc import Iterable, Mapping, Sequence

import numpy as np
from scipy.ndimage import uniform_filter1d

from awescli.flightlog.log import FlightLog
from awescli.flightlog.smoothing import local_quadratic
from awescli.flightlog.split import Range
from awescli.learning.correction import ROWS, Correction, initial_weights
from awescli.learning.network_inputs import check_inputs, inputs_of_instant
from awescli.notation.errors import BadInput
from awescli.notation.quantities import STATES
from awescli.physics.instant import Instant
from awescli.physics.kite import Kite
from awescli.simulation.rollout import inputs_of, setpoints_of
from awescli.simulation.segments import SMOOTHING, smooth_states

MARGIN = 0.2
"""Share by which the box is wider than the training range on either side: a range seen in a minute is not the whole range."""
DRIFT = 0.1
"""An input that lies outside its box on more than this share of the validation samples is not used."""
TIME = 0.9
"""An input whose rank correlation with time is larger tells the time."""
SLOW = 0.5
"""[s] the residual acceleration is averaged over this before its size is taken: what is faster is mostly differentiated noise."""
EVERYWHERE = 1e9
"""Width of the edge of a box that has none: within ten ranges of it exp(-e^2) is 1 to the last bit."""
SMALLEST = (1e-3, 1e-3, 1e-3, 1e-3, 1e-3, 1e-3)
"""[m/s2, rad/s2] least scale of an output: a model without any residual must not divide by it."""


def instants(
    log: FlightLog, kite: Kite, values: Mapping[str, float] | None = None
) -> tuple[Instant, list[np.ndarray], list[np.ndarray], list[float]]:
    """The instant of the physics at every sample of the log (arrays (N,) instead of numbers), at smoothed measured states.

    values: parameters that differ from the kite's, within their bounds or not.
    """
    U, SP, Z = inputs_of(log, kite).T, setpoints_of(log).T, smooth_states(log).T
    own_values = dict(zip(kite.parameter_names, kite.parameters.vector(), strict=True)) | dict(values or {})
    c = [float(own_values[n]) for n in kite.parameter_names]
    own = len(kite.state_names) - 12
    x = [*Z, *(np.zeros(len(log)) for _ in range(own)), *SP]
    x[12 : 12 + own] = kite.initial(x, list(U), c)
    return kite.instant(x, list(U), c), x, list(U), c


def samples_of(ranges: Iterable[tuple[int, int]], valid: np.ndarray) -> np.ndarray:
    """(N,) bool: valid samples inside the half-open ranges."""
    inside = np.zeros(len(valid), bool)
    for first, last in ranges:
        inside[first:last] = True
    return inside & valid


def input_signals(log: FlightLog, kite: Kite, names: Sequence[str]) -> np.ndarray:
    """(N, n) network inputs along the log."""
    at, *_ = instants(log, kite)
    return np.stack([np.broadcast_to(np.asarray(v, dtype=float), (len(log),)) for v in inputs_of_instant(names)(at)], axis=1)


def residual_acceleration(log: FlightLog, kite: Kite) -> np.ndarray:
    """(N, 6) measured less modelled derivatives of (u, v, w, p, q, r), by a local quadratic through the measured states."""
    at, *_ = instants(log, kite)
    measured = local_quadratic(np.stack([log[STATES[r]] for r in ROWS], axis=1), log.dt, SMOOTHING, derivative=1)
    modelled = np.stack([np.broadcast_to(np.asarray(at.derivative[r], dtype=float), (len(log),)) for r in ROWS], axis=1)
    return measured - modelled


def drifting(log: FlightLog, kite: Kite, names: Sequence[str], train: Sequence[Range], validation: Sequence[Range]) -> tuple[str, ...]:
    """Inputs that leave their training range on the validation flight, or run through the known flight as time does.

    Kept, the first would be extrapolated, or let the correction fade everywhere but in training. The others (a line that only gets longer)
    tell the time and nothing else, also where validation lies between training loops: a network would learn the wind of the day from them.
    """
    use, other = (np.flatnonzero(samples_of(ranges, log.valid)) for ranges in (train, validation))
    if not (use.size and other.size):
        return ()
    signals = input_signals(log, kite, names)
    low, high = signals[use].min(0), signals[use].max(0)
    room = MARGIN * (high - low) + 1e-9 * np.abs(high)
    outside = ((signals[other] < low - room) | (signals[other] > high + room)).mean(0)
    order = _order_in_time(signals[np.sort(np.concatenate([use, other]))])
    return tuple(n for n, share, r in zip(names, outside, order, strict=True) if share > DRIFT or abs(r) > TIME)


def _order_in_time(signals: np.ndarray) -> np.ndarray:
    """(n,) Spearman's rank correlation of signals (N, n) with time; 0 for one that never changes."""
    rank = np.argsort(np.argsort(signals, axis=0, kind="stable"), axis=0) - (len(signals) - 1) / 2
    time = np.arange(len(signals)) - (len(signals) - 1) / 2
    return np.where(np.ptp(signals, axis=0) > 0, time @ rank / (time @ time), 0.0)


def untrained(
    log: FlightLog, kite: Kite, ranges: Sequence[Range], names: Sequence[str], hidden: Sequence[int], seed: int, 
    validation: Sequence[Range] = (), scaling: str = "standard",
    fade: bool = True,
) -> Correction:  # fmt: skip
    """A null correction normalised on the training ranges; inputs that never change there are left out.

    validation: ranges on which the correction will be proved: the box in which it may act spans them too. scaling: standard: inputs by
    their mean and standard deviation; minmax: from -1 to 1 over the training ranges. fade: without it the correction acts everywhere.
    """
    check_inputs(names)
    use = samples_of(ranges, log.valid)
    if use.sum() < 50:
        raise BadInput(f"only {int(use.sum())} valid training samples", do="Train on a longer flight, or enlarge split.train.")
    signals = input_signals(log, kite, names)[use]
    mean, deviation = signals.mean(0), signals.std(0)
    moving = deviation > 1e-6 * np.maximum(1e-3, np.abs(signals).max(0))
    if not moving.any():
        raise BadInput("no network input changes on the training samples", do="Choose other inputs.")
    names = tuple(n for n, m in zip(names, moving, strict=True) if m)
    signals, mean, deviation = signals[:, moving], mean[moving], deviation[moving]
    if scaling == "minmax":
        mean, deviation = (signals.max(0) + signals.min(0)) / 2, np.ptp(signals, axis=0) / 2
    known = (input_signals(log, kite, names)[samples_of((*ranges, *validation), log.valid)] - mean) / deviation
    middle, half = (known.max(0) + known.min(0)) / 2, (known.max(0) - known.min(0)) / 2 * (1 + 2 * MARGIN)
    slow = uniform_filter1d(residual_acceleration(log, kite), max(1, int(round(SLOW / log.dt))), axis=0)
    scale = np.maximum(np.sqrt((slow[use] ** 2).mean(0)), SMALLEST)
    hidden = tuple(int(h) for h in hidden)
    weights = initial_weights((len(names), *hidden, len(ROWS)), seed)
    return Correction(names, hidden, weights, mean, deviation, middle, half, scale, **({} if fade else {"width": EVERYWHERE}))


def outside_share(log: FlightLog, kite: Kite, correction: Correction, ranges: Sequence[Range]) -> float:
    """Share of samples in the ranges at which the correction has faded below one half."""
    use = samples_of(ranges, log.valid)
    z = (input_signals(log, kite, correction.inputs)[use] - correction.mean) / correction.deviation
    e = np.maximum(np.abs(z - correction.middle) / correction.half - 1, 0) / correction.width
    return float((np.exp(-(e * e).sum(1)) < 0.5).mean()) if use.any() else 0.0
