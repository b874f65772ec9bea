"""Links eliminated by the compiled function beside numpy, link by link: to rounding, and where no factor exists."""

import numpy as np
import pytest
from elimination_speed import by_numpy, links

from awescli.estimation.backward import eliminate_backward


def compare(M, E, behind, R, columns, rel):
    W = R.shape[2]
    expected = by_numpy(M, E, behind, columns)
    eliminate_backward(M, E, behind, R, columns)
    for m, (root, Y, V) in enumerate(expected):
        for found, wanted in ((R[:, m, :, :W], root), (M[:, m, :W, W:columns], Y), (M[:, m, W:, W:columns], V)):
            assert np.abs(found - wanted).max(initial=0.0) <= rel * np.abs(wanted).max(initial=0.0)


SIZES = [(1, 1, 12, 1, 1), (3, 4, 13, 8, 1), (2, 3, 5, 11, 40), (4, 2, 14, 3, 17), (2, 3, 12, 0, 6)]


@pytest.mark.parametrize(("K", "L", "n_s", "W", "more"), SIZES)
def test_as_numpy_does_it(K, L, n_s, W, more):
    compare(*links(0, K, L, n_s, W, more), rel=1e-9)


def test_a_ridge_where_rounding_left_no_factor():
    """Two processes that do the same: their Gram matrix is singular."""
    M, E, behind, R, columns = links(1, 2, 1, 12, 4, 3)
    E[:], behind[:] = 0.0, 0.0
    M[:, 0, 1], M[:, 0, :, 1] = M[:, 0, 0], M[:, 0, :, 0]
    M[:, 0, 1, :] = M[:, 0, 0, :]
    M[1, 0, 1, 1] -= 1e-6 * M[1, 0, 0, 0]  # less than singular: asks for a larger ridge
    own = by_numpy(M[:1].copy(), E[:1], behind[:1], columns), by_numpy(M[1:].copy(), E[1:], behind[1:], columns)
    eliminate_backward(M, E, behind, R, columns)
    for k, ((root, _, _),) in enumerate(own):
        assert np.isfinite(R[k]).all()
        assert R[k, 0, 1, 1] == pytest.approx(root[0, 1, 1], rel=0.1)
    assert R[0, 0, 1, 1] > 100 * R[1, 0, 1, 1] > 0


def test_of_no_metric_the_diagonal_is_left():
    M, E, behind, R, columns = links(2, 1, 1, 12, 3, 2)
    E[:], behind[:] = 0.0, 0.0
    M[0, 0, 0, 0] = -5.0
    expected = by_numpy(M.copy(), E, behind, columns)[0][0]
    eliminate_backward(M, E, behind, R, columns)
    assert np.allclose(R[0, 0, :, :3], expected[0], rtol=1e-12) and R[0, 0, 0, 0] == pytest.approx(6.0**-0.5)
