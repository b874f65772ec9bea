"""The fit of parameters to segments of one or several flights (docs/equations.md (21), (23)): parameters are shared, or a
flight's own; the nuisances of every flight are integrated out."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from awescli.estimation.fitted import Fit, JointFit, Share, deviance_of
from awescli.estimation.gauss_newton import RISEN, Linearised, Solution, covariance, minimise
from awescli.estimation.information_filter import Information
from awescli.estimation.laplace import Differences, log_det_gradient
from awescli.estimation.limits import limits_of
from awescli.estimation.links import Gram
from awescli.estimation.misfit import DIVERGED_COST, Linear, Misfit, NuisanceValues
from awescli.estimation.quadratic_program import Limits
from awescli.notation.parameters import ParameterTable

UPDATES, UPDATE_DISTANCE = 5, 25.0
"""How often the log determinant is differentiated anew after a small step (its square, in standard deviations), at most: in a direction
that is hardly seen it may change as fast as the cost, and the fit would oscillate for ever."""
PROMISED = 2.0
"""Times what one step promises that all further ones together may gain: 0.3 to 1.4 times on development flights."""
FAR = 1000.0
"""After a step as large as this (its square, as above) the fit is far away, and the log determinant is small beside the cost."""
LESS = 1e-6
"""Share of a segment's squares by which rounding may miss what is left of them, once its nuisances are at their best."""
RELAXATIONS = 4
"""How many Gauss-Newton steps may bring the nuisances to their best at fixed parameters ..."""
ENOUGH = 0.5
"""... which they have reached when a step gains less than this per segment ..."""
AS_PROMISED = 0.1
"""... or ends within this cost of what it promised: what the next one would gain is about what the last one missed."""


@dataclass(frozen=True)
class _Inner:
    """Of one flight: its nuisances; what integrating them out adds to J'r (n,), and the unknowns at which that was found; how often;
    differenced: what of the slope was; taught: is it what steps have shown, as one ended higher than it had promised?"""

    own: NuisanceValues
    slope: np.ndarray
    slope_at: np.ndarray | None
    updates: int = 0
    differenced: Differences = field(default_factory=dict)
    taught: bool = False


@dataclass(frozen=True)
class _Known:
    """Of one flight at a point: what it says, linearised."""

    gram: Gram
    information: Information
    alive: np.ndarray
    flies: np.ndarray
    counted: np.ndarray
    log_det: float


