"""The constrained Gauss-Newton: its quadratic program against independent solvers, its search on problems with known minima."""

import itertools
from dataclasses import replace

import numpy as np
import pytest
from oracles import kkt_violation
from scipy.optimize import LinearConstraint, lsq_linear, minimize

from awescli.estimation import gauss_newton
from awescli.estimation.gauss_newton import TAKEN_BACK, Linearised, OutOfReach, covariance, minimise
from awescli.estimation.quadratic_program import Limits, best_step
from awescli.notation.errors import NumericalFailure


def bounded_step(H, b, lower, upper):
    """A step from 0 under bounds alone."""
    return best_step(H, b, Limits.box(lower, upper), np.zeros(len(b)))[0]


def problem(seed, n=6, condition=1e4):
    """(H, b, lower, upper): a random positive definite quadratic in badly mixed units, minimum in or outside a box around zero."""
    random = np.random.default_rng(seed)
    Q = np.linalg.qr(random.standard_normal((n, n)))[0]
    units = 10.0 ** random.uniform(-3, 3, n)
    H = (Q * np.geomspace(1, condition, n)) @ Q.T / np.outer(units, units)
    d = 2 * random.standard_normal(n) * units
    return H, H @ d, -random.uniform(0.1, 3, n) * units, random.uniform(0.1, 3, n) * units


@pytest.mark.parametrize("seed", range(40))
def test_the_step_is_optimal(seed):
    """Guards the bounded step by its optimality conditions and by scipy's trust-region solver on the unscaled problem."""
    H, b, lower, upper = problem(seed)
    d = bounded_step(H, b, lower, upper)
    size = np.abs(b / np.sqrt(np.diag(H))).max()
    unit = np.sqrt(np.diag(H))
    assert kkt_violation(H / np.outer(unit, unit), b / unit, lower * unit, upper * unit, d * unit) < 1e-7 * size
    L = np.linalg.cholesky(H / np.outer(unit, unit))
    other = lsq_linear(L.T, np.linalg.solve(L, b / unit), bounds=(lower * unit, upper * unit), method="trf", tol=1e-14).x / unit

    def value(d):
        return 0.5 * d @ H @ d - b @ d

    assert value(d) <= value(other) + 1e-9 * abs(value(other))


@pytest.mark.parametrize("seed", range(10))
def test_the_step_is_the_best_of_all_active_sets(seed):
    """Guards against a wrong active set: every combination of free, lower and upper of 4 unknowns tried by brute force."""
    H, b, lower, upper = problem(100 + seed, n=4, condition=100)
    best, d_best = np.inf, None
    for pattern in itertools.product((-1, 0, 1), repeat=4):
        d = np.where(np.array(pattern) < 0, lower, np.where(np.array(pattern) > 0, upper, 0.0))
        free = np.array(pattern) == 0
        if free.any():
            d[free] = np.linalg.solve(H[np.ix_(free, free)], b[free] - H[np.ix_(free, ~free)] @ d[~free])
        if (d >= lower - 1e-12 * np.abs(lower)).all() and (d <= upper + 1e-12 * np.abs(upper)).all():
            value = 0.5 * d @ H @ d - b @ d
            if value < best:
                best, d_best = value, d
    assert bounded_step(H, b, lower, upper) == pytest.approx(d_best, rel=1e-6, abs=1e-9 * np.abs(d_best).max())


def test_a_step_without_active_bounds_is_newtons():
    """Guards the short cut where no bound matters, infinite bounds included."""
    H, b, _, _ = problem(3)
    free = np.full(6, np.inf)
    assert bounded_step(H, b, -free, free) == pytest.approx(np.linalg.solve(H, b), rel=1e-7)
    assert bounded_step(np.zeros((0, 0)), np.zeros(0), np.zeros(0), np.zeros(0)).shape == (0,)


