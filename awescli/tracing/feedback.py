"""Which surfaces answer what the kite does, and which are moved by a plan that does not look at it.

There is feedback from the kite to a surface where the kite tells more of what the surface does next than the surface's own past does
(Granger, Econometrica 37, 1969; feedback between recorded signals: Caines & Chan, IEEE Transactions on Automatic Control 20, 1975). That
surfaces move the kite does not make it look so: a surface is asked for at the next sample, which no kite has felt yet.
"""

from collections.abc import Sequence

import numpy as np
from scipy import stats

from awescli.flightlog.log import FlightLog
from awescli.notation.quantities import ANGLES, SURFACES

PAST = 3
"""Samples of the surface before the one that is asked for, and of the kite."""
SEEN = ("p", "q", "r", "phi", "theta", "psi", "V_a", "alpha", "beta", "v_n", "v_e", "v_d")
"""What a controller may look at, and no surface moves at once."""
AT_ONCE = ("a_x", "a_y", "a_z", "tension")
"""What a controller may look at, too, and surfaces move at once: a sample later their own past tells that."""
CHANCE = 0.001
"""Probability with which a surface that is moved by a plan is said to answer all the same: it is then only doubted as one that does. (Set
on JSBSim flights of families 42 to 45, whose steered rudders are far below.)"""


def answering(log: FlightLog) -> tuple[str, ...]:
    """The surfaces of a log that answer its kite, or may do so."""
    return tuple(s for s in SURFACES if s in log.inputs and _answers(log, s))


def _answers(log: FlightLog, surface: str) -> bool:
    u, now = log.inputs[surface], np.arange(PAST, len(log))
    # a kite knows nothing of a command that is given at the same moment
    now = now[np.all([log.valid[now - k] for k in range(PAST + 1)], axis=0)]
    kite = [(np.unwrap(log[n]) if n in ANGLES else log[n], int(n in AT_ONCE)) for n in (*SEEN, *AT_ONCE) if n in log]
    own = _columns([u[now - k] for k in range(1, PAST + 1)])
    # steps: levels that wander as slowly as the surface does look like answers by chance
    seen = _columns([x[now - k - late] - x[now - k - late - 1] for x, late in kite for k in (0, 1)])
    freedom = len(now) - own.shape[1] - seen.shape[1] - 1
    if freedom < 1 or not seen.shape[1]:
        return True
    alone, both = (_left(X, u[now] - u[now - 1]) for X in (own, np.hstack([own, seen])))
    if both <= 0:
        return alone > 0
    F = (alone - both) / seen.shape[1] / (both / freedom)
    return bool(stats.f.sf(F, seen.shape[1], freedom) < CHANCE)


def _columns(signals: Sequence[np.ndarray]) -> np.ndarray:
    """(N, n) signals beside each other, about their means."""
    X = np.column_stack(signals) if signals else np.zeros((0, 0))
    return X - X.mean(axis=0) if X.size else X


def _left(X: np.ndarray, y: np.ndarray) -> float:
    """Sum of squares that a linear regression of y (N,) on columns X (N, n), and a constant, leaves."""
    y = y - y.mean()
    return float(((y - X @ np.linalg.lstsq(X, y, rcond=None)[0]) ** 2).sum())
