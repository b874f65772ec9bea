"""Gusts as unknowns: the prior is Dryden's, its lengths are found, and integrating gusts out leaves parameters without bias."""

from dataclasses import replace

import numpy as np
import pytest
from kites import DEVELOPMENT, flight
from scipy.linalg import cho_solve

from awescli.estimation.fit import fit, likeliest_gusts
from awescli.estimation.gust_level import gust_level
from awescli.estimation.nuisance_wind import Gusts
from awescli.estimation.question import ask, simulator_of
from awescli.estimation.simulation_error import SimulationError, with_gust_noise
from awescli.flightlog.split import Split
from awescli.physics.kite import Kite
from awescli.simulation.gusts import dryden

STEPS, DT = 250, 0.02


@pytest.fixture(scope="module")
def turbulent():
    """40 s in gusts of 0.8 m/s, as a flight with noise is logged."""
    return flight(seed=5, duration=42.0, noise=True, effects=(("turbulence", (("sigma", 0.8), ("L", 150.0))),))


@pytest.fixture(scope="module")
def question(turbulent):
    log = turbulent.log
    n = len(log)
    parts = Split(((0, int(0.85 * n)),), ((int(0.85 * n), n),), (), (1, 1, 0), "time")
    asked, gusts = ask(simulator_of(DEVELOPMENT, log), log, parts, 5.0, tuple(log.measured)), Gusts(0.8, 0.1, airspeed=40.0)
    return replace(asked, fitted=with_gust_noise(asked.simulator, asked.fitted, gusts), gusts=gusts)


def test_the_prior_is_the_covariance_of_dryden_gusts():
    """Guards the prior: within a segment it is that of the generator's gusts, but for the variance of the mean; whose mean over many
    segments is right: integral of the correlation over the time flown."""
    gusts = Gusts(0.7, 0.1, airspeed=40.0, length=150.0, vertical_length=60.0)
    P = np.linalg.inv(gusts.precision(STEPS, DT))
    time = np.arange(0, 5.01, 0.1)
    horizontal, vertical = (lambda t: np.exp(-t * 40 / 150)), (lambda t: (1 - t / 3) * np.exp(-t / 1.5))
    for axis, form in enumerate((horizontal, horizontal, vertical)):
        C = P[axis::3, axis::3] / 0.49
        difference = C - form(np.abs(time[:, None] - time))
        assert np.ptp(difference) < 1e-6 and difference[0, 0] > 0
        assert C.mean() == pytest.approx(((7.5, 7.5, 1.5)[axis]) / 5.0, rel=1e-6)
    made = dryden(200_000, 0.1, 40.0, seed=3)
    flown = made[: 4000 * 50].reshape(80, 2500, 3).mean(axis=1)
    # the mean over 250 s, of 80 pieces, has a variance of integral / time
    assert np.allclose(flown.var(axis=0), np.array([7.5, 7.5, 1.5]) / 250, rtol=0.5)


def test_what_hats_cannot_follow_is_the_rest_of_simulated_gusts():
    """Guards the noise between nodes by least squares through made gusts."""
    gusts = Gusts(1.0, 0.25, airspeed=40.0)
    H = gusts.hats(STEPS, DT)
    made = dryden(100 * (STEPS + 1), DT, 40.0, seed=8).reshape(100, STEPS + 1, 3)
    rest = made - np.einsum("ts,ksa->kta", H @ np.linalg.pinv(H), made)
    assert gusts.between_nodes(STEPS, DT) == pytest.approx(rest.std(axis=(0, 1)), rel=0.05)


def test_lengths_are_found_again_whatever_the_wind_was_off():
    """Guards the estimate of the lengths: from made gusts, and the same with a constant error of the wind on top of them."""
    made = dryden(120 * 251, DT, 40.0, seed=4, length=100.0, vertical_length=50.0).reshape(120, 251, 3)[:, ::5] * 0.8
    asked = Gusts(0.8, 0.1, airspeed=40.0)
    moments = np.einsum("kta,ksa->ats", made, made) / len(made)
    found = asked.likeliest(moments, STEPS, DT)
    assert found.length == pytest.approx(100, rel=0.1) and found.vertical_length == pytest.approx(50, rel=0.1)
    off = made + np.array([1.5, -2.0, 0.5])
    again = asked.likeliest(np.einsum("kta,ksa->ats", off, off) / len(off), STEPS, DT)
    assert again.length == pytest.approx(found.length, rel=1e-6)


def test_the_pitot_tells_the_level():
    """Guards the level of the gusts: what the regression takes away of them is given back."""
    kite = None
    levels = []
    for seed in range(6):
        rough = flight(seed=20 + seed, duration=60.0, noise=True, effects=(("turbulence", (("sigma", 0.8), ("L", 150.0))),))
        kite = kite or Kite(DEVELOPMENT, rough.log.wind.height)
        levels.append(gust_level(rough.log, kite))
    assert np.sqrt(np.mean(np.square(levels))) == pytest.approx(0.8, rel=0.2)