def test_a_parameter_at_its_bound_may_leave_it_inwards():
    """Guards zero-width steps: at a bound the step towards the inside is free, the step out is zero."""
    H = np.eye(2)
    assert bounded_step(H, np.array([1.0, -1.0]), np.zeros(2), np.array([2.0, 2.0])) == pytest.approx([1.0, 0.0], abs=1e-9)


def test_a_parameter_that_nothing_depends_on_stays():
    """Guards a flight that never moves a surface, fitted without prior: a row of zeros in H made the step a NaN."""
    H, b = np.diag([4.0, 0.0, 1.0]), np.array([4.0, 0.0, 3.0])
    for upper in (9.0, 2.0):
        d = bounded_step(H, b, np.full(3, -9.0), np.full(3, upper))
        assert d == pytest.approx([1.0, 0.0, min(3.0, upper)])


def test_a_matrix_that_rounding_made_indefinite_still_gives_a_step():
    """Guards a trace that once ended in a LinAlgError: a Hessian with an eigenvalue of -3.5e-4 (of a unit diagonal)."""
    H, b = np.array([[1.0, 1.00035, 0.1], [1.00035, 1.0, 0.1], [0.1, 0.1, 1.0]]), np.array([1.0, 1.0, 1.0])
    d = bounded_step(H, b, np.full(3, -9.0), np.full(3, 9.0))
    assert np.isfinite(d).all() and b @ d > 0


def test_a_singular_information_matrix_gives_large_and_finite_variances():
    """Guards NaN standard deviations: two parameters of which only the sum is known have positive, huge variances; others keep theirs."""
    H = np.array([[1.0, 1.0, 0.0], [1.0, 1.0 - 1e-16, 0.0], [0.0, 0.0, 4.0]])
    C = covariance(H, np.ones(3))
    assert C[2, 2] == pytest.approx(0.25) and C[0, 0] > 1e9 and C[1, 1] > 1e9
    assert (np.linalg.eigvalsh(C) > 0).all() and C[0, 0] + 2 * C[0, 1] + C[1, 1] < 1e-3 * C[0, 0]
    regular = problem(5)[0]
    assert covariance(regular, 1 / np.sqrt(np.diag(regular))) == pytest.approx(np.linalg.inv(regular), rel=1e-6)


class Patient:
    """A problem that never gives up."""

    def gives_up(self, at, promised):
        return False


class Curve(Patient):
    """Residuals of y = a exp(-b t) + c: what `minimise` sees of a fit without inner unknowns."""

    def __init__(self, truth=(2.0, 0.7, 0.3), noise=0.0):
        self.t = np.linspace(0, 5, 40)
        self.y = self.model(np.array(truth)) + noise * np.random.default_rng(0).standard_normal(40)

    def model(self, x):
        return x[0] * np.exp(-np.clip(x[1] * self.t, -50, 50)) + x[2]

    def linearise(self, x, inner, before):
        e = np.exp(-x[1] * self.t)
        J = np.column_stack([e, -x[0] * self.t * e, np.ones(40)])
        r = self.y - self.model(x)
        return Linearised(float(r @ r), J.T @ r, J.T @ J, inner, 0.0, None)

    def trial(self, at, x, step, share):
        return float(((self.y - self.model(x)) ** 2).sum()), at.inner + 1

    def corrected(self, at, there):
        return None

    def solve(self, start, lower=(-9, -9, -9), upper=(9, 9, 9), **how):
        return minimise(self, np.array(start, float), 0, Limits.box(lower, upper), **how)


def test_it_finds_a_known_minimum_from_afar():
    """Guards damping and line search: a nonlinear fit from a start where the full step is useless. (Growing curves, b < 0, have a local
    minimum of their own at c = 9.)"""
    curve = Curve()
    found = curve.solve((0.5, 3.0, -1.0), lower=(-9, 0, -9), tolerance=1e-20, iterations=60)
    assert found.outcome == "converged" and found.x == pytest.approx((2.0, 0.7, 0.3), rel=1e-8)
    assert list(found.history) == sorted(found.history, reverse=True) and found.inner == len(found.history) - 1


