"""Memory for sensitivities, used again: they are larger than all else of a flight, and a system hands out new memory page by page, which
costs time."""

import math
from collections import deque
from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np

SIZE = 2**25
"""[bytes] that the sensitivities of some segments may take at once, for each core."""


class Workspace:
    """Memory that its owner fills again and again."""

    def __init__(self) -> None:
        self._held = np.empty(0)

    def array(self, shape: tuple[int, ...]) -> np.ndarray:
        """An array that is not filled, in the place of the one before."""
        size = math.prod(shape)
        if len(self._held) < size:
            self._held = np.empty(size)
        return self._held[:size].reshape(shape)


_FREE: deque[Workspace] = deque()


@contextmanager
def workspace() -> Iterator[Workspace]:
    """A workspace that nobody else has until the end of the block."""
    try:
        mine = _FREE.pop()
    except IndexError:
        mine = Workspace()
    try:
        yield mine
    finally:
        _FREE.append(mine)
