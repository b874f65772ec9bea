"""Sensitivities of segments from node to node, and what they say in Gram matrices, link by link.

What acts between two nodes counts farther on only through the state at the second one, so a column for it need not be carried through
the whole segment: with s the deviation of the state at a node, g and g+ what acts there and at the next node (linear in between), and p the
globals,

    ds+ = E [ds, dg, dg+],      dy = L [ds, dg, dg+] + S dp   at every sample of the link.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise

import numpy as np

from awescli.notation.present import present
from awescli.notation.quantities import STATES
from awescli.simulation.groups import each_part

RUNAWAY = np.errstate(over="ignore", invalid="ignore")
"""Where segments may have left the numbers: that is counted, by `alive`, and no warning to a user."""


@dataclass(frozen=True)
class Links:
    """What K segments of N samples say, linearised. L links begin at samples `nodes`, the last one ends at the last sample.

    J: (K, N, n_out, n_s + 2 A + n) sensitivities of the outputs to the state at the last node, to A disturbances at even and at odd nodes,
    and to n globals over the whole segment; ends: (K, L - 1, n_s, n_s + 2 A) those of the state at the next node; r: (K, N, n_out) residual
    over its noise; weight: (K, N, n_out) one over the noise, 0 where a sample does not count; drifts: channels that drift, by their place;
    offsets: (K, n_e) of the states of effects at the start, spread: (n_e,) their prior standard deviations about zero; unknown: states
    before these of which nothing is known at the start.
    """

    J: np.ndarray
    ends: np.ndarray
    r: np.ndarray
    weight: np.ndarray
    nodes: np.ndarray
    drifts: tuple[int, ...] = ()
    offsets: np.ndarray | None = None
    spread: np.ndarray = field(default_factory=lambda: np.zeros(0))
    unknown: int = len(STATES)

    @property
    def n_start(self) -> int:
        """States that are free at the start: those of the kite, and those of its effects, about which `spread` is known beforehand."""
        return self.unknown + len(self.spread)

    def __len__(self) -> int:
        return len(self.J)

    def _known_offsets(self) -> np.ndarray:
        return present(self.offsets, "the offset of the effects' states at the start")

    def from_known_starts(self) -> "Links":
        """The same where segments begin without an error: nothing depends on the kite's states there any more. They stay as columns whose
        change is zero by a prior of its own (standard deviation one, which leaves no determinant). J and ends are overwritten."""
        self.J[:, : self.bounds[1] if len(self.nodes) > 1 else None, :, : self.unknown] = 0.0
        self.ends[:, :1, :, : self.unknown] = 0.0
        offsets = np.hstack([np.zeros((len(self), self.unknown)), self._known_offsets()])
        return replace(self, offsets=offsets, spread=np.r_[np.ones(self.unknown), self.spread], unknown=0)

    def pick(self, which: np.ndarray | slice) -> "Links":
        """Some of the segments, by index or mask."""
        offsets = None if self.offsets is None else self.offsets[which]
        return replace(self, offsets=offsets, **{name: getattr(self, name)[which] for name in ("J", "ends", "r", "weight")})

    @property
    def n_s(self) -> int:
        return self.ends.shape[2]

    @property
    def disturbances(self) -> int:
        """A"""
        return (self.ends.shape[3] - self.n_s) // 2

    @property
    def n(self) -> int:
        """Number of globals."""
        return self.J.shape[3] - self.ends.shape[3]

    @property
    def bounds(self) -> np.ndarray:
        """(L + 1,) samples of all nodes, that at the end included."""
        return np.append(self.nodes, self.r.shape[1] - 1)

    def order(self, link: int) -> np.ndarray:
        """(n_s + 2 A,) columns [state, disturbances at the first node, at the second node] of a link."""
        acting = np.arange(self.n_s, self.ends.shape[3])
        return np.r_[: self.n_s, np.roll(acting, self.disturbances * (link % 2))]

    def end_sensitivities(self) -> np.ndarray:
        """(K, L - 1, n_s, n_s + 2 A) E, disturbances at the first node before those at the second."""
        E = self.ends.copy()
        E[:, 1::2] = E[:, 1::2][..., self.order(1)]
        return E

    def gram(self) -> "Gram":
        """Gram matrices of what the segments say, whitened."""
        K, L, width, D, k = len(self), len(self.nodes), self.ends.shape[3], len(self.drifts), self.n + 1
        q = width + 2 * D
        found = np.empty((K, L, q, q)), np.empty((K, L, q, k)), np.empty((K, k, k))

        def work(part: slice):
            self.pick(part)._fill(*(a[part] for a in found))

        each_part(work, K)
        self._add_prior(*found)
        dof = (self.weight > 0).sum(axis=(1, 2)) - float(self.unknown)
        log_prior = 2 * float(np.log(self.spread).sum())
        return Gram(*found, self.end_sensitivities(), self.bounds, self.n_start, self.disturbances, dof, log_prior)

    def _add_prior(self, x: np.ndarray, xy: np.ndarray, y: np.ndarray) -> None:
        """What is known of the effects' states at the start."""
        if not len(self.spread):
            return
        own, precision = np.arange(self.unknown, self.n_start), 1 / self.spread**2
        x[:, 0, own, own] += precision
        offsets = self._known_offsets()
        xy[:, 0, own, -1] -= precision * offsets
        y[:, -1, -1] += (precision * offsets**2).sum(axis=1)

    def gradients(self) -> tuple[np.ndarray, np.ndarray]:
        """(K, L, q) and (K, n): products of the residual with the whitened columns of `gram`, x in each link and globals: -1/2 of the
        gradient of its square to what is free, so states count at the start of the first link alone (`adjoint`)."""
        width, L, D = self.ends.shape[3], len(self.nodes), len(self.drifts)
        rw = self.r * self.weight
        products = np.matmul(rw[:, :, None], self.J)[:, :, 0]
        found = np.zeros((len(self), L, width + 2 * D))
        found[..., :width] = np.add.reduceat(products[..., :width], self.nodes, axis=1)
        found[:, 1::2, :width] = found[:, 1::2][..., self.order(1)]
        if len(self.spread):
            found[:, 0, self.unknown : self.n_start] -= self._known_offsets() / self.spread**2
        samples, hats = self._hats()
        for d, channel in enumerate(self.drifts):
            found[..., [width + d, width + D + d]] = np.einsum("lhs,kls->klh", hats, rw[:, samples, channel])
        return adjoint(found, self.end_sensitivities()), products[..., width:].sum(axis=1)

    def _hats(self) -> tuple[np.ndarray, np.ndarray]:
        """(L, m) samples of each link, links shorter than the longest filled up, and (L, 2, m) how much each counts for the first and the
        second node; 0 where it is not the link's."""
        N, first = self.r.shape[1], self.nodes
        until = np.append(first[1:], N)
        samples = first[:, None] + np.arange((until - first).max())
        counted, samples = samples < until[:, None], np.minimum(samples, N - 1)
        late = (samples - first[:, None]) / np.maximum(np.diff(self.bounds), 1)[:, None]
        return samples, np.stack([1 - late, late], axis=1) * counted[:, None]

    @RUNAWAY
    def _fill(self, T: np.ndarray, R: np.ndarray, G: np.ndarray) -> None:
        (N, n_out), width, k = self.r.shape[1:], self.ends.shape[3], self.n + 1
        x, y = np.empty((N, n_out, width)), np.empty((N, n_out, k))
        alike, where = self._alike(), self._hats()
        for J, r, weight, t, o, g in zip(self.J, self.r, self.weight, T, R, G, strict=True):
            np.multiply(J[..., :width], weight[..., None], out=x)
            np.multiply(J[..., width:], weight[..., None], out=y[..., :-1])
            y[..., -1] = r
            for links, samples in alike:
                there = [rows[samples].reshape(links.stop - links.start, -1, rows.shape[-1]) for rows in (x, y)]
                across = there[0].swapaxes(1, 2)
                t[links, :width, :width], o[links, :width] = np.matmul(across, there[0]), np.matmul(across, there[1])
            flat = y.reshape(-1, k)
            np.matmul(flat.T, flat, out=g)
            self._fill_drifts(t, o, x, y, weight, *where)
        order = np.r_[self.order(1), width : T.shape[-1]]
        T[:, 1::2], R[:, 1::2] = T[:, 1::2, order[:, None], order], R[:, 1::2, order]

    def _alike(self) -> list[tuple[slice, slice]]:
        """(links side by side that have as many samples each, their samples)."""
        bounds = np.append(self.nodes, self.r.shape[1])
        ends = np.flatnonzero(np.diff(bounds, n=2)) + 1
        runs = pairwise((0, *ends.tolist(), len(self.nodes)))
        return [(slice(first, until), slice(bounds[first], bounds[until])) for first, until in runs]

    def _fill_drifts(
        self, t: np.ndarray, o: np.ndarray, x: np.ndarray, y: np.ndarray, weight: np.ndarray, samples: np.ndarray, hats: np.ndarray
    ) -> None:  # fmt: skip
        """A drift adds its value to one channel: its column is the hat of a node over that channel's noise."""
        width, D = self.ends.shape[3], len(self.drifts)
        if not D:
            return
        t[:, width:, width:] = 0.0
        for d, channel in enumerate(self.drifts):
            columns = hats * weight[samples, channel][:, None]
            with_x, with_y = (np.matmul(columns, rows[samples, channel]) for rows in (x, y))
            for node in (0, 1):
                place = width + node * D + d
                t[:, place, :width] = t[:, :width, place] = with_x[:, node]
                o[:, place] = with_y[:, node]
                for other in (0, 1):
                    t[:, place, width + other * D + d] = (columns[:, node] * columns[:, other]).sum(axis=1)

    def changed(self, states: np.ndarray, acting: np.ndarray, drifting: np.ndarray, change: np.ndarray) -> np.ndarray:
        """(K, N, n_out, c) whitened changes of the outputs for c changes of states (K, L, n_s, c), disturbances (K, L + 1, A, c) and drifts
        (K, L + 1, D, c) at the nodes, and of globals (n, c)."""
        width, bounds = self.ends.shape[3], self.bounds
        y = np.matmul(self.J[..., width:], change) if self.n else np.zeros((*self.r.shape, states.shape[-1]))
        for m, first in enumerate(self.nodes):
            link = slice(first, bounds[m + 1] + (m == len(self.nodes) - 1))
            x = np.concatenate([states[:, m], acting[:, m], acting[:, m + 1]], axis=1)
            y[:, link] += np.matmul(self.J[:, link, :, :width][..., self.order(m)], x[:, None])
            late = ((np.arange(link.start, link.stop) - first) / max(bounds[m + 1] - first, 1))[None, :, None]
            for d, channel in enumerate(self.drifts):
                y[:, link, channel] += (1 - late) * drifting[:, m, d, None] + late * drifting[:, m + 1, d, None]
        return y * self.weight[..., None]


