"""Integrate the nuisances of segments out: starts of which nothing is known, and processes that last from segment to segment.

The nuisances of a flight are the start z0 of every segment and the values w of processes at the nodes. From node to node

    s+ = E [s, g, g+],      dy = L [s, w, w+],      w+ = F w + e,   e ~ N(0, Q),   F = exp(-dt / memory),   Q = level^2 (1 - F^2),

with s the deviation of the state, g the part of w that acts on it. All before the last node of a segment is eliminated from its end to its
start, node by node (an information filter that runs backward; Fraser & Potter 1969), all segments abreast; what is left of each, a Gram
matrix of [w at its first node, w at its last node, globals, residual], is joined along the flight. The cost is linear in nodes, and nothing
is approximated: H, b, cost and determinant are those of generalised least squares with the dense covariance that the nuisances cause
(tests/estimation/test_information_filter.py).
"""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace

import numpy as np

from awescli.estimation.axes import Axes, gap_between
from awescli.estimation.gram_of_axes import GramOfAxes
from awescli.estimation.links import Gram
from awescli.notation.present import present

RIDGE = 1e-12
"""Of the diagonal: what rounding asks for where an unknown is hardly seen."""


@dataclass(frozen=True)
class _Eliminated:
    """Unknowns v (K, a) eliminated from Gram matrices of [v, x, y]: v = M^-1 (r - X x - Y p), M = C C'. C: (K, a, a); X: (K, a, x) and Y:
    (K, a, n + 1) with y = [p, r], both divided by C."""

    C: np.ndarray
    X: np.ndarray
    Y: np.ndarray

    def solve(self, x: np.ndarray, change: np.ndarray, mean: np.ndarray, noise: np.ndarray) -> np.ndarray:
        """(K, a, c) v for c cases: x (K, x, c), change of the globals (n, c), mean (c,) 1 where the residual counts, noise (K, a, c)."""
        inside = noise + self.Y[..., -1:] * mean - np.matmul(self.Y[..., :-1], change) - np.matmul(self.X, x[..., : self.X.shape[-1], :])
        return np.linalg.solve(self.C.swapaxes(-1, -2), inside)

    @property
    def log_det(self) -> np.ndarray:
        """(K,) log det M"""
        return 2 * np.log(np.diagonal(self.C, axis1=-2, axis2=-1)).sum(axis=-1)


def _eliminate(M: np.ndarray, cross: np.ndarray, rest: np.ndarray, n_x: int) -> tuple[_Eliminated, np.ndarray]:
    """(what gives v back, Gram matrices of the rest without v) for Gram matrices M (K, a, a) of v, cross (K, a, b) and rest (K, b, b); of
    the rest, the first n_x are x and the others y."""
    C = _cholesky(M)
    # dividing by C with one factorisation for all: C is small, and well scaled by its ridge
    Y = np.matmul(np.linalg.inv(C), cross) if C.shape[-1] else cross
    return _Eliminated(C, Y[..., :n_x], Y[..., n_x:]), rest - np.matmul(Y.swapaxes(-1, -2), Y)


