"""Simulation error: truth is recovered, gradients are gradients, intervals hold, diverging segments do no harm."""

from dataclasses import replace

import numpy as np
import pytest
from kites import DEVELOPMENT, lively, truly
from scipy import stats

from awescli.estimation.answer import describe
from awescli.estimation.fit import JointFit, fit
from awescli.estimation.nuisance_wind import RecordError
from awescli.estimation.simulation_error import DIVERGED_COST, SimulationError
from awescli.simulation.campaign_flights import perturbed
from awescli.simulation.rollout import Simulator
from awescli.simulation.segments import Observed
from awescli.stages.identify import shown

CALM = RecordError(0.0)
FREE = DEVELOPMENT.table().free


@pytest.fixture(scope="module")
def simulator(kite):
    return Simulator(kite)


@pytest.fixture(scope="module")
def observed(kite, calm, simulator):
    """16 segments of 2.5 s on which every surface moves, measured without noise."""
    return truly(lively(kite, calm.log, count=16, seconds=2.5), simulator)


def upto(observed: Observed, seconds: float) -> Observed:
    """Only the first seconds of every segment count."""
    sigma = observed.sigma.copy()
    sigma[:, int(round(seconds / observed.segments.dt)) + 1 :] = np.inf
    return observed.with_sigma(sigma)


def told(found, declared):
    """`describe` of a fit of one flight."""
    place = np.arange(len(found.names))
    joint = JointFit(found.names, found.parameters, declared, found.solution, found.covariance, found.chi2, (), (found,), (place,))
    return describe(joint)


def from_afar(simulator, observed, names, seed, share):
    """A fit from a guess that is off by `share`, short horizons first; rows off the list stay at the truth."""
    guess = perturbed(DEVELOPMENT, seed, (share, share)).table()
    table = declared = simulator.kite.parameters.with_rows(guess[n] for n in names)
    start = None
    for seconds, tolerance in ((0.5, 1.0), (1.0, 1.0), (2.5, 1e-12)):
        found = fit(simulator.holding(table), upto(observed, seconds), table, names, gusts=CALM, prior=False, tolerance=tolerance,
                    iterations=60, start=start)  # fmt: skip
        table, start = found.parameters, found
    return found, declared


@pytest.mark.parametrize("seed", [1, 2])
def test_truth_is_recovered_from_a_guess_that_is_30_percent_off(simulator, observed, seed):
    """Guards the whole estimator: on noise-free data all parameters come back to 1e-6, the segments' starts unknown too.

    One inertia is given: no flight can tell a common factor of the inertias, the moment coefficients and the attachment arm, which
    multiplies both sides of the moment equation.
    """
    names = tuple(n for n in FREE if n != "Jy")
    found, declared = from_afar(simulator, observed, names, seed, 0.3)
    assert found.solution.outcome == "converged" and told(found, declared)["common_factors"] == []
    truth = simulator.kite.parameters
    for name in names:
        assert found.parameters[name].value == pytest.approx(truth[name].value, rel=1e-6, abs=1e-6 * truth[name].prior_std), name
    assert np.abs(found.starts - observed.segments.starts).max() < 1e-6


def test_the_factor_that_no_flight_can_tell_is_reported_as_unseen(simulator, observed):
    """Guards `excited` and the covariance of a singular problem: with all inertias free, only ratios are known, and the answer says so
    with finite numbers (a NaN standard deviation once stood here)."""
    found, declared = from_afar(simulator, observed, FREE, 1, 0.3)
    said = told(found, declared)
    answer = said["parameters"]
    truth = simulator.kite.parameters
    moments = [n for n in FREE if n[:2] in ("Jx", "Jy", "Jz", "Cl", "Cm", "Cn", "rt")]
    for name in FREE:
        assert answer[name]["excited"] == (name not in moments), name
        assert np.isfinite(answer[name]["std"]) and answer[name]["std"] >= 0
    (factor,) = said["common_factors"]
    assert set(factor["parameters"]) == set(moments)
    ratios = [found.parameters[n].value / truth[n].value for n in moments]
    assert ratios == pytest.approx([ratios[0]] * len(moments), rel=1e-6)
    for name in (n for n in FREE if n not in moments):
        assert found.parameters[name].value == pytest.approx(truth[name].value, rel=1e-6), name


