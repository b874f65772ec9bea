"""Samples for a controller fit: which surfaces move, the states as measured and as smoothed, and which loop each sample is in."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.signal import savgol_filter

from awescli.control.features import FEATURES, evaluate
from awescli.control.law import state_mapping
from awescli.control.pattern import Pattern
from awescli.controller_fit.centres import thin
from awescli.controller_fit.pattern import fit_pattern, loop_numbers
from awescli.flightlog.log import FlightLog
from awescli.notation.errors import BadInput
from awescli.notation.quantities import SURFACES

SMOOTHED = ("p_n", "p_e", "p_d", "v_n", "v_e", "v_d", "phi", "theta", "psi", "p", "q", "r")


BLOCK = 4.0
"""[s] a block of a flight without loops: longer than what one gust or manoeuvre correlates over."""


LEAST = 50
"""Valid training samples, as many as a network is trained on at least: five seconds at 10 Hz."""
SLIVER = 0.1
"""Share of the longest loop below which a part's piece of a loop is none."""


@dataclass(frozen=True)
class Samples:
    """One flight as a regression problem.

    measured, smoothed: z mappings, each value (N,); set_points: (N, S) [rad]; surfaces: the S that move; constants: the rest;
    loop: (N,) int; train, validation, test: (N,) bool, disjoint, valid samples only; dt: [s]; pattern: from the train samples;
    looping: whether loop numbers loops, or blocks of time of a flight that does not circle.
    """

    measured: dict
    smoothed: dict
    set_points: np.ndarray
    surfaces: tuple[str, ...]
    constants: dict
    loop: np.ndarray
    train: np.ndarray
    validation: np.ndarray
    test: np.ndarray
    dt: float
    pattern: Pattern
    looping: bool


def smooth_states(log: FlightLog, window_s: float) -> FlightLog:
    """The log with white sensor noise smoothed out of its states: a cubic Savitzky-Golay filter, run by run of valid samples.

    A law fitted to noisy states is an errors-in-variables problem: its gains shrink, its fit bends to the noise. The controller saw the
    true states, and a loop takes seconds, so a cubic over `window_s` keeps the flight and drops most of the noise.
    """
    points = int(window_s / log.dt) // 2 * 2 + 1
    measured = dict(log.measured)
    edges = np.flatnonzero(np.diff(np.concatenate([[0], log.valid.astype(int), [0]])))
    for name in SMOOTHED:
        signal = np.unwrap(measured[name]) if name in ("phi", "theta", "psi") else measured[name].copy()
        for first, last in zip(edges[::2], edges[1::2], strict=True):
            if last - first > points > 3:
                signal[first:last] = savgol_filter(signal[first:last], points, 3)
        measured[name] = signal
    return replace(log, measured=measured)


def mask_of(ranges: Sequence[tuple[int, int]], valid: np.ndarray, what: str) -> np.ndarray:
    """(N,) bool of the valid samples in `ranges`, a list of (first, last) sample numbers, last excluded."""
    mask = np.zeros(valid.shape[0], dtype=bool)
    for first, last in ranges:
        if not 0 <= first < last <= valid.shape[0]:
            raise BadInput(f"the {what} range {first}..{last} is not inside the flight's {valid.shape[0]} samples")
        mask[first:last] = True
    return mask & valid


def moving_surfaces(
    log: FlightLog, train: np.ndarray, wanted: Sequence[str] | None, least: float
) -> tuple[tuple[str, ...], dict[str, float]]:
    """(surfaces whose set-point moves by more than `least` rad in the train samples, the others with their constant)."""
    logged = [name for name in SURFACES if name in log.inputs]
    span = {name: float(np.ptp(log.inputs[name][train])) for name in logged}
    for name in wanted or ():
        if name not in span:
            raise BadInput(f"flight '{log.name}' logs no set-point of '{name}'", do=f"It logs: {', '.join(logged) or 'none'}.")
        if span[name] <= least:
            raise BadInput(
                f"surface '{name}' never moves in the training part of '{log.name}'", do="Drop it from the list: it is kept as a constant."
            )
    moving = tuple(wanted or (name for name in logged if span[name] > least))
    if not moving:
        raise BadInput(
            f"no surface moves in the training part of flight '{log.name}'",
            do=f"A controller cannot be identified: check the columns of the set-points ({', '.join(logged) or 'none found'}).",
        )
    return moving, {name: float(np.median(log.inputs[name][train])) for name in logged if name not in moving}


