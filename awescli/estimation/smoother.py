"""The way back through what an information filter has eliminated: nuisances at their best, drawn, and the steps of the processes.

All before the last node of a segment was eliminated from its end to its start, and segments along the flight from the last to the first; in
the other order everything comes back (a two-pass smoother; Rauch, Tung & Striebel 1965, run the other way in time).
"""

from dataclasses import dataclass

import numpy as np

from awescli.estimation.axes import Axes, gap_between
from awescli.estimation.elimination import Eliminated
from awescli.estimation.links import Gram


@dataclass(frozen=True)
class Innovations:
    """What the axes do from node to node, in units of their own noise, summed over a flight; all (W,). mean: squares of the best values;
    spread: variances about them; steps: how many, the first value included. longer: minus half the slope of the deviance along the
    logarithm of the memory, the noise from node to node held; known: what the flight determines of the slope of that (`levels`)."""

    mean: np.ndarray
    spread: np.ndarray
    steps: int
    longer: np.ndarray
    known: np.ndarray


@dataclass(frozen=True)
class Nuisances:
    """Changes of nuisances, c cases. states: (K, L, n_s, c) of the state at the beginning of each link; path: (K, L + 1, W, c) of the
    processes at the nodes."""

    states: np.ndarray
    path: np.ndarray

    def of(self, which: slice) -> "Nuisances":
        """Of some segments."""
        return Nuisances(self.states[which], self.path[which])

    def starts(self, n_start: int) -> np.ndarray:
        """(K, n_start, c)"""
        return self.states[:, 0, :n_start]


