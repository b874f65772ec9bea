"""Simulation error of re-initialised segments (seed eq. 11): parameters and segment starts that fit them together."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import block_diag

from awescli.estimation.gauss_newton import Solution, covariance, minimise
from awescli.estimation.gust_level import within_window
from awescli.estimation.information import Information, reduce
from awescli.estimation.limits import limits_of
from awescli.notation.constraints import LinearConstraint
from awescli.notation.parameters import ParameterTable
from awescli.notation.quantities import STATES
from awescli.simulation.rollout import Columns, Simulator
from awescli.simulation.segments import Observed

DIVERGED_COST = 25.0
"""Cost of a sample that a diverged rollout never reached: a five-sigma error. Keeps the line search away without infinities."""


@dataclass(frozen=True)
class Gusts:
    """Nuisance wind: what the recorded wind leaves out, per axis with standard deviation `std` [m/s].

    Constant over windows of `window` seconds; windows are correlated as exp(-|dt| / memory) (Dryden: memory = L / V_a).
    window = inf: one constant error of the recorded wind per segment.
    """

    std: float
    window: float = np.inf
    memory: float = 3.0

    def columns(self, steps: int, dt: float) -> tuple[tuple[str, int, int], ...]:
        """(parameter, first step, last step) of every window and axis."""
        if self.std <= 0:
            return ()
        length = max(1, int(round(min(self.window, steps * dt) / dt)))
        # the last window holds the last sample too
        last = lambda a: a + length if a + length < steps else steps + 1  # noqa: E731
        return tuple((f"gust.{axis}", a, last(a)) for a in range(0, steps, length) for axis in "ned")

    def precision(self, steps: int, dt: float) -> np.ndarray:
        """Prior precision of the windows, in the order of `columns`."""
        columns = self.columns(steps, dt)
        if not columns:
            return np.zeros((0, 0))
        start = np.array([a for _, a, _ in columns[::3]]) * dt
        correlation = np.exp(-np.abs(start[:, None] - start) / self.memory)
        return np.kron(np.linalg.inv(correlation), np.eye(3)) / self.std**2


@dataclass(frozen=True)
class Fit:
    """What a fit found: parameters (all rows, new values for the free ones), own (K, n_own) unknowns of the segments (starts first),
    solution, information at the solution.

    constraints: the kite's, kept by the fit where they name one of `names`;
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
    constraints: tuple[LinearConstraint, ...] = ()

    @property
    def starts(self) -> np.ndarray:
        """(K, 12) fitted states at the segments' starts."""
        return self.own[:, :12]


def with_gust_noise(simulator: Simulator, observed: Observed, gusts: Gusts, values=None) -> Observed:
    """The observations with the noise of what gusts do inside a window added to their own.

    Inside a window the wind is not constant; what is left shows at once in tension, accelerations and airspeed, through the
    direct dependence of each output on the wind, taken where a window begins.
    """
    rest = within_window(gusts.std, gusts.window, gusts.memory)
    windows = gusts.columns(observed.segments.steps, observed.segments.dt)
    _, J = simulator.sensitivities(observed.segments, Columns((), (), windows), observed.outputs, values)
    starts = np.array([first for _, first, _ in windows])
    direct = J[:, starts, :, np.arange(len(windows))]
    variance = rest**2 * np.mean(direct**2, axis=(0, 1)) * 3
    return observed.with_sigma(np.sqrt(observed.sigma**2 + variance))


def with_residual_noise(observed: Observed, fit: "Fit", simulator: Simulator, gusts: Gusts) -> Observed:
    """The observations with each channel's noise raised to the level of its own residual, where that is larger.

    For gusty air only: gusts shorter than the windows move the kite, not only its sensors, and no window can follow them.
    """
    problem = SimulationError(simulator, observed, fit.names, gusts)
    problem.own = fit.own
    trajectories = simulator.rollout(problem.segments(fit.own), problem.values([fit.parameters[n].value for n in fit.names]))
    r = observed.residual(trajectories)
    level = np.sqrt(np.mean(r * r, axis=(0, 1)))
    return observed.with_sigma(observed.sigma * np.maximum(level, 1.0))


