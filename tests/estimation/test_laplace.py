"""Gusts as nuisances: their memory is Dryden's, and integrating them out leaves parameters without bias."""

from dataclasses import replace

import numpy as np
import pytest
from kites import DEVELOPMENT, flight

from awescli.estimation import fit as fits
from awescli.estimation import laplace
from awescli.estimation.fit import fit, relaxed
from awescli.estimation.laplace import estimates, log_det_gradient, shrunk
from awescli.estimation.problem import build, simulator_of
from awescli.estimation.processes.gusts import Gusts, mean_airspeed
from awescli.estimation.processes.roll_gusts import RollGusts
from awescli.flightlog.split import Split
from awescli.notation.present import present
from awescli.simulation.gusts import dryden, roll_gust
from awescli.simulation.rollout import Columns

LEVEL = 0.8


@pytest.fixture(scope="module")
def log():
    """40 s in gusts of 0.8 m/s, as a flight with noise is logged."""
    return flight(seed=5, duration=42.0, noise=True, effects=(("turbulence", (("sigma", LEVEL), ("L", 150.0))),)).log


@pytest.fixture(scope="module")
def problem(log):
    """Of the true kite in these gusts, their level known."""
    n = len(log)
    parts = Split(((0, int(0.85 * n)),), ((int(0.85 * n), n),), (), (1, 1, 0), "time")
    built = build(simulator_of(DEVELOPMENT, log), log, parts, 5.0, tuple(log.measured))
    gusts = Gusts.of(DEVELOPMENT, log).at(dict.fromkeys(("horizontal gusts", "vertical gusts"), LEVEL))
    return built.with_processes([gusts])


def test_memories_are_those_of_made_gusts(log):
    """Guards the processes against the generator: over its memory a horizontal or rolling gust falls to 1/e of what it was; the vertical
    one, of another form, to (1 - 1/4) exp(-1/2)."""
    airspeed, b = mean_airspeed(log), DEVELOPMENT.parameters["b"].value
    memory = {g.name: g.memory for process in (Gusts, RollGusts) for g in process.of(DEVELOPMENT, log).groups}
    made = dryden(100_000, 0.1, airspeed, seed=3)
    rolling = roll_gust(100_000, 0.02, airspeed, b, seed=4)
    for name, series, dt, expected in (
        ("horizontal gusts", made[:, 0], 0.1, np.exp(-1)), ("vertical gusts", made[:, 2], 0.1, 0.75 * np.exp(-0.5)),
        ("roll gusts", rolling, 0.02, np.exp(-1)),
    ):  # fmt: skip
        lag = int(round(memory[name] / dt))
        assert np.mean(series[lag:] * series[:-lag]) / np.mean(series**2) == pytest.approx(expected, abs=0.06), name


def slope_at(*given):
    """(n,) of `log_det_gradient`."""
    return present(log_det_gradient(*given), "a slope")[0]


def coarse(problem, seconds: float):
    return problem.with_processes([replace(p, spacing=seconds) for p in problem.processes])


def test_the_tilt_is_the_gradient_of_the_log_determinant(problem):
    """Guards what integrating gusts out adds, against central differences of the log determinant with the nuisances at their best
    throughout: the mean over random probes, within three standard errors, a twentieth, and what would move the parameter by a two hundredth
    of its standard deviation."""
    names = ("CLa", "Cmq", "CtD")
    at = coarse(problem, 0.25)
    misfit = replace(at.misfit(names=names), observed=at.fitted.pick(np.arange(3)))
    table = problem.kite.parameters
    x, every = np.array([table[n].value for n in names]), np.arange(3)

    def best(x):
        held = replace(misfit, simulator=misfit.simulator.holding(table.with_values(dict(zip(names, x, strict=True)))), names=())
        return fit(held, held.simulator.kite.parameters, prior=False, tolerance=1e-8).own

    def log_det(x):
        own = best(x)
        return float(misfit.eliminated(misfit.linear(x, own).gram, own, every).log_det.sum())

    own = best(x)
    gram = misfit.linear(x, own).gram
    info = misfit.eliminated(gram, own, every)
    log_det_gradients = estimates(misfit, x, own, gram, every, info.samples(48, seed=0))
    chance, seen = log_det_gradients.std(axis=0) / np.sqrt(len(log_det_gradients)), 0
    for i, name in enumerate(names):
        e = np.eye(len(names))[i] * 2e-3 * abs(x[i])
        slope = -(log_det(x + e) - log_det(x - e)) / (4 * e[i])
        tolerance = 3 * chance[i] + 0.05 * abs(slope) + 0.005 * np.sqrt(info.H[i, i])
        assert abs(log_det_gradients[:, i].mean() - slope) < tolerance, name
        seen += abs(slope) > 3 * chance[i]
    assert seen >= 2