def _cholesky(M: np.ndarray) -> np.ndarray:
    """Factors C C' of M (K, a, a) with the least ridge on the diagonal that makes them exist."""
    if not M.shape[-1]:
        return M
    diagonal = np.einsum("...ii->...i", M)
    ridge = RIDGE * (1 + diagonal)
    for _ in range(6):
        try:
            firm = M + ridge[..., None] * np.eye(M.shape[-1])
            return np.linalg.cholesky(firm)
        except np.linalg.LinAlgError:
            ridge = 100 * ridge
    return np.linalg.cholesky(np.where(np.eye(M.shape[-1]) > 0, np.abs(M) + 1.0, 0.0))


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
class Information:
    """What segments say of the globals, their nuisances integrated out.

    H: (n, n) information and b: (n,) gradient J'r of all; cost: (K,) squared whitened residual with the nuisances at their best, and
    log_det: (K,) log of the determinants that integrating them out adds (the prior's normalisation included), both as increments from the
    segments behind alone to a flight that has this one too; dof: (K,) samples less free start values.
    """

    H: np.ndarray
    b: np.ndarray
    cost: np.ndarray
    log_det: np.ndarray
    dof: np.ndarray
    _back: "_Back | None"

    @property
    def deviance(self) -> np.ndarray:
        """(K,) -2 log likelihood but for the constant of the white noise (`Misfit.log_noise`)."""
        return self.cost + self.log_det

    def _links_back(self) -> "_Back":
        return present(self._back, "the way back to the nuisances of a fit without segments")

    def innovations(self) -> Innovations:
        """Of the processes, globals held: what their levels are estimated from."""
        return self._links_back().innovations(self.nuisances().path[..., 0])

    def nuisances(self, change: np.ndarray | None = None) -> "Nuisances":
        """By how much the nuisances change, at best, with a change (n,) of the globals."""
        n = len(self.b)
        change = np.zeros(n) if change is None else change
        return self._links_back().nuisances(change[:, None], np.ones(1), None)

    def responses(self) -> "Nuisances":
        """What the nuisances do at best as each of the globals grows by one: n cases."""
        n = len(self.b)
        return self._links_back().nuisances(np.eye(n), np.zeros(n), None)

    def samples(self, count: int, seed: int) -> "Nuisances":
        """`count` draws of the nuisances about their best, globals held."""
        random = np.random.default_rng(seed)
        return self._links_back().nuisances(np.zeros((len(self.b), count)), np.zeros(count), random)


