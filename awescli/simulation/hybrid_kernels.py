"""Numba kernels of the corrected kite: a rollout that keeps what its gradient needs, and the exact reverse of that rollout.

Same RK4, same sampling and the same order of operations as `kernels.rollout`: with null weights both give the same bits. The reverse
is the discrete adjoint: lambda_k = (d x_{k+1} / d x_k)^T lambda_{k+1} + d cost / d x_k, with the step's own Jacobian.
"""

import numpy as np
from numba import njit, prange

from awescli.engine.adjoint import call_adjoint
from awescli.engine.call import call_value
from awescli.engine.dense import call_network, call_network_backward
from awescli.simulation.sampling import _inputs_at, _sample, _stop_diverged


@njit(cache=True)
def _corrected(f, network, x, u, c, constants, weights, n_s, rows, y, correction, kept, out):
    """out = derivative of the physics + correction in `rows`; y holds [derivative, the network's inputs]."""
    call_value(f, (x.ctypes.data, u.ctypes.data, c, y.ctypes.data))
    call_network(network, (y[n_s:].ctypes.data, constants, weights, correction.ctypes.data, kept.ctypes.data))
    for i in range(n_s):
        for lane in range(y.shape[1]):
            out[i, lane] = y[i, lane]
    for k in range(rows.shape[0]):
        for lane in range(y.shape[1]):
            out[rows[k], lane] += correction[k, lane]


@njit(cache=True)
def _moved(stage, x, scale, k, n_s):
    """stage[:n_s] = x + scale k"""
    for i in range(n_s):
        for lane in range(x.shape[1]):
            stage[i, lane] = x[i, lane] + scale * k[i, lane]


@njit(parallel=True, cache=True)
def rollout(f, g, initial, law, network, n_s, n_in, rows, constants, weights, X0, SP, U, C, h, substeps, X, Y, stages, kept, alive):
    """Simulate, and keep. f: [derivative, network inputs]; g: outputs of the cost; network: `dense.value`; others as `kernels.rollout`.

    Fills X (G, K+1, n_x, L), Y (G, K+1, n_y, L), stages (G, K*substeps, 4, n_x, L), kept (G, K*substeps, 4, n_kept, L), alive (G, L).
    """
    G, samples, n_x, L = X.shape
    step = h / substeps
    p_constants, p_weights = constants.ctypes.data, weights.ctypes.data
    for group in prange(G):
        x = np.zeros((n_x, L))
        u = np.empty((U.shape[2], L))
        y, correction = np.empty((n_s + n_in, L)), np.empty((rows.shape[0], L))
        k1, k2, k3, k4 = np.empty((n_s, L)), np.empty((n_s, L)), np.empty((n_s, L)), np.empty((n_s, L))
        chosen = np.empty((n_x - n_s, L))
        c = C[group].ctypes.data
        for i in range(12):
            x[i] = X0[group, i]
        _sample(x, 0, SP[group], n_s)
        if law:
            call_value(law, (x.ctypes.data, U[group, 0].ctypes.data, c, chosen.ctypes.data))
            x[n_s:] = chosen
        # into a place of its own: written over x, the later states would be computed from the earlier ones' new values
        begun = np.empty((n_s - 12, L))
        call_value(initial, (x.ctypes.data, U[group, 0].ctypes.data, c, begun.ctypes.data))
        x[12:n_s] = begun
        start = x.copy()
        for k in range(samples):
            _sample(x, k, SP[group], n_s)
            if law:
                call_value(law, (x.ctypes.data, U[group, k].ctypes.data, c, chosen.ctypes.data))
                x[n_s:] = chosen
            X[group, k] = x
            call_value(g, (x.ctypes.data, U[group, k].ctypes.data, c, Y[group, k].ctypes.data))
            if k == samples - 1:
                break
            for sub in range(substeps):
                m = k * substeps + sub
                s, a = stages[group, m], kept[group, m]
                for j in range(4):
                    s[j] = x
                _inputs_at(u, U[group], k, sub / substeps)
                _corrected(f, network, s[0], u, c, p_constants, p_weights, n_s, rows, y, correction, a[0], k1)
                _moved(s[1], x, step / 2, k1, n_s)
                _inputs_at(u, U[group], k, (sub + 0.5) / substeps)
                _corrected(f, network, s[1], u, c, p_constants, p_weights, n_s, rows, y, correction, a[1], k2)
                _moved(s[2], x, step / 2, k2, n_s)
                _corrected(f, network, s[2], u, c, p_constants, p_weights, n_s, rows, y, correction, a[2], k3)
                _moved(s[3], x, step, k3, n_s)
                _inputs_at(u, U[group], k, (sub + 1.0) / substeps)
                _corrected(f, network, s[3], u, c, p_constants, p_weights, n_s, rows, y, correction, a[3], k4)
                for i in range(n_s):
                    for lane in range(L):
                        x[i, lane] += step / 6 * (k1[i, lane] + 2 * k2[i, lane] + 2 * k3[i, lane] + k4[i, lane])
            _stop_diverged(x, start, alive[group], k + 1)


