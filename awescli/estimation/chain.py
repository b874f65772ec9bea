"""Sensitivities of segments in a nuisance wind, from node to node of that wind.

The wind at a node counts in the link before it and in the link behind it, and farther on only through the state at the ends of these: with
s_m the state at node m and g_m the wind there,

    ds_m+1 = E_m [ds_m, dg_m, dg_m+1],      dy = L_m [ds_m, dg_m, dg_m+1] in link m,

so that nothing need be kept, or multiplied, for every node at every sample. Two links that follow each other are one longer link, with the
state at its begin and the wind at its three nodes: E and T = L'L of it come from theirs (`_Links.then`), and so on until one link is the
whole segment, whose T is the Gram matrix of start and gusts: a smoother in information form (Rauch, Tung & Striebel 1965), with the states
between eliminated in pairs. Nothing is left out: Gram matrices are those of a column for every node at every sample.
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
        """Gram matrices of the whitened columns: (K, n_own, n_own) of the own unknowns; (K, n_own, n + 1) of
        them and [globals, residual]; (K, n + 1, n + 1) of these."""
        width, k, n_own = self.ends.shape[3], self.n + 1, self.n_own
        found = np.empty((len(self), n_own, n_own)), np.empty((len(self), n_own, k)), np.empty((len(self), k, k))

        def work(part: slice):
            chain = self.pick(part)
            products = np.empty((len(chain), len(self.nodes), width, width + k))
            chain._products(products, found[2][part])
            whole = _Links(chain._ends(), products[..., width:], products[..., :width]).joined(chain._axes)
            found[1][part] = chain._own_rows(whole.R)
            found[0][part] = chain._own_rows(chain._own_rows(whole.T).swapaxes(1, 2))

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
        R = np.add.reduceat(products[..., :width], self.nodes, axis=1)[..., None]
        R[:, 1::2, n_s:] = R[:, 1::2, _order(n_s, width, 1)]
        whole = _Links(self._ends(), R, None).joined(self._axes)
        return np.concatenate([self._own_rows(whole.R)[..., 0], products[..., width:].sum(axis=1)], axis=1)

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
        """(K, links, n_s, width) `ends` with the wind at the first node of every link before that at its second; 0 behind the last one."""
        n_s, width = self.ends.shape[2:]
        E = np.concatenate([self.ends, np.zeros((len(self), 1, n_s, width))], axis=1)
        E[:, 1::2, :, n_s:] = E[:, 1::2][..., _order(n_s, width, 1)]
        return E

    def _own_rows(self, a: np.ndarray) -> np.ndarray:
        """(K, n_own, k) of (K, 1, width, k) or (K, width, k), [state, wind at all nodes]: what is free at the start, and the nodes that
        there are."""
        n_s, a = self.ends.shape[2], a.reshape(len(a), *a.shape[-2:])
        return np.concatenate([a[:, : self.n_start], a[:, n_s : n_s + self.n_own - self.n_start]], axis=1)


def _order(n_s: int, width: int, m: int) -> np.ndarray:
    """Columns of the wind at the first and at the second node of link m, among [state, even, odd nodes]."""
    return np.roll(np.arange(n_s, width), (width - n_s) // 2 * (m % 2))


@dataclass(frozen=True)
class _Links:
    """Links (K, links, ...) by [state at the begin, wind at all nodes] (width): E (n_s, width) sensitivities of the state at the end; R
    (width, k) products of those of all outputs with others, T (width, width) with themselves, None where nobody asks."""

    E: np.ndarray
    R: np.ndarray
    T: np.ndarray | None

    def pick(self, which: slice) -> "_Links":
        return _Links(*(a if a is None else a[:, which] for a in (self.E, self.R, self.T)))

    def joined(self, axes: int) -> "_Links":
        """All of them as one link."""
        links, behind = self, None
        while (count := links.E.shape[1]) > 1:
            if count % 2:
                behind = links.pick(slice(-1, None)).then(behind, axes)
            links = links.pick(slice(0, count - 1, 2)).then(links.pick(slice(1, None, 2)), axes)
        return links.then(behind, axes)

    def then(self, after: "_Links | None", axes: int) -> "_Links":
        """Each as one with the link after it, which shares a node with it and knows what was before by the state."""
        if after is None:
            return self
        n_s, before = self.E.shape[2:]
        shared, width = before - axes, before + after.E.shape[3] - n_s - axes
        back, many = self.E.swapaxes(2, 3), self.E.shape[:2]
        E, R, T = np.zeros((*many, n_s, width)), np.zeros((*many, width, self.R.shape[3])), None
        E[..., :before] = np.matmul(after.E[..., :n_s], self.E)
        E[..., shared:] += after.E[..., n_s:]
        R[:, :, :before] = self.R + np.matmul(back, after.R[:, :, :n_s])
        R[:, :, shared:] += after.R[:, :, n_s:]
        if self.T is not None:
            T, known = np.zeros((*many, width, width)), np.matmul(back, after.T[:, :, :n_s])
            T[:, :, :before, :before] = self.T + np.matmul(known[..., :n_s], self.E)
            T[:, :, :before, shared:] += known[..., n_s:]
            T[:, :, shared:, :before] += known[..., n_s:].swapaxes(2, 3)
            T[:, :, shared:, shared:] += after.T[:, :, n_s:, n_s:]
        return _Links(E, R, T)