def test_it_stops_at_a_bound_with_the_others_at_their_best():
    """Guards bounds during the search: b may not fall below 0.9; the rest is the least squares solution on that edge."""
    found = Curve().solve((1.0, 1.5, 0.0), lower=(-9, 0.9, -9), tolerance=1e-12, iterations=60)
    A = np.column_stack([np.exp(-0.9 * np.linspace(0, 5, 40)), np.ones(40)])
    best = np.linalg.lstsq(A, Curve().y, rcond=None)[0]
    assert found.x[1] == pytest.approx(0.9, abs=1e-9) and found.x[[0, 2]] == pytest.approx(best, rel=1e-6)


def test_outcomes_have_names():
    """Guards the three endings: converged, no_progress, iteration_limit."""
    assert Curve(noise=0.1).solve((2.0, 0.7, 0.3)).outcome == "converged"
    assert Curve().solve((0.5, 3.0, -1.0), tolerance=1e-14, iterations=1).outcome == "iteration_limit"

    class Stuck(Curve):
        def trial(self, at, x, step, share):
            return np.nan, at.inner + 1  # whatever is tried diverges

    found = Stuck().solve((0.5, 3.0, -1.0))
    assert found.outcome == "no_progress" and found.inner == 0


def test_a_problem_may_give_up_where_a_step_promises_too_little():
    """Guards the time that hopeless candidates take: what is promised is what the step would gain were the curve as straight as it looks,
    and it is asked for once a point, where the fit ends too."""
    asked = []

    class Impatient(Curve):
        def gives_up(self, at, promised):
            straight = np.linalg.solve(at.H, at.b)
            assert promised == pytest.approx(straight @ at.b)
            asked.append(at.cost)
            return at.cost - 2 * promised > self.reach

    hopeful, start = Impatient(noise=0.1), {"start": (1.5, 1.0, 0.2), "lower": np.full(3, -999.0), "upper": np.full(3, 999.0)}
    hopeful.reach = np.inf
    found = hopeful.solve(**start)
    assert found.outcome == "converged" and asked == list(found.history)
    hopeful.reach = found.cost
    assert hopeful.solve(**start).x == pytest.approx(found.x)
    hopeful.reach = 0.9 * found.cost
    with pytest.raises(OutOfReach):
        hopeful.solve(**start)


def test_a_quadratic_program_that_fails_is_an_outcome(monkeypatch):
    """Guards a fit against an abort: what the solver of a step cannot do is named, and the fit ends where it stands."""

    def fails(*_):
        raise NumericalFailure("quadratic_program", "not solved")

    monkeypatch.setattr(gauss_newton, "best_step", fails)
    found = Curve().solve((0.5, 3.0, -1.0))
    assert found.outcome == "quadratic_program" and found.x == pytest.approx((0.5, 3.0, -1.0))


def test_a_state_goes_through_the_steps_unchanged_by_them():
    """Guards the optimiser as a value: a step from a state is the same step again, and a run may go on from any state."""
    curve, limits = Curve(), Limits.box((-9, 0, -9), (9, 9, 9))
    states = [gauss_newton.init(curve, np.array([0.5, 3.0, -1.0]), 0, limits)]
    while not states[-1].outcome:
        states.append(gauss_newton.step(curve, limits, states[-1], 1e-16))
    again = gauss_newton.step(curve, limits, states[3], 1e-16)
    assert np.array_equal(again.x, states[4].x) and again.history == states[4].history and len(states[3].history) == 4
    assert states[-1].outcome == "converged"


def test_steps_that_promise_more_than_they_bring_come_to_an_end():
    """Guards a fit at a kink: every step promises as much as the one before and brings an eighth of it."""

    class Kink(Patient):
        """inner: the cost."""

        def linearise(self, x, inner, before):
            return Linearised(inner, np.ones(1), np.eye(1), inner, 0.0, None)

        def trial(self, at, x, step, share):
            return at.inner - 0.25 * share, at.inner - 0.25 * share

    how = {"x": np.zeros(1), "inner": 10.0, "limits": Limits.box([-99.0], [99.0]), "iterations": 20}
    found = minimise(Kink(), tolerance=0.9, **how)
    assert found.outcome == "no_progress" and len(found.history) == 4 and found.kkt == pytest.approx(1.0)
    assert minimise(Kink(), tolerance=0.7, **how).outcome == "iteration_limit"


