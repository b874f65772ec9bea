"""Folds of cross-validation where a flight has few loops."""

from dataclasses import replace

import numpy as np
import pytest
from controller_fit.circling import FIXED, circling

from awescli.controller_fit.config import ControllerConfig
from awescli.controller_fit.fit import fit_controller
from awescli.controller_fit.samples import gather, in_blocks, loops_flown
from awescli.notation.errors import BadInput


def test_few_loops_are_cut_into_blocks_of_time():
    """Guards short flights: three loops cannot be six folds, but three, and it is said; or six blocks of equal length are, where that is
    wanted."""
    log, parts, settings = circling(), ([(0, 1200)], [(1200, 1700)]), {"kind": "linear", "features": FIXED, "folds": 6}
    with pytest.raises(BadInput, match="3 loops in the training part, fewer than 6 folds"):
        fit_controller(log, *parts, ControllerConfig(**settings, few_loops="refuse"))
    fit = fit_controller(log, *parts, ControllerConfig(**settings))
    assert (fit.report["folds"], fit.report["folds_of"]) == (3, "loops") and np.isfinite(fit.report["nrmse"]["test"]["rudder"])
    fit = fit_controller(log, *parts, ControllerConfig(**settings, few_loops="blocks"))
    assert (fit.report["folds"], fit.report["folds_of"]) == (6, "blocks") and np.isfinite(fit.report["nrmse"]["test"]["rudder"])
    cut = in_blocks(gather(log, *parts), 6)
    assert np.bincount(cut.loop[cut.train]).tolist() == [200] * 6 and (np.diff(cut.loop) >= 0).all()


@pytest.mark.parametrize("lost", ["but for three samples", "at the limit of its rate"])
def test_a_loop_of_which_nothing_is_left_is_none(lost):
    """Guards a plan that stopped at "2 loops in the training part, fewer than 3 folds" where blocks of time were allowed: of three loops
    one is a sliver, or one in which all set-points move as fast as they can."""
    log, settings = circling(), {"kind": "linear", "features": FIXED, "folds": 3}
    loop = gather(log, [(0, 3000)], [(3000, 3500)]).loop
    begins = np.searchsorted(loop, [1, 2, 3])
    ends = int(begins[1]) + 3
    if lost == "at the limit of its rate":
        rudder, ends = log.inputs["rudder"].copy(), int(begins[2])
        there = slice(begins[0], begins[1])
        rudder[there] = rudder[begins[0] - 1] + 0.1 * (np.arange(begins[1] - begins[0]) % 2 == 0)
        log = replace(log, inputs={**log.inputs, "rudder": rudder})
    parts = [(0, ends)], [(1500, 2000)]
    assert np.unique(gather(log, *parts).loop[:ends]).size == 3
    assert loops_flown(gather(log, *parts)) == (2 if lost == "but for three samples" else 3)
    with pytest.raises(BadInput, match="2 loops in the training part, fewer than 3 folds"):
        fit_controller(log, *parts, ControllerConfig(**settings, few_loops="refuse"))
    assert fit_controller(log, *parts, ControllerConfig(**settings)).report["folds"] == 2
    fit = fit_controller(log, *parts, ControllerConfig(**settings, few_loops="blocks"))
    assert fit.report["folds_of"] == "blocks" and np.isfinite(fit.report["nrmse"]["test"]["rudder"])


def test_one_block_is_too_few():
    """Guards cross-validation: with one loop, or one block of a flight without loops, nothing is left to judge a law on."""
    log, settings = circling(), {"kind": "linear", "features": FIXED}
    parts = [(0, 190)], [(3000, 3500)]
    with pytest.raises(BadInput, match="1 loop in the training part, fewer than 2 folds") as error:
        fit_controller(log, *parts, ControllerConfig(**settings))
    assert "few_loops to blocks" in str(error.value)
