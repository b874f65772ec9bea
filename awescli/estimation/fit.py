"""The fit of parameters and segment starts to one or several flights (seed eq. 11): parameters are shared, or a flight's own."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from awescli.estimation.gauss_newton import Solution, covariance, minimise
from awescli.estimation.information import Information
from awescli.estimation.limits import limits_of
from awescli.estimation.quadratic_program import Limits
from awescli.estimation.simulation_error import DIVERGED_COST, Gusts, SimulationError
from awescli.notation.constraints import LinearConstraint
from awescli.notation.parameters import ParameterTable
from awescli.simulation.rollout import Simulator
from awescli.simulation.segments import Observed


@dataclass(frozen=True)
class Share:
    """What one flight brings to a fit.

    simulator: holding the values of all parameters that are not fitted; observed: its segments; names: its parameters that are fitted;
    parameters, prior: its tables, to start from and to be weighed against; unknowns: what `names` are called in the fit: two flights
    share a parameter where their names for it are the same; own: (K, n_own) start values of the segments' unknowns, from an earlier fit.
    """

    simulator: Simulator
    observed: Observed
    gusts: Gusts
    names: tuple[str, ...]
    parameters: ParameterTable
    prior: ParameterTable
    unknowns: tuple[str, ...]
    own: np.ndarray | None = None

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
            if share.own is not None:
                error.own = share.own.copy()

    def linearise(self, x):
        self.x = x
        found = [error.information(x[place]) for error, place in zip(self.errors, self.places, strict=True)]
        self.information, self.alive = [i for i, _ in found], [t.alive for _, t in found]
        self.flies = [alive > e.observed.segments.steps for alive, e in zip(self.alive, self.errors, strict=True)]
        any_flies = any(f.any() for f in self.flies)
        self.heard = [f if any_flies else np.ones_like(f) for f in self.flies]
        b, H, own_gain = self.precision * (self.centre - x), np.diag(self.precision), 0.0
        costs = [error.costs(x[place], error.own) for error, place in zip(self.errors, self.places, strict=True)]
        for info, place, heard, flies, (cost, _) in zip(self.information, self.places, self.heard, self.flies, costs, strict=True):
            b[place] += info.b[heard].sum(0)
            H[np.ix_(place, place)] += info.H[heard].sum(0)
            # what the own unknowns alone can still gain counts as progress too
            own_gain += float((cost - info.cost)[flies].sum())
        return self._total(x, costs), b, H, own_gain

    def move(self, step, share):
        x = self.limits.clip(self.x + share * step)
        self.moved = [error.own.copy() for error in self.errors]
        for own, info, place, flies in zip(self.moved, self.information, self.places, self.flies, strict=True):
            for k in np.flatnonzero(flies):
                own[k] += share * info.own(k, step[place])
        return self._total(x, [e.costs(x[place], own) for e, place, own in zip(self.errors, self.places, self.moved, strict=True)])

    def accept(self):
        for error, own in zip(self.errors, self.moved, strict=True):
            error.own = own

    def _total(self, x, costs) -> float:
        total = float(self.precision @ (self.centre - x) ** 2)
        for error, (cost, whole), flies, heard in zip(self.errors, costs, self.flies, self.heard, strict=True):
            if (flies & ~whole).any():
                return np.inf  # a step may not lose a segment
            # segments that had diverged before are set aside at a fixed price until a new linearisation finds them flying
            total += float(cost[heard].sum()) + DIVERGED_COST * error.observed.measured[0].size * np.count_nonzero(~heard)
        return total


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
    info = replace(info, cost=np.where(flies, info.cost, DIVERGED_COST * share.observed.measured[0].size))
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
    gusts: Gusts,
    prior_table: ParameterTable | None = None,
    own: np.ndarray | None = None,
    **how,
) -> Fit:
    """`fit_together` of one flight: its parameters `names`, weighed against `prior_table` (default: `parameters`)."""
    names = tuple(names)
    share = Share(simulator, observed, gusts, names, parameters, prior_table or parameters, names, own)
    return fit_together([share], **how).flights[0]


def with_residual_noise(observed: Observed, fit: Fit, simulator: Simulator, gusts: Gusts) -> Observed:
    """The observations with each channel's noise raised to the level of its own residual, where that is larger.

    For gusty air only: gusts shorter than the windows move the kite, not only its sensors, and no window can follow them.
    """
    problem = SimulationError(simulator, observed, fit.names, gusts)
    problem.own = fit.own
    trajectories = simulator.rollout(problem.segments(fit.own), problem.values([fit.parameters[n].value for n in fit.names]))
    r = observed.residual(trajectories)
    level = np.sqrt(np.mean(r * r, axis=(0, 1)))
    return observed.with_sigma(observed.sigma * np.maximum(level, 1.0))