def test_products_with_the_residual_are_the_gradient_to_what_is_free(problem):
    """Guards the log determinant's slope, of which a tenth was missing: what moves at one node moves the states at all later ones, by the
    sensitivities of the point where the gradient is taken. Starts and gusts against central differences of the cost, away from the best."""
    every, names = np.arange(2), ("CLa", "Cmq")
    misfit = replace(coarse(problem, 0.25).misfit(names=names), observed=problem.fitted.pick(every))
    x, own = problem.kite.parameters.vector(names), misfit.own()
    random = np.random.default_rng(2)
    own.path[...] = 0.5 * random.normal(size=own.path.shape)
    of_x, of_globals, alive = next(misfit.gradients(x, [own]))
    assert (alive > misfit.observed.segments.steps).all()
    n_s, A = misfit.simulator.n_s, len(misfit.disturbances)
    assert not of_x[:, 1:, :n_s].any()

    def slope(moved):
        (up, _), (down, _) = (misfit.costs(*moved(side * 1e-4)) for side in (1.0, -1.0))
        return -(up - down) / 4e-4

    def started(state):
        return lambda by: (x, replace(own, starts=own.starts + by * np.eye(own.starts.shape[1])[state]))

    def gusted(node, axis):
        def moved(by):
            path = own.path.copy()
            path[:, node, axis] += by
            return x, replace(own, path=path)

        return moved

    for state in (2, 4, 7, 11):
        assert of_x[:, 0, state] == pytest.approx(slope(started(state)), rel=1e-4), state
    for node in (0, 1, 2, 7, len(misfit.nodes) - 1):
        for axis in range(A):
            before = of_x[:, node - 1, n_s + A + axis] if node else 0.0
            behind = of_x[:, node, n_s + axis] if node < len(misfit.nodes) - 1 else 0.0
            assert before + behind == pytest.approx(slope(gusted(node, axis)), rel=1e-4, abs=1e-3), (node, axis)
    for i in range(len(names)):
        assert of_globals[:, i] == pytest.approx(slope(lambda by, i=i: (x + by * np.eye(2)[i], own)), rel=1e-3), names[i]


def test_further_columns_have_the_slopes_of_globals(problem):
    """Guards the slope of candidates, which are columns behind the globals: that of a parameter is the same whether it is a global or such
    a column."""
    every, names = np.arange(3), ("CLa", "Cmq", "CtD")
    at = coarse(problem, 0.25)
    whole = replace(at.misfit(names=names), observed=at.fitted.pick(every))
    fewer, x = replace(whole, names=names[:1]), problem.kite.parameters.vector(names)
    own = relaxed(whole, x, whole.own())

    def extra(some, own):
        segments, outputs = some.segments(own), some.observed.outputs
        return some.simulator.sensitivities(segments, Columns((), names[1:]), outputs, some.values(x[:1]))[1]

    found = []
    for misfit, how in ((whole, {}), (fewer, {"extra": extra, "columns": 2})):
        there = x[: len(misfit.names)]
        gram = misfit.linear(there, own, **how).gram
        draws = misfit.eliminated(gram, own, every).samples(2, seed=0)
        found.append(estimates(misfit, there, own, gram, every, draws, **how))
    assert found[1] == pytest.approx(found[0], rel=1e-6) and np.abs(found[0]).min() > 0


