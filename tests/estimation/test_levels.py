"""Levels of processes and of noise: what was flown is estimated, what was not there is not found."""

from dataclasses import replace

import numpy as np
import pytest
from kites import DEVELOPMENT, flight, lively, truly
from scipy import stats

from awescli.estimation import levels_in_turn, staged_fit
from awescli.estimation.fit import fit
from awescli.estimation.levels import LONGER, mean_squares, noise_factors, opened, prior_deviance, relevelled
from awescli.estimation.levels_in_turn import _hurried
from awescli.estimation.misfit import Misfit
from awescli.estimation.problem import build, levels_found, simulator_of
from awescli.estimation.processes.base import Group, Prior, spacing
from awescli.estimation.processes.drift import Drift
from awescli.estimation.processes.gusts import Gusts
from awescli.estimation.processes.model_error import ModelError
from awescli.estimation.processes.pitch_yaw_gusts import PitchYawGusts
from awescli.estimation.staged_fit import MODEL_ERROR, _closed, fit_in_stages
from awescli.flightlog.split import Split
from awescli.notation.parameters import ParameterTable
from awescli.physics.disturbances import DISTURBANCES, both
from awescli.simulation.rollout import Simulator


def wandering(*axes: tuple[str, float], memory: float = 0.7, spacing: float = 0.25) -> ModelError:
    """Model error on some axes: (axis, level), with priors so wide that they do not matter."""
    wide = Prior(0.3, 3.0)
    return ModelError(tuple(Group(a, (a,), level, memory, wide, Prior(memory)) for a, level in axes), spacing)


@pytest.fixture(scope="module")
def simulator(kite):
    return Simulator(kite, both(DISTURBANCES))


@pytest.fixture(scope="module")
def observed(kite, calm):
    """16 segments of 2.5 s, apart from one another."""
    return lively(kite, calm.log, count=16, seconds=2.5)


def drawn(misfit: Misfit, seed: int) -> np.ndarray:
    """(K, L + 1, W) paths of the processes, drawn from their own distribution; no two segments are one flight."""
    random, axes = np.random.default_rng(seed), misfit.axes
    gap = np.diff(misfit.nodes) * misfit.observed.segments.dt
    path = axes.level * random.standard_normal((len(misfit.observed.segments), len(misfit.nodes), len(axes)))
    for m, dt in enumerate(gap):
        path[:, m + 1] = axes.decay(dt) * path[:, m] + np.sqrt(axes.variance(dt)) * path[:, m + 1] / axes.level
    return path


def levelled(misfit: Misfit, table, rounds: int = 5):
    """(levels, noise factors) after fits of the nuisances and new levels in turn."""
    own, factors = None, {}
    for _ in range(rounds):
        found = fit(misfit, table, prior=False, own=own, tolerance=0.1)
        processes, _ = relevelled(misfit, found.gram, found.own, found.counted)
        factors = noise_factors(found)
        new = misfit.with_processes(processes)
        misfit, own = new, new.carried(found.own, misfit)
    return {g.name: g.level for p in misfit.processes for g in p.groups}, factors


def test_a_level_that_was_flown_is_estimated(simulator, observed, kite):
    """Guards the estimate by simulation: forces and moments of known level are drawn, flown and measured with noise; from levels that are
    four times too small and too large the estimates agree and hold the truth within what so many steps can tell."""
    true = {"force_z": 1.0, "moment_y": 0.3}
    loose = Misfit(simulator, observed, (), (wandering(*true.items()),))
    own = replace(loose.own(), path=drawn(loose, 5))
    flown = truly(replace(observed, segments=loose.segments(own)), simulator, noise_seed=6)
    measured = replace(observed, measured=flown.measured)
    found = []
    for factor in (0.25, 4.0):
        begun = wandering(*((a, factor * level) for a, level in true.items()))
        levels, factors = levelled(Misfit(simulator, measured, (), (begun,)), kite.parameters)
        found.append(levels)
        for axis, level in true.items():
            assert levels[axis] == pytest.approx(level, rel=0.2), axis  # 160 nodes: 6 % if every step were seen
        assert max(abs(f - 1) for f in factors.values()) < 0.1
    assert found[0] == pytest.approx(found[1], rel=0.05)


