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
from awescli.estimation.backward import eliminate_backward, padded
from awescli.estimation.elimination import Eliminated, eliminate_first
from awescli.estimation.gram_of_axes import GramOfAxes
from awescli.estimation.links import Gram
from awescli.estimation.smoother import Innovations, Nuisances, Smoother
from awescli.notation.present import present


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
    _back: Smoother | None

    @property
    def deviance(self) -> np.ndarray:
        """(K,) -2 log likelihood but for the constant of the white noise (`Misfit.log_noise`)."""
        return self.cost + self.log_det

    def _links_back(self) -> Smoother:
        return present(self._back, "the way back to the nuisances of a fit without segments")

    def innovations(self) -> Innovations:
        """Of the processes, globals held: what their levels are estimated from."""
        return self._links_back().innovations(self.nuisances().path[..., 0])

    def nuisances(self, change: np.ndarray | None = None) -> Nuisances:
        """By how much the nuisances change, at best, with a change (n,) of the globals."""
        n = len(self.b)
        change = np.zeros(n) if change is None else change
        return self._links_back().nuisances(change[:, None], np.ones(1), None)

    def responses(self) -> Nuisances:
        """What the nuisances do at best as each of the globals grows by one: n cases."""
        n = len(self.b)
        return self._links_back().nuisances(np.eye(n), np.zeros(n), None)

    def samples(self, count: int, seed: int) -> Nuisances:
        """`count` draws of the nuisances about their best, globals held."""
        random = np.random.default_rng(seed)
        return self._links_back().nuisances(np.zeros((len(self.b), count)), np.zeros(count), random)


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
    return replace(info, _back=Smoother(gram, axes, path, starts[:, None] + times, E[..., : links.width], start, inner, joined, which))


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
) -> tuple[Eliminated, Eliminated, np.ndarray, np.ndarray]:
    """(eliminated inner nodes (K, L - 1, ...), first one first; eliminated starts; Gram matrices (K, 2 W + n + 1, ...) of [w at the first
    node, w at the last one, globals, residual]; (K,) log det of all this)."""
    gram = links.gram
    n_s, n_start, W, L, K = gram.n_s, gram.n_start, len(axes), len(spans), len(gram)
    # columns of a link: w at its second node, [state, w] at its first one, w at the last node of the segment, globals and residual
    x, after, w0 = slice(0, links.width), slice(0, W), slice(W + n_s, links.width)
    kept = slice(W, links.width)
    F, Q = axes.decay(spans), axes.variance(spans)
    step = path[:, 1:] - F * path[:, :-1]  # what the present values ask of the noise
    here = np.arange(W)
    # the processes' steps as Gram matrices: of [w+, s, w] with itself (the same in all segments), with the residual, and of this
    P, asks = np.zeros((L, links.width, links.width)), np.zeros((K, L, links.width))
    P[:, here, here], P[:, W + n_s + here, W + n_s + here] = 1 / Q, F * F / Q
    P[:, here, W + n_s + here] = P[:, W + n_s + here, here] = -F / Q
    asks[..., after], asks[..., w0] = -step / Q, F * step / Q
    rest = gram.y.copy()
    rest[:, -1, -1] += (step * step / Q).sum(axis=(1, 2))
    columns, width = links.width + W + gram.y.shape[-1], links.width
    roots, divided = np.zeros((K, L - 1, W, padded(W))), np.empty((K, L - 1, W, columns - W))
    roots[..., here, here] = 1.0
    for some, M in links.backward(L):
        M[..., x] += P[some]
        M[..., columns - 1] += asks[:, some]
        if some.stop == L:
            # w at the second node of the last link stays, with globals and residual: what is said of [s, w] is said with it
            M, behind = M[:, :-1], M[:, -1].copy()
            of_last = np.concatenate([behind[:, after, after], behind[:, after, width + W : columns]], axis=2)
            behind[:, kept, width : width + W] = behind[:, kept, after]
            some = slice(some.start, L - 1)
        eliminate_backward(M, E[:, some], behind, roots[:, some], columns)
        if M.shape[1]:
            divided[:, some], behind = M[:, :, after, W:columns], M[:, 0]
    V, roots = behind[:, kept, W:columns], np.ascontiguousarray(roots[..., :W])
    last = divided[..., n_s + W :].reshape(K, (L - 1) * W, W + rest.shape[-1])
    around = np.concatenate([of_last, np.concatenate([of_last[..., W:].swapaxes(1, 2), rest], axis=2)], axis=1)
    around -= np.matmul(last.swapaxes(1, 2), last)
    inner = Eliminated(roots, divided[..., : n_s + 2 * W], divided[..., n_s + 2 * W :])
    free, first = slice(0, n_start), slice(n_s, n_s + W)
    around = np.concatenate([V[:, first, n_s:], np.concatenate([V[:, first, n_s + W :].swapaxes(1, 2), around], axis=2)], axis=1)
    start, of_ends = eliminate_first(V[:, free, free], V[:, free, n_s:], around, 2 * W)
    log_det = inner.log_det.sum(axis=1) + start.log_det + np.log(Q).sum() + gram.log_prior
    return inner, start, of_ends, log_det


