"""The misfit and its fit: truth is recovered, gradients are gradients, intervals hold, diverging segments do no harm."""

from dataclasses import replace

import numpy as np
import pytest
from kites import DEVELOPMENT, lively, truly
from scipy import stats

from awescli.estimation import misfit as misfits
from awescli.estimation.fit import fit, relaxed
from awescli.estimation.fitted import JointFit
from awescli.estimation.identifiability import describe
from awescli.estimation.misfit import DIVERGED_COST, Misfit
from awescli.estimation.processes.base import Group
from awescli.estimation.processes.wind_record import WindRecord
from awescli.physics.disturbances import GUSTS
from awescli.simulation.campaign_flights import perturbed
from awescli.simulation.rollout import Simulator
from awescli.simulation.segments import Observed
from awescli.stages.identify import shown

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
    own = None
    for seconds, tolerance in ((0.5, 1.0), (1.0, 1.0), (2.5, 1e-12)):
        misfit = Misfit(simulator.holding(table), upto(observed, seconds), names)
        found = fit(misfit, table, prior=False, tolerance=tolerance, iterations=60, own=own)
        table, own = found.parameters, found.own
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
    assert np.abs(found.own.starts - observed.segments.starts).max() < 1e-6


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


def wind(level: float, memory: float, spacing: float) -> WindRecord:
    """A process on the air whose level is known."""
    return WindRecord((Group.known("wind", GUSTS, level, memory),), spacing)


def test_the_gradient_is_that_of_the_cost(simulator, observed):
    """Guards b: minus half the derivative of the cost in every parameter, nuisances at their best, by central differences."""
    names = ("CLa", "Cmq", "rtz", "dl")
    misfit = Misfit(simulator, truly(observed, simulator, noise_seed=3), names, (wind(0.5, 3.0, 0.5),))
    x, every = np.array([simulator.kite.parameters[n].value for n in names]) * 1.02, np.arange(16)
    # with nuisances at their best the envelope theorem makes b the full gradient
    own = misfit.own()
    for _ in range(6):
        own = own.moved(misfit.eliminated(misfit.linear(x, own).gram, own).nuisances())
    b = misfit.eliminated(misfit.linear(x, own).gram, own).b

    def cost(x):
        return misfit.costs(x, own)[0].sum() + misfit.prior_cost(own, every)

    for i, name in enumerate(names):
        e = np.eye(len(names))[i] * 1e-5 * abs(x[i])
        slope = (cost(x + e) - cost(x - e)) / (2 * e[i])
        assert b[i] == pytest.approx(-slope / 2, rel=1e-4, abs=1e-5 * np.abs(b).max()), name


def test_a_gust_in_the_truth_is_found_at_its_nodes(simulator, observed, kite):
    """Guards nuisances beyond the start: wind that the record does not know comes back, node by node, from noise-free data."""
    loose = Misfit(simulator, observed, (), (wind(20.0, 0.01, 1.0),))
    own = loose.own()
    path = np.random.default_rng(3).uniform(-0.6, 0.6, own.path.shape)
    own = replace(own, path=path)
    flown = truly(replace(observed, segments=loose.segments(own)), simulator)
    asked = Observed(observed.segments, flown.outputs, flown.measured, flown.sigma)
    found = fit(Misfit(simulator, asked, (), loose.processes), kite.parameters, prior=False, tolerance=1e-9)
    assert np.abs(found.own.path - path).max() < 1e-3


def test_nuisances_follow_a_step_of_the_parameters(simulator, observed):
    """Guards the narrow valley: after a step of a well known parameter the nuisances are brought to their best, where nothing is left to
    gain, and they never get worse."""
    misfit = Misfit(simulator, truly(observed, simulator, noise_seed=4), ("CLa",), (wind(0.5, 3.0, 0.25),))
    x, every = np.array([simulator.kite.parameters["CLa"].value * 1.05]), np.arange(16)
    before = misfit.own()
    own = relaxed(misfit, x, before)
    cost = lambda own: misfit.costs(x, own)[0].sum() + misfit.prior_cost(own, every)  # noqa: E731
    assert cost(own) < cost(before)
    assert cost(own) - misfit.eliminated(misfit.linear(x, own).gram, own).cost.sum() < 0.5 * 16