@dataclass(frozen=True)
class _Back:
    """What was eliminated, in the order in which it comes back. times: (K, L + 1) of the nodes [s]; start: of the segments; inner: from the
    first inner node on; joined: (along the flight: w at the first node where it is not that at the last one before, w at the last node)."""

    gram: Gram
    axes: Axes
    path: np.ndarray
    times: np.ndarray
    E: np.ndarray
    start: _Eliminated
    inner: tuple[_Eliminated, ...]
    joined: tuple[tuple[_Eliminated | None, _Eliminated], ...]
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
        for m, inner in enumerate(self.inner):
            x = np.concatenate([states[:, m], path[:, m], path[:, L]], axis=1)
            path[:, m + 1] = inner.solve(x, change, mean, noise(K, W))
            states[:, m + 1] = np.matmul(self.E[:, m], np.concatenate([states[:, m], path[:, m], path[:, m + 1]], axis=1))
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
                inverse = np.linalg.inv(first.C).T
                gain = -inverse @ first.X if first.X.shape[-1] else np.zeros((W, W))
                own = inverse @ inverse.T
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
            inverse = np.linalg.inv(last.C).T
            gain = -inverse @ last.X
            B = gain @ A @ gain.T + inverse @ inverse.T
            ends[i] = np.block([[A, A @ gain.T], [gain @ A, B]])
            before = B
        return ends, Innovations(square, spread, count, longer, known)

    def _within(self, ends: np.ndarray, F: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(variances of the steps from node to node, covariances of these with w before them), each (L, W), summed over segments."""
        W, n_s, n_start, which = len(self.axes), self.gram.n_s, self.gram.n_start, self.which
        n, (found, crossed) = n_s + 2 * W, np.zeros((2, len(self.gram.bounds) - 1, W))
        s, w, b = slice(0, n_s), slice(n_s, n_s + W), slice(n_s + W, n)
        # covariance S of [s, w at the node, w at the last node]
        inverse = np.linalg.inv(self.start.C[which]).swapaxes(1, 2)
        gain = np.zeros((len(which), n, 2 * W))
        gain[:, :n_start] = -np.matmul(inverse, self.start.X[which])
        gain[:, w, :W] = gain[:, b, W:] = np.eye(W)
        S = np.matmul(np.matmul(gain, ends), gain.swapaxes(1, 2))
        S[:, :n_start, :n_start] += np.matmul(inverse, inverse.swapaxes(1, 2))
        for m, inner in enumerate(self.inner):
            inverse = np.linalg.inv(inner.C[which]).swapaxes(1, 2)
            own = np.matmul(inverse, inverse.swapaxes(1, 2))
            gain = -np.matmul(inverse, inner.X[which])
            moved = gain.copy()
            moved[:, :, w] -= np.diag(F[m])
            seen = np.matmul(moved, S)
            found[m] = ((seen * moved).sum(axis=2) + np.einsum("kii->ki", own)).sum(axis=0)
            crossed[m] = np.einsum("kii->i", seen[:, :, w])
            E = self.E[which, m]
            A, B = np.zeros((len(which), n, n)), np.zeros((len(which), n, W))
            A[:, w], A[:, b, b], B[:, w] = gain, np.eye(W), np.eye(W)
            A[:, s, : n_s + W] = E[:, :, : n_s + W]
            A[:, s] += np.matmul(E[:, :, n_s + W :], gain)
            B[:, s] = E[:, :, n_s + W :]
            S = np.matmul(np.matmul(A, S), A.swapaxes(1, 2)) + np.matmul(np.matmul(B, own), B.swapaxes(1, 2))
        moved = np.zeros((W, n))
        moved[:, b], moved[:, w] = np.eye(W), -np.diag(F[-1])
        seen = np.matmul(moved, S)
        found[-1], crossed[-1] = (seen * moved).sum(axis=2).sum(axis=0), np.einsum("kii->i", seen[:, :, w])
        return found, crossed


def eliminate(gram: Gram, axes: Axes, path: np.ndarray, starts: np.ndarray, dt: float, which: np.ndarray | None = None) -> Information:
    """Integrate the nuisances of segments out.

    path: (K, L + 1, W) present values of the processes at the nodes, about which the segments are linearised; starts: (K,) times of the
    first samples of segments [s], ascending; dt: of a sample [s]; which: segments that count, in that order (default: all).
    """
    which = np.arange(len(gram)) if which is None else np.asarray(which)
    times = gram.bounds * dt
    links = GramOfAxes.of(gram, axes)
    E = links.end_sensitivities()
    inner, start, of_ends, log_det = _segments(links, axes, path, E, np.diff(times))
    info, joined = _joined(axes, path, starts[:, None] + times, which, of_ends, log_det, gram.dof)
    if not len(which):
        return info
    return replace(info, _back=_Back(gram, axes, path, starts[:, None] + times, E, start, inner, joined, which))


def eliminate_parts(
    grams: Iterable[Gram], axes: Axes, path: np.ndarray, starts: np.ndarray, dt: float, which: Callable[[], np.ndarray]
) -> Information:
    """`eliminate` of segments in parts, one behind the other, of which only what joins them along the flight is kept: there is no way back
    to the nuisances. which: asked once all parts have come."""
    of_ends, log_det, dof, times, first = [], [], [], np.zeros(0), 0
    for gram in grams:
        part, times = slice(first, first + len(gram)), gram.bounds * dt
        links, first = GramOfAxes.of(gram, axes), part.stop
        _, _, ends, det = _segments(links, axes, path[part], links.end_sensitivities(), np.diff(times))
        of_ends.append(ends)
        log_det.append(det)
        dof.append(gram.dof)
    ends, det, free = (np.concatenate(each) for each in (of_ends, log_det, dof))
    return _joined(axes, path, starts[:, None] + times, which(), ends, det, free)[0]


def _segments(
    links: GramOfAxes, axes: Axes, path: np.ndarray, E: np.ndarray, spans: np.ndarray
) -> tuple[tuple[_Eliminated, ...], _Eliminated, np.ndarray, np.ndarray]:
    """(eliminated inner nodes, first one first; eliminated starts; Gram matrices (K, 2 W + n + 1, ...) of [w at the first node, w at the
    last one, globals, residual]; (K,) log det of all this)."""
    gram = links.gram
    n_s, n_start, W, L = gram.n_s, gram.n_start, len(axes), len(spans)
    s, w0, w1 = slice(0, n_s), slice(n_s, n_s + W), slice(n_s + W, n_s + 2 * W)
    F, Q = axes.decay(spans), axes.variance(spans)
    step = path[:, 1:] - F * path[:, :-1]  # what the present values ask of the noise
    here, log_det = np.arange(W), np.zeros(len(gram))
    # the processes' steps as Gram matrices: of [s, w, w+] with itself (the same in all segments), with the residual, and of this
    P, asks = np.zeros((L, n_s + 2 * W, n_s + 2 * W)), np.zeros((len(gram), L, n_s + 2 * W))
    P[:, n_s + here, n_s + here], P[:, n_s + W + here, n_s + W + here] = F * F / Q, 1 / Q
    P[:, n_s + here, n_s + W + here] = P[:, n_s + W + here, n_s + here] = -F / Q
    asks[..., w0], asks[..., w1] = F * step / Q, -step / Q

    G = gram.y.copy()
    G[:, -1, -1] += (step * step / Q).sum(axis=(1, 2))
    # the last link: w at its second node stays, with globals and residual
    M, U = links.x(L - 1) + P[L - 1], links.xy(L - 1)
    U[..., -1] += asks[:, L - 1]
    V = M[:, : n_s + W, : n_s + W]
    cross = np.concatenate([M[:, : n_s + W, w1], U[:, : n_s + W]], axis=2)
    rest = np.concatenate([np.concatenate([M[:, w1, w1], U[:, w1]], axis=2), np.concatenate([U[:, w1].swapaxes(1, 2), G], axis=2)], axis=1)
    inner: list[_Eliminated] = []
    nothing = np.zeros((len(gram), n_s + 2 * W, W))
    for m in range(L - 2, -1, -1):
        M, U = links.x(m), np.concatenate([nothing, links.xy(m)], axis=2)
        M += P[m]
        U[..., -1] += asks[:, m]
        e = E[:, m]
        back = e.swapaxes(1, 2)
        M += np.matmul(back, np.matmul(V[:, s, s], e))
        mixed = np.matmul(back, V[:, s, w0])
        M[:, :, w1] += mixed
        M[:, w1, :] += mixed.swapaxes(1, 2)
        M[:, w1, w1] += V[:, w0, w0]
        U += np.matmul(back, cross[:, s])
        U[:, w1] += cross[:, w0]
        kept = slice(0, n_s + W)
        C = _cholesky(M[:, w1, w1])
        inverse = np.linalg.inv(C)
        Yx, Yu = np.matmul(inverse, M[:, w1, kept]), np.matmul(inverse, U[:, w1])
        inner.append(_Eliminated(C, np.concatenate([Yx, Yu[..., :W]], axis=2), Yu[..., W:]))
        log_det += inner[-1].log_det
        V = M[:, kept, kept] - np.matmul(Yx.swapaxes(1, 2), Yx)
        cross = U[:, kept] - np.matmul(Yx.swapaxes(1, 2), Yu)
        rest = rest - np.matmul(Yu.swapaxes(1, 2), Yu)
    free = slice(0, n_start)
    to_rest = np.concatenate([V[:, free, w0], cross[:, free]], axis=2)
    around = np.concatenate(
        [np.concatenate([V[:, w0, w0], cross[:, w0]], axis=2), np.concatenate([cross[:, w0].swapaxes(1, 2), rest], axis=2)], axis=1
    )
    start, of_ends = _eliminate(V[:, free, free], to_rest, around, 2 * W)
    log_det += start.log_det + np.log(Q).sum() + gram.log_prior
    return tuple(reversed(inner)), start, of_ends, log_det


def _joined(
    axes: Axes, path: np.ndarray, times: np.ndarray, which: np.ndarray, of_ends: np.ndarray, log_det: np.ndarray, dof: np.ndarray
) -> tuple[Information, tuple[tuple[_Eliminated | None, _Eliminated], ...]]:
    """(the segments `which` along the flight, from the last to the first, without the way back; what was eliminated between them)."""
    W, L = len(axes), path.shape[1] - 1
    k = of_ends.shape[1] - 2 * W
    here, a, b, y = np.arange(W), slice(0, W), slice(W, 2 * W), slice(2 * W, 2 * W + k)
    cost, added = np.zeros(len(of_ends)), np.zeros(len(of_ends))
    # Gram matrix of [w at the first node of the segment behind, globals, residual], and log det, of all behind
    behind, behind_det, so_far = np.zeros((W + k, W + k)), 0.0, (0.0, 0.0)
    joined: list[tuple[_Eliminated | None, _Eliminated]] = []
    for place in range(len(which) - 1, -1, -1):
        seg = which[place]
        M, det = of_ends[seg].copy(), float(log_det[seg]) + behind_det
        first = None
        if place < len(which) - 1:
            nxt = which[place + 1]
            gap = gap_between(times[seg, -1], times[nxt, 0])
            if gap > 0:
                # w at the first node behind is a step of the gap away from w at the last node here
                f, q = axes.decay(gap), axes.variance(gap)
                e = path[nxt, 0] - f * path[seg, L]
                behind[here, here] += 1 / q
                behind[here, -1] -= e / q
                behind[-1, here] -= e / q
                to_rest = np.concatenate([np.diag(-f / q), behind[a, W:]], axis=1)
                around = np.zeros((W + k, W + k))
                around[here, here] = f * f / q
                around[here, -1] = around[-1, here] = f * e / q
                around[W:, W:] = behind[W:, W:]
                around[-1, -1] += (e * e / q).sum()
                first, behind = _eliminate(behind[a, a], to_rest, around, W)
                det += float(first.log_det) + float(np.log(q).sum())
            M[W:, W:] += behind
        joined_last, whole = _eliminate(M[b, b], np.concatenate([M[b, a], M[b, y]], axis=1), _without(M, W), W)
        det += float(joined_last.log_det)
        joined.append((first, joined_last))
        behind, behind_det = whole, det
        total = _begun(axes, path[seg, 0], behind, det)
        cost[seg], added[seg] = total[0][-1, -1] - so_far[0], total[1] - so_far[1]
        so_far = float(total[0][-1, -1]), total[1]
    n = k - 1
    if not len(which):
        return Information(np.zeros((n, n)), np.zeros(n), cost, added, dof, None), ()
    (whole, _, first), joined = total, joined[::-1]
    # joined[i] holds w at the first node of the segment BEHIND i; move each to its own segment
    firsts = [first, *(f for f, _ in joined[:-1])]
    joined = [(f, last) for f, (_, last) in zip(firsts, joined, strict=True)]
    return Information(whole[:n, :n], whole[:n, -1], cost, added, dof, None), tuple(joined)


def _without(M: np.ndarray, W: int) -> np.ndarray:
    """Rows and columns of a Gram matrix of [w first, w last, y] without w last."""
    kept = np.r_[:W, 2 * W : len(M)]
    return M[np.ix_(kept, kept)]


def _begun(axes: Axes, value: np.ndarray, behind: np.ndarray, det: float) -> tuple[np.ndarray, float, _Eliminated]:
    """(Gram matrix of y, log det, w at the first node) of a flight that begins here, its processes stationary."""
    W, here = len(axes), np.arange(len(axes))
    M, p = behind.copy(), axes.level**2
    M[here, here] += 1 / p
    M[here, -1] -= value / p
    M[-1, here] -= value / p
    M[-1, -1] += (value * value / p).sum()
    first, whole = _eliminate(M[:W, :W], M[:W, W:], M[W:, W:], 0)
    return whole, det + float(first.log_det) + np.log(p).sum(), first
