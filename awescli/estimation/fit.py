"""The fit of parameters and segment starts to one or several flights (seed eq. 11): parameters are shared, or a flight's own."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from awescli.estimation.gauss_newton import Solution, covariance, minimise
from awescli.estimation.information import Information
from awescli.estimation.limits import limits_of
from awescli.estimation.nuisance_wind import SETTLED_WINDOW, Gusts, RecordError
from awescli.estimation.quadratic_program import Limits
from awescli.estimation.simulation_error import DIVERGED_COST, SimulationError, with_gust_noise
from awescli.notation.constraints import LinearConstraint
from awescli.notation.parameters import ParameterTable
from awescli.simulation.rollout import Simulator
from awescli.simulation.segments import Observed

SWINGS, SWING = 5, 25.0
"""How often the own unknowns are integrated out anew after a small step (its square, in standard deviations), at most: in a direction that
is hardly seen what that adds may change as fast as the cost, and the fit would swing for ever."""
FAR = 1000.0
"""After a step as large as this (its square, as above) the fit is far away, and what integrating out adds is small beside the cost."""


@dataclass(frozen=True)
class Share:
    """What one flight brings to a fit.

    simulator: holding the values of all parameters that are not fitted; observed: its segments; names: its parameters that are fitted;
    parameters, prior: its tables, to start from and to be weighed against; unknowns: what `names` are called in the fit: two flights
    share a parameter where their names for it are the same; start: an earlier fit to the same segments, to begin from.
    """

    simulator: Simulator
    observed: Observed
    gusts: RecordError
    names: tuple[str, ...]
    parameters: ParameterTable
    prior: ParameterTable
    unknowns: tuple[str, ...]
    start: "Fit | None" = None

    def table(self, rows: ParameterTable) -> ParameterTable:
        """The fitted rows of `rows` (this flight's names) under their names in the fit."""
        return ParameterTable(replace(rows[n], name=u) for n, u in zip(self.names, self.unknowns, strict=True))

    def constraints(self) -> tuple[LinearConstraint, ...]:
        """The kite's constraints in the names of the fit."""
        return tuple(c.renamed(dict(zip(self.names, self.unknowns, strict=True))) for c in self.simulator.kite.constraints)


@dataclass(frozen=True)
class Fit:
    """What a fit found about one flight: parameters (all rows, new values for the free ones), own (K, n_own) unknowns of the segments
    (starts first), solution (of all flights), information at the solution, in the order `names`.

    covariance: (n, n) of the free parameters in the order `names`, prior included; chi2: squared whitened residual per degree of freedom.
    """

    names: tuple[str, ...]
    parameters: ParameterTable
    own: np.ndarray
    solution: Solution
    information: Information
    covariance: np.ndarray
    chi2: float
    alive: np.ndarray

    @property
    def starts(self) -> np.ndarray:
        """(K, 12) fitted states at the segments' starts."""
        return self.own[:, :12]


@dataclass(frozen=True)
class JointFit:
    """What a fit found from one or several flights.

    names: all unknowns; parameters, prior: tables that hold them (and the first flight's other rows); covariance: (n, n); chi2: of all
    segments; constraints: in the names of the fit; places: per flight, where its names stand among the unknowns.
    """

    names: tuple[str, ...]
    parameters: ParameterTable
    prior: ParameterTable
    solution: Solution
    covariance: np.ndarray
    chi2: float
    constraints: tuple[LinearConstraint, ...]
    flights: tuple[Fit, ...]
    places: tuple[np.ndarray, ...]

    @property
    def known(self) -> np.ndarray:
        """(n, n) information of all segments on the unknowns, without the prior."""
        return sum(_lifted(f.information.H.sum(0), place, len(self.names)) for f, place in zip(self.flights, self.places, strict=True))

    def with_covariance(self, covariance: np.ndarray) -> "JointFit":
        """The same fit with another covariance (n, n), the flights' own included."""
        flights = tuple(
            replace(f, covariance=covariance[np.ix_(place, place)]) for f, place in zip(self.flights, self.places, strict=True)
        )
        return replace(self, covariance=covariance, flights=flights)


def _lifted(a: np.ndarray, place: np.ndarray, n: int) -> np.ndarray:
    """E'a (or E'a E): a flight's gradient or information among all n unknowns, E the selection of its own ones."""
    whole = np.zeros((n,) * a.ndim)
    whole[np.ix_(*[place] * a.ndim)] = a
    return whole


class _Problem:
    """All flights of a fit as `minimise` sees them: cost, gradient and Hessian of the unknowns, the segments' own ones eliminated.

    The own unknowns move along with every step; what a trial would make of them waits until the step is accepted. A segment that
    diverged keeps its own unknowns and has no say in the step, unless all did.
    """

    def __init__(self, shares: Sequence[Share], names: tuple[str, ...], centre: np.ndarray, precision: np.ndarray, limits: Limits):
        self.centre, self.precision, self.limits = centre, precision, limits
        self.places = tuple(np.array([names.index(u) for u in share.unknowns], dtype=int) for share in shares)
        self.errors = [SimulationError(share.simulator, share.observed, share.names, share.gusts) for share in shares]
        for error, share in zip(self.errors, shares, strict=True):
            if share.start is not None:
                start = share.parameters.vector(share.names)
                error.own, _ = error.at_best(start, share.start.own)
        self.integrals = [_Integral.of(share, error) for share, error in zip(shares, self.errors, strict=True)]
        self.x, self.integrated_at, self.swings = None, None, 0

    def _due(self, x) -> bool:
        """Is it time to integrate the own unknowns out anew: never done, or the parameters have moved by a standard deviation since?"""
        if self.integrated_at is None or any(i.unknown for i in self.integrals):
            return True
        step = x - self.x
        if float(step @ self.H @ step) > FAR:
            return False
        moved = float((x - self.integrated_at) @ self.H @ (x - self.integrated_at))
        self.swings += 1.0 < moved < SWING
        return moved > SWING or (moved > 1.0 and self.swings < SWINGS)

    def linearise(self, x):
        if due := self._due(x):
            self.integrated_at = x
        step, self.x = 0 * x if self.x is None else x - self.x, x
        found = [error.information(x[place], integrate=due) for error, place in zip(self.errors, self.places, strict=True)]
        self.information, self.alive = [i for i, _ in found], [t.alive for _, t in found]
        self.flies = [alive > e.observed.segments.steps for alive, e in zip(self.alive, self.errors, strict=True)]
        any_flies = any(f.any() for f in self.flies)
        self.heard = [f if any_flies else np.ones_like(f) for f in self.flies]
        for integral, info, place in zip(self.integrals, self.information, self.places, strict=True):
            integral.update(info, step[place])
        b, H, own_gain = self.precision * (self.centre - x), np.diag(self.precision), 0.0
        costs = [error.costs(x[place], error.own) for error, place in zip(self.errors, self.places, strict=True)]
        parts = zip(self.information, self.integrals, self.places, self.heard, self.flies, costs, strict=True)
        for info, integral, place, heard, flies, (cost, _) in parts:
            b[place] += (info.b + integral.tilt)[heard].sum(0)
            H[np.ix_(place, place)] += info.H[heard].sum(0)
            # what the own unknowns alone can still gain counts as progress too
            own_gain += float((cost - info.cost)[flies].sum())
        self.H, self.total = H, self._total(x, costs)
        return self.total, b, H, own_gain

    def move(self, step, share):
        x = self.limits.clip(self.x + share * step)
        self.moved = [error.own.copy() for error in self.errors]
        for own, info, place, flies in zip(self.moved, self.information, self.places, self.flies, strict=True):
            for k in np.flatnonzero(flies):
                own[k] += share * info.own(k, step[place])
        costs = [e.costs(x[place], own) for e, place, own in zip(self.errors, self.places, self.moved, strict=True)]
        total = self._total(x, costs)
        if total > self.total:
            # a narrow valley: the own unknowns are known so well that a straight step leaves it
            found = [e.at_best(x[place], own) for e, place, own in zip(self.errors, self.places, self.moved, strict=True)]
            self.moved = [own for own, _ in found]
            total = self._total(x, [costs for _, costs in found])
        return total

    def accept(self):
        for error, own in zip(self.errors, self.moved, strict=True):
            error.own = own

    def _total(self, x, costs) -> float:
        total = float(self.precision @ (self.centre - x) ** 2)
        parts = zip(self.errors, self.integrals, self.places, costs, self.flies, self.heard, strict=True)
        for error, integral, place, (cost, whole), flies, heard in parts:
            if (flies & ~whole).any():
                return np.inf  # a step may not lose a segment
            # segments that had diverged before are set aside at a fixed price until a new linearisation finds them flying
            total += float(cost[heard].sum()) + DIVERGED_COST * error.observed.measured[0].size * np.count_nonzero(~heard)
            total += float(integral.volume_at((x - self.x)[place])[heard].sum())
        return total


class _Integral:
    """What integrating the own unknowns of a flight out adds to its cost (volume (K,)) and its gradient (tilt (K, n)), as last known."""

    def __init__(self, volume: np.ndarray, tilt: np.ndarray):
        self.volume, self.tilt = volume, tilt

    @classmethod
    def of(cls, share: Share, error: SimulationError) -> "_Integral":
        """As the fit that is begun from has it."""
        tilt = np.zeros((len(error.own), len(share.names)))
        known = {n: i for i, n in enumerate(share.start.names)} if share.start is not None else {}
        for j, name in enumerate(share.names):
            if name in known:
                tilt[:, j] = share.start.information.tilt[:, known[name]]
        return cls(np.full(len(error.own), np.nan), tilt)

    @property
    def unknown(self) -> bool:
        return bool(np.isnan(self.volume).any())

    def volume_at(self, step: np.ndarray) -> np.ndarray:
        """(K,) the volume after a step of the parameters, to first order; 0 where none is known."""
        return np.nan_to_num(self.volume - 2 * self.tilt @ step)

    def update(self, information: Information, step: np.ndarray) -> None:
        """Take what a linearisation knows, and carry the rest along the step that led to it."""
        self.volume = np.where(np.isnan(information.volume), self.volume - 2 * self.tilt @ step, information.volume)
        self.tilt = np.where(np.isnan(information.tilt), self.tilt, information.tilt)


def fit_together(
    shares: Sequence[Share],
    *,
    prior: bool = True,
    iterations: int = 30,
    tolerance: float = 1e-2,
    on_iteration: Callable[[int, float], None] = lambda i, c: None,
) -> JointFit:
    """Fit the unknowns of all flights, and their segments' starts, to observed segments (seed eq. 11, weights from the noise), under the
    parameters' bounds and the kites' constraints. Raises BadInput where no values satisfy these.

    prior: weigh deviations from the shares' `prior` with each row's `prior_std` (maximum a posteriori).
    """
    names = tuple(dict.fromkeys(u for share in shares for u in share.unknowns))
    # who comes first decides about a shared row
    parameters, weighed = (
        getattr(shares[0], which).with_rows(row for s in reversed(shares) for row in s.table(getattr(s, which)).rows)
        for which in ("parameters", "prior")
    )
    constraints = tuple({c.text: c for share in reversed(shares) for c in share.constraints()}.values())
    limits = limits_of(parameters, names, constraints)
    stds = np.array([parameters[n].prior_std for n in names])
    precision = 1 / stds**2 if prior else np.zeros(len(names))
    problem = _Problem(shares, names, weighed.vector(names), precision, limits)
    solution = minimise(
        problem.linearise, problem.move, problem.accept, parameters.vector(names), limits,
        tolerance=tolerance, iterations=iterations, on_iteration=on_iteration,
    )  # fmt: skip
    found = parameters.with_values(dict(zip(names, solution.x, strict=True)))
    spread = covariance(solution.H, stds, limits.A[limits.equal])
    flights = tuple(_fit_of(share, problem, i, solution, spread) for i, share in enumerate(shares))
    chi2 = _chi2(problem.information, problem.flies, len(names))
    return JointFit(names, found, weighed, solution, spread, chi2, constraints, flights, problem.places)


def _fit_of(share: Share, problem: _Problem, i: int, solution: Solution, spread: np.ndarray) -> Fit:
    """One flight's part of a joint solution."""
    place, info, flies = problem.places[i], problem.information[i], problem.flies[i]
    table = share.parameters.with_values(dict(zip(share.names, solution.x[place], strict=True)))
    chi2 = _chi2([info], [flies], len(place))
    cost, integral = np.where(flies, info.cost, DIVERGED_COST * share.observed.measured[0].size), problem.integrals[i]
    info = replace(info, cost=cost, volume=integral.volume_at(np.zeros(len(place))), tilt=integral.tilt)
    return Fit(share.names, table, problem.errors[i].own, solution, info, spread[np.ix_(place, place)], chi2, problem.alive[i])


def _chi2(information: Sequence[Information], flies: Sequence[np.ndarray], n: int) -> float:
    """Residual level of the segments that fly; a lost one stands in the account at its price."""
    if not any(f.any() for f in flies):
        return DIVERGED_COST
    cost, dof = (sum(getattr(i, what)[f].sum() for i, f in zip(information, flies, strict=True)) for what in ("cost", "dof"))
    return float(cost / max(dof - n, 1))


def fit(
    simulator: Simulator,
    observed: Observed,
    parameters: ParameterTable,
    names: Sequence[str],
    *,
    gusts: RecordError,
    prior_table: ParameterTable | None = None,
    start: Fit | None = None,
    **how,
) -> Fit:
    """`fit_together` of one flight: its parameters `names`, weighed against `prior_table` (default: `parameters`)."""
    names = tuple(names)
    share = Share(simulator, observed, gusts, names, parameters, prior_table or parameters, names, start)
    return fit_together([share], **how).flights[0]


def likeliest_gusts(observed: Observed, fit: Fit, gusts: Gusts, rounds: int = 20) -> Gusts:
    """The lengths of gusts, and the level of roll gusts, under which those of a fit are likeliest (expectation-maximisation at the fit's
    linearisation)."""
    segments = observed.segments
    steps, dt = segments.steps, segments.dt
    prior = gusts.precision(steps, dt)
    factors = [factor for factor, _, _ in fit.information.back]
    whole = [np.triu(c).T @ np.triu(c) if not lower else np.tril(c) @ np.tril(c).T for c, lower in factors]
    n = len(gusts.axes)
    for _ in range(rounds):
        new = gusts.precision(steps, dt)
        moments = np.zeros((n, len(new) // n, len(new) // n))
        for M, own in zip(whole, fit.own, strict=True):
            M = M.copy()
            M[12:, 12:] += new - prior
            spread = np.linalg.inv(M)
            wind = (own + spread[:, 12:] @ ((prior - new) @ own[12:]))[12:]
            for axis in range(n):
                moments[axis] += np.outer(wind[axis::n], wind[axis::n]) + spread[12 + axis :: n, 12 + axis :: n]
        before, gusts = gusts, gusts.likeliest(moments / len(whole), steps, dt)
        if all(np.allclose(getattr(gusts, what), getattr(before, what), rtol=0.01) for what in ("stds", "length", "vertical_length")):
            break
    return gusts


def settled(simulator: Simulator, fit: Fit, gusts: RecordError, *observed: Observed) -> tuple[RecordError, list[Observed]]:
    """(nuisance wind, observations) with the lengths of gusts that a fit to the first of `observed` tells, their nodes close together, and
    the noise that these leave in its model. Both as they were in calm air; and where no air has gusts of that length: then they stand in
    for what the model lacks, and nodes close together would do so the better."""
    likeliest = likeliest_gusts(observed[0], fit, gusts) if gusts.random else gusts
    if not gusts.random or not likeliest.possible:
        return gusts, list(observed)
    gusts = replace(likeliest, window=SETTLED_WINDOW)
    found = simulator.holding(fit.parameters)
    return gusts, [with_gust_noise(found, o, gusts) for o in observed]