def test_nuisances_that_end_where_a_step_promised_are_not_looked_at_again(simulator, observed, monkeypatch):
    """Guards the time of a trial: one step is enough where it ends as promised, and another one would gain next to nothing."""
    misfit = Misfit(simulator, truly(observed, simulator, noise_seed=4), ("CLa",), (wind(0.5, 3.0, 0.25),))
    x, linear, looked = np.array([simulator.kite.parameters["CLa"].value]), Misfit.linear, []
    best = relaxed(misfit, x, relaxed(misfit, x, misfit.own()))
    near = replace(best, starts=best.starts + 1e-4 * np.random.default_rng(0).standard_normal(best.starts.shape))
    monkeypatch.setattr(Misfit, "linear", lambda self, *how, **more: looked.append(linear(self, *how, **more)) or looked[-1])
    own = relaxed(misfit, x, near)
    assert len(looked) == 1
    every = np.arange(16)
    cost = lambda own: misfit.costs(x, own)[0].sum() + misfit.prior_cost(own, every)  # noqa: E731
    assert cost(near) - cost(own) > 0.5 * 16 and cost(own) - cost(best) < 0.2


def test_standard_deviations_are_those_of_the_estimates(simulator, observed):
    """Guards the covariance: over 14 noise realisations the normalised errors of all parameters behave as chi-square.

    Generous bands (99.9 %) because a fit with Jacobians is only asymptotically Gaussian; the long campaign is in benchmarks.
    """
    names = ("CLa", "CL0", "CD0", "CYb", "Clb", "Clp", "Cma", "Cmq", "Cnb", "Cndr", "CtD", "rtz", "dl")
    table, errors, chi2 = simulator.kite.parameters, [], []
    for seed in range(14):
        found = fit(Misfit(simulator, truly(observed, simulator, noise_seed=100 + seed), names), table, prior=False, tolerance=1e-2)
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
    found = fit(Misfit(simulator.holding(guess), short, names), guess, tolerance=1e-6)
    for name in ("Jx", "Jz"):
        assert found.parameters[name].value == pytest.approx(guess[name].value, rel=0.02)
    guess = truth.with_values({"CLa": 1.1 * truth["CLa"].value})
    seen = fit(Misfit(simulator.holding(guess), observed, ("CLa",)), guess, tolerance=1e-6)
    assert seen.parameters["CLa"].value == pytest.approx(truth["CLa"].value, rel=1e-3)
    assert np.sqrt(seen.covariance[0, 0]) < 0.1 * truth["CLa"].prior_std


def test_a_bound_is_kept_and_reported(simulator, observed):
    """Guards bounds through the whole estimator, and that the answer says which parameter sits at one."""
    truth = simulator.kite.parameters
    cramped = truth.with_rows([replace(truth["CLa"], value=5.0, lower=4.0, upper=5.4), truth["CD0"]])
    found = fit(Misfit(simulator.holding(cramped), observed, ("CLa", "CD0")), cramped, tolerance=1e-6)
    answer = told(found, cramped)["parameters"]
    assert found.parameters["CLa"].value == pytest.approx(5.4, abs=1e-6) and answer["CLa"]["at_bound"] and not answer["CD0"]["at_bound"]
    assert "bound" in answer["CLa"]["advice"]


def test_words_of_a_parameter_say_what_its_numbers_say(simulator, observed):
    """Guards "hardly seen, kept near its prior", which was said of an inertia at its bound, 2.36 prior standard deviations off: a weak
    parameter is near its prior, or it moved, and a well seen one is neither."""
    truth = simulator.kite.parameters
    names = ("CLa", "CD0", "CtD")
    found = fit(Misfit(simulator.holding(truth), observed, names), truth, tolerance=1e-6)
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
    misfit = Misfit(simulator, lost, ("CLa",))
    cost, whole = misfit.costs(np.array([truth["CLa"].value]), misfit.own())
    assert whole.tolist() == [k != 5 for k in range(16)] and cost[5] == pytest.approx(DIVERGED_COST * observed.measured[0].size)
    guess = truth.with_values({"CLa": 6.2})
    found = fit(Misfit(simulator.holding(guess), lost, ("CLa",)), guess, prior=False, tolerance=1e-6)
    assert found.solution.outcome == "converged" and found.solution.cost == pytest.approx(cost[5], rel=1e-4)
    # the search stops at a millionth of the whole cost, the lost segment's price included
    assert found.parameters["CLa"].value == pytest.approx(truth["CLa"].value, rel=1e-4)
    assert found.chi2 < 0.01 and np.flatnonzero(found.alive < 126).tolist() == [5]