@dataclass(frozen=True)
class Gram:
    """Gram matrices of the whitened columns x = [state, disturbances at both nodes (2 A), drifts at both nodes (2 D)] and y = [globals,
    residual] of K segments of L links.

    x: (K, L, q, q) in each link; xy: (K, L, q, n + 1); y: (K, n + 1, n + 1); E: (K, L - 1, n_s, n_s + 2 A) sensitivities of the state at
    the next node; bounds: (L + 1,) samples of the nodes; n_start: states that are free at the start; disturbances: A; dof: (K,) samples
    less free start values; log_prior: of a segment's start, the log of the variances that are known beforehand.
    """

    x: np.ndarray
    xy: np.ndarray
    y: np.ndarray
    E: np.ndarray
    bounds: np.ndarray
    n_start: int
    disturbances: int
    dof: np.ndarray
    log_prior: float = 0.0

    def __len__(self) -> int:
        return len(self.x)

    @property
    def n_s(self) -> int:
        return self.E.shape[2]

    @property
    def n(self) -> int:
        """Number of globals."""
        return self.y.shape[1] - 1

    def gradients(self) -> tuple[np.ndarray, np.ndarray]:
        """`Links.gradients` of what was linearised."""
        return adjoint(self.xy[..., -1], self.E), self.y[:, :-1, -1]

    def asked(self, of_x: np.ndarray, of_globals: np.ndarray) -> "Gram":
        """The same with m other products of the residual, of_x (K, L, q, m) and of_globals (K, n, m): the last in its place, those before
        behind the globals, as if they were some."""
        n, m = self.n, of_x.shape[-1]
        y = np.zeros((len(self), n + m, n + m))
        y[:, :n, :n] = self.y[:, :n, :n]
        y[:, :n, n:], y[:, n:, :n] = of_globals, of_globals.swapaxes(1, 2)
        return replace(self, xy=np.concatenate([self.xy[..., :n], of_x], axis=-1), y=y)

    def of(self, globals_: np.ndarray) -> "Gram":
        """The same for some of the globals, by index."""
        kept = np.append(globals_, self.n).astype(int)
        return replace(self, xy=self.xy[..., kept], y=self.y[:, kept[:, None], kept])


def adjoint(products: np.ndarray, E: np.ndarray) -> np.ndarray:
    """Products (K, L, q) of something with the columns x of L links -> those with what is free, the states at the start and what acts: the
    adjoint recursion from the last node to the first, with the E (K, L - 1, n_s, n_s + 2 A) of the point where the products stand."""
    found, n_s, width = products.copy(), *E.shape[2:]
    for m in range(E.shape[1], 0, -1):
        found[:, m - 1, :width] += np.einsum("ks,ksw->kw", found[:, m, :n_s], E[:, m - 1])
        found[:, m, :n_s] = 0.0
    return found


def joined(parts: Sequence[Gram]) -> Gram:
    """The Gram matrices of segments that were worked through in parts, one part behind the other."""
    names = ("x", "xy", "y", "E", "dof")
    return replace(parts[0], **{name: np.concatenate([getattr(part, name) for part in parts]) for name in names})