@njit(cache=True)
def _pulled_back(f, network, x, u, c, constants, weights, kbar, n_s, rows, alive, k, w, ybar, v, kept, delta):
    """v = (d corrected derivative / d x)^T kbar, and delta at the network's sums; zero where a lane no longer counts."""
    L = x.shape[1]
    for j in range(rows.shape[0]):
        for lane in range(L):
            ybar[j, lane] = kbar[rows[j], lane]
    for i in range(n_s):
        for lane in range(L):
            w[i, lane] = kbar[i, lane]
    call_network_backward(network, (constants, weights, kept.ctypes.data, ybar.ctypes.data, delta.ctypes.data, w[n_s:].ctypes.data))
    call_adjoint(f, (x.ctypes.data, u.ctypes.data, c, w.ctypes.data, v.ctypes.data))
    for lane in range(L):
        if alive[lane] <= k + 1:
            for a in (v, delta, kept):
                for i in range(a.shape[0]):
                    a[i, lane] = 0.0


@njit(cache=True)
def _add_to_weights(total, sizes, kept, delta, a):
    """total += sum over lanes of delta x activations, layer by layer: the network's vector-Jacobian product.

    kept (n_kept, L) is turned into rows a (L, n_kept) first, so that the inner loop runs along a row of W: all of it stays in the
    nearest cache, where one product over the whole rollout would fetch everything from memory again.
    """
    L = kept.shape[1]
    for i in range(kept.shape[0]):
        for lane in range(L):
            a[lane, i] = kept[i, lane]
    place = first_a = first_d = 0
    for number in range(sizes.shape[0] - 1):
        n, m = sizes[number], sizes[number + 1]
        for i in range(m):
            e = delta[first_d + i]
            row = total[place + i * n : place + (i + 1) * n]
            for lane in range(0, L, 4):
                e0, e1, e2, e3 = e[lane], e[lane + 1], e[lane + 2], e[lane + 3]
                for j in range(n):
                    q = first_a + j
                    row[j] += (e0 * a[lane, q] + e1 * a[lane + 1, q]) + (e2 * a[lane + 2, q] + e3 * a[lane + 3, q])
            bias = 0.0
            for lane in range(L):
                bias += e[lane]
            total[place + n * m + i] += bias
        place += (n + 1) * m
        first_a += n
        first_d += m


@njit(cache=True)
def _gather(xbar, setpointbar, v, n_s):
    """Add v to the derivatives at the state and at the held set-points."""
    for i in range(n_s):
        for lane in range(v.shape[1]):
            xbar[i, lane] += v[i, lane]
    for i in range(n_s, v.shape[0]):
        for lane in range(v.shape[1]):
            setpointbar[i - n_s, lane] += v[i, lane]


@njit(cache=True)
def _drop_ended(a, alive, k):
    """Zero the lanes that ended before sample k: what follows a divergence does not count, and may not be a number."""
    for lane in range(a.shape[1]):
        if alive[lane] <= k:
            for i in range(a.shape[0]):
                a[i, lane] = 0.0


