"""Constrained Gauss-Newton SQP: damped steps from a quadratic program, an exact penalty as merit, Armijo. Knows residuals, not kites.

The merit function is f + sigma |g| + tau max(0, -h) with sigma and tau above the multipliers (Nocedal & Wright, ch. 18), the Hessian J'J.
A problem is three functions (`LeastSquares`); the state of the optimiser is a value, passed through `init` and `step`.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, Protocol

import numpy as np

from awescli.estimation.quadratic_program import Limits, best_step
from awescli.notation.errors import NumericalFailure

SUFFICIENT = 0.1
"""Share of the decrease that the slope promises which a step must bring (Armijo's c)."""
SHORTER = 0.8
"""Factor between one trial of the search and the next (Armijo's beta) ..."""
FAR_SHORTER = 0.5
"""... and where a parabola through what is known has its minimum at less than this share of the trial."""
SHORTEST = 0.1
"""Below this share of a step, damping helps more than a shorter step."""
DAMPINGS = 5
"""So often is a step that does not help tried again, ten times more damped each time ..."""
SAME = 0.01
"""... but not one that damping has changed by less than this share (its square, each unknown in its standard deviation with the others
held, as it is damped: what is hardly seen together may change alone): at a kink it fails again."""
STALLED = 3
"""So many steps that together gain less than what a fit need not gain are enough: at a kink, as a dead band has one, they never end."""
RISEN = 2.0
"""Cost by which a new linearisation may be above the point before, and a minimisation end above the lowest point it has been at: a trial
does not see all of the cost."""
TAKEN_BACK = 6
"""So many steps in a row that end higher are taken back before a minimisation ends without progress."""
STRAYED = 25.0
"""Cost above the lowest point from which on a minimisation has not converged, whatever the slopes say at the end: below, both places are
one minimum, as well as the slope of what is not linear is known."""
FEASIBLE = 1e-9
"""Largest violation of a row of `Limits` that counts as none."""


@dataclass(frozen=True)
class Linearised:
    """A problem at a point. cost there; b = -dcost/dx / 2 = J'r and H = J'J, inner unknowns eliminated; inner: the inner unknowns there;
    inner_gain: what these alone would still gain; known: what the problem wants back in `trial`."""

    cost: float
    b: np.ndarray
    H: np.ndarray
    inner: Any
    inner_gain: float
    known: Any


class LeastSquares(Protocol):
    """A sum of squares over x and inner unknowns, which follow x."""

    def linearise(self, x: np.ndarray, inner: Any, before: Linearised | None) -> Linearised:
        """The problem at x and `inner`; before: at the point that the last step left."""
        ...

    def trial(self, at: Linearised, x: np.ndarray, step: np.ndarray, share: float) -> tuple[float, Any]:
        """(cost, inner unknowns) after a share of a step that leads to x, the inner unknowns moved along."""
        ...

    def corrected(self, at: Linearised, there: Linearised) -> Linearised | None:
        """The problem `at` a point once more, after a step from it to `there` has shown what a trial does not see; None where nothing is
        learnt from it."""
        ...

    def gives_up(self, at: Linearised, promised: float) -> bool:
        """Is what may be reached from a point, where a step promises to lower the cost so much, of no use?"""
        ...


class OutOfReach(Exception):
    """A minimisation was given up: it comes nowhere near what it was asked for."""


@dataclass(frozen=True)
class State:
    """x, at: where it stands; damping, multipliers (n + m,), sigma, tau: what the steps so far have taught; history: cost after every
    iteration, gains: of every step; taken_back: steps in a row that were; kkt, outcome: how it ended, "" while it goes on."""

    # where it stands
    x: np.ndarray
    at: Linearised
    # what the steps have taught
    damping: float
    multipliers: np.ndarray
    sigma: float
    tau: float
    # how it went
    history: tuple[float, ...]
    gains: tuple[float, ...]
    taken_back: int
    kkt: float
    outcome: str


@dataclass(frozen=True)
class Solution:
    """x: the minimiser; cost: the value there; H: Gauss-Newton Hessian there (prior included); inner: the inner unknowns there; at: the
    problem there; outcome: "converged", "no_progress", "iteration_limit" or "quadratic_program"; kkt: residual of the optimality
    conditions, see `step`; history: cost after every iteration.

    multipliers: (n + m,) of bounds and rows: how much the optimal cost falls per unit that an upper limit is raised (negative: that a
    lower one is raised), 0 where a limit is not active.
    """

    x: np.ndarray
    cost: float
    H: np.ndarray
    at: Linearised
    outcome: str
    kkt: float
    history: tuple[float, ...]
    multipliers: np.ndarray

    @property
    def inner(self) -> Any:
        return self.at.inner


def covariance(H: np.ndarray, scale: np.ndarray, equalities: np.ndarray | None = None) -> np.ndarray:
    """Inverse of an information matrix that may be singular, positive definite always: a direction of which H knows next to nothing,
    less than 1e-12 of the best known one in units of `scale` (n,), gets the large but finite variance of that floor.

    equalities: (m, n) rows A of constraints A x = const, which leave no variance across them.
    """
    basis = np.diag(scale)
    if equalities is not None and len(equalities):
        _, s, Vt = np.linalg.svd(equalities * scale)
        basis = basis @ Vt[np.count_nonzero(s > 1e-12 * s[0]) :].T
    values, vectors = np.linalg.eigh(basis.T @ H @ basis)
    # what is left of a model that flies nowhere may be no information at all
    floor = 1e-12 * max(values[-1], 1.0) if len(values) else 0.0
    spread = basis @ vectors
    return spread / np.maximum(values, floor) @ spread.T


def init(problem: LeastSquares, x: np.ndarray, inner: Any, limits: Limits) -> State:
    """Where a minimisation begins; x may start outside the rows of `limits`, not outside the bounds."""
    at = problem.linearise(x, inner, None)
    return State(x, at, 0.0, np.zeros(len(x) + len(limits.low)), 0.0, 0.0, (at.cost,), (), 0, np.inf, "")


def step(problem: LeastSquares, limits: Limits, state: State, tolerance: float) -> State:
    """One step, or the outcome.

    It has converged when the KKT residual at the multipliers of the quadratic program falls below `tolerance`, or below a millionth of the
    cost. It is counted in units of the cost (chi-square for whitened residuals): the gradient of the Lagrangian in the norm of H^-1, plus
    the complementarity products, plus what the inner unknowns would gain; and no row may be violated. It ends without progress where no
    step helps, or the last STALLED ones together helped by less than `tolerance`. Raises OutOfReach where the problem gives up.
    """
    x, at, damping, kkt = state.x, state.at, state.damping, state.kkt
    violation, tried, known = limits.violation(x), None, np.diag(at.H)
    for _ in range(DAMPINGS):
        try:
            d, found = best_step(at.H + damping * np.diag(known), at.b, limits, x)
        except NumericalFailure as e:
            return replace(state, kkt=kkt, outcome=e.outcome)
        if damping == 0:
            kkt = float(d @ at.H @ d + 2 * _complementarity(found, limits, x)) + at.inner_gain
            if problem.gives_up(at, kkt):
                raise OutOfReach
            if kkt < max(tolerance, 1e-6 * at.cost) and _feasible(limits, x):
                return replace(state, multipliers=found, kkt=kkt, outcome="converged")
        if len(state.gains) >= STALLED and sum(state.gains[-STALLED:]) < tolerance:
            break
        state = _above_multipliers(state, limits, found[len(x) :])
        same = tried is not None and known @ (d - tried) ** 2 <= SAME * (known @ tried**2)
        share, gain, inner = (0.0, 0.0, None) if same else _search(problem, limits, state, d, violation)
        if share:
            new = limits.clip(x + share * d)
            linearised = problem.linearise(new, inner, at)
            if linearised.cost > at.cost + RISEN and (again := problem.corrected(at, linearised)):
                back = state.taken_back + 1
                return replace(state, at=again, taken_back=back, kkt=kkt, outcome="no_progress" if back == TAKEN_BACK else "")
            return replace(
                state, x=new, at=linearised, damping=0.0 if damping < 1e-3 else damping / 10, kkt=kkt, taken_back=0,
                multipliers=state.multipliers + share * (found - state.multipliers),
                history=(*state.history, linearised.cost), gains=(*state.gains, gain),
            )  # fmt: skip
        tried, damping = tried if same else d, max(10 * damping, 1e-3)
    return replace(state, damping=damping, kkt=kkt, outcome="no_progress")


def minimise(
    problem: LeastSquares,
    x: np.ndarray,
    inner: Any,
    limits: Limits,
    *,
    tolerance: float = 1e-3,
    iterations: int = 30,
    on_iteration: Callable[[int, float], None] = lambda i, c: None,
) -> Solution:
    """Minimise a sum of squares over x in `limits`, at most so many steps. Where it has wandered off uphill, it ends where it was lowest,
    and without progress where that was far below. Raises OutOfReach where the problem gives up."""
    state = init(problem, x, inner, limits)
    lowest = state.at.cost if _feasible(limits, x) else np.inf, x, state.at.inner
    for iteration in range(iterations):
        on_iteration(iteration, state.at.cost)
        state = step(problem, limits, state, tolerance)
        if state.at.cost < lowest[0] and _feasible(limits, state.x):
            lowest = state.at.cost, state.x, state.at.inner
        if state.outcome:
            break
    if state.at.cost > lowest[0] + RISEN:
        cost, x, inner = lowest
        outcome = state.outcome if state.at.cost < cost + STRAYED else "no_progress"
        state = replace(state, x=x, at=problem.linearise(x, inner, None), outcome=outcome)
    s = state
    return Solution(s.x, float(s.at.cost), s.at.H, s.at, s.outcome or "iteration_limit", s.kkt, s.history, 2 * s.multipliers)


def _feasible(limits: Limits, x: np.ndarray) -> bool:
    return bool(limits.violation(x).max(initial=0.0) < FEASIBLE)


def _search(problem: LeastSquares, limits: Limits, state: State, d: np.ndarray, violation: np.ndarray) -> tuple[float, float, Any]:
    """(the first share of a step at which the merit has fallen enough, by how much, the inner unknowns there); 0 if there is none."""
    x, at = state.x, state.at
    here = _penalty(state, limits, violation)
    merit, slope = at.cost + here, -2 * float(at.b @ d) - 2 * at.inner_gain - here
    share = 1.0
    while share > SHORTEST:
        there = x + share * d
        cost, inner = problem.trial(at, limits.clip(there), d, share)
        rise = cost + _penalty(state, limits, limits.violation(there)) - merit
        if np.isfinite(rise) and rise < SUFFICIENT * share * slope:
            return share, -rise, inner
        lowest = -slope * share / max(2 * (rise - slope * share), 1e-300)
        share *= SHORTER if lowest > FAR_SHORTER else FAR_SHORTER
    return 0.0, 0.0, None


def _complementarity(multipliers: np.ndarray, limits: Limits, x: np.ndarray) -> float:
    """Sum of |multiplier * distance to its limit|."""
    below, above = limits.room(x)
    distance = np.where(multipliers > 0, above, below)
    return float(np.abs(multipliers[multipliers != 0] * distance[multipliers != 0]).sum())


def _above_multipliers(state: State, limits: Limits, multipliers: np.ndarray) -> State:
    """sigma and tau only grow, and stay above the multipliers (m,) of the rows (of half the cost)."""
    size, equal = 3 * np.abs(multipliers), limits.equal
    return replace(state, sigma=max(state.sigma, size[equal].max(initial=0.0)), tau=max(state.tau, size[~equal].max(initial=0.0)))


def _penalty(state: State, limits: Limits, violation: np.ndarray) -> float:
    return float(np.where(limits.equal, state.sigma, state.tau) @ violation)