def test_an_estimate_is_the_second_difference_of_the_cost(problem):
    """Guards the same as the fit takes it, to four digits: along a parameter and what nuisances do at best with it, the slope of the cost
    at the best plus and minus a draw, less twice that there."""
    every, names = np.arange(3), ("CLa", "Cmq", "CtD")
    at = coarse(problem, 0.25)
    misfit = replace(at.misfit(names=names), observed=at.fitted.pick(every))
    table = problem.kite.parameters
    x, own = table.vector(names), fit(replace(misfit, names=()), table, prior=False, tolerance=1e-6).own
    gram = misfit.linear(x, own).gram
    info = misfit.eliminated(gram, own, every)
    draws, answers = info.samples(2, seed=1), info.responses()
    found = estimates(misfit, x, own, gram, every, draws)

    def slope(own, i, by):
        (up, _), (down, _) = (misfit.costs(x + side * by * np.eye(3)[i], own.moved(answers, side * by, None, i)) for side in (1.0, -1.0))
        return float(up.sum() - down.sum()) / (4 * by)

    for i, name in enumerate(names):
        by = 1e-3 * abs(x[i])
        there = slope(own, i, by)
        for case in range(2):
            sides = [slope(own.moved(draws, side * laplace.PROBE, None, case), i, by) for side in (1.0, -1.0)]
            expected = -(sum(sides) - 2 * there) / (2 * laplace.PROBE**2)
            assert found[case, i] == pytest.approx(expected, rel=2e-3), (name, case)


@pytest.mark.parametrize("unsure", [0.0, 0.5])
def test_where_probes_scatter_the_log_determinant_is_differenced(problem, log, monkeypatch, unsure):
    """Guards lags of actuators in gusts that roll the kite: estimates of the slope with their time constant scatter by more than two
    standard deviations; a fit ended short of it, and it was called a delay. Either way (unsure: every component, or this
    one), what moves the parameter is that of central differences with the nuisances at their best."""
    monkeypatch.setattr(laplace, "UNSURE", unsure)
    tau = "actuator_lag:rudder.tau"
    n = len(log)
    parts = Split(((0, int(0.85 * n)),), ((int(0.85 * n), n),), (), (1, 1, 0), "time")
    lagging = build(simulator_of(DEVELOPMENT, log, ["actuator_lag:rudder"]), log, parts, 5.0, tuple(log.measured))
    rolling = RollGusts.of(DEVELOPMENT, log).at({"roll gusts": 0.03})
    names, every = ("CLa", "Jx", tau), np.arange(4)
    at = lagging.with_processes([*problem.processes, rolling])
    misfit = replace(at.misfit(names=names), observed=at.fitted.pick(every))
    x = lagging.simulator.kite.parameters.with_values({tau: 0.05}).vector(names)
    own = relaxed(misfit, x, relaxed(misfit, x, misfit.own()))
    gram = misfit.linear(x, own).gram
    info = misfit.eliminated(gram, own, every)
    std = 1 / np.sqrt(np.diag(info.H))
    scatter = estimates(misfit, x, own, gram, every, info.samples(8, seed=0)).std(axis=0) * std
    assert scatter[2] > 2 and (scatter[:2] < 1).all(), scatter

    def log_det(x):
        best = relaxed(misfit, x, relaxed(misfit, x, own))
        return float(misfit.eliminated(misfit.linear(x, best).gram, best, every).log_det.sum())

    found = slope_at(misfit, x, own, gram, info, every, np.zeros(3), 8)
    for i in range(3) if unsure == 0.0 else (2,):
        e = 0.5 * std[i] * np.eye(3)[i]
        slope = -(log_det(x + e) - log_det(x - e)) / (4 * e[i])
        assert abs(found[i] - slope) * std[i] < 0.05 + 0.1 * abs(slope) * std[i], names[i]