class SimulationError:
    """The misfit of one simulator to observed segments, as a function of parameters and of the segments' own unknowns.

    own: (K, n_own) the segments' unknowns: start (12 states), then the nuisance wind in its windows.
    """

    def __init__(self, simulator: Simulator, observed: Observed, names: Sequence[str], gusts: Gusts):
        self.simulator, self.observed, self.names = simulator, observed, tuple(names)
        segments = observed.segments
        self.windows = gusts.columns(segments.steps, segments.dt)
        self.own_prior = block_diag(np.zeros((12, 12)), gusts.precision(segments.steps, segments.dt))
        self.own = np.concatenate([segments.starts, np.zeros((len(segments), len(self.windows)))], axis=1)
        first = simulator.kite.input_names.index("gust_n")
        self._gust_inputs = slice(first, first + 3)

    @property
    def starts(self) -> np.ndarray:
        return self.own[:, :12]

    def values(self, x) -> dict[str, float]:
        return dict(zip(self.names, x, strict=True))

    def segments(self, own: np.ndarray):
        """The segments from their own starts, in their own wind."""
        segments = self.observed.segments.starting_at(own[:, :12])
        if not self.windows:
            return segments
        wind = np.zeros((len(own), segments.steps + 1, 3))
        for i, (_, first, last) in enumerate(self.windows):
            wind[:, first:last, i % 3] = own[:, None, 12 + i]
        return segments.with_inputs(self._gust_inputs, wind)

    def information(self, x: np.ndarray, parameters: Sequence[str] | None = None, extra: np.ndarray | None = None, values=None):
        """(Information, Trajectories) on `parameters` (default: the free names) at parameter values x and the present own unknowns.

        extra: (K, N+1, n_out, n) further columns (secants) behind those of the parameters; values: further parameter values.
        """
        names = self.names if parameters is None else tuple(parameters)
        # windows come last in `Columns`; own unknowns must come first in the Gram matrix
        columns = Columns(STATES, names, self.windows)
        trajectories, J = self.simulator.sensitivities(
            self.segments(self.own), columns, self.observed.outputs, {**self.values(x), **(values or {})}
        )
        s, g = len(STATES), len(names)
        w = len(self.windows)
        if extra is not None:
            J = np.concatenate([J, extra], axis=-1)
        order = np.r_[:s, s + g : s + g + w, s : s + g, s + g + w : J.shape[-1]]
        r = self.observed.residual(trajectories)
        sigma = np.where(self._reached(trajectories)[:, :, None], self.observed.sigma, np.inf)
        information = reduce(J, r, sigma, s + w, self.own_prior, self.own, order)
        return information, trajectories

    def _reached(self, trajectories) -> np.ndarray:
        return np.arange(self.observed.measured.shape[1])[None] < trajectories.alive[:, None]

    def costs(self, x: np.ndarray, own: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(cost, whole), each (K,), at other parameters and own unknowns: whitened squares and the prior of the own wind; whole: the
        segment did not diverge. One that did is charged DIVERGED_COST per sample that it missed, and at most that for the others."""
        trajectories = self.simulator.rollout(self.segments(own), self.values(x))
        r = self.observed.residual(trajectories)
        reached = self._reached(trajectories)
        whole = reached.all(axis=1)
        squares, limit = (r * r).sum(axis=2), DIVERGED_COST * len(self.observed.outputs)
        squares[~whole] = np.where(reached[~whole], np.minimum(squares[~whole], limit), limit)
        return squares.sum(axis=1) + np.einsum("ki,ij,kj->k", own, self.own_prior, own), whole


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
    own: np.ndarray | None = None,
    on_iteration: Callable[[int, float], None] = lambda i, c: None,
) -> Fit:
    """Fit the free parameters `names`, and the segments' starts, to observed segments (seed eq. 11, weights from the noise), under
    the parameters' bounds and the kite's constraints. Raises BadInput where no values satisfy these.

    own: (K, n_own) start values of the segments' unknowns, from an earlier fit of the same segments.
    prior: weigh deviations from `prior_table` (default: `parameters`) with each row's `prior_std` (maximum a posteriori).
    """
    problem = SimulationError(simulator, observed, names, gusts)
    names = problem.names
    rows = [parameters[n] for n in names]
    x0 = np.array([r.value for r in rows])
    limits = limits_of(parameters, names, simulator.kite.constraints)
    centre = np.array([(prior_table or parameters)[n].value for n in names])
    precision = np.array([1 / r.prior_std**2 if prior else 0.0 for r in rows])
    if own is not None:
        problem.own = own.copy()
    # the own unknowns move along with every step; what a trial would make of them waits until the step is accepted
    here: dict = {}

    def total(x, own):
        cost, whole = problem.costs(x, own)
        if (here["flies"] & ~whole).any():
            return np.inf  # a step may not lose a segment
        # segments that had diverged before are set aside at a fixed price until a new linearisation finds them flying
        aside = DIVERGED_COST * observed.measured[0].size * np.count_nonzero(~here["heard"])
        return float(cost[here["heard"]].sum() + aside + precision @ (centre - x) ** 2)

    def linearise(x):
        info, trajectories = problem.information(x)
        # a segment that diverged keeps its own unknowns and has no say in the step, unless all did
        flies = trajectories.alive > observed.segments.steps
        heard = flies if flies.any() else np.ones_like(flies)
        here.update(x=x, info=info, alive=trajectories.alive, flies=flies, heard=heard)
        b = info.b[heard].sum(0) + precision * (centre - x)
        # what the own unknowns alone can still gain counts as progress too
        own_gain = float((problem.costs(x, problem.own)[0] - info.cost)[flies].sum())
        return total(x, problem.own), b, info.H[heard].sum(0) + np.diag(precision), own_gain

    def move(step, share):
        moved = problem.own.copy()
        for k in np.flatnonzero(here["flies"]):
            moved[k] += share * here["info"].own(k, step)
        here["moved"] = moved
        return total(limits.clip(here["x"] + share * step), moved)

    def accept():
        problem.own = here["moved"]

    solution = minimise(linearise, move, accept, x0, limits, tolerance=tolerance, iterations=iterations, on_iteration=on_iteration)
    info = here["info"]
    table = parameters.with_values(dict(zip(names, solution.x, strict=True)))
    spread = covariance(solution.H, np.array([r.prior_std for r in rows]), limits.A[limits.equal])
    # the level of the residual is that of the segments that fly; a lost one stands in the account at its price
    flies = here["flies"]
    chi2 = float(info.cost[flies].sum() / max(info.dof[flies].sum() - len(names), 1)) if flies.any() else DIVERGED_COST
    info = replace(info, cost=np.where(flies, info.cost, DIVERGED_COST * observed.measured[0].size))
    return Fit(names, table, problem.own, solution, info, spread, chi2, here["alive"], simulator.kite.constraints)
