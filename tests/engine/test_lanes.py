"""Segments abreast and apart again: every number keeps its place."""

import numpy as np
import pytest

from awescli.engine.lanes import abreast, apart, lane_rows
from awescli.engine.machine import LANES


@pytest.mark.parametrize("count", [1, 3, LANES])
@pytest.mark.parametrize("shape", [(1,), (7,), (8,), (5, 23), (3, 8, 2)])
def test_there_and_back(count, shape):
    """Guards squares and what is left beside them, and lanes without a segment: the last one fills them, and nobody else is written to."""
    segments = np.random.default_rng(0).normal(size=(count, *shape))
    lanes = abreast(segments)
    for lane in range(LANES):
        assert np.array_equal(lanes[..., lane], segments[min(lane, count - 1)])
    room = np.full((count + 1, *shape), np.nan)
    apart(lanes, room[:count])
    assert np.array_equal(room[:count], segments) and np.isnan(room[count]).all()


def test_segments_that_are_parts_of_larger_ones():
    """Guards the stride: segments need not follow each other directly, but each must be in one piece."""
    whole = np.random.default_rng(1).normal(size=(LANES, 3, 11))
    assert np.array_equal(abreast(whole[:, 1]), whole[:, 1].T)
    apart(lane_rows(11), whole[:, 1])
    assert (whole[:, 1] == 0).all() and (whole[:, [0, 2]] != 0).all()
    with pytest.raises(AssertionError):
        abreast(whole[:, :, 1])


def test_rows_begin_on_a_cache_line():
    for n in range(1, 6):
        assert lane_rows(n, 3).ctypes.data % 64 == 0 and lane_rows(n, 3).shape == (n, 3, LANES)