def test_nothing_is_differenced_along_what_has_no_metric(problem, monkeypatch):
    """Guards fits far from their minimum, whose information may be negative: no step can be taken from it."""
    names, every = ("CLa", "Cmq"), np.arange(2)
    at = coarse(problem, 0.25)
    misfit = replace(at.misfit(names=names), observed=at.fitted.pick(every))
    x, own = problem.kite.parameters.vector(names), misfit.own()
    gram = misfit.linear(x, own).gram
    info = misfit.eliminated(gram, own, every)
    scattered = np.array([[1e9, 1e9], [-1e9, -1e9]] * 4)
    monkeypatch.setattr(laplace, "estimates", lambda *given: scattered.copy())
    asked = []
    monkeypatch.setattr(laplace, "by_differences", lambda *given: asked.append(given[-1]) or 0.0)
    for sign in (1.0, -1.0):
        log_det_gradient(misfit, x, own, gram, replace(info, H=np.diag([sign, 1.0]) * np.abs(info.H)), every, np.zeros(2), 8)
    assert [step.nonzero()[0].tolist() for step in asked] == [[0], [1], [1]] and np.isfinite(asked).all()


def test_differences_are_kept_until_their_own_global_has_moved(problem, monkeypatch):
    """Guards the time of a fit in gusts, a third of which were differences taken anew at every look: one is as good as long as its global
    stays within its own standard deviation, all others unknown."""
    names, every = ("CLa", "Cmq"), np.arange(2)
    at = coarse(problem, 0.25)
    misfit = replace(at.misfit(names=names), observed=at.fitted.pick(every))
    x, own = problem.kite.parameters.vector(names), misfit.own()
    gram = misfit.linear(x, own).gram
    info = replace(misfit.eliminated(gram, own, every), H=np.array([[100.0, 99.0], [99.0, 100.0]]))
    std = np.sqrt(np.diag(np.linalg.inv(info.H)))
    asked = []
    monkeypatch.setattr(laplace, "estimates", lambda *given: np.array([[1e9, 1e9], [-1e9, -1e9]] * 4))
    monkeypatch.setattr(laplace, "by_differences", lambda *given: asked.append(int(given[-1].argmax())) or 0.5 + len(asked) / 100)

    def look(x, before):
        asked.clear()
        return present(log_det_gradient(misfit, x, own, gram, info, every, np.zeros(2), 8, before), "a slope")

    slope, first = look(x, {})
    assert asked == [0, 1] and slope == pytest.approx([0.51, 0.52])
    slope, second = look(x + [0.9 * std[0], -1.1 * std[1]], first)
    assert asked == [1] and slope == pytest.approx([0.51, 0.51]) and second[0] == first[0] and second[1][0] != first[1][0]
    # what is kept stays where it was taken: many small steps are a large one
    assert look(x + [1.1 * std[0], -1.1 * std[1]], second)[1][0] != first[0] and asked == [0]


def test_a_slope_that_steps_contradict_is_learnt_from_them(problem, monkeypatch):
    """Guards fits of measured flights in gusts, whose probes contradict each other: with a slope ten standard deviations wrong in every
    parameter a fit ends next to the minimum, as each step that ends higher is taken back and has shown how the log determinant changes."""
    names = ("CLa", "Cmq", "CtD")
    at = coarse(problem, 0.25)
    misfit, table = replace(at.misfit(names=names), observed=at.fitted.pick(np.arange(3))), problem.kite.parameters
    own = fit(replace(misfit, names=()), table, prior=False, tolerance=0.1).own
    right = fit(misfit, table, prior=False, own=own, tolerance=0.01, probes=16)
    wrong_by = 10 * np.sqrt(np.diag(right.information.H))
    monkeypatch.setattr(fits, "log_det_gradient", lambda *given: (wrong_by, {}))
    found = fit(misfit, table, prior=False, own=own, tolerance=0.01)
    x, expected = (f.parameters.vector(names) for f in (found, right))
    assert found.solution.outcome == "converged" and found.solution.cost < right.solution.cost + 4.0
    assert (np.abs(x - expected) < 2.0 * np.sqrt(np.diag(right.covariance))).all()


