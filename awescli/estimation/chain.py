"""Sensitivities of segments in a nuisance wind, from node to node of that wind.

The wind at a node counts in the link before it and in the link behind it, and farther on only through the state at the ends of these: with
s_m the state at node m and g_m the wind there,

    ds_m+1 = E_m [ds_m, dg_m, dg_m+1],      dy = L_m [ds_m, dg_m, dg_m+1] in link m,

so that nothing need be kept, or multiplied, for every node at every sample. T_m = L_m' L_m + E_m' Q_m+1 E_m is what link m and all behind
it say of its three, Q_m the part of it that the state has: the backward pass of a smoother (Rauch, Tung & Striebel 1965) in information
form. Nothing is left out: the Gram matrices are those of a column for every node at every sample.
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
        n_s, width = self.ends.shape[2:]
        K, k = len(self), self.n + 1
        T, of_globals = np.empty((K, len(self.nodes), width, width + k)), np.empty((K, k, k))

        def work(part: slice):
            self.pick(part)._products(T[part], of_globals[part])

        each_part(work, K)
        E = self._ends()
        _add_what_follows(T, E, width)
        of_own = np.zeros((K, self._room, self._room))
        of_own[:, : self.n_start, : self.n_start] = T[:, 0, : self.n_start, : self.n_start]
        for m, X in self._states(E):
            here, past = self._at(m), X.shape[2]
            first = slice(here.start, past)
            known = np.matmul(X.swapaxes(1, 2), T[:, m, :n_s, n_s:width])
            of_own[:, here, here] += T[:, m, n_s:, n_s:width]
            of_own[:, :past, here] += known
            # the wind at the first node of the link counts by the state too
            of_own[:, first, first] += known[:, first, : self._axes].swapaxes(1, 2)
        return of_own[:, : self.n_own, : self.n_own], self._of_own(T[..., width:])[:, : self.n_own], of_globals

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
        _add_what_follows(T, self._ends(), 0)
        return np.concatenate([self._of_own(T)[:, : self.n_own, 0], products[..., width:].sum(axis=1)], axis=1)

    def own(self) -> np.ndarray:
        """(K, N, n_out, n_own) whitened sensitivities to every own unknown at every sample."""
        n_s, width = self.ends.shape[2:]
        found = np.zeros((*self.r.shape, self._room))
        edges = [*self.nodes, self.r.shape[1]]
        for m, X in self._states(self._ends()):
            link = slice(edges[m], edges[m + 1])
            L = self.J[:, link, :, :width]
            found[:, link, :, : X.shape[2]] = np.matmul(L[..., :n_s], X[:, None])
            found[:, link, :, self._at(m)] += L[..., _order(n_s, width, m)]
        return found[..., : self.n_own] * self.weight[..., None]

    def globals(self) -> np.ndarray:
        """(K, N, n_out, n) whitened sensitivities to the globals."""
        return self.J[..., self.ends.shape[3] :] * self.weight[..., None]

    @property
    def _axes(self) -> int:
        return (self.ends.shape[3] - self.ends.shape[2]) // 2

    @property
    def _room(self) -> int:
        """Own unknowns up to the second node of the last link: with a wind that is the same all the time there is none."""
        return self._at(len(self.nodes)).start + self._axes

    def _at(self, m: int) -> slice:
        """Where the wind at the two nodes of link m stands among the own unknowns."""
        return slice(self.n_start + m * self._axes, self.n_start + (m + 2) * self._axes)

    def _ends(self) -> np.ndarray:
        """`ends` with the wind at the first node of every link before that at its second."""
        n_s, width = self.ends.shape[2:]
        E = self.ends.copy()
        E[:, 1::2, :, n_s:] = E[:, 1::2][..., _order(n_s, width, 1)]
        return E

    def _states(self, E: np.ndarray):
        """m, (K, n_s, unknowns up to node m): the sensitivity of the state at node m, for every link."""
        n_s = E.shape[2]
        room = np.zeros((len(self), n_s, self._room))
        room[:, range(self.n_start), range(self.n_start)] = 1.0
        for m in range(len(self.nodes)):
            X = room[:, :, : self._at(m + 1).start]
            yield m, X
            if m < E.shape[1]:
                X[:] = np.matmul(E[:, m, :, :n_s], X)
                room[:, :, self._at(m)] += E[:, m, :, n_s:]

    def _of_own(self, T: np.ndarray) -> np.ndarray:
        """(K, own unknowns, k) from what every link and all behind it say of its three (K, links, width, k)."""
        n_s = self.ends.shape[2]
        found = np.zeros((len(self), self._room, T.shape[3]))
        found[:, : self.n_start] = T[:, 0, : self.n_start]
        for m in range(len(self.nodes)):
            found[:, self._at(m)] += T[:, m, n_s:]
        return found


def _order(n_s: int, width: int, m: int) -> np.ndarray:
    """Columns of the wind at the first and at the second node of link m, among [state, even, odd nodes]."""
    return np.roll(np.arange(n_s, width), (width - n_s) // 2 * (m % 2))


def _add_what_follows(T: np.ndarray, E: np.ndarray, width: int) -> None:
    """Add to T (K, links, 3, width + k), products of a link's three with themselves (width 0: without) and with k others, those of all
    links behind it, which know its three by the state at its end."""
    n_s = E.shape[2]
    for m in range(E.shape[1] - 1, -1, -1):
        back, Q = E[:, m].swapaxes(1, 2), T[:, m + 1, :n_s]
        if width:
            T[:, m, :, :width] += np.matmul(back, np.matmul(Q[..., :n_s], E[:, m]))
        T[:, m, :, width:] += np.matmul(back, Q[..., width:])