def test_a_memory_that_was_flown_is_estimated(simulator, kite, calm):
    """Guards the memories by simulation: of a slow force and a quick moment, level and memory return from one memory for both, and from
    memories that are too long and too short; between two fits a memory goes no farther than it may."""
    observed = lively(kite, calm.log, count=16, seconds=5.0)
    true = {"force_z": (1.0, 2.0), "moment_y": (0.3, 0.3)}
    wide = Prior(0.3, 3.0), Prior(0.7, 2.0)
    flown = ModelError(tuple(Group(a, (a,), level, memory, *wide) for a, (level, memory) in true.items()), 0.1)
    loose = Misfit(simulator, observed, (), (flown,))
    own = replace(loose.own(), path=drawn(loose, 5))
    measured = replace(observed, measured=truly(replace(observed, segments=loose.segments(own)), simulator, noise_seed=6).measured)
    found = []
    for begun in ({"force_z": 0.7, "moment_y": 0.7}, {"force_z": 0.3, "moment_y": 1.5}):
        misfit, own = Misfit(simulator, measured, (), (flown.at(dict.fromkeys(true, 0.3), begun),)), None
        for _ in range(6):
            fitted = fit(misfit, kite.parameters, prior=False, own=own, tolerance=0.1)
            processes, _ = relevelled(misfit, fitted.gram, fitted.own, fitted.counted)
            for before, after in zip(misfit.processes[0].groups, processes[0].groups, strict=True):
                assert 1 / LONGER - 1e-9 < after.memory / before.memory < LONGER + 1e-9
            own, misfit = fitted.own, misfit.with_processes(processes)
        found.append({g.name: g.memory for g in misfit.processes[0].groups})
        for g in misfit.processes[0].groups:
            level, memory = true[g.name]
            # 80 s are 40 memories of the force: 16 % of its level, 32 % of its memory
            assert g.level == pytest.approx(level, rel=0.25) and g.memory == pytest.approx(memory, rel=0.45), g.name
    assert found[0] == pytest.approx(found[1], rel=0.1)


def test_gusts_that_pitch_and_yaw_the_kite_are_estimated(simulator, observed, kite, calm):
    """Guards the gusts' gradients along the fuselage: drawn, flown and measured with noise, from levels three times too small, beside model
    error of the same moments, which is slower and was not flown."""
    true = {"pitch gusts": 0.3, "yaw gusts": 0.5}
    gusts = replace(PitchYawGusts.of(kite.declaration, calm.log), spacing=0.05)
    loose = Misfit(simulator, observed, (), (gusts.at(true),))
    flown = truly(replace(observed, segments=loose.segments(replace(loose.own(), path=drawn(loose, 5)))), simulator, noise_seed=6)
    begun = gusts.at({name: level / 3 for name, level in true.items()}), wandering(("moment_y", 0.05), ("moment_z", 0.05))
    levels, _ = levelled(Misfit(simulator, replace(observed, measured=flown.measured), (), begun), kite.parameters)
    for name, level in true.items():
        assert levels[name] == pytest.approx(level, rel=0.2), name
    assert levels["moment_y"] == levels["moment_z"] == 0.0


def test_what_was_not_flown_is_not_found(simulator, observed, kite):
    """Guards the false alarm: of six axes and gusts that are open in noise alone, none stays."""
    measured = truly(observed, simulator, noise_seed=7)
    open_ = (wandering(*((a, 0.1) for a in ("force_x", "force_y", "force_z", "moment_x", "moment_y", "moment_z"))),)
    levels, _ = levelled(Misfit(simulator, measured, (), open_), kite.parameters, rounds=2)
    assert set(levels.values()) == {0.0}


