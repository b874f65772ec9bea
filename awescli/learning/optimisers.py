"""Adam and L-BFGS on a cost with a gradient. They know vectors, not kites."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np


@dataclass(frozen=True)
class Adam:
    """Kingma & Ba 2015, algorithm 1, with the gradient's norm clipped. first, second: moments (n,); count: steps taken."""

    first: np.ndarray
    second: np.ndarray
    count: int = 0
    rate: float = 0.01
    clip: float = 10.0

    @classmethod
    def fresh(cls, n: int, rate: float, clip: float) -> "Adam":
        return cls(np.zeros(n), np.zeros(n), 0, rate, clip)

    def step(self, x: np.ndarray, gradient: np.ndarray) -> tuple["Adam", np.ndarray]:
        """(the optimiser after one step, the new x)"""
        b1, b2, small = 0.9, 0.999, 1e-8
        size = float(np.linalg.norm(gradient))
        g = gradient * min(1.0, self.clip / max(size, 1e-300))
        m, v, t = b1 * self.first + (1 - b1) * g, b2 * self.second + (1 - b2) * g * g, self.count + 1
        step = self.rate * (m / (1 - b1**t)) / (np.sqrt(v / (1 - b2**t)) + small)
        return replace(self, first=m, second=v, count=t), x - step


class Lowest:
    """Keeps the point of lowest cost among those it is shown; what is no number never wins."""

    def __init__(self, cost: Callable[[np.ndarray], float]):
        self.cost, self.x, self.lowest = cost, None, np.inf

    def __call__(self, x: np.ndarray) -> None:
        cost = self.cost(x)
        if cost < self.lowest:
            self.x, self.lowest = x.copy(), cost


def lbfgs(
    cost: Callable[[np.ndarray], tuple[float, np.ndarray]], x: np.ndarray, iterations: int, watch: Callable[[np.ndarray], None],
    memory: int = 100,
) -> tuple[np.ndarray, float, int]:  # fmt: skip
    """(x, cost there, evaluations): scipy's L-BFGS-B without bounds. watch(x) is called after every iteration.

    Its line search (More & Thuente 1994) meets the strong Wolfe conditions; memory as in Rositani (2025).
    """
    from scipy.optimize import minimize

    options = {"maxiter": iterations, "maxcor": memory, "maxfun": 3 * iterations, "ftol": 1e-9, "gtol": 1e-9}
    found = minimize(cost, x, jac=True, method="L-BFGS-B", options=options, callback=watch)
    return found.x, float(found.fun), int(found.nfev)