def _joined(
    axes: Axes, path: np.ndarray, times: np.ndarray, which: np.ndarray, of_ends: np.ndarray, log_det: np.ndarray, dof: np.ndarray
) -> tuple[Information, tuple[tuple[Eliminated | None, Eliminated], ...]]:
    """(the segments `which` along the flight, from the last to the first, without the way back; what was eliminated between them)."""
    W, L = len(axes), path.shape[1] - 1
    k = of_ends.shape[1] - 2 * W
    here, a, b, y = np.arange(W), slice(0, W), slice(W, 2 * W), slice(2 * W, 2 * W + k)
    cost, added, n = np.zeros(len(of_ends)), np.zeros(len(of_ends)), k - 1
    if not len(which):
        return Information(np.zeros((n, n)), np.zeros(n), cost, added, dof, None), ()
    # Gram matrix of [w at the first node of the segment behind, globals, residual], and log det, of all behind; the same of each place
    behind, behind_det = np.zeros((W + k, W + k)), 0.0
    whole, dets = np.empty((len(which), W + k, W + k)), np.empty(len(which))
    joined: list[tuple[Eliminated | None, Eliminated]] = []
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
                first, behind = eliminate_first(behind[a, a], to_rest, around, W)
                det += float(first.log_det) + float(np.log(q).sum())
            M[W:, W:] += behind
        joined_last, behind = eliminate_first(M[b, b], np.concatenate([M[b, a], M[b, y]], axis=1), _without(M, W), W)
        behind_det = det + float(joined_last.log_det)
        joined.append((first, joined_last))
        whole[place], dets[place] = behind, behind_det
    begun, totals, added_up = _begun(axes, path[which, 0], whole, dets)
    cost[which] = totals[:, -1, -1] - np.append(totals[1:, -1, -1], 0.0)
    added[which] = added_up - np.append(added_up[1:], 0.0)
    joined = joined[::-1]
    # joined[i] holds w at the first node of the segment BEHIND i; move each to its own segment
    first = Eliminated(begun.inverse[0], begun.X[0], begun.Y[0])
    firsts = [first, *(f for f, _ in joined[:-1])]
    joined = [(f, last) for f, (_, last) in zip(firsts, joined, strict=True)]
    return Information(totals[0, :n, :n], totals[0, :n, -1], cost, added, dof, None), tuple(joined)


def _without(M: np.ndarray, W: int) -> np.ndarray:
    """Rows and columns of a Gram matrix of [w first, w last, y] without w last."""
    kept = np.r_[:W, 2 * W : len(M)]
    return M[np.ix_(kept, kept)]


def _begun(axes: Axes, value: np.ndarray, behind: np.ndarray, det: np.ndarray) -> tuple[Eliminated, np.ndarray, np.ndarray]:
    """(w at the first node, Gram matrix of y, log det) of flights that begin here, their processes stationary; all (k, ...)."""
    W, here = len(axes), np.arange(len(axes))
    M, p = behind.copy(), axes.level**2
    M[:, here, here] += 1 / p
    M[:, here, -1] -= value / p
    M[:, -1, here] -= value / p
    M[:, -1, -1] += (value * value / p).sum(axis=1)
    first, whole = eliminate_first(M[:, :W, :W], M[:, :W, W:], M[:, W:, W:], 0)
    return first, whole, det + first.log_det + np.log(p).sum()
