"""The line's length that the winch does not say: what it does to the pull, where a fit begins, and that a level that was flown returns."""

from dataclasses import replace

import numpy as np
import pytest
from estimation.test_levels import drawn
from kites import DEVELOPMENT, at_point, flight, lively, truly

from awescli.estimation.fit import fit
from awescli.estimation.levels import relevelled
from awescli.estimation.misfit import Misfit
from awescli.estimation.processes.base import Prior
from awescli.estimation.processes.line import LineLength
from awescli.physics.disturbances import DISTURBANCES, LINE, both
from awescli.physics.kite import Kite
from awescli.simulation.rollout import Simulator


@pytest.fixture(scope="module")
def flown():
    return flight(seed=3, duration=30.0, noise=True)


def test_a_longer_line_pulls_less_by_its_spring(kite):
    """Guards the sign: 1 cm more line than the winch says unloads the virtual spring by k_v times that."""
    x, u, c = at_point(kite)
    longer = list(u)
    longer[kite.input_names.index(LINE)] += 0.01
    k_v = kite.parameters["k_v"].value
    assert kite.instant(x, u, c).tension - kite.instant(x, longer, c).tension == pytest.approx(0.01 * k_v)


def test_a_fit_begins_where_the_kite_was(flown):
    """Guards slack lines: at the nodes the line is as much longer as the distance says, its usual offset aside; and what the distance
    scatters is known of the level beforehand."""
    log = flown.log
    (group,) = LineLength.of(flown.declared, log).groups
    longer = np.linalg.norm([log[n] for n in ("p_n", "p_e", "p_d")], axis=0) - log["tether_length"]
    observed = lively(Kite(flown.declared), log, count=3, seconds=2.0)
    nodes = np.array([0, 10, 40])
    begun = group.begins(observed, nodes)
    assert begun == pytest.approx(longer[observed.segments.first[:, None] + nodes] - np.median(longer[log.valid]))
    assert group.of_level.median == pytest.approx(max(np.std(longer[log.valid]), 0.3))


def test_a_kite_that_flies_free_has_none(flown):
    """Guards untethered aircraft: without a line there is nothing to be longer."""
    inputs = {n: s for n, s in flown.log.inputs.items() if n not in ("tether_length", "reel_out_speed")}
    assert LineLength.of(DEVELOPMENT, replace(flown.log, inputs=inputs)).groups == ()
    free = DEVELOPMENT.model_copy(update={"effects": ("gravity", "aerodynamics")})
    assert LineLength.of(free, flown.log).groups == ()


def test_a_level_of_the_line_that_was_flown_is_estimated(kite, calm):
    """Guards the process by simulation: lengths of known level are drawn, flown and measured with noise; the level returns."""
    simulator, true = Simulator(kite, both(DISTURBANCES)), 0.2
    process = LineLength.of(calm.declared, calm.log)
    (group,) = process.groups
    process = replace(process, groups=(replace(group, level=true, of_level=Prior(0.3, 3.0)),), spacing=0.25)
    observed = lively(kite, calm.log, count=16, seconds=2.5)
    loose = Misfit(simulator, observed, (), (process,))
    own = loose.own()
    own = replace(own, path=drawn(loose, 5))
    measured = truly(replace(observed, segments=loose.segments(own)), simulator, noise_seed=6).measured
    misfit, begun = Misfit(simulator, replace(observed, measured=measured), (), (process.at({group.name: 0.4 * true}),)), None
    for _ in range(5):
        found = fit(misfit, kite.parameters, prior=False, own=begun or replace(misfit.own(), path=0.0 * drawn(misfit, 1)), tolerance=0.1)
        processes, _ = relevelled(misfit, found.gram, found.own, found.counted)
        new = misfit.with_processes(processes)
        misfit, begun = new, new.carried(found.own, misfit)
    assert misfit.processes[0].levels[group.name] == pytest.approx(true, rel=0.2)