@dataclass(frozen=True)
class _Problem:
    """All flights of a fit as `gauss_newton` sees them; inner unknowns: a tuple of `_Inner`.

    A segment that diverged keeps its nuisances and has no say in the step, unless all did. reach: deviance (`JointFit.deviance`) above
    which the fit is of no use.
    """

    shares: tuple[Share, ...]
    places: tuple[np.ndarray, ...]
    names: tuple[str, ...]
    prior: ParameterTable | None
    integrates: tuple[bool, ...]
    probes: int
    reach: float

    def begin(self, x: np.ndarray) -> tuple[_Inner, ...]:
        inner = []
        for share, place in zip(self.shares, self.places, strict=True):
            own = share.own or share.misfit.own()
            if share.own is not None:
                own = relaxed(share.misfit, x[place], own)
            inner.append(_Inner(own, np.zeros(len(place)), None) if share.slope is None else _Inner(own, share.slope, x, UPDATES))
        return tuple(inner)

    def linearise(self, x: np.ndarray, inner: tuple[_Inner, ...], before: Linearised | None) -> Linearised:
        linear = [s.misfit.linear(x[place], i.own) for s, i, place in zip(self.shares, inner, self.places, strict=True)]
        told = [together(s.misfit, i.own, said) for s, i, said in zip(self.shares, inner, linear, strict=True)]
        flies = [alive > s.misfit.observed.segments.steps for s, (alive, _) in zip(self.shares, told, strict=True)]
        any_flies = any(f.any() for f in flies)
        away, slope = self._deviations(x)
        b, H, cost, gain = -slope * away, np.diag(slope**2), float(away @ away), 0.0
        known = []
        each = zip(self.shares, self.places, inner, linear, told, flies, self.integrates, strict=True)
        for share, place, i, said, (alive, info), fly, integrates in each:
            misfit, gram, counted = share.misfit, said.gram, np.flatnonzero(fly)
            if not any_flies:
                counted = np.arange(len(fly))
                info = misfit.eliminated(gram, i.own, counted)
            squares = float(said.squares[counted].sum()) + misfit.prior_cost(i.own, counted)
            # what is not differentiated has no place in the merit either
            log_det = float(info.log_det.sum()) if integrates else 0.0
            known.append(_Known(gram, info, alive, fly, counted, log_det))
            cost += squares + log_det + self._lost(share, fly, counted)
            b[place] += info.b
            H[np.ix_(place, place)] += info.H
            # what the nuisances alone can still gain counts as progress too
            gain += squares - float(info.cost.sum()) if fly.any() else 0.0
        if before is None or cost <= before.cost + RISEN:
            inner = tuple(self._integrated(n, x, i, before, k) for n, (i, k) in enumerate(zip(inner, known, strict=True)))
        for place, i in zip(self.places, inner, strict=True):
            b[place] += i.slope
        return Linearised(cost, b, H, inner, gain, (x, tuple(known)))

    def trial(self, at: Linearised, x: np.ndarray, step: np.ndarray, share: float) -> tuple[float, tuple[_Inner, ...]]:
        moved = []
        for i, known, place in zip(at.inner, at.known[1], self.places, strict=True):
            # the filter's states belong to the step that it was asked for
            change = known.information.nuisances(step[place]) if len(known.counted) else None
            moved.append(i.own.moved(change, share, known.flies) if change is not None else i.own)
        cost = self._cost(at, x, moved)
        if not cost < at.cost:
            # a narrow valley: the nuisances are known so well that a straight step leaves it
            moved = [
                relaxed(s.misfit, x[place], own) if integrates else own
                for s, place, own, integrates in zip(self.shares, self.places, moved, self.integrates, strict=True)
            ]
            cost = self._cost(at, x, moved) if any(self.integrates) else cost
        return cost, tuple(replace(i, own=own) for i, own in zip(at.inner, moved, strict=True))

    def _cost(self, at: Linearised, x: np.ndarray, moved: Sequence[NuisanceValues]) -> float:
        """The cost at x and nuisances `moved`, the log determinant to first order."""
        x0, known = at.known
        total = float((self._deviations(x)[0] ** 2).sum())
        for share, place, own, k, i in zip(self.shares, self.places, moved, known, at.inner, strict=True):
            cost, whole = share.misfit.costs(x[place], own)
            if (k.flies & ~whole).any():
                return np.inf  # a step may not lose a segment
            # segments that had diverged before are set aside at a fixed price until a new linearisation finds them flying
            total += float(cost[k.counted].sum()) + share.misfit.prior_cost(own, k.counted) + self._lost(share, k.flies, k.counted)
            total += k.log_det - 2 * float(i.slope @ (x - x0)[place])
        return total

    def _deviations(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """From the prior, with their slopes; none where nothing is drawn to it."""
        return self.prior.deviations(self.names, x) if self.prior is not None else (0.0 * x, 0.0 * x)

    @staticmethod
    def _lost(share: Share, flies: np.ndarray, counted: np.ndarray) -> float:
        """The price of segments that have no say."""
        return DIVERGED_COST * share.misfit.observed.measured[0].size * (len(flies) - len(counted))

    def corrected(self, at: Linearised, there: Linearised) -> Linearised | None:
        """The same with slopes that the step has taught: what a trial does not see is how the log determinant changes."""
        x, b = there.known[0], at.b.copy()
        inner = tuple(self._taught(n, i, x, at, known) for n, (i, known) in enumerate(zip(at.inner, there.known[1], strict=True)))
        if all(new is old for new, old in zip(inner, at.inner, strict=True)):
            return None
        for place, new, old in zip(self.places, inner, at.inner, strict=True):
            b[place] += new.slope - old.slope
        return replace(at, b=b, inner=inner)

    def gives_up(self, at: Linearised, promised: float) -> bool:
        """Would the fit stay above its reach though it gained several times what a step promises?"""
        if self.reach == np.inf:
            return False
        each = zip(self.shares, at.known[1], strict=True)
        return sum(deviance_of(s.misfit, k.information, k.counted, k.flies) for s, k in each) - PROMISED * promised > self.reach

    def _taught(self, n: int, i: _Inner, x: np.ndarray, before: Linearised, known: _Known) -> _Inner:
        """Of flight n: the slope with which the log determinant changes along a step to x as it did, nothing else of it changed (Broyden's
        update, in the norm of the information). The same where x has not moved, or other segments count."""
        place, was = self.places[n], before.known[1][n]
        step, H = (x - before.known[0])[place], before.H[np.ix_(place, place)]
        size = _square(H, step)
        if not (self.integrates[n] and size > 0 and np.array_equal(known.counted, was.counted)):
            return i
        missed = -0.5 * (known.log_det - was.log_det) - float(i.slope @ step)
        return replace(i, slope=i.slope + missed / size * (H @ step), slope_at=x, taught=True)

    def _integrated(self, n: int, x: np.ndarray, i: _Inner, before: Linearised | None, known: _Known) -> _Inner:
        """Of flight n: the slope, found anew where it is due: it never was, or the parameters have moved by a standard deviation since."""
        share, place, updates = self.shares[n], self.places[n], i.updates
        if not (self.integrates[n] and len(known.counted) and len(place)):
            return i
        if before is None:
            due = share.own is not None and i.slope_at is None
        else:
            size = _square(before.H, x - before.known[0])
            if i.taught:
                return self._taught(n, i, x, before, known) if size > 1.0 else i
            distance = np.inf if i.slope_at is None else _square(before.H, x - i.slope_at)
            updates += size <= FAR and 1.0 < distance < UPDATE_DISTANCE
            due = size <= FAR and (distance > UPDATE_DISTANCE or (distance > 1.0 and updates < UPDATES))
        if not due:
            return replace(i, updates=updates)
        precision = self._deviations(x)[1][place] ** 2
        found = log_det_gradient(
            share.misfit, x[place], i.own, known.gram, known.information, known.counted, precision, self.probes, i.differenced
        )
        slope, differenced = (i.slope, i.differenced) if found is None else found
        return replace(i, slope=slope, slope_at=x, updates=updates, differenced=differenced)


def together(misfit: Misfit, own: NuisanceValues, said: Linear) -> tuple[np.ndarray, Information]:
    """((K,) samples before a segment diverged, what the others say together). One that is so sensitive to its start that rounding leaves
    less than nothing of its squares is as good as diverged."""
    alive, steps = said.alive.copy(), misfit.observed.segments.steps
    while True:
        counted = np.flatnonzero(alive > steps)
        information = misfit.eliminated(said.gram, own, counted)
        lost = ~(information.cost[counted] >= -LESS * (1 + said.squares[counted]))
        if not lost.any():
            return alive, information
        alive[counted[lost]] = steps


def _square(H: np.ndarray, step: np.ndarray) -> float:
    """Of a step (n,), in standard deviations where H (n, n) is the information."""
    return float(step @ H @ step)


def relaxed(misfit: Misfit, x: np.ndarray, own: NuisanceValues) -> NuisanceValues:
    """Nuisances moved to their best at parameters x; never worse than `own`."""
    cost, whole = misfit.costs(x, own)
    total = float(cost.sum()) + misfit.prior_cost(own, np.flatnonzero(whole))
    for _ in range(RELAXATIONS):
        said = misfit.linear(x, own, parameters=())
        flies = said.alive > misfit.observed.segments.steps
        counted = np.flatnonzero(flies)
        if not len(counted):
            return own
        information = misfit.eliminated(said.gram, own, counted)
        trial = own.moved(information.nuisances(), 1.0, flies)
        trial_cost, trial_whole = misfit.costs(x, trial)
        if (whole & ~trial_whole).any():
            return own
        trial_total = float(trial_cost.sum()) + misfit.prior_cost(trial, np.flatnonzero(trial_whole))
        if not trial_total < total:
            return own
        gain, own, total, whole = total - trial_total, trial, trial_total, trial_whole
        missed = trial_total - float(information.cost.sum())
        if gain < ENOUGH * len(whole) or (flies.all() and abs(missed) < AS_PROMISED):
            break
    return own


def fit_together(
    shares: Sequence[Share], *, prior: bool = True, iterations: int = 30, tolerance: float = 1e-2, probes: int = 2,
    reach: float = np.inf, on_iteration: Callable[[int, float], None] = lambda i, c: None,
) -> JointFit:  # fmt: skip
    """Fit the unknowns of all flights under the parameters' bounds and the kites' constraints, the nuisances integrated out. Raises
    BadInput where no values satisfy these, OutOfReach where the fit comes nowhere near a deviance of `reach`.

    prior: weigh deviations from the shares' `prior` (`ParameterTable.deviations`, maximum a posteriori); probes: of each look at the log
    determinant of the nuisances (`laplace.log_det_gradient`).
    """
    names = tuple(dict.fromkeys(u for share in shares for u in share.unknowns))
    # who comes first decides about a shared row
    parameters, weighed = (
        getattr(shares[0], which).with_rows(row for s in reversed(shares) for row in s.table(getattr(s, which)).rows)
        for which in ("parameters", "prior")
    )
    constraints = tuple({c.text: c for share in reversed(shares) for c in share.constraints()}.values())
    limits: Limits = limits_of(parameters, names, constraints)
    stds = np.array([parameters[n].prior_std for n in names])
    places = tuple(np.array([names.index(u) for u in share.unknowns], dtype=int) for share in shares)
    integrates = tuple(any(p.random for p in s.misfit.processes if any(g.level > 0 for g in p.groups)) for s in shares)
    problem = _Problem(tuple(shares), places, names, weighed if prior else None, integrates, probes, reach)
    x = parameters.vector(names)
    solution = minimise(problem, x, problem.begin(x), limits, tolerance=tolerance, iterations=iterations, on_iteration=on_iteration)
    found = parameters.with_values(dict(zip(names, solution.x, strict=True)))
    spread = covariance(solution.H, stds, limits.A[limits.equal])
    flights = tuple(_fit_of(*each, solution, spread) for each in zip(shares, places, solution.inner, solution.at.known[1], strict=True))
    costs, dof = (sum(float(getattr(f.information, w)[f.flies].sum()) for f in flights) for w in ("cost", "dof"))
    chi2 = costs / max(dof - len(names), 1) if any(f.flies.any() for f in flights) else DIVERGED_COST
    return JointFit(names, found, weighed, solution, spread, chi2, constraints, flights, places)


def _fit_of(share: Share, place: np.ndarray, inner: _Inner, known: _Known, solution: Solution, spread: np.ndarray) -> Fit:
    """One flight's part of a joint solution."""
    table = share.parameters.with_values(dict(zip(share.names, solution.x[place], strict=True)))
    flies = known.flies
    cost, dof = (float(getattr(known.information, what)[flies].sum()) for what in ("cost", "dof"))
    chi2 = cost / max(dof - len(place), 1) if flies.any() else DIVERGED_COST
    return Fit(
        table, share.misfit, inner.own, solution, known.gram, known.information, known.counted, known.alive,
        spread[np.ix_(place, place)], chi2, inner.slope,
    )  # fmt: skip


def fit(
    misfit: Misfit,
    parameters: ParameterTable,
    *,
    prior_table: ParameterTable | None = None,
    own: NuisanceValues | None = None,
    **how: Any,
) -> Fit:
    """`fit_together` of one flight, weighed against `prior_table` (default: `parameters`)."""
    return fit_together([Share(misfit, parameters, prior_table or parameters, misfit.names, own)], **how).flights[0]
