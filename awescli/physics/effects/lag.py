"""First-order lag shared by the effects that have one: the state, its rate, and what "no lag" means."""

from awescli.notation.scalars import Scalar, select

LONGEST_STEP = 0.02
"""[s] no model is stepped by more (`simulation.stepping`)."""
SHORTEST = 0.6 * LONGEST_STEP
"""[s] the shortest lag that is stepped through: RK4 is stable to h/tau = 2.78. What lags by less is a mixture of this lag and none, late by
tau on average: a fit can go to null and come back from it, and the cost has no step on the way."""


def lag_time(tau: Scalar) -> Scalar:
    """[s] The lag with which the state follows: tau, or the shortest one."""
    return select(tau - SHORTEST, tau, SHORTEST + 0.0 * tau)


def lagged(x: Scalar, value: Scalar, tau: Scalar) -> Scalar:
    """The lagged value: the state x, towards null ever more of `value` itself, and `value` to the last bit at null."""
    return select(tau - SHORTEST, x, value + (x - value) * (tau / SHORTEST))


def lag_rate(x: Scalar, value: Scalar, tau: Scalar) -> Scalar:
    """dx/dt = (value - x) / tau."""
    return (value - x) / lag_time(tau)


def clipped(x: Scalar, limit: Scalar) -> Scalar:
    """x limited to +-limit."""
    x = select(x - limit, limit, x)
    return select(-limit - x, -limit, x)