def test_noise_is_estimated_beside_a_process(simulator, observed, kite):
    """Guards the noise's factors: a channel that is twice as noisy as declared is told, the others are not, although starts and a process
    take up a part of every residual."""
    loose = Misfit(simulator, observed, (), (wandering(("force_z", 1.0)),))
    own = replace(loose.own(), path=drawn(loose, 8))
    flown = truly(replace(observed, segments=loose.segments(own)), simulator, noise_seed=9)
    at = observed.outputs.index("q")
    truth = truly(replace(observed, segments=loose.segments(own)), simulator)
    measured = flown.measured.copy()
    measured[..., at] += flown.measured[..., at] - truth.measured[..., at]
    found = fit(Misfit(simulator, replace(observed, measured=measured), (), loose.processes), kite.parameters, prior=False, tolerance=0.1)
    factors = noise_factors(found)
    assert factors["q"] == pytest.approx(2.0, rel=0.06)
    assert max(abs(f - 1) for n, f in factors.items() if n != "q") < 0.1


def test_a_noise_that_a_process_follows_is_found_at_once(simulator, observed, kite):
    """Guards the number of rounds: of a channel that is much more precise than declared, starts and a process take up much of what is left,
    and nothing of that is noise. One step comes near; the mean square with what is not known stays a fifth above."""
    loose = Misfit(simulator, observed, (), (wandering(("moment_y", 3.0)),))
    own = replace(loose.own(), path=drawn(loose, 8))
    flown, truth = (truly(replace(observed, segments=loose.segments(own)), simulator, **noise) for noise in ({"noise_seed": 9}, {}))
    at = observed.outputs.index("q")
    measured = flown.measured.copy()
    measured[..., at] = truth.measured[..., at] + 0.3 * (flown.measured[..., at] - truth.measured[..., at])
    found = fit(Misfit(simulator, replace(observed, measured=measured), (), loose.processes), kite.parameters, prior=False, tolerance=0.1)
    assert noise_factors(found)["q"] == pytest.approx(0.3, rel=0.15)
    assert mean_squares(found)["q"][0] ** 0.5 > 1.2 * 0.3


@pytest.mark.parametrize("spread", [14.0, 15.9, 16.4])
def test_a_noise_of_which_nothing_is_left_stays(simulator, observed, kite, monkeypatch, spread):
    """Guards a channel with few samples that nuisances determine nearly all: what is left of them is no more than the error of the draws,
    on either side, and says nothing of the noise."""
    found = fit(Misfit(simulator, observed, (), ()), kite.parameters, prior=False, tolerance=0.1)
    sums = tuple(np.full(len(observed.outputs), value) for value in (0.4, spread, 16.0))
    monkeypatch.setattr("awescli.estimation.levels._whitened", lambda *of: sums)
    assert all(factor == pytest.approx(1.0, abs=0.15) for factor in noise_factors(found).values())


def test_a_group_that_is_worth_nothing_goes_alone(simulator, observed, kite):
    """Guards pruning: of two axes the one that was flown stays, the other goes, and the deviance of the rest does not rise."""
    loose = Misfit(simulator, observed, (), (wandering(("force_z", 1.0)),))
    own = replace(loose.own(), path=drawn(loose, 11))
    flown = truly(replace(observed, segments=loose.segments(own)), simulator, noise_seed=12)
    both = wandering(("force_z", 0.5), ("moment_x", 0.1))
    misfit = Misfit(simulator, replace(observed, measured=flown.measured), (), (both,))
    found = fit(misfit, kite.parameters, prior=False, tolerance=0.1)
    (kept,), gain = relevelled(misfit, found.gram, found.own, found.counted)
    assert kept.levels["moment_x"] == 0.0 and kept.levels["force_z"] == pytest.approx(1.0, rel=0.3) and gain > 0