@pytest.mark.parametrize("n, rounds", [(0, 1), (1, 2)])
def test_a_step_that_damping_hardly_changes_is_not_tried_again(n, rounds):
    """Guards the time at a kink, where no trial helps: without unknowns one search is all there is; with one, damping halves its step by
    the last of five times, and is only then tried again."""

    class Stuck(Patient):
        tried = 0

        def linearise(self, x, inner, before):
            return Linearised(10.0, np.ones(n), np.eye(n), None, 1.0, None)

        def trial(self, at, x, step, share):
            self.tried += share == 1.0
            return 11.0, None

    stuck = Stuck()
    found = minimise(stuck, np.zeros(n), None, Limits.box(np.full(n, -99.0), np.full(n, 99.0)), tolerance=0.1)
    assert found.outcome == "no_progress" and stuck.tried == rounds


def test_a_step_that_only_what_is_hardly_seen_keeps_from_helping_is_tried_damped():
    """Guards a fit of two unknowns that a flight hardly tells apart: a full step takes their difference where the model does not fly.
    Little damping takes that away, and hardly anything of what the step promises."""
    H = np.array([[1.0, 1 - 1e-6], [1 - 1e-6, 1.0]])
    truth = np.array([1.0 + 60.0, 1.0 - 60.0])

    class Alike(Patient):
        def linearise(self, x, inner, before):
            d = truth - x
            return Linearised(float(d @ H @ d), H @ d, H, None, 0.0, None)

        def trial(self, at, x, step, share):
            d = truth - x
            return (np.inf if abs(x[0] - x[1]) > 5.0 else float(d @ H @ d)), None

    limits = Limits.box([-99.0, -99.0], [99.0, 99.0])
    one = gauss_newton.step(Alike(), limits, gauss_newton.init(Alike(), np.zeros(2), None, limits), 1e-9)
    assert one.x.sum() == pytest.approx(2.0, rel=0.01) and abs(one.x[0] - one.x[1]) < 5.0


def test_who_wanders_off_uphill_ends_where_it_was_lowest():
    """Guards a fit against what a trial does not see: beyond b = 1 every new linearisation shows a cost that no trial had, and the fit of a
    curve with b = 2 ends below that, at the lowest point it was at."""

    class Hidden(Curve):
        def linearise(self, x, inner, before):
            at = super().linearise(x, inner, before)
            return replace(at, cost=at.cost + 1e4 * (x[1] > 1))

    start = {"start": (2.0, 0.5, 0.3), "lower": (-9, 0, -9), "tolerance": 1e-12}
    assert Curve((2.0, 2.0, 0.3)).solve(**start).x[1] == pytest.approx(2.0, abs=1e-3)
    found = Hidden((2.0, 2.0, 0.3)).solve(**start)
    assert found.outcome == "no_progress" and found.x[1] < 1 and found.cost == min(found.history) < 1e4 < max(found.history)


class Unseen(Patient):
    """(x - 2)^2 plus 2 s x, of which a trial sees `slope` instead of s; what a step has shown is believed if it `learns`."""

    def __init__(self, s, slope=0.0, learns=True):
        self.s, self.slope, self.learns, self.asked = s, slope, learns, 0

    def linearise(self, x, inner, before):
        slope, self.asked = self.slope if inner is None else inner, self.asked + 1
        return Linearised((x[0] - 2) ** 2 + 2 * self.s * x[0], np.array([2 - x[0] - slope]), np.eye(1), slope, 0.0, x[0])

    def trial(self, at, x, step, share):
        return at.cost + (x[0] - 2) ** 2 - (at.known - 2) ** 2 + 2 * at.inner * (x[0] - at.known), at.inner

    def corrected(self, at, there):
        seen = (there.cost - (there.known - 2) ** 2 - at.cost + (at.known - 2) ** 2) / (2 * (there.known - at.known))
        slope = seen if self.learns else at.inner
        return replace(at, inner=slope, b=at.b + at.inner - slope)