def gather(
    log: FlightLog,
    train_ranges: Sequence[tuple[int, int]],
    validation_ranges: Sequence[tuple[int, int]],
    surfaces: Sequence[str] | None = None,
    smooth_window_s: float = 0.3,
    least_motion: float = 1e-4,
) -> Samples:
    """The samples of a log; what is neither train nor validation is test."""
    train, validation = mask_of(train_ranges, log.valid, "training"), mask_of(validation_ranges, log.valid, "validation")
    if (train & validation).any():
        raise BadInput("training and validation ranges overlap", do="Give each sample to one of them.")
    if train.sum() < LEAST:
        raise BadInput(f"only {train.sum()} valid training samples", do="Give a longer training range.")
    moving, constants = moving_surfaces(log, train, surfaces, least_motion)
    measured = state_mapping(log)
    smoothed = state_mapping(smooth_states(log, smooth_window_s)) if smooth_window_s > 0 else measured
    pattern = fit_pattern(smoothed, train)
    loops = loop_numbers(smoothed, pattern)
    looping = bool(np.unique(loops[train]).size > 2)
    return Samples(
        measured, smoothed, np.stack([log.inputs[s] for s in moving], axis=1), moving, constants,
        loops if looping else (np.arange(loops.size) * log.dt // BLOCK).astype(int),
        train, validation, log.valid & ~train & ~validation, log.dt, pattern, looping,
    )  # fmt: skip


def loops_flown(samples: Samples) -> int:
    """Loops in the train part but for slivers: a thinned flight may hold nothing of one."""
    held = np.unique(samples.loop[samples.train], return_counts=True)[1]
    return int((held >= SLIVER * held.max(initial=0)).sum())


def in_blocks(samples: Samples, blocks: int) -> Samples:
    """The samples with blocks of time in the place of loops, so many of equal length in the train part: for a flight with fewer loops than
    folds. Neighbouring blocks are not as independent as loops are."""
    rows = np.flatnonzero(samples.train)
    edges = rows[np.arange(1, blocks) * rows.size // blocks]
    return replace(samples, loop=np.searchsorted(edges, np.arange(samples.loop.size), side="right"))


def answered(samples: Samples, delay_steps: int, fastest: dict[str, float]) -> Samples:
    """The samples with each state beside the set-point that answers it, `delay_steps` later; without those where a set-point moved at its
    limit `fastest` (surface -> rad/s), which do not show what the law asked for. Test samples stay: they are scored, limiter included."""
    if not delay_steps and not fastest:
        return samples
    n, U = samples.loop.size, samples.set_points
    later = np.minimum(np.arange(n) + delay_steps, n - 1)
    rates = np.abs(np.diff(U, axis=0, prepend=U[:1])) / samples.dt
    free = np.ones(n, dtype=bool)
    for surface, limit in fastest.items():
        free &= rates[:, samples.surfaces.index(surface)] < 0.999 * limit
    own = np.arange(n) + delay_steps < n
    masks = {name: getattr(samples, name) & getattr(samples, name)[later] & own for name in ("train", "validation", "test")}
    masks |= {name: masks[name] & free[later] for name in ("train", "validation")}
    return replace(samples, set_points=U[later], **masks)


def thinned(samples: Samples, most: int) -> Samples:
    """At most `most` train and `most` / 2 validation samples, evenly thinned: what a quick trial needs of a long flight."""
    train, validation = (thin(np.flatnonzero(m), k) for m, k in ((samples.train, most), (samples.validation, most // 2)))
    rows = np.sort(np.concatenate([train, validation]))
    masks = {name: getattr(samples, name)[rows] for name in ("train", "validation", "test")}
    z = {name: samples_at(getattr(samples, name), rows) for name in ("measured", "smoothed")}
    return replace(samples, set_points=samples.set_points[rows], loop=samples.loop[rows], **masks, **z)


def samples_at(z: dict, rows: np.ndarray) -> dict:
    """z at some samples; what is constant over the flight stays a number."""
    return {name: signal[rows] if np.ndim(signal) else signal for name, signal in z.items()}


def available(samples: Samples, names: Sequence[str]) -> tuple[tuple[str, ...], list[str]]:
    """(features that can be evaluated and vary, notes on the dropped ones)."""
    kept, notes = [], []
    for name in names:
        lacking = [key for key in FEATURES[name].needs if key not in samples.smoothed]
        if lacking:
            notes.append(f"feature '{name}' dropped: the log has no {', '.join(lacking)}")
            continue
        column = evaluate((name,), samples.smoothed, samples.pattern)[0]
        column = np.broadcast_to(column, samples.train.shape)[samples.train]
        if np.std(column) <= 1e-9 * (1.0 + np.abs(column).max()):
            notes.append(f"feature '{name}' dropped: constant ({column[0]:.4g}) in the training part")
        else:
            kept.append(name)
    if not kept:
        raise BadInput("no feature is left: all are constant or missing", do="Choose other features. " + "; ".join(notes))
    return tuple(kept), notes


def feature_matrix(
    z: Mapping[str, np.ndarray], names: Sequence[str], pattern: Pattern, centre: Sequence[float], scale: Sequence[float]
) -> np.ndarray:
    """Standardised features (N, F)."""
    n = z["p_n"].shape[0]
    columns = evaluate(names, z, pattern)
    return np.stack([(np.broadcast_to(c, n) - m) / s for c, m, s in zip(columns, centre, scale, strict=True)], axis=1)


def standardisation(
    z: Mapping[str, np.ndarray], names: Sequence[str], pattern: Pattern, keep: np.ndarray
) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """(mean, standard deviation) of each feature over the samples `keep`."""
    columns = [np.broadcast_to(c, keep.shape)[keep] for c in evaluate(names, z, pattern)]
    return tuple(float(c.mean()) for c in columns), tuple(float(c.std()) for c in columns)


def loop_folds(loop: np.ndarray, folds: int) -> np.ndarray:
    """Fold number (N,) of each sample: neighbouring loops stay together, so that a fold is flight the fit has not seen."""
    present = np.unique(loop)
    if present.size < folds:
        raise BadInput(
            f"{present.size} loops in the training part, fewer than {folds} folds",
            do=f"Set folds to at most {present.size}, or give a longer training range.",
        )
    return (np.searchsorted(present, loop) * folds) // present.size
