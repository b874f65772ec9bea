"""What integrating nuisances out adds to the cost where the model is not linear in them: its gradient (Laplace's approximation).

Nuisances that are many and known badly, as gusts are, pull the globals towards values under which they would matter more: a fit then
explains noise by them. What corrects that is the log determinant of their normal matrix M = C C'. With d = PROBE C^-T z and random z of
unit variance, the second difference of the gradient J'r along d is on average, by Fisher's identity, -1/2 the gradient of the log
determinant, to second order in d (Hutchinson's estimator); a change of the nuisances' own gradient is answered by the nuisances.
"""

from collections.abc import Mapping

import numpy as np

from awescli.estimation.information_filter import Information
from awescli.estimation.links import Gram
from awescli.estimation.misfit import Further, Misfit, NuisanceValues
from awescli.estimation.smoother import Nuisances

PROBE = 0.5
"""Size of the probes, in standard deviations: small enough not to lose a segment."""
UNSURE = 1.0
"""Standard error of the mean of the estimates, in standard deviations of the global, beyond which a component of the gradient is taken from
differences of the log determinant instead. So uncertain is the time constant of an actuator beside gusts that roll the kite."""
ENOUGH = 4
"""Probes from which on that is asked: two hardly say how uncertain they are. With fewer, such a component is left out."""
APART = 0.3
"""Standard deviations of the global to either side in these differences."""
MOVED = 1.0
"""Standard deviations of the global, all others unknown, by which it may move before these differences are taken anew."""
LARGEST = 0.1
"""Share of the cost by which a step along the slope alone may change it: beyond, the model is far from the flight, and this is no
correction."""
Differences = Mapping[int, tuple[float, float]]
"""Global, by its place -> (its value, -1/2 of the derivative of the log determinant there), for those that were taken from differences."""


def log_det_gradient(
    misfit: Misfit, x: np.ndarray, own: NuisanceValues, gram: Gram, info: Information, which: np.ndarray, precision: np.ndarray,
    probes: int, before: Differences | None = None,
) -> tuple[np.ndarray, Differences] | None:  # fmt: skip
    """(n,) -1/2 of the gradient of the log determinant with respect to the globals, at parameter values x and nuisances at their best:
    what is to be added to J'r; and what of it was differenced. None where a probe loses a segment. gram, info: of `misfit` there, info of
    the segments `which`; precision: (n,) of the prior; before: what was differenced elsewhere, which holds near there.

    The mean of `probes` >= 2 estimates, drawn towards zero by what their scatter says of it (James and Stein): where a model is far from
    linear in nuisances that matter little, one estimate would move parameters by several standard deviations at random. A component of
    which they leave too much uncertain is taken from differences of the log determinant.
    """
    found = estimates(misfit, x, own, gram, which, info.samples(probes, seed=0))
    if found is None:
        return None
    H = info.H + np.diag(precision)
    nothing, before = np.zeros(found.shape[1]), before or {}
    # probes far from the flight may end in numbers that are none
    if not np.isfinite(found).all():
        return nothing, before
    # nothing is asked of what H says nothing of, or is no metric of (a fit far from its minimum)
    std = np.array([1 / np.sqrt(h) if h > 0 else 0.0 for h in np.diag(H)])
    unsure = np.flatnonzero(std * found.std(axis=0, ddof=1) > UNSURE * np.sqrt(len(found)))
    found[:, unsure] = 0.0
    mean = shrunk(found, H)
    far, differenced = MOVED * np.maximum(alone(H, std), std), dict(before)
    for i in unsure.tolist() if probes >= ENOUGH else ():
        if i not in before or abs(x[i] - before[i][0]) > far[i]:
            differenced[i] = x[i], by_differences(misfit, x, own, info, which, APART * std[i] * np.eye(len(x))[i])
        mean[i] = differenced[i][1]
    small = mean @ np.linalg.solve(H, mean) < LARGEST * float(info.cost[which].sum())
    return mean if small else nothing, differenced