def test_a_step_that_ends_higher_than_any_trial_is_taken_back_and_learnt_from():
    """Guards fits of measured flights in gusts: their log determinant rises along the first step by a thousand and more, and where the
    probes do not see it the fit climbed for thirty steps and ended where it had begun. One step back, and the minimum is found."""
    limits = Limits.box([-99.0], [99.0])
    problem = Unseen(5.0)
    found = minimise(problem, np.zeros(1), None, limits, tolerance=1e-9)
    assert found.outcome == "converged" and found.x[0] == pytest.approx(2.0 - 5.0) and problem.asked <= 4
    # without that it ends at once, where it is lowest
    problem = Unseen(5.0, learns=False)
    found = minimise(problem, np.zeros(1), None, limits, tolerance=1e-9)
    assert found.outcome == "no_progress" and found.x[0] == 0.0 and problem.asked == 1 + TAKEN_BACK
    # what is off by less than matters is not taken back
    assert minimise(Unseen(0.1), np.zeros(1), None, limits, tolerance=1e-9).x[0] == pytest.approx(2.0)


@pytest.mark.parametrize("seed", range(20))
def test_a_step_under_linear_constraints_is_optimal(seed):
    """Guards the whole quadratic program, equalities included, by stationarity, signs and complementarity, and by scipy's SLSQP."""
    random = np.random.default_rng(seed)
    H, b, lower, upper = problem(seed, condition=1e3)
    unit = np.sqrt(np.diag(H))
    A = random.standard_normal((3, 6)) * unit
    high = np.array([0.1, 0.2, 0.05])
    low = np.array([-np.inf, -0.1, 0.05])
    limits = Limits(lower, upper, A, low, high)
    d, multipliers = best_step(H, b, limits, np.zeros(6))
    rows = np.vstack([np.eye(6), A])
    assert np.abs((H @ d - b + rows.T @ multipliers) / unit).max() < 1e-8 * np.abs(b / unit).max()
    value, below, above = rows @ d, np.r_[lower, low], np.r_[upper, high]
    assert (value <= above + 1e-9 * np.maximum(1, np.abs(above))).all() and (value >= below - 1e-9 * np.maximum(1, np.abs(below))).all()
    at = np.where(multipliers > 0, above, below)
    assert value[multipliers != 0] == pytest.approx(at[multipliers != 0], rel=1e-8, abs=1e-9) and multipliers[8] != 0
    scaled, target = H / np.outer(unit, unit), b / unit
    other = minimize(
        lambda y: 0.5 * y @ scaled @ y - target @ y, np.zeros(6), jac=lambda y: scaled @ y - target, method="SLSQP",
        bounds=list(zip(lower * unit, upper * unit, strict=True)), options={"ftol": 1e-14, "maxiter": 500},
        constraints=[{"type": "eq", "fun": lambda y: A[2:] / unit @ y - 0.05}]
        + [{"type": "ineq", "fun": lambda y: np.r_[high[:2] - A[:2] / unit @ y, A[1] / unit @ y - low[1]]}],
    )  # fmt: skip
    assert d * unit == pytest.approx(other.x, abs=1e-4 * np.abs(other.x).max())
    assert 0.5 * d @ H @ d - b @ d <= other.fun + 1e-9 * abs(other.fun)


def constrained(start, A, low, high, **how):
    """The curve fitted under rows, b >= 0."""
    limits = Limits(np.array([-9.0, 0, -9]), np.full(3, 9.0), np.atleast_2d(A), np.atleast_1d(low), np.atleast_1d(high))
    curve = Curve()
    return curve, minimise(curve, np.array(start), 0, limits, tolerance=1e-13, iterations=100, **how)


