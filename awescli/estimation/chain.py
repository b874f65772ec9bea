"""Sensitivities of segments in a nuisance wind, from node to node of that wind.

The wind at a node counts in the link before it and in the link behind it, and farther on only through the state at the ends of these: with
s_m the state at node m and g_m the wind there,

    ds_m+1 = E_m [ds_m, dg_m, dg_m+1],      dy = L_m [ds_m, dg_m, dg_m+1] in link m,

so that nothing need be kept, or multiplied, for every node at every sample. Two links that follow each other are one longer link, with the
state at its begin and the wind at its three nodes: E and T = L'L of it come from theirs (`_joined`), and so on until one link is the whole
segment, whose T is the Gram matrix of start and gusts. (The information form of a smoother's passes, Rauch, Tung & Striebel 1965, with the
states between eliminated in pairs.) Nothing is left out: the Gram matrices are those of a column for every node at every sample.
"""

from dataclasses import dataclass, replace

import numpy as np

from awescli.notation.quantities import STATES
from awescli.simulation.groups import each_part


@dataclass(frozen=True)
class Chain:
    """What K segments say about their own unknowns, [start (n_start), wind at every node (axes)], and about globals.

    J: (K, N, n_out, width + n) sensitivities to the state at the last node up to a sample, to the wind at even and at odd nodes since then
    (width in all), and to the globals over the whole segment; ends: (K, links - 1, n_s, width) those of the state at the next node.
    r: (K, N, n_out) residual over its noise; weight: (K, N, n_out) one over the noise, 0 where a sample does not count; nodes: samples at
    which links begin; n_own: number of own unknowns; n_start: of states, the first ones, that are free at the start.
    """

    J: np.ndarray
    ends: np.ndarray
    r: np.ndarray
    weight: np.ndarray
    nodes: np.ndarray
    n_own: int
    n_start: int = len(STATES)

    def __len__(self) -> int:
        return len(self.J)

    def pick(self, which) -> "Chain":
        """Some of the segments, by index or mask."""
        return replace(self, **{name: getattr(self, name)[which] for name in ("J", "ends", "r", "weight")})

    @property
    def n(self) -> int:
        """Number of globals."""
        return self.J.shape[3] - self.ends.shape[3]

    def gram(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Gram matrices of the whitened columns: (K, n_own, n_own) of the own unknowns, of which only the upper triangle is filled; (K,
        n_own, n + 1) of them and [globals, residual]; (K, n + 1, n + 1) of these."""
        width, k, own = self.ends.shape[3], self.n + 1, self.n_own
        found = np.empty((len(self), own, own)), np.empty((len(self), own, k)), np.empty((len(self), k, k))

        def work(part: slice):
            chain = self.pick(part)
            T = np.empty((len(chain), len(self.nodes), width, width + k))
            chain._products(T, found[2][part])
            found[0][part], found[1][part] = chain._of_own(T, width)

        each_part(work, len(self))
        return found

    def _products(self, of_links: np.ndarray, of_globals: np.ndarray) -> None:
        """Fill in (K, links, width, width + n + 1) of the three of every link with themselves, the globals and the residual in it; and (K,
        n + 1, n + 1) of globals and residual."""
        (_, N, n_out), (n_s, width), k = self.r.shape, self.ends.shape[2:], self.n + 1
        until = np.append(self.nodes[1:], N)
        samples = self.nodes[:, None] + np.arange((until - self.nodes).max())
        # links shorter than the longest are filled up by zeros
        counted, samples = (samples < until[:, None])[..., None], np.minimum(samples, N - 1)
        found, rows = np.empty((*samples.shape, n_out, width + k - 1)), np.empty((*samples.shape, n_out, width + k))
        flat = rows.reshape(len(samples), -1, width + k)
        for J, r, weight, T, G in zip(self.J, self.r, self.weight, of_links, of_globals, strict=True):
            np.take(J, samples, axis=0, out=found, mode="clip")
            np.multiply(found, (weight[samples] * counted)[..., None], out=rows[..., :-1])
            rows[1::2, ..., n_s:width] = rows[1::2, ..., _order(n_s, width, 1)]
            rows[..., -1] = r[samples] * counted
            np.matmul(flat[..., :width].swapaxes(1, 2), flat, out=T)
            B = flat[..., width:].reshape(-1, k)
            np.matmul(B.T, B, out=G)

    def gradient(self) -> np.ndarray:
        """(K, n_own + n) J'r, whitened."""
        n_s, width = self.ends.shape[2:]
        products = np.matmul((self.r * self.weight)[:, :, None], self.J)[:, :, 0]
        T = np.add.reduceat(products[..., :width], self.nodes, axis=1)[..., None]
        T[:, 1::2, n_s:] = T[:, 1::2, _order(n_s, width, 1)]
        return np.concatenate([self._of_own(T, 0)[1][..., 0], products[..., width:].sum(axis=1)], axis=1)

    def own(self) -> np.ndarray:
        """(K, N, n_out, n_own) whitened sensitivities to every own unknown at every sample."""
        n_s, width = self.ends.shape[2:]
        E, edges, axes = self._ends(), [*self.nodes, self.r.shape[1]], self._axes
        room = self.n_start + (len(self.nodes) + 1) * axes
        found, state = np.zeros((*self.r.shape, room)), np.zeros((len(self), n_s, room))
        state[:, range(self.n_start), range(self.n_start)] = 1.0
        for m in range(len(self.nodes)):
            link, wind = slice(edges[m], edges[m + 1]), slice(self.n_start + m * axes, self.n_start + (m + 2) * axes)
            L = self.J[:, link, :, :width]
            found[:, link] = np.matmul(L[..., :n_s], state[:, None])
            found[:, link, :, wind] += L[..., _order(n_s, width, m)]
            if m < E.shape[1]:
                state = np.matmul(E[:, m, :, :n_s], state)
                state[:, :, wind] += E[:, m, :, n_s:]
        return found[..., : self.n_own] * self.weight[..., None]

    def globals(self) -> np.ndarray:
        """(K, N, n_out, n) whitened sensitivities to the globals."""
        return self.J[..., self.ends.shape[3] :] * self.weight[..., None]

    @property
    def _axes(self) -> int:
        return (self.ends.shape[3] - self.ends.shape[2]) // 2

    def _ends(self) -> np.ndarray:
        """`ends` with the wind at the first node of every link before that at its second."""
        n_s, width = self.ends.shape[2:]
        E = self.ends.copy()
        E[:, 1::2, :, n_s:] = E[:, 1::2][..., _order(n_s, width, 1)]
        return E

    def _of_own(self, T: np.ndarray, width: int) -> tuple[np.ndarray, np.ndarray]:
        """(K, n_own, n_own) and (K, n_own, k) of the whole segment, from what every link says of its three (K, links, 3, width + k).
        width 0: the second alone."""
        n_s, axes = self.ends.shape[2], self._axes
        # nothing follows the last link
        E = np.concatenate([self._ends(), np.zeros((len(self), 1, *self.ends.shape[2:]))], axis=1)
        behind = None
        while T.shape[1] > 1:
            if T.shape[1] % 2:
                last = T[:, -1:], E[:, -1:]
                behind = _joined(*last, *behind, axes, width > 0) if behind else last
            T, E = _joined(T[:, :-1:2], E[:, :-1:2], T[:, 1::2], E[:, 1::2], axes, width > 0)
        if behind:
            T, E = _joined(T, E, *behind, axes, width > 0)
        # what is free at the start, and the wind at the nodes that there are
        own, k = E.shape[3] if width else 0, T.shape[3] - (E.shape[3] if width else 0)
        found, at_start = T[:, 0], self.n_start
        rows = ((slice(0, at_start), slice(0, at_start)), (slice(at_start, self.n_own), slice(n_s, n_s + self.n_own - at_start)))
        of_own, cross = np.empty((len(T), self.n_own, self.n_own if width else 0)), np.empty((len(T), self.n_own, k))
        for to, of in rows:
            cross[:, to] = found[:, of, own:]
            for to_column, of_column in rows if width else ():
                of_own[:, to, to_column] = found[:, of, of_column]
        return of_own, cross


def _order(n_s: int, width: int, m: int) -> np.ndarray:
    """Columns of the wind at the first and at the second node of link m, among [state, even, odd nodes]."""
    return np.roll(np.arange(n_s, width), (width - n_s) // 2 * (m % 2))


def _joined(T: np.ndarray, E: np.ndarray, T_next: np.ndarray, E_next: np.ndarray, axes: int, of_own: bool) -> tuple[np.ndarray, np.ndarray]:
    """(T, E) of links (K, links, ...) and those that follow them as one: of [state, wind at all nodes], which share the node between them.

    of_own: T has columns for the products of these with themselves, before those for others.
    """
    n_s, before, after = E.shape[2], E.shape[3], E_next.shape[3]
    width, shared = before + after - n_s - axes, before - axes
    k = T.shape[3] - (before if of_own else 0)
    joined, ends = np.zeros((*T.shape[:2], width, k + (width if of_own else 0))), np.zeros((*E.shape[:3], width))
    # the link that follows knows all that was before by the state
    known = np.matmul(E.swapaxes(2, 3), T_next[:, :, :n_s])
    others, of_others = slice(joined.shape[3] - k, None), slice(T_next.shape[3] - k, None)
    joined[:, :, :before, others] = T[..., T.shape[3] - k :] + known[..., of_others]
    joined[:, :, shared:, others] += T_next[:, :, n_s:, of_others]
    if of_own:
        wind = known[..., n_s:after]
        joined[:, :, :before, :before] = T[..., :before] + np.matmul(known[..., :n_s], E)
        joined[:, :, :before, shared:width] += wind
        joined[:, :, shared:, :before] += wind.swapaxes(2, 3)
        joined[:, :, shared:, shared:width] += T_next[:, :, n_s:, n_s:after]
    ends[..., :before] = np.matmul(E_next[..., :n_s], E)
    ends[..., shared:] += E_next[..., n_s:]
    return joined, ends
