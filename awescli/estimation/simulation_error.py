"""Simulation error of re-initialised segments (seed eq. 11): parameters and segment starts that fit them together."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from awescli.estimation.gauss_newton import Solution, minimise
from awescli.estimation.information import Information, reduce
from awescli.notation.parameters import ParameterTable
from awescli.notation.quantities import STATES
from awescli.simulation.rollout import Columns, Simulator
from awescli.simulation.segments import Observed

DIVERGED_COST = 25.0
"""Cost of a sample that a diverged rollout never reached: a five-sigma error. Keeps the line search away without infinities."""


@dataclass(frozen=True)
class Gusts:
    """Nuisance wind: its error is constant over windows of `window` seconds with standard deviation `std` [m/s] per axis."""

    std: float
    window: float = np.inf

    def columns(self, steps: int, dt: float) -> tuple[tuple[str, int, int], ...]:
        if self.std <= 0:
            return ()
        length = max(1, int(round(min(self.window, steps * dt) / dt)))
        return tuple((f"gust.{axis}", a, min(a + length, steps + 1)) for a in range(0, steps, length) for axis in "ned")


@dataclass(frozen=True)
class Fit:
    """What a fit found: parameters (all rows, new values for the free ones), starts (K, 12), solution, information at the solution.

    covariance: (n, n) of the free parameters in the order `names`, prior included; chi2: squared whitened residual per degree of freedom.
    """

    names: tuple[str, ...]
    parameters: ParameterTable
    starts: np.ndarray
    solution: Solution
    information: Information
    covariance: np.ndarray
    chi2: float
    alive: np.ndarray


class SimulationError:
    """The misfit of one simulator to observed segments, as a function of parameters; starts are moved along as inner unknowns."""

    def __init__(self, simulator: Simulator, observed: Observed, names: Sequence[str], gusts: Gusts, *, estimate_starts: bool = True):
        self.simulator, self.observed, self.names, self.gusts = simulator, observed, tuple(names), gusts
        self.own_states = STATES if estimate_starts else ()
        windows = gusts.columns(observed.segments.steps, observed.segments.dt)
        self.windows = windows
        self.own_prior = np.concatenate([np.zeros(len(self.own_states)), np.full(len(windows), 1 / gusts.std**2 if windows else 0.0)])
        self.starts = observed.segments.starts.copy()

    def values(self, x) -> dict[str, float]:
        return dict(zip(self.names, x, strict=True))

    def information(self, x: np.ndarray, parameters: Sequence[str] | None = None) -> tuple[Information, object]:
        """Reduced information on `parameters` (default: the free names) at parameter values x and the present starts."""
        names = self.names if parameters is None else tuple(parameters)
        # windows come last in `Columns`; own unknowns must come first in the Gram matrix
        columns = Columns(self.own_states, names, self.windows)
        segments = self.observed.segments.starting_at(self.starts)
        trajectories, J = self.simulator.sensitivities(segments, columns, self.observed.outputs, self.values(x))
        s, g = len(self.own_states), len(names)
        J = np.concatenate([J[..., :s], J[..., s + g :], J[..., s : s + g]], axis=-1) if self.windows and g else J
        r = self.observed.residual(trajectories)
        sigma = np.where(self._reached(trajectories)[:, :, None], self.observed.sigma, np.inf)
        self.last_J_own = J[..., : s + len(self.windows)]
        return reduce(J, r, sigma, s + len(self.windows), self.own_prior), trajectories

    def _reached(self, trajectories) -> np.ndarray:
        return np.arange(self.observed.measured.shape[1])[None] < trajectories.alive[:, None]

    def penalty(self, trajectories) -> float:
        """Cost of the samples that diverged rollouts never reached."""
        missing = (~self._reached(trajectories)).sum() * len(self.observed.outputs)
        return DIVERGED_COST * float(missing)

    def cost(self, x: np.ndarray, starts: np.ndarray) -> float:
        """Cost at other parameters and starts, the nuisance wind at its best for the last linearisation."""
        trajectories = self.simulator.rollout(self.observed.segments.starting_at(starts), self.values(x))
        r = self.observed.residual(trajectories)
        total = float((r * r).sum()) + self.penalty(trajectories)
        if self.windows:
            s = len(self.own_states)
            weight = np.where(np.isfinite(self.observed.sigma), 1 / self.observed.sigma, 0.0)
            for k in range(len(r)):
                A = (self.last_J_own[k][..., s:] * weight[k][..., None]).reshape(-1, len(self.windows))
                projected = A.T @ r[k].reshape(-1)
                M = A.T @ A + np.diag(self.own_prior[s:])
                total -= float(projected @ np.linalg.solve(M, projected))
        return total


def fit(
    simulator: Simulator,
    observed: Observed,
    parameters: ParameterTable,
    names: Sequence[str],
    *,
    gusts: Gusts,
    prior: bool = True,
    prior_table: ParameterTable | None = None,
    iterations: int = 30,
    tolerance: float = 1e-2,
    estimate_starts: bool = True,
    on_iteration: Callable[[int, float], None] = lambda i, c: None,
) -> Fit:
    """Fit the free parameters `names`, and the segments' starts, to observed segments (seed eq. 11, weights from the noise).

    prior: weigh deviations from `prior_table` (default: `parameters`) with each row's `prior_std` (maximum a posteriori).
    """
    problem = SimulationError(simulator, observed, names, gusts, estimate_starts=estimate_starts)
    names = problem.names
    rows = [parameters[n] for n in names]
    x0 = np.array([r.value for r in rows])
    centre = np.array([(prior_table or parameters)[n].value for n in names])
    precision = np.array([1 / r.prior_std**2 if prior else 0.0 for r in rows])
    state = {"x": x0, "pending": None}

    def linearise(x):
        state["x"] = x
        info, trajectories = problem.information(x)
        state["info"], state["alive"] = info, trajectories.alive
        b = info.b.sum(0) + precision * (centre - x)
        H = info.H.sum(0) + np.diag(precision)
        cost = float(info.cost.sum()) + problem.penalty(trajectories) + float(precision @ (centre - x) ** 2)
        # move the starts to their best for these parameters: `own` at zero change
        state["best"] = info
        return _total(x, problem.starts), b, H if len(x) else np.zeros((0, 0)) if cost is None else H

    def _total(x, starts):
        return problem.cost(x, starts) + float(precision @ (centre - x) ** 2)

    def move(step, share):
        starts = problem.starts.copy()
        for k in range(len(starts)):
            if state["alive"][k] > observed.segments.steps:
                starts[k, : len(problem.own_states)] += share * state["info"].own(k, step)[: len(problem.own_states)]
        x = np.clip(state["x"] + share * step, [r.lower for r in rows], [r.upper for r in rows])
        state["pending"] = starts
        return _total(x, starts)

    def accept():
        problem.starts = state["pending"]

    lower, upper = np.array([r.lower for r in rows]), np.array([r.upper for r in rows])
    solution = minimise(linearise, move, accept, x0, lower, upper, tolerance=tolerance, iterations=iterations, on_iteration=on_iteration)
    info = state["info"]
    table = parameters.with_values(dict(zip(names, solution.x, strict=True)))
    covariance = np.linalg.inv(solution.H) if len(names) else np.zeros((0, 0))
    chi2 = float(info.cost.sum() / max(info.dof.sum() - len(names), 1))
    return Fit(names, table, problem.starts, solution, info, covariance, chi2, state["alive"])
