"""Screening: what the residual says about each candidate, beyond what the free parameters can absorb."""

from dataclasses import replace

import numpy as np
import pytest
from kites import DEVELOPMENT, lively, sizes, truly

from awescli.estimation.fit import fit
from awescli.estimation.nuisance_wind import RecordError
from awescli.estimation.simulation_error import SimulationError
from awescli.physics.disturbances import GUSTS, both
from awescli.physics.kite import Kite, make_effect
from awescli.simulation.rollout import Simulator
from awescli.tracing.candidates import variants
from awescli.tracing.screen import holm, screen

KEYS = ("sideslip_drag", "parasitic_drag", "actuator_lag:rudder", "pitch_curvature", "airspeed_scale", "position_latency",
        "surface_bias:roll", "tether_drag", "lift_stall", "heading_bias")  # fmt: skip
FREE = ("CL0", "CLa", "CD0", "CYb", "Clb", "Cma", "Cnb", "Cndr", "dl")


@pytest.fixture(scope="module")
def library(calm):
    kite = Kite(DEVELOPMENT, calm.log.wind.height, KEYS)
    own = [p.name for e in kite.effects if e.key in KEYS for p in e.rows()]
    return Simulator(kite, (*FREE, *own, *both(GUSTS)))


@pytest.fixture(scope="module")
def cut(library, calm):
    return lively(library.kite, calm.log, count=12, seconds=3.0)


def screened(library, observed, names=FREE):
    """The screening at the null model's own fit."""
    table = library.kite.parameters
    null = fit(library, observed, table, names, gusts=RecordError(0.0), tolerance=1e-3)
    problem = SimulationError(library.holding(null.parameters), observed, names, RecordError(0.0))
    problem.own = null.own
    x = np.array([null.parameters[n].value for n in names])
    precision = np.array([1 / table[n].prior_std ** 2 for n in names])
    return screen(problem, x, precision, np.array([table[n].value for n in names]), library.kite, KEYS)


def test_nothing_is_significant_where_nothing_is_missing(library, cut):
    """Guards the false alarm: noise alone, a dozen candidates, and none passes the family-wise test."""
    found = screened(library, truly(cut, library, noise_seed=1))
    assert not holm([s.p_value for s in found.scores]).any()


@pytest.mark.parametrize("key", ["sideslip_drag", "airspeed_scale", "pitch_curvature", "tether_drag"])
def test_the_effect_in_the_truth_leads_with_its_size(library, cut, key):
    """Guards the score test: at a small size the true effect has the largest predicted drop, and the one-step estimate is its size."""
    small = {n: p.value + 0.2 * (sizes(key)[n] - p.value) for n, p in ((n, library.kite.parameters[n]) for n in sizes(key))}
    found = screened(library, truly(cut, library, small, noise_seed=2))
    best = found.scores[0]
    assert best.key == key and holm([s.p_value for s in found.scores])[0]
    for name, size, std in zip(best.moving, best.size, best.std, strict=True):
        expected = small[name] - library.kite.parameters[name].value
        assert size == pytest.approx(expected, abs=4 * std + 0.1 * abs(expected)), name


def test_a_one_sided_effect_is_found_through_its_probe(library, cut):
    """Guards secants: a lag has no slope at null, its difference at a probe leads all the same, with a positive share."""
    truth = {"actuator_lag:rudder.tau": 0.15}
    found = screened(library, truly(cut, library, truth, noise_seed=3))
    best = found.scores[0]
    assert best.key == "actuator_lag:rudder" and best.variant.secant and best.size[0] > 0
    assert best.variant.at["actuator_lag:rudder.tau"] * best.size[0] == pytest.approx(0.15, rel=0.35)


def test_what_a_free_parameter_absorbs_does_not_count(library, cut):
    """Guards the projection: constant extra drag is CD0 by another name, so with CD0 free it cannot be told; with CD0 fixed it can."""
    observed = truly(cut, library, {"parasitic_drag.dCD": 0.03}, noise_seed=4)
    found = screened(library, observed)
    significant = dict(zip((s.key for s in found.scores), holm([s.p_value for s in found.scores]), strict=True))
    drag = next((s for s in found.scores if s.key == "parasitic_drag"), None)
    assert drag is None or "parasitic_drag.dCD" not in drag.moving or not significant["parasitic_drag"]
    fixed = screened(library, observed, tuple(n for n in FREE if n != "CD0"))
    assert fixed.scores[0].key == "parasitic_drag" and "parasitic_drag.dCD" in fixed.scores[0].moving


def test_cosines_are_those_of_directions(library, cut):
    """Guards the angle between candidates: one with itself, symmetric, and never above one."""
    found = screened(library, truly(cut, library, sizes("sideslip_drag"), noise_seed=5))
    for a in found.scores[:4]:
        assert found.cosine(a, a) == pytest.approx(1.0, abs=1e-6)
        for b in found.scores[:4]:
            assert found.cosine(a, b) == pytest.approx(found.cosine(b, a), abs=1e-6) and 0 <= found.cosine(a, b) <= 1


def test_holm_is_holms():
    """Guards the correction for many tests by a worked example: step down, and stop at the first that fails."""
    assert holm([0.01, 0.04, 0.03, 0.005], level=0.05).tolist() == [True, False, False, True]
    assert holm([0.0021, 0.9, 0.0024], level=0.01).tolist() == [True, False, True]
    assert holm([0.02], level=0.01).tolist() == [False]


def test_variants_are_the_grid_of_shapes_and_probes():
    """Guards how an effect is tried: smooth ones once, shapes and probes on their grids, shapes never as a strength."""
    assert [v.at for v in variants(make_effect("sideslip_drag", DEVELOPMENT))] == [{}]
    lag = variants(make_effect("actuator_lag:rudder", DEVELOPMENT))
    assert len(lag) == 6 and all(v.secant and v.moving == ("actuator_lag:rudder.tau",) for v in lag)
    stall = variants(make_effect("lift_stall", DEVELOPMENT))
    assert len(stall) == 4 and all(not v.secant and v.moving == ("lift_stall.k",) for v in stall)
    assert len({v.label for v in (*lag, *stall)}) == 10


def test_segments_that_do_not_count_have_no_say(library, cut):
    """Guards invalid samples in the screening: a gross error where sigma is infinite changes nothing."""
    observed = truly(cut, library, noise_seed=6)
    sigma, spoilt = observed.sigma.copy(), observed.measured.copy()
    sigma[3, 40:60] = np.inf
    spoilt[3, 40:60] += 1e3
    clean, dirty = (screened(library, replace(observed, measured=m, sigma=sigma)) for m in (observed.measured, spoilt))
    assert [s.key for s in clean.scores] == [s.key for s in dirty.scores]
    assert [s.drop for s in clean.scores] == pytest.approx([s.drop for s in dirty.scores], rel=1e-6)
