"""What the links of segments say of the axes of processes, instead of the disturbances and drifts that these act on."""

from dataclasses import dataclass

import numpy as np

from awescli.estimation.axes import Axes
from awescli.estimation.links import Gram


@dataclass(frozen=True)
class GramOfAxes:
    """Gram matrices of [state, w, w+], link by link. width: n_s + 2 W; runs: (where, from where) columns are copied, in pieces that lie
    together on both sides: one place at a time numpy takes longer to copy than to eliminate."""

    gram: Gram
    width: int
    runs: list[tuple[slice, slice]]

    @classmethod
    def of(cls, gram: Gram, axes: Axes) -> "GramOfAxes":
        n_s, A = gram.n_s, gram.disturbances
        width = n_s + 2 * A
        D = (gram.x.shape[-1] - width) // 2
        nodes = (np.where(axes.acts >= 0, n_s + node * A + axes.acts, width + node * D + axes.drifts) for node in (0, 1))
        place = np.concatenate([np.arange(n_s), *nodes]).astype(int)
        runs = np.split(np.arange(len(place)), np.flatnonzero(np.diff(place) != 1) + 1)
        return cls(gram, len(place), [(slice(r[0], r[-1] + 1), slice(place[r[0]], place[r[-1]] + 1)) for r in runs])

    def x(self, link: int) -> np.ndarray:
        """(K, n_s + 2 W, n_s + 2 W)"""
        found, own = np.empty((len(self.gram), self.width, self.width)), self.gram.x[:, link]
        for rows, of_rows in self.runs:
            for columns, of_columns in self.runs:
                found[:, rows, columns] = own[:, of_rows, of_columns]
        return found

    def xy(self, link: int) -> np.ndarray:
        """(K, n_s + 2 W, n + 1) with [globals, residual]."""
        found, own = np.empty((len(self.gram), self.width, self.gram.xy.shape[-1])), self.gram.xy[:, link]
        for rows, of_rows in self.runs:
            found[:, rows] = own[:, of_rows]
        return found

    def end_sensitivities(self) -> np.ndarray:
        """(K, L - 1, n_s, n_s + 2 W) of the state at the next node to [state, w, w+]; to drifts there are none."""
        E, acting = np.zeros((*self.gram.E.shape[:3], self.width)), self.gram.n_s + 2 * self.gram.disturbances
        for columns, of_columns in self.runs:
            count = max(min(of_columns.stop, acting) - of_columns.start, 0)
            E[..., columns.start : columns.start + count] = self.gram.E[..., of_columns.start : of_columns.start + count]
        return E
