"""What an actuator was asked to do before a rollout begins: one that is slow, limited or has play stands where that has left it."""

from collections.abc import Iterator

import numpy as np

from awescli.notation.quantities import SURFACES
from awescli.notation.scalars import Scalar
from awescli.physics.instant import Instant

_LOOKS = ((8, 0.05), (8, 0.1), (8, 0.25), (8, 0.5), (5, 1.0), (4, 2.0))
BEHIND = tuple(round(float(t), 9) for t in np.cumsum([apart for count, apart in _LOOKS for _ in range(count)]))
"""[s] before now at which a recorded set-point is looked at: closely within the last second, ever further apart before:
what was asked between two looks long ago is not known."""
ASKED = (*SURFACES, "reel_out_speed")
"""Set-points of which the past may be asked: of surfaces, and of a winch."""


def past_of(setpoint: str) -> tuple[str, ...]:
    """Inputs that hold by how much a set-point, one of `ASKED`, differed from that of now, at `BEHIND`: zero where it has stood still."""
    return tuple(f"{setpoint}_before_{k}" for k in range(len(BEHIND)))


def moves(setpoint: str, at: Instant) -> Iterator[tuple[float, Scalar, Scalar]]:
    """(seconds, set-point before, set-point after) of every move of one from the earliest moment of `BEHIND` up to now, as differences from
    that of now."""
    ago = [(0.0, 0.0), *zip(BEHIND, (at.inputs[name] for name in past_of(setpoint)), strict=True)]
    for (later, after), (earlier, before) in zip(ago[-2::-1], ago[:0:-1], strict=True):
        yield earlier - later, before, after
