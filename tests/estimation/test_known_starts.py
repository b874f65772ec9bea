"""Segments that begin at the measured state (Rositani eq. 11c): nothing but parameters, and what acts between, is left to fit."""

from dataclasses import replace

import numpy as np
from kites import DEVELOPMENT, flight

from awescli.estimation import staged_fit
from awescli.estimation.fit import fit
from awescli.estimation.misfit import Misfit
from awescli.estimation.prediction import predict
from awescli.estimation.problem import build, simulator_of
from awescli.flightlog.loops import find_loops
from awescli.flightlog.split import split
from awescli.notation.quantities import MEASURED, STATES
from awescli.physics.kite import Kite
from awescli.simulation.rollout import Columns, Simulator
from awescli.simulation.segments import observe

NAMES = ("CLa", "CD0", "Cnr")


def observed():
    log = flight(duration=40.0, noise=True).log
    simulator = Simulator(Kite(DEVELOPMENT, log.wind.height), NAMES)
    return simulator, observe(log, simulator.kite, np.arange(100, 1700, 200), 150, MEASURED)


def test_the_information_is_that_of_the_parameters_alone():
    """Guards H and b against the dense sensitivities of the parameters: no start takes any of it away, and no start moves."""
    simulator, cut = observed()
    misfit = Misfit(simulator, cut, NAMES, (), True)
    x = simulator.kite.parameters.vector(NAMES)
    links, trajectories = misfit.links(x, misfit.own())
    info = misfit.eliminated(links.gram(), misfit.own())
    _, J = simulator.sensitivities(cut.segments, Columns(parameters=NAMES), cut.outputs)
    weight = np.where(np.isfinite(cut.sigma), 1 / cut.sigma, 0.0)
    A, r = (J * weight[..., None]).reshape(-1, len(NAMES)), cut.residual(trajectories).reshape(-1)
    np.testing.assert_allclose(info.H.sum(axis=0) if info.H.ndim == 3 else info.H, A.T @ A, rtol=1e-9)
    np.testing.assert_allclose(info.b.sum(axis=0) if info.b.ndim == 2 else info.b, A.T @ r, rtol=1e-8)
    assert not info.nuisances().starts(len(STATES)).any()


def test_parameters_come_back_from_true_starts():
    """Guards the fit: from the true starts, 30 % off, the truth is found inside its intervals."""
    simulator, cut = observed()
    truth = simulator.kite.parameters
    run = simulator.rollout(cut.segments)
    noise = np.random.default_rng(1).standard_normal(cut.measured.shape)
    exact = run.outputs[:, :, [MEASURED.index(n) for n in cut.outputs]]
    noisy = replace(cut, measured=exact + np.where(np.isfinite(cut.sigma), cut.sigma, 0) * noise)
    off = truth.with_values({n: 1.3 * truth[n].value for n in NAMES})
    result = fit(Misfit(simulator, noisy, NAMES, (), True), off, prior=False)
    assert result.solution.outcome == "converged"
    assert abs(result.chi2 - 1) < 0.05
    for i, name in enumerate(NAMES):
        assert abs(result.parameters[name].value - truth[name].value) < 4 * np.sqrt(result.covariance[i, i]), name
    np.testing.assert_array_equal(result.own.starts[:, : len(STATES)], cut.segments.starts)


def test_where_short_horizons_lead_astray_the_fit_goes_straight(monkeypatch):
    """Guards the curriculum of fits without processes (development flight d01 ended ten times as far from the flight by it)."""
    log = flight(duration=40.0, noise=True).log
    problem = build(simulator_of(DEVELOPMENT, log), log, split(find_loops(log), log=log), 3.0, MEASURED, by_range=True, known_starts=True)
    problem = replace(problem, names=("CLa",))
    real, begun = staged_fit.fit_levels, []

    def fit_levels(problems, labels, tables, *args):
        begun.append((problems[0].horizon, tables[0]["CLa"].value))
        result, fitted = real(problems, labels, tables, *args)
        lost = len(begun) == 2  # the whole horizon, from where the short one has led
        return (replace(result, solution=replace(result.solution, cost=1e9, outcome="iteration_limit")) if lost else result), fitted

    monkeypatch.setattr(staged_fit, "fit_levels", fit_levels)
    monkeypatch.setattr(staged_fit, "levels_first", lambda problems, *args: (problems, [None] * len(problems)))
    result, _ = staged_fit.fit_flights([staged_fit.Flight(problem)], [1.5], prior=False)
    declared = problem.simulator.kite.parameters["CLa"].value
    (short, first), (whole, second), (again, third) = begun
    assert (short, whole, again) == (1.5, 3.0, 3.0) and first == third == declared != second
    assert result.solution.outcome == "converged"


def test_a_prediction_begins_at_the_measured_state():
    log = flight(duration=40.0, noise=True).log
    simulator, parts = Simulator(Kite(DEVELOPMENT, log.wind.height), ()), split(find_loops(log), log=log)
    fitted, measured = (predict(simulator, log, parts.test, 2.0, known_starts=known) for known in (False, True))
    np.testing.assert_array_equal(fitted.first, measured.first)
    start = observe(log, simulator.kite, measured.first, 2, MEASURED).segments.starts
    np.testing.assert_allclose(measured.simulated["psi"][:, 0], start[:, STATES.index("psi")], atol=1e-12)
    assert fitted.nrmse()["mean"] < measured.nrmse()["mean"]