@njit(parallel=True, cache=True)
def gradient(f, g, initial, law, network, n_s, sizes, rows, constants, weights, SP, U, C, h, substeps, X, Ybar, stages, kept, alive,
             X0bar, Wbar):  # fmt: skip
    """Reverse of `rollout` for d cost / d Y = Ybar (G, K+1, n_y, L). f, g, initial, law: `adjoint` addresses; network: `dense.backward`.

    sizes: layer widths. Fills X0bar (G, 12, L) = d cost / d starts and Wbar (G, n_weights), each group's d cost / d weights.
    """
    G, samples, n_x, L = X.shape
    step = h / substeps
    p_constants, p_weights = constants.ctypes.data, weights.ctypes.data
    for group in prange(G):
        u = np.empty((U.shape[2], L))
        w, ybar, v = np.empty((n_s + sizes[0], L)), np.empty((rows.shape[0], L)), np.empty((n_x, L))
        activations, delta = np.empty((L, kept.shape[3])), np.empty((kept.shape[3] - 1 - sizes[0], L))
        total = np.zeros(Wbar.shape[1])
        xbar, before, kbar = np.zeros((n_s, L)), np.zeros((n_s, L)), np.zeros((n_s, L))
        setpointbar = np.zeros((n_x - n_s, L))
        c, ended = C[group].ctypes.data, alive[group]
        for k in range(samples - 1, -1, -1):
            if k < samples - 1:
                setpointbar[:] = 0.0
                for sub in range(substeps - 1, -1, -1):
                    m = k * substeps + sub
                    s, a = stages[group, m], kept[group, m]
                    before[:] = xbar
                    for j in range(3, -1, -1):
                        _inputs_at(u, U[group], k, (sub + (0.0 if j == 0 else 0.5 if j < 3 else 1.0)) / substeps)
                        share = step / 6 if j == 0 or j == 3 else step / 3
                        onward = step / 2 if j < 2 else step
                        for i in range(n_s):
                            for lane in range(L):
                                kbar[i, lane] = share * before[i, lane] + (onward * v[i, lane] if j < 3 else 0.0)
                        _pulled_back(f, network, s[j], u, c, p_constants, p_weights, kbar, n_s, rows, ended, k, w, ybar, v, a[j], delta)
                        _add_to_weights(total, sizes, a[j], delta, activations)
                        _gather(xbar, setpointbar, v, n_s)
            else:
                setpointbar[:] = 0.0
            call_adjoint(g, (X[group, k].ctypes.data, U[group, k].ctypes.data, c, Ybar[group, k].ctypes.data, v.ctypes.data))
            _drop_ended(v, ended, k)
            _gather(xbar, setpointbar, v, n_s)
            if law:
                _through_law(law, X[group, k], SP[group, k], U[group, k], c, n_s, setpointbar, v)
                for i in range(n_s):
                    for lane in range(L):
                        xbar[i, lane] += v[i, lane]
        Wbar[group] = total
        x = X[group, 0].copy()
        call_adjoint(initial, (x.ctypes.data, U[group, 0].ctypes.data, c, xbar[12:].ctypes.data, v.ctypes.data))
        for i in range(12):
            for lane in range(L):
                X0bar[group, i, lane] = xbar[i, lane] + (v[i, lane] if n_s > 12 else 0.0)
        if law and n_s > 12:
            for i in range(n_s, n_x):
                setpointbar[i - n_s] = v[i]
            x[12:n_s] = 0.0
            _through_law(law, x, SP[group, 0], U[group, 0], c, n_s, setpointbar, v)
            for i in range(12):
                for lane in range(L):
                    X0bar[group, i, lane] += v[i, lane]


@njit(cache=True)
def _through_law(law, x, recorded, u, c, n_s, setpointbar, v):
    """v = (d law / d x)^T setpointbar where the law saw the state and the recorded set-points."""
    seen = x.copy()
    seen[n_s:] = recorded
    call_adjoint(law, (seen.ctypes.data, u.ctypes.data, c, setpointbar.ctypes.data, v.ctypes.data))