def test_opening_and_priors():
    """Guards what is tried first: groups at zero at a share of their median, others as they are; the prior is log-normal."""
    process = wandering(("force_z", 0.0), ("moment_y", 0.7))
    (there,) = opened((process,), (MODEL_ERROR,), 0.05)
    assert there.levels == {"force_z": pytest.approx(0.015), "moment_y": 0.7}
    assert opened((process,), ("gusts",)) == (process,)
    density = stats.lognorm(s=3.0, scale=0.3)
    # -2 log density in log level, less its value at the median
    value = -2 * (density.logpdf(0.7) + np.log(0.7) - density.logpdf(0.3) - np.log(0.3))
    assert prior_deviance((process,)) == pytest.approx(value)


ASKED = ("CL0", "Cma", "Cndr")


def in_gusts(sigma: float, length: float = 150.0):
    """(problem of a flight of 42 s in gusts of `sigma` [m/s] and `length` [m], of which only ASKED are not known; the truth's table)."""
    flown = flight(seed=5, duration=42.0, noise=True, effects=(("turbulence", (("sigma", sigma), ("L", length))),) if sigma else ())
    n = len(flown.log)
    parts = Split(((0, int(0.85 * n)),), ((int(0.85 * n), n),), (), (1, 1, 0), "time")
    truth, guess = flown.flown.table(), flown.declared.table()
    rows = [guess[p] if p in ASKED else replace(guess[p], value=truth[p].value, free=False) for p in guess]
    declared = flown.declared.with_parameters(ParameterTable(rows))
    return build(simulator_of(declared, flown.log), flown.log, parts, 2.5, tuple(flown.log.measured)), truth


def test_gusts_that_were_flown_are_found_and_none_where_none_were():
    """Guards the whole way from a log: in gusts of 0.8 m/s their level is estimated and nothing is called model error; in calm air both are
    absent."""
    found = {}
    for sigma in (0.8, 0.0):
        problem, _ = in_gusts(sigma)
        gusts = {g.name for p in problem.processes if isinstance(p, Gusts) for g in p.groups}
        _, problem = fit_in_stages(problem, (1.0,))
        found[sigma] = {name: said["level"] for name, said in levels_found(problem).items() if name != "wind record"}
    assert found[0.0] == {}
    assert set(found[0.8]) <= gusts and "horizontal gusts" in found[0.8]
    # 35 s hold a dozen correlation times of the horizontal gusts
    assert found[0.8]["horizontal gusts"] == pytest.approx(0.8, rel=0.4)


def test_gusts_of_another_length_keep_their_level():
    """Guards the length of gusts from a log: gusts of 0.8 m/s that are 40 m long, a quarter of what is expected, seem to be of
    1.5 m/s where their length is held."""
    problem, _ = in_gusts(0.8, 40.0)
    _, free = fit_in_stages(problem, (1.0,))
    found = levels_found(free)["horizontal gusts"]
    assert found["level"] == pytest.approx(0.8, rel=0.25)
    assert found["memory_s"] == pytest.approx(40.0 / problem.log["V_a"].mean(), rel=0.6)
    held = [replace(p, groups=tuple(replace(g, of_memory=Prior(g.memory)) for g in p.groups)) for p in problem.processes]
    _, held = fit_in_stages(problem.with_processes(held), (1.0,))
    assert levels_found(held)["horizontal gusts"]["level"] > 1.3


def test_a_fit_that_begins_in_gusts_finds_them_and_keeps_the_derivatives():
    """Guards `in_gusts` against inventing model error: in gusts of 0.8 m/s, which the controller answers, their level is found at once,
    nothing is left to the line, and the parameters lie within three standard deviations of the truth."""
    problem, truth = in_gusts(0.8)
    fitted, problem = fit_in_stages(problem, (1.0,), in_gusts=True)
    levels = {name: said["level"] for name, said in levels_found(problem).items()}
    assert levels["horizontal gusts"] == pytest.approx(0.8, rel=0.4) and "line length" not in levels
    std = dict(zip(fitted.names, np.sqrt(np.diag(fitted.covariance)), strict=True))
    for name in ASKED:
        assert abs(fitted.parameters[name].value - truth[name].value) < 3 * std[name], name


