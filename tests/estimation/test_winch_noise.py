"""The process for a line's length that was read in coarse steps."""

from dataclasses import replace

from kites import DEVELOPMENT, flight

from awescli.estimation.processes.winch_noise import WinchNoise
from awescli.flightlog.log import Unknown
from awescli.physics.disturbances import LINE


def test_only_a_noisy_winch_on_a_line_is_unknown():
    """Guards good winches, which have no process, and kites that fly free."""
    flown = flight(seed=3, duration=10.0)
    assert WinchNoise.of(flown.declared, flown.log).groups == ()
    noisy = replace(flown.log, unknown={"tether_length": Unknown(0.01, 0.4)})
    (group,) = WinchNoise.of(DEVELOPMENT, noisy).groups
    assert (group.axes, group.level, group.memory) == ((LINE,), 0.01, 0.4) and group.of_level.spread == 0
    free = DEVELOPMENT.model_copy(update={"effects": tuple(k for k in DEVELOPMENT.effects if k != "tether")})
    assert WinchNoise.of(free, noisy).groups == ()
