"""What the links of segments say of the axes of processes, instead of the disturbances and drifts that these act on."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from awescli.estimation.axes import Axes
from awescli.estimation.backward import padded, row_length
from awescli.estimation.links import Gram

AT_ONCE = 1 << 21
"""[bytes] of links that are put together at once: few enough to stay in a core's cache, many enough for numpy to be worth calling."""


@dataclass(frozen=True)
class GramOfAxes:
    """Gram matrices of x = [w+, s, w], link by link: s the state and w the processes at its first node, w+ these at its second one.

    W: axes; runs: (where, from where) columns of x are copied, in pieces that lie together on both sides: one place at a time numpy takes
    longer to copy than to eliminate.
    """

    gram: Gram
    W: int
    runs: list[tuple[slice, slice]]

    @classmethod
    def of(cls, gram: Gram, axes: Axes) -> "GramOfAxes":
        n_s, A = gram.n_s, gram.disturbances
        width = n_s + 2 * A
        D = (gram.x.shape[-1] - width) // 2
        first, second = (np.where(axes.acts >= 0, n_s + node * A + axes.acts, width + node * D + axes.drifts) for node in (0, 1))
        place = np.concatenate([second, np.arange(n_s), first]).astype(int)
        runs = np.split(np.arange(len(place)), np.flatnonzero(np.diff(place) != 1) + 1)
        return cls(gram, len(axes), [(slice(r[0], r[-1] + 1), slice(place[r[0]], place[r[-1]] + 1)) for r in runs if len(r)])

    @property
    def width(self) -> int:
        """Of x."""
        return self.gram.n_s + 2 * self.W

    def backward(self, count: int) -> Iterator[tuple[slice, np.ndarray]]:
        """(links, (K, links, width, row_length(columns))) of some links after the other, the last ones of 0, ..., count - 1 first: x with
        [x, nothing yet, globals, residual], to be written into; what is in between makes room for w at the last node of the segment."""
        size, (K, _, _, k) = self.width, self.gram.xy.shape
        columns = size + self.W + k
        at_once = max(AT_ONCE // (8 * K * size * columns), 1)
        for until in range(count, 0, -at_once):
            some = slice(max(until - at_once, 0), until)
            rows = np.zeros((K, until - some.start, size, row_length(columns)))
            for here, of_rows in self.runs:
                for there, of_columns in self.runs:
                    rows[:, :, here, there] = self.gram.x[:, some, of_rows, of_columns]
                rows[:, :, here, size + self.W : columns] = self.gram.xy[:, some, of_rows]
            yield some, rows

    def end_sensitivities(self) -> np.ndarray:
        """(K, L - 1, n_s, padded(width)) of the state at the next node to x; to drifts there are none, nor behind the width."""
        E, acting = np.zeros((*self.gram.E.shape[:3], padded(self.width))), self.gram.n_s + 2 * self.gram.disturbances
        for columns, of_columns in self.runs:
            count = max(min(of_columns.stop, acting) - of_columns.start, 0)
            E[..., columns.start : columns.start + count] = self.gram.E[..., of_columns.start : of_columns.start + count]
        return E
