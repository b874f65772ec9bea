"""First-order lag shared by the effects that have one: the state, its rate, and what "no lag" means."""

from awescli.notation.scalars import select

SHORTEST = 0.012
"""[s] a lag below this is taken as none: with 20 ms steps RK4 cannot tell them apart (stable to h/tau = 2.78)."""


def lagged(x, value, tau):
    """The lagged value: the state x where there is a lag, `value` itself (to the last bit) where tau is null."""
    return select(tau - SHORTEST, x, value)


def lag_rate(x, value, tau):
    """dx/dt = (value - x) / tau; the state follows at the shortest lag where tau is null."""
    return (value - x) / select(tau - SHORTEST, tau, SHORTEST + 0.0 * tau)


def clipped(x, limit):
    """x limited to +-limit."""
    x = select(x - limit, limit, x)
    return select(-limit - x, -limit, x)