def test_gusts_that_are_integrated_out_pull_no_parameter(problem):
    """Guards the fit in gusty air: at the truth gusts at their best alone would pull the parameters by many standard deviations (chi-square
    in the norm of the information; 1 is chance); with the log determinant's slope three quarters of that are gone."""
    names = tuple(n for n in problem.names if n not in problem.kite.record)
    at = coarse(problem, 0.1)
    nothing = at.misfit(names=())
    own = fit(nothing, problem.kite.parameters, prior=False, tolerance=0.01).own
    misfit, x = at.misfit(names=names), problem.kite.parameters.vector(names)
    gram, every = misfit.linear(x, own).gram, np.arange(len(at.fitted.segments))
    info = misfit.eliminated(gram, own, every)
    scale = np.array([problem.prior[n].prior_std for n in names])
    values, vectors = np.linalg.eigh(info.H * np.outer(scale, scale))
    known = values > 1.0

    def size(b):
        return float((((vectors.T @ (scale * b))[known]) ** 2 / values[known]).sum()) / known.sum()

    assert size(info.b) > 8
    assert size(info.b + slope_at(misfit, x, own, gram, info, every, 1 / scale**2, 2)) < size(info.b) / 4


def test_a_probe_that_ends_in_no_number_says_nothing(problem, monkeypatch):
    """Guards fits of models that are far from the flight (the AP2 at 25 Hz): an estimate that overflowed made a step of NaN, and a
    traceback of it. It is no correction, as one that is too large is none."""
    names, every = ("CLa", "Cmq"), np.arange(2)
    at = coarse(problem, 0.25)
    misfit = replace(at.misfit(names=names), observed=at.fitted.pick(every))
    own = fit(replace(misfit, names=()), problem.kite.parameters, prior=False, tolerance=0.1).own
    x = problem.kite.parameters.vector(names)
    gram = misfit.linear(x, own).gram
    info = misfit.eliminated(gram, own, every)
    for broken in (np.inf, np.nan):
        monkeypatch.setattr(laplace, "estimates", lambda *given, broken=broken: np.array([[broken, 1.0], [1.0, 1.0]]))
        assert np.array_equal(slope_at(misfit, x, own, gram, info, every, np.ones(2), 2), np.zeros(2)), broken


def test_estimates_that_contradict_each_other_say_nothing():
    """Guards the Laplace term where it is all chance (a calm flight with a model error that matters little): estimates that scatter by more
    than their mean are drawn to zero, those that agree stay, and on average the risk is below that of the mean (James and Stein)."""
    random, H = np.random.default_rng(0), np.diag([4.0, 1.0, 0.25, 9.0, 1.0, 1.0])
    scale = 1 / np.sqrt(np.diag(H))
    agreed = np.array([10.0, -3.0, 2.0, 5.0, 0.0, 1.0]) / scale
    assert shrunk(agreed + 1e-3 * random.normal(size=(2, 6)), H) == pytest.approx(agreed, rel=1e-2, abs=1e-2)
    # where H is no metric, variances may be negative: the mean is never made larger
    for sign in (1.0, -1.0):
        assert np.array_equal(shrunk(np.array([[2.0, 0.0], [0.0, 1.0]]), np.diag([sign, -sign])), np.zeros(2))
    risk = {"mean": 0.0, "shrunk": 0.0}
    for _ in range(200):
        found = random.normal(size=(2, 6)) / scale
        for name, value in (("mean", found.mean(axis=0)), ("shrunk", shrunk(found, H))):
            risk[name] += value @ np.linalg.solve(H, value)
    assert risk["shrunk"] < 0.6 * risk["mean"]