def test_a_segment_of_which_rounding_leaves_less_than_nothing_is_as_good_as_diverged(simulator, observed, monkeypatch):
    """Guards evidence: next to divergence a Gram matrix holds 1e30 beside a residual of 1e4, and what is left of the square was once
    -1e15, a gain that led every answer. It is priced as a diverged segment, and the others find the truth."""
    linear = Misfit.linear

    def rounded(self, *asked, **how):
        said = linear(self, *asked, **how)
        if len(said.alive) == 16:
            said.gram.y[5, -1, -1] -= 1e15
        return said

    truth = simulator.kite.parameters
    guess = truth.with_values({"CLa": 6.2})
    misfit = Misfit(simulator.holding(guess), observed, ("CLa",))
    without = fit(replace(misfit, observed=observed.pick([k for k in range(16) if k != 5])), guess, prior=False, tolerance=1e-6)
    monkeypatch.setattr(Misfit, "linear", rounded)
    found = fit(misfit, guess, prior=False, tolerance=1e-6)
    assert np.flatnonzero(~found.flies).tolist() == [5] and found.solution.outcome == "converged"
    assert found.parameters["CLa"].value == pytest.approx(truth["CLa"].value, rel=1e-4)
    assert found.deviance == pytest.approx(without.deviance + DIVERGED_COST * observed.measured[0].size, abs=1.0)


def test_what_leaves_the_numbers_is_counted_and_warns_nobody(simulator, observed, recwarn):
    """Guards a user's terminal: one start whose squares overflow. numpy's warnings are errors nowhere, and said nowhere."""
    misfit = Misfit(simulator, observed, ("CL0",))
    own, x = misfit.own(), np.array([DEVELOPMENT.parameters["CL0"].value])
    own.starts[0] = 1e200
    cost, whole = misfit.costs(x, own)
    found = misfit.linear(x, own)
    assert not whole[0] and whole[1:].all() and np.isfinite(cost).all()
    assert found.alive[0] <= observed.segments.steps and not [w for w in recwarn if issubclass(w.category, RuntimeWarning)]


def test_nuisances_are_carried_to_other_segments_of_a_flight(simulator, observed):
    """Guards a model that goes on from a part of a flight: segments that both have keep their starts, others begin as a fit does."""
    whole = Misfit(simulator, observed, FREE)
    part = replace(whole, observed=observed.pick([2, 5, 11]))
    own = part.own()
    own.starts[:] += 0.25
    found, fresh = whole.carried(own, part), whole.own()
    there = np.isin(np.arange(len(observed.segments)), [2, 5, 11])
    assert np.array_equal(found.starts[there], own.starts) and np.array_equal(found.starts[~there], fresh.starts[~there])
    assert np.array_equal(part.carried(found, whole).starts, own.starts)


def test_what_segments_say_does_not_depend_on_how_many_are_worked_through_at_once(simulator, observed, monkeypatch):
    """Guards long flights: Gram matrices, squares and gradients of small parts, each in the place of the one before, are those of all
    segments at once to the last bit."""
    misfit = Misfit(simulator, observed, FREE)
    x, own = simulator.kite.parameters.vector(FREE), misfit.own()
    links, trajectories = misfit.links(x, own)
    whole = links.gram()
    monkeypatch.setattr(misfits, "most_at_once", lambda size: 5)
    said = misfit.linear(x, own)
    for name in ("x", "xy", "y", "E", "dof"):
        assert np.array_equal(getattr(said.gram, name), getattr(whole, name)), name
    assert said.squares == pytest.approx((links.r**2).sum(axis=(1, 2)), rel=1e-14) and np.array_equal(said.alive, trajectories.alive)
    of_x, of_globals, alive = next(misfit.gradients(x, [own]))
    assert of_x == pytest.approx(whole.xy[..., -1], rel=1e-9, abs=1e-6) and np.array_equal(alive, said.alive)
    assert of_globals == pytest.approx(whole.y[:, :-1, -1], rel=1e-9, abs=1e-6)
    info = misfit.eliminated(whole, own)
    few = misfit.information(x, own, FREE[:-1], lambda some, own: some.links(x, own, FREE[-1:])[0].J[..., -1:], 1)
    assert few.H == pytest.approx(info.H, rel=1e-9, abs=1e-6) and few.cost == pytest.approx(info.cost)
    r, counted = misfit.whitened(x, own)
    assert r == pytest.approx(links.r, abs=1e-9) and np.array_equal(counted, links.weight > 0)