@dataclass(frozen=True)
class Smoother:
    """What was eliminated, in the order in which it comes back. times: (K, L + 1) of the nodes [s]; E: (K, L - 1, n_s, W + n_s + W) of the
    state at the next node to [w+, s, w]; start: of the segments; inner: of the inner nodes (K, L - 1, ...); joined: (along the flight: w
    at the first node where it is not that at the last one before, w at the last node)."""

    gram: Gram
    axes: Axes
    path: np.ndarray
    times: np.ndarray
    E: np.ndarray
    start: Eliminated
    inner: Eliminated
    joined: tuple[tuple[Eliminated | None, Eliminated], ...]
    which: np.ndarray

    def nuisances(self, change: np.ndarray, mean: np.ndarray, random: np.random.Generator | None) -> Nuisances:
        gram, W, c = self.gram, len(self.axes), change.shape[1]
        K, L, n_s, n_start = len(gram), len(gram.bounds) - 1, gram.n_s, gram.n_start

        def noise(*shape):
            return random.standard_normal((*shape, c)) if random is not None else np.zeros((*shape, c))

        path, states = np.zeros((K, L + 1, W, c)), np.zeros((K, L, n_s, c))
        before = np.zeros((W, c))
        for k, (first, last) in zip(self.which, self.joined, strict=True):
            a = before if first is None else first.solve(before, change, mean, noise(W))
            before = last.solve(a, change, mean, noise(W))
            path[k, 0], path[k, L] = a, before
        ends = np.concatenate([path[:, 0], path[:, L]], axis=1)
        states[:, 0, :n_start] = self.start.solve(ends, change, mean, noise(K, n_start))
        gain = self.inner.gain
        apart = self.inner.apart(change, mean, noise(L - 1, K, W).swapaxes(0, 1)) + np.matmul(gain[..., n_s + W :], path[:, L:])
        for m in range(L - 1):
            x = np.concatenate([states[:, m], path[:, m]], axis=1)
            path[:, m + 1] = apart[:, m] + np.matmul(gain[:, m, :, : n_s + W], x)
            states[:, m + 1] = np.matmul(self.E[:, m], np.concatenate([path[:, m + 1], x], axis=1))
        return Nuisances(states, path)

    def innovations(self, change: np.ndarray) -> Innovations:
        """For the best change (K, L + 1, W) of the path."""
        L, which, axes = len(self.gram.bounds) - 1, self.which, self.axes
        path, spans = (self.path + change)[which], np.diff(self.times[0])
        F, Q, slope = axes.decay(spans), axes.variance(spans), axes.slope(spans)
        steps = path[:, 1:] - F * path[:, :-1]
        mean, count = (steps**2 / Q).sum(axis=(0, 1)), len(which) * L
        longer, known = (slope * steps * path[:, :-1] / Q).sum(axis=(0, 1)), (slope**2 * path[:, :-1] ** 2 / Q).sum(axis=(0, 1))
        ends, along = self._along(path)
        inside, crossed = self._within(ends, F)
        return Innovations(
            mean + along.mean, (inside / Q).sum(axis=0) + along.spread, count + along.steps,
            longer + (slope * crossed / Q).sum(axis=0) + along.longer, known + along.known,
        )  # fmt: skip

    def _along(self, path: np.ndarray) -> tuple[np.ndarray, Innovations]:
        """((K, 2 W, 2 W) covariance of w at both ends of the segments; the steps between segments, the first value of all included)."""
        W, axes, which = len(self.axes), self.axes, self.which
        ends, (spread, square, longer, known), count = np.zeros((len(which), 2 * W, 2 * W)), np.zeros((4, W)), 0
        before = np.zeros((W, W))
        for i, (first, last) in enumerate(self.joined):
            if first is None:
                A = before
            else:
                gain = first.gain if first.X.shape[-1] else np.zeros((W, W))
                own = first.covariance
                A = gain @ before @ gain.T + own
                # before the first segment lies an endless gap
                gap = gap_between(self.times[which[i - 1], -1], self.times[which[i], 0]) if i else np.inf
                f, q, slope, w = axes.decay(gap), axes.variance(gap), axes.slope(gap), path[i - 1, -1] if i else np.zeros(W)
                e = path[i, 0] - f * w
                moved = gain - np.diag(f)
                crossed = moved @ before
                spread += np.diag(crossed @ moved.T + own) / q
                square += e * e / q
                longer += slope * (e * w + np.diag(crossed)) / q
                known += slope**2 * w * w / q
                count += 1
            gain = last.gain
            B = gain @ A @ gain.T + last.covariance
            ends[i] = np.block([[A, A @ gain.T], [gain @ A, B]])
            before = B
        return ends, Innovations(square, spread, count, longer, known)

    def _within(self, ends: np.ndarray, F: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(variances of the steps from node to node, covariances of these with w before them), each (L, W), summed over segments."""
        W, n_s, n_start, which = len(self.axes), self.gram.n_s, self.gram.n_start, self.which
        n, (found, crossed) = n_s + 2 * W, np.zeros((2, len(self.gram.bounds) - 1, W))
        s, w, b = slice(0, n_s), slice(n_s, n_s + W), slice(n_s + W, n)
        # covariance S of [s, w at the node, w at the last node]
        gain = np.zeros((len(which), n, 2 * W))
        gain[:, :n_start] = self.start.gain[which]
        gain[:, w, :W] = gain[:, b, W:] = np.eye(W)
        S = np.matmul(np.matmul(gain, ends), gain.swapaxes(1, 2))
        S[:, :n_start, :n_start] += self.start.covariance[which]
        gains, owns = self.inner.gain[which], self.inner.covariance[which]
        for m in range(gains.shape[1]):
            gain, own = gains[:, m], owns[:, m]
            moved = gain.copy()
            moved[:, :, w] -= np.diag(F[m])
            seen = np.matmul(moved, S)
            found[m] = ((seen * moved).sum(axis=2) + np.einsum("kii->ki", own)).sum(axis=0)
            crossed[m] = np.einsum("kii->i", seen[:, :, w])
            E = self.E[which, m]
            A, B = np.zeros((len(which), n, n)), np.zeros((len(which), n, W))
            A[:, w], A[:, b, b], B[:, w] = gain, np.eye(W), np.eye(W)
            A[:, s, : n_s + W] = E[:, :, W:]
            A[:, s] += np.matmul(E[:, :, :W], gain)
            B[:, s] = E[:, :, :W]
            S = np.matmul(np.matmul(A, S), A.swapaxes(1, 2)) + np.matmul(np.matmul(B, own), B.swapaxes(1, 2))
        moved = np.zeros((W, n))
        moved[:, b], moved[:, w] = np.eye(W), -np.diag(F[-1])
        seen = np.matmul(moved, S)
        found[-1], crossed[-1] = (seen * moved).sum(axis=2).sum(axis=0), np.einsum("kii->i", seen[:, :, w])
        return found, crossed