def test_the_gradient_is_that_of_the_cost(simulator, observed):
    """Guards b: minus half the derivative of the cost in every parameter, own unknowns held, by central differences."""
    names = ("CLa", "Cmq", "rtz", "dl")
    problem = SimulationError(simulator, truly(observed, simulator, noise_seed=3), names, RecordError(0.5, 0.5))
    x = np.array([simulator.kite.parameters[n].value for n in names]) * 1.02
    problem.own[:, 12:] = 0.3
    info, _ = problem.information(x)
    # with own unknowns at their optimum the envelope theorem makes b the full gradient: move them there first
    for _ in range(6):
        problem.own += np.array([info.own(k, np.zeros(len(names))) for k in range(len(problem.own))])
        info, _ = problem.information(x)
    for i, name in enumerate(names):
        h = 1e-5 * abs(x[i])
        e = np.eye(len(names))[i] * h
        slope = (problem.costs(x + e, problem.own)[0].sum() - problem.costs(x - e, problem.own)[0].sum()) / (2 * h)
        assert info.b.sum(0)[i] == pytest.approx(-slope / 2, rel=1e-4, abs=1e-5 * np.abs(info.b.sum(0)).max()), name


def test_nodes_of_wind_share_every_sample():
    """Guards the nuisance wind: hats sum to one up to the last sample and are felt from the node before to the node behind; its prior is a
    covariance."""
    gusts = RecordError(0.8, 0.5, 3.0)
    nodes, hats = gusts.nodes(120, 0.02), gusts.hats(120, 0.02)
    assert hats.shape == (121, 6) and nodes[[0, -1]].tolist() == [0, 120] and np.allclose(hats.sum(axis=1), 1.0, atol=1e-14)
    for before, hat, behind in zip([-1, *nodes], hats.T, [*nodes[1:], 121], strict=False):
        assert np.flatnonzero(hat)[[0, -1]].tolist() == [before + 1, behind - 1]
    P = np.linalg.inv(gusts.precision(120, 0.02))
    assert np.diag(P) == pytest.approx(0.64)
    assert P[0, 3] == pytest.approx(0.64 * np.exp(-24 * 0.02 / 3.0)) and P[0, 1] == pytest.approx(0, abs=1e-12)
    assert RecordError(0.0).nodes(120, 0.02).tolist() == [] and RecordError(0.1).nodes(120, 0.02).tolist() == [0]


def test_a_gust_in_the_truth_is_found_at_its_nodes(simulator, observed, kite):
    """Guards own unknowns beyond the start: wind that the record does not know comes back, node by node, from noise-free data."""
    gusts = RecordError(20.0, 1.0, 0.01)
    first, steps, dt = kite.input_names.index("gust_n"), observed.segments.steps, observed.segments.dt
    nodes = np.random.default_rng(3).uniform(-0.6, 0.6, (len(observed.segments), len(gusts.nodes(steps, dt)), 3))
    wind = np.einsum("tj,kja->kta", gusts.hats(steps, dt), nodes)
    flown = truly(replace(observed, segments=observed.segments.with_inputs(slice(first, first + 3), wind)), simulator)
    asked = Observed(observed.segments, flown.outputs, flown.measured, flown.sigma)
    found = fit(simulator, asked, kite.parameters, (), gusts=gusts, prior=False, tolerance=1e-9)
    assert np.abs(found.own[:, 12:].reshape(nodes.shape) - nodes).max() < 1e-3


def test_standard_deviations_are_those_of_the_estimates(simulator, observed):
    """Guards the covariance: over 14 noise realisations the normalised errors of all parameters behave as chi-square.

    Generous bands (99.9 %) because a fit with Jacobians is only asymptotically Gaussian; the long campaign is in benchmarks.
    """
    names = ("CLa", "CL0", "CD0", "CYb", "Clb", "Clp", "Cma", "Cmq", "Cnb", "Cndr", "CtD", "rtz", "dl")
    table, errors, chi2 = simulator.kite.parameters, [], []
    for seed in range(14):
        found = fit(simulator, truly(observed, simulator, noise_seed=100 + seed), table, names, gusts=CALM, prior=False, tolerance=1e-2)
        e = np.array([found.parameters[n].value - table[n].value for n in names])
        errors.append(np.linalg.solve(np.linalg.cholesky(found.covariance), e))
        chi2.append(found.chi2)
    total = float((np.array(errors) ** 2).sum())
    low, high = stats.chi2.ppf((5e-4, 1 - 5e-4), np.size(errors))
    assert low < total < high, total / np.size(errors)
    # each parameter by itself: none is badly off while the sum looks right
    assert (np.abs(np.mean(errors, axis=0)) * np.sqrt(14) < 4).all() and (np.abs(errors) < 4.5).all()
    assert np.mean(chi2) == pytest.approx(1.0, abs=0.02)