def test_the_tilt_is_the_gradient_of_the_volume(question):
    """Guards what integrating gusts out adds, against finite differences of the volume with the own unknowns at their best throughout:
    means over random signs, within three standard errors."""
    observed, gusts = question.fitted.pick(np.arange(2)), replace(question.gusts, window=0.25)
    names = ("CLa", "Cmq", "CtD")
    problem = SimulationError(question.simulator, observed, names, gusts)
    x = np.array([question.prior[n].value for n in names])
    problem.own = fit(question.simulator, observed, question.prior, (), gusts=gusts, prior=False, tolerance=1e-6).own
    tilts = np.array([problem.information(x, integrate=True, seed=s)[0].tilt.sum(0) for s in range(20)])

    def volumes(x):
        other = SimulationError(question.simulator, observed, names, gusts)
        other.own, _ = problem.at_best(x, problem.own)
        return np.array([other.information(x, integrate=True, seed=s)[0].volume.sum() for s in range(20)])

    for i, name in enumerate(names):
        e = np.eye(len(names))[i] * 2e-3 * abs(x[i])
        slopes = -(volumes(x + e) - volumes(x - e)) / (4 * e[i])
        chance = np.hypot(slopes.std(), tilts[:, i].std()) / np.sqrt(20)
        assert abs(tilts[:, i].mean() - slopes.mean()) < 3 * chance + 0.02 * abs(slopes.mean()), name
        assert abs(slopes.mean()) > 3 * chance, name


def test_gusts_that_are_integrated_out_pull_no_parameter(question):
    """Guards the fit in gusty air: at the truth the gradient is what chance makes of it (chi-square in the norm of the information), while
    gusts at their best alone would pull by many standard deviations."""
    names = tuple(n for n in question.names if n not in question.kite.record)
    problem = SimulationError(question.simulator, question.fitted, names, question.gusts)
    found = fit(question.simulator, question.fitted, question.prior, (), gusts=question.gusts, prior=False, tolerance=0.01)
    problem.own = found.own
    info, _ = problem.information(np.array([question.prior[n].value for n in names]), integrate=True)
    scale = np.array([question.prior[n].prior_std for n in names])
    values, vectors = np.linalg.eigh(info.H.sum(0) * np.outer(scale, scale))
    known = values > 1.0

    def size(b):
        return float((((vectors.T @ (scale * b))[known]) ** 2 / values[known]).sum()) / known.sum()

    assert size(info.b.sum(0)) > 2.5
    assert size((info.b + info.tilt).sum(0)) < 1.7


def test_lengths_come_back_from_a_flight(question):
    """Guards expectation-maximisation: from a prior of a third and of three times the length, the fitted gusts tell the same one."""
    lengths = []
    for factor in (1 / 3, 3.0):
        gusts = replace(question.gusts, length=150.0 * factor, vertical_length=60.0 * factor)
        found = fit(question.simulator, question.fitted, question.prior, (), gusts=gusts, prior=False, tolerance=0.1)
        lengths.append(likeliest_gusts(question.fitted, found, gusts))
    assert lengths[0].length == pytest.approx(lengths[1].length, rel=0.1)
    assert 75 < lengths[0].length < 300 and 30 < lengths[0].vertical_length < 120


def test_noise_between_nodes_is_replaced_and_not_piled_up(question):
    """Guards the noise that is settled anew after every accepted effect."""
    once = with_gust_noise(question.simulator, question.fitted, question.gusts)
    again = with_gust_noise(question.simulator, once, question.gusts)
    assert np.allclose(once.sigma, again.sigma, rtol=1e-12) and (once.added > 0).any()
    calm = with_gust_noise(question.simulator, once, replace(question.gusts, std=1e-9))
    assert np.allclose(calm.sigma, np.sqrt(once.sigma**2 - once.added), rtol=1e-6)


def test_own_unknowns_follow_a_step_of_the_parameters(question):
    """Guards the narrow valley: after a step of a well known parameter the own unknowns are brought to their best, where their gradient
    is zero."""
    names = ("CLa",)
    problem = SimulationError(question.simulator, question.fitted, names, question.gusts)
    before = problem.own.copy()
    x = np.array([question.prior["CLa"].value * 1.05])
    own, (cost, whole) = problem.at_best(x, before)
    start, _ = problem.costs(x, before)
    assert whole.all() and (cost < start).all() and (problem.own == before).all()
    problem.own = own
    info, _ = problem.information(x)
    assert cost.sum() - info.cost.sum() < 0.5 * len(own)
    assert np.isfinite([cho_solve(f, np.ones(len(f[0]))) for f, _, _ in info.back]).all()


def test_what_integrating_adds_is_known_anew_after_a_long_way():
    """Guards the volume against being carried on along its old slope: ten standard deviations on, it promised hundreds of units of cost
    that are not there. Small steps to and fro end, a step from far away waits."""
    from awescli.estimation.fit import SWINGS, _Problem

    problem = _Problem.__new__(_Problem)
    problem.integrals, problem.H, problem.x, problem.integrated_at = (), np.eye(1), np.zeros(1), np.zeros(1)
    problem.swings = 0
    assert [problem._due(np.array([2.0])) for _ in range(SWINGS)] == [True] * (SWINGS - 1) + [False]
    assert problem._due(np.array([6.0])) and not problem._due(np.array([0.5])) and not problem._due(np.array([40.0]))