CASES = {
    "inequality": ([[1.0, 0.0, 1.0]], [-np.inf], [2.1]),
    "equality": ([[1.0, -2.0, 0.0]], [0.8], [0.8]),
    "both, and one that does not matter": ([[1.0, 0, 1], [1, -2, 0], [0, 1, 1]], [-np.inf, 0.8, -5], [2.1, 0.8, 5]),
}


@pytest.mark.parametrize("case", CASES)
@pytest.mark.parametrize("start", [(1.0, 1.0, 0.0), (5.0, 0.2, 3.0)])
def test_it_finds_the_constrained_minimum(case, start):
    """Guards the SQP by scipy's trust-region interior point method; the second start violates the rows. (The SQP may stop a millionth
    of the cost above the minimum.)"""
    A, low, high = CASES[case]
    curve, found = constrained(start, A, low, high)
    other = minimize(
        lambda x: ((curve.y - curve.model(x)) ** 2).sum(), (1.0, 1.0, 0.0), method="trust-constr", bounds=[(-9, 9), (0, 9), (-9, 9)],
        constraints=[LinearConstraint(A, low, high)], options={"gtol": 1e-11, "xtol": 1e-13, "maxiter": 3000},
    )  # fmt: skip
    assert found.outcome == "converged" and found.x == pytest.approx(other.x, abs=5e-4) and found.cost <= other.fun * (1 + 1e-6)
    value = np.array(A) @ found.x
    assert (value <= np.array(high) + 1e-9).all() and (value >= np.array(low) - 1e-9).all()


@pytest.mark.parametrize("case", CASES)
def test_multipliers_are_what_a_limit_costs(case):
    """Guards sign and unit of the multipliers: central differences of the optimal cost over each limit."""
    A, low, high = (np.array(v, float) for v in CASES[case])
    _, found = constrained((1.0, 1.0, 0.0), A, low, high)
    for i in range(len(high)):
        h = 1e-4 * np.eye(len(high))[i]
        moved = [constrained((1.0, 1.0, 0.0), A, np.where(low == high, low + s * h, low), high + s * h)[1].cost for s in (1, -1)]
        assert found.multipliers[3 + i] == pytest.approx((moved[1] - moved[0]) / 2e-4, rel=1e-3, abs=1e-7)
    assert np.abs(found.multipliers[3:]).max() > 0.01 and found.multipliers[:3] == pytest.approx(0)


def test_a_start_outside_the_constraints_pays_for_it_in_the_merit():
    """Guards the penalty: from a start with a lower cost than any feasible point, the search must be able to climb."""
    _, found = constrained((2.0, 0.7, 0.3), [[1.0, 0.0, 1.0]], [-np.inf], [2.1])
    assert found.history[0] < 1e-20 and found.outcome == "converged" and found.cost > 1e-3
    assert found.x[0] + found.x[2] == pytest.approx(2.1, abs=1e-9)


def test_an_equality_leaves_no_variance_across_it():
    """Guards the covariance under equalities: that of the reduced problem, by substitution of x2 = 2 x0 + const."""
    H = problem(5, n=3, condition=10)[0]
    substituted = np.array([[1.0, 0], [0, 1], [2, 0]])
    reduced = substituted @ np.linalg.inv(substituted.T @ H @ substituted) @ substituted.T
    scale = 1 / np.sqrt(np.diag(H))
    assert covariance(H, scale, np.array([[2.0, 0.0, -1.0]])) == pytest.approx(reduced, rel=1e-6, abs=1e-9 * np.abs(reduced).max())


def test_no_information_leaves_large_variances_and_no_infinite_ones():
    """Guards a model that flies nowhere (Thor): its information was none, or negative by rounding, and its covariance overflowed."""
    scale = np.array([1.0, 0.1, 30.0])
    for H in (np.zeros((3, 3)), -1e-3 * np.eye(3)):
        C = covariance(H, scale)
        assert np.isfinite(C).all() and (np.sqrt(np.diag(C)) > 1e3 * scale).all()