def test_the_prior_pulls_where_the_flight_is_silent(simulator, observed):
    """Guards maximum a posteriori: what the data do not see stays at the prior, what they see moves to the truth."""
    names, truth = ("CLa", "Jx", "Jy", "Jz", "Jxz"), simulator.kite.parameters
    silent = replace(observed, sigma=np.where(np.isin(np.array(observed.outputs), ("p_n", "p_e", "p_d")), observed.sigma, np.inf))
    guess = truth.with_values({n: truth[n].value * 1.1 for n in names})
    short = upto(silent, 0.2)
    found = fit(simulator.holding(guess), short, guess, names, gusts=CALM, tolerance=1e-6)
    for name in ("Jx", "Jz"):
        assert found.parameters[name].value == pytest.approx(guess[name].value, rel=0.02)
    guess = truth.with_values({"CLa": 1.1 * truth["CLa"].value})
    seen = fit(simulator.holding(guess), observed, guess, ("CLa",), gusts=CALM, tolerance=1e-6)
    assert seen.parameters["CLa"].value == pytest.approx(truth["CLa"].value, rel=1e-3)
    assert np.sqrt(seen.covariance[0, 0]) < 0.1 * truth["CLa"].prior_std


def test_a_bound_is_kept_and_reported(simulator, observed):
    """Guards bounds through the whole estimator, and that the answer says which parameter sits at one."""
    truth = simulator.kite.parameters
    cramped = truth.with_rows([replace(truth["CLa"], value=5.0, lower=4.0, upper=5.4), truth["CD0"]])
    found = fit(simulator.holding(cramped), observed, cramped, ("CLa", "CD0"), gusts=CALM, tolerance=1e-6)
    answer = told(found, cramped)["parameters"]
    assert found.parameters["CLa"].value == pytest.approx(5.4, abs=1e-6) and answer["CLa"]["at_bound"] and not answer["CD0"]["at_bound"]
    assert "bound" in answer["CLa"]["advice"]


def test_words_of_a_parameter_say_what_its_numbers_say(simulator, observed):
    """Guards "hardly seen, kept near its prior", which was said of an inertia at its bound, 2.36 prior standard deviations off: a weak
    parameter is near its prior, or it moved, and a well seen one is neither."""
    truth = simulator.kite.parameters
    names = ("CLa", "CD0", "CtD")
    found = fit(simulator.holding(truth), observed, truth, names, gusts=CALM, tolerance=1e-6)
    width = np.array([truth[n].prior_std for n in names])
    declared = truth.with_rows(replace(truth[n], value=truth[n].value - shift * truth[n].prior_std, lower=-np.inf, upper=np.inf,
                                       std=truth[n].prior_std) for n, shift in zip(names, (2.36, 0.3, 2.0), strict=True))  # fmt: skip
    weak = replace(found, covariance=np.diag(np.square(np.array([0.64, 0.64, 0.1]) * width)))
    answer = told(weak, declared)["parameters"]
    assert [answer[n]["determined"] for n in names] == ["poorly", "hardly", "well"]
    assert "near its prior" in answer["CD0"]["advice"] and "near its prior" not in answer["CLa"]["advice"]
    assert "more than one prior standard deviation off" in answer["CLa"]["advice"] and answer["CtD"]["advice"] == ""
    edge = replace(weak, parameters=weak.parameters.with_rows([replace(weak.parameters["CD0"], lower=weak.parameters["CD0"].value)]))
    at_bound = told(edge, declared)["parameters"]["CD0"]
    assert (
        at_bound["at_bound"]
        and at_bound["determined"] == "poorly"
        and "at its bound, though this flight hardly sees it" in at_bound["advice"]
    )
    assert shown(at_bound)[""] == "at its bound; poorly determined" and shown(answer["CD0"])[""] == "hardly seen, near its prior"


def test_a_diverging_segment_does_not_end_the_fit(simulator, observed):
    """Guards robustness: a segment whose start is hopeless is charged a finite cost and the others find the truth (what the lost one
    might have gained once stood in the way of every step)."""
    truth = simulator.kite.parameters
    starts = observed.segments.starts.copy()
    starts[5, 3:6] = (400.0, -300.0, 900.0)
    lost = observed.starting_at(starts)
    problem = SimulationError(simulator, lost, ("CLa",), CALM)
    cost, whole = problem.costs(np.array([truth["CLa"].value]), problem.own)
    assert whole.tolist() == [k != 5 for k in range(16)] and cost[5] == pytest.approx(DIVERGED_COST * observed.measured[0].size)
    guess = truth.with_values({"CLa": 6.2})
    found = fit(simulator.holding(guess), lost, guess, ("CLa",), gusts=CALM, prior=False, tolerance=1e-6)
    assert found.solution.outcome == "converged" and found.solution.cost == pytest.approx(cost[5], rel=1e-4)
    # the search stops at a millionth of the whole cost, the lost segment's price included
    assert found.parameters["CLa"].value == pytest.approx(truth["CLa"].value, rel=1e-4)
    assert found.chi2 < 0.01 and np.flatnonzero(found.alive < 126).tolist() == [5]
