"""What a surface was asked to do before a rollout begins: an actuator that is slow, limited or has play stands where that has left it."""

from collections.abc import Iterator

import numpy as np

from awescli.notation.scalars import Scalar
from awescli.physics.instant import Instant

_LOOKS = ((8, 0.05), (8, 0.1), (8, 0.25), (8, 0.5), (5, 1.0), (4, 2.0))
BEHIND = tuple(round(float(t), 9) for t in np.cumsum([apart for count, apart in _LOOKS for _ in range(count)]))
"""[s] before now at which a recorded set-point is looked at: closely within the last second, ever further apart before:
what a surface did between two looks long ago is not known."""


def past_of(surface: str) -> tuple[str, ...]:
    """Inputs that hold by how much the set-point of a surface differed from that of now, at `BEHIND`: all zero where it has stood still."""
    return tuple(f"{surface}_before_{k}" for k in range(len(BEHIND)))


def moves(surface: str, at: Instant) -> Iterator[tuple[float, Scalar, Scalar]]:
    """(seconds, set-point before, set-point after) of every move of a surface from the earliest moment of `BEHIND` up to now, set-points as
    differences from that of now."""
    ago = [(0.0, 0.0), *zip(BEHIND, (at.inputs[name] for name in past_of(surface)), strict=True)]
    for (later, after), (earlier, before) in zip(ago[-2::-1], ago[:0:-1], strict=True):
        yield earlier - later, before, after