@pytest.mark.parametrize("ends", [True, False])
def test_a_fit_settles_between_nodes_that_are_far_apart_first(monkeypatch, ends):
    """Guards the time in gusts: what has settled between nodes 0.1 s apart is where the fit between all nodes begins, and it
    ends at the same values; what has not come to its minimum there is forgotten. Without gusts there is one fit as before."""
    problem, _ = in_gusts(0.8)
    gusty = problem.with_processes(staged_fit.wide_open(problem.processes))
    plain, asked = levels_in_turn.fit_levels, []

    def counting(problems, labels, tables, *, tolerance, owns, **how):
        result, found = plain(problems, labels, tables, tolerance=tolerance, owns=owns, **how)
        asked.append((spacing(found[0].processes), tables[0]))
        failed = replace(result, solution=replace(result.solution, kkt=result.solution.cost))
        return (result if ends or len(asked) > 1 else failed), found

    monkeypatch.setattr(levels_in_turn, "fit_levels", counting)
    tables = [problem.simulator.kite.parameters]
    how = {"labels": [""], "tables": tables, "per_flight": (), "prior": True, "rounds": 3, "tolerance": 0.1}
    result, (found,) = levels_in_turn.fit_coarsely_first([gusty], **how)
    assert [round(step, 9) for step, _ in asked] == [levels_in_turn.COARSE, spacing(gusty.processes)] and spacing(found.processes) < 0.03
    assert (asked[1][1] is tables[0]) is not ends
    assert result.flights[0].misfit.nodes.size > 50
    if ends:
        straight, _ = plain([gusty], **how)
        away = (result.solution.x - straight.solution.x) / np.sqrt(np.diag(straight.covariance))
        assert np.abs(away).max() < 0.5
        asked.clear()
        levels_in_turn.fit_coarsely_first([problem], **how)
        assert len(asked) == 1


def test_a_level_falls_fast_until_it_has_risen():
    """Guards a gusty flight against levels that swing: with falls taken twice as far, round after round, vertical gusts went from 0.36 to
    0.45 m/s and back, and model error that was not there stayed. A level that has risen once goes only as far as it was asked."""
    was, asked = (wandering(("force_z", 0.8)),), (wandering(("force_z", 0.4)),)
    assert _hurried(was, asked, set())[0].levels["force_z"] == pytest.approx(0.2)
    assert _hurried(was, asked, {"force_z"})[0].levels["force_z"] == pytest.approx(0.4)
    assert _hurried(asked, was, set())[0].levels["force_z"] == pytest.approx(0.8)


def test_what_gusts_stand_for_is_not_kept_beside_them():
    """Guards the look for gusts: model error that stood in their place is closed, as far as it goes, and opens again if it is needed."""
    (closed,) = _closed((wandering(("force_z", 0.8), ("moment_y", 1e-3)),), MODEL_ERROR, 0.05)
    assert closed.levels == {"force_z": pytest.approx(0.05 * 0.3), "moment_y": pytest.approx(1e-3)}


def test_the_nodes_of_a_drift_stay_when_model_error_goes(calm):
    """Guards a position 0.15 s late (blind pair): without model error its drift had nodes 1.25 s apart instead of 0.2 s, could not follow a
    loop any more, and the noise of the position rose to three times what it is."""
    error, drift = (opened([kind.of(DEVELOPMENT, calm.log)], (kind.name,))[0] for kind in (ModelError, Drift))
    assert spacing([drift]) == spacing([drift, error]) < np.inf
