"""Adam is torch's Adam; L-BFGS shows every iteration to whoever watches, and the watcher keeps the best of them."""

import numpy as np
import torch
from scipy.optimize import rosen, rosen_der

from awescli.learning.optimisers import Adam, Lowest, lbfgs


def test_adam_takes_the_steps_of_torch():
    random = np.random.default_rng(0)
    start = random.normal(size=7)
    # half of the gradients are longer than the clip
    gradients = random.normal(size=(40, 7)) * np.where(np.arange(40) % 2, 0.1, 10.0)[:, None]
    x, adam = start, Adam.fresh(7, 0.01, 2.0)
    theirs = torch.tensor(start, requires_grad=True)
    optimiser = torch.optim.Adam([theirs], lr=0.01)
    for g in gradients:
        adam, x = adam.step(x, g)
        theirs.grad = torch.tensor(g)
        torch.nn.utils.clip_grad_norm_([theirs], 2.0)
        optimiser.step()
    # clip_grad_norm_ divides by the norm + 1e-6
    assert np.abs(x - theirs.detach().numpy()).max() < 1e-6


def test_lbfgs_is_watched_and_the_best_that_it_passed_is_kept():
    """Trained to the minimum of one function, judged by another whose minimum lies on the way: stopping early, as on validation."""
    start = np.array([-1.2, 1.0, 0.5, -0.3])
    shown = []
    x, cost, evaluations = lbfgs(lambda x: (rosen(x), rosen_der(x)), start, 200, lambda x: shown.append(x.copy()))
    assert np.abs(x - 1).max() < 1e-4 and cost < 1e-8
    assert len(shown) <= evaluations < 200 and np.array_equal(shown[-1], x)
    middle = shown[len(shown) // 2]
    lowest = Lowest(lambda x: float(((x - middle) ** 2).sum()))
    again, _, _ = lbfgs(lambda x: (rosen(x), rosen_der(x)), start, 200, lowest)
    assert np.array_equal(again, x), "being watched changes nothing"
    assert np.array_equal(lowest.x, middle) and lowest.lowest == 0.0


def test_what_is_no_number_is_never_the_lowest():
    lowest = Lowest(lambda x: float(x[0]))
    for value in (np.nan, np.inf, 3.0, np.nan, 2.0, 2.5):
        lowest(np.array([value]))
    assert lowest.lowest == 2.0 and lowest.x[0] == 2.0
    assert Lowest(lambda x: np.nan).x is None