def alone(H: np.ndarray, std: np.ndarray) -> np.ndarray:
    """(n,) standard deviations of globals of information H (n, n), all others unknown; std: (n,) those with all others known. Zero where H
    is no metric."""
    spread = np.diag(np.linalg.pinv(H * np.outer(std, std), hermitian=True))
    return std * np.sqrt(np.maximum(spread, 0.0))


def by_differences(misfit: Misfit, x: np.ndarray, own: NuisanceValues, info: Information, which: np.ndarray, step: np.ndarray) -> float:
    """-1/2 of the derivative of the log determinant along a step (n,) of one global, the nuisances at their best on either side; 0 where
    that loses a segment, or the log determinant bends by more than it slopes."""
    either = differences(misfit, x, own, info, which, step)
    if either is None:
        return 0.0
    up, down = either.sum(axis=1)
    return -0.5 * float(up - down) / (2 * float(step.sum())) if abs(up + down) < abs(up - down) else 0.0


def differences(
    misfit: Misfit, x: np.ndarray, own: NuisanceValues, info: Information, which: np.ndarray, step: np.ndarray
) -> np.ndarray | None:  # fmt: skip
    """(2, len(which)) change of the log determinant of each segment `which`, a step (n,) of globals ahead and one behind, the nuisances at
    their best there; None where one loses a segment."""
    log_det = []
    for change in (step, -step):
        there = own.moved(info.nuisances(change), 1.0, np.isin(np.arange(len(own.path)), which))
        said = misfit.linear(x + change, there, parameters=())
        if not (said.alive[which] > misfit.observed.segments.steps).all():
            return None
        log_det.append(misfit.eliminated(said.gram, there, which).log_det[which] - info.log_det[which])
    return np.array(log_det)


def estimates(
    misfit: Misfit, x: np.ndarray, own: NuisanceValues, gram: Gram, which: np.ndarray, draws: Nuisances, extra: Further | None = None,
    columns: int = 0,
) -> np.ndarray | None:  # fmt: skip
    """(m, n) the gradient as each of m draws of the nuisances sees it; None where one loses a segment. extra, columns: further columns
    behind those of the globals (`Misfit.parts`), which `gram` has, too."""
    mask, (rest_x, rest) = np.isin(np.arange(len(gram)), which), gram.gradients()
    sides = (own.moved(draws, side * PROBE, mask, case) for case in range(draws.path.shape[-1]) for side in (1.0, -1.0))
    seen, every_x, every = misfit.gradients(x, sides, extra, columns), [], []
    for ahead, behind in zip(seen, seen, strict=True):
        if any(not (alive[which] > misfit.observed.segments.steps).all() for _, _, alive in (ahead, behind)):
            return None
        every_x.append((ahead[0] + behind[0] - 2.0 * rest_x) / (2 * PROBE**2))
        every.append((ahead[1] + behind[1] - 2.0 * rest) / (2 * PROBE**2))
    # the prior's pull is linear, and gone from second differences: processes at rest
    at_rest = NuisanceValues(own.starts, 0.0 * own.path)
    info = misfit.eliminated(gram.asked(np.stack(every_x, axis=-1), np.stack(every, axis=-1)), at_rest, which)
    return np.vstack([info.H[gram.n :, : gram.n], info.b[: gram.n]])


def shrunk(found: np.ndarray, H: np.ndarray) -> np.ndarray:
    """(n,) the mean of estimates (m, n) times 1 - (its variance) / (its square), in the norm of H^-1; zero where the
    first is no less, or H is no metric at all (a fit far from its minimum)."""
    mean = found.mean(axis=0)
    apart = found - mean
    variance = float(np.sum(apart.T * np.linalg.solve(H, apart.T))) / (len(found) * (len(found) - 1))
    square = float(mean @ np.linalg.solve(H, mean))
    return mean * (1.0 - variance / square) if 0.0 <= variance < square else 0.0 * mean
