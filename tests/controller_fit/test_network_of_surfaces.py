"""A network that drives several surfaces at once."""

from types import SimpleNamespace

import numpy as np

from awescli.controller_fit.network import _forward, _train


def test_two_surfaces_of_an_affine_law_are_recovered():
    random = np.random.default_rng(3)
    X = random.normal(size=(300, 4))
    U = 0.1 * X @ random.normal(size=(4, 2)) + 0.02
    hold = SimpleNamespace(X=X[:20], U=U[:20], strength=0.01)
    config = SimpleNamespace(seed=0, network_width=4)
    fields = _train(SimpleNamespace(X=X, U=U), np.arange(300), 1e-6, config, hold, 30)
    scale = U.std(axis=0)
    assert np.abs((_forward(fields, X) - U) / scale).max() < 0.02
