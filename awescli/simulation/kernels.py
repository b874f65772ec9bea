"""Numba kernels that step compiled programs through time: classical RK4, LANES segments abreast, groups of lanes in parallel.

They know addresses of programs and sizes, no kite. x = [states, held set-points]; exogenous inputs run linearly between samples,
set-points are held from sample to sample (seed eq. 9e as flown: sample and hold).
"""

import numpy as np
from numba import njit, prange

from awescli.engine.call import call_tangent, call_value

LIMIT = 1e6
"""A state beyond this, or not finite, has diverged; its lane stops there and is set back to its start so that it stays harmless."""


@njit(cache=True)
def _inputs_at(u, U, k, share):
    """u = U[k] + share (U[k+1] - U[k])"""
    for i in range(u.shape[0]):
        for lane in range(u.shape[1]):
            u[i, lane] = U[k, i, lane] + share * (U[k + 1, i, lane] - U[k, i, lane])


@njit(cache=True)
def _sample(x, k, SP, n_s):
    """Take over the recorded set-points of sample k."""
    for i in range(SP.shape[1]):
        for lane in range(x.shape[1]):
            x[n_s + i, lane] = SP[k, i, lane]


@njit(cache=True)
def _stop_diverged(x, start, alive, k):
    """Mark lanes whose state left the numbers; put them back to their start. Returns how many stopped now."""
    stopped = 0
    for lane in range(x.shape[1]):
        good = True
        for i in range(x.shape[0]):
            if not (abs(x[i, lane]) < LIMIT):
                good = False
        if not good:
            if alive[lane] > k:
                alive[lane] = k
                stopped += 1
            for i in range(x.shape[0]):
                x[i, lane] = start[i, lane]
    return stopped


@njit(parallel=True, cache=True)
def rollout(f, g, initial, law, n_s, X0, SP, U, C, h, substeps, X, Y, alive):
    """Simulate. X0 (G, 12, L); SP (G, K+1, n_sp, L); U (G, K+1, n_u, L); C (G, n_c, L); h [s] between samples.

    f, g, initial, law: addresses of `value` functions (law = 0: recorded set-points). Fills X (G, K+1, n_x, L), Y (G, K+1, n_y, L)
    and alive (G, L), the number of samples before divergence.
    """
    G, samples, n_x, L = X.shape
    step = h / substeps
    for group in prange(G):
        x = np.zeros((n_x, L))
        u = np.empty((U.shape[2], L))
        stage = np.empty((n_x, L))
        k1, k2, k3, k4 = np.empty((n_s, L)), np.empty((n_s, L)), np.empty((n_s, L)), np.empty((n_s, L))
        c = C[group].ctypes.data
        for i in range(12):
            x[i] = X0[group, i]
        _sample(x, 0, SP[group], n_s)
        if law:
            call_value(law, (x.ctypes.data, U[group, 0].ctypes.data, c, x[n_s:].ctypes.data))
        call_value(initial, (x.ctypes.data, U[group, 0].ctypes.data, c, x[12:].ctypes.data))
        start = x.copy()
        for k in range(samples):
            _sample(x, k, SP[group], n_s)
            if law:
                call_value(law, (x.ctypes.data, U[group, k].ctypes.data, c, k1.ctypes.data))
                x[n_s:] = k1[: n_x - n_s]
            X[group, k] = x
            call_value(g, (x.ctypes.data, U[group, k].ctypes.data, c, Y[group, k].ctypes.data))
            if k == samples - 1:
                break
            for sub in range(substeps):
                _inputs_at(u, U[group], k, sub / substeps)
                call_value(f, (x.ctypes.data, u.ctypes.data, c, k1.ctypes.data))
                stage[:] = x
                for i in range(n_s):
                    for lane in range(L):
                        stage[i, lane] = x[i, lane] + step / 2 * k1[i, lane]
                _inputs_at(u, U[group], k, (sub + 0.5) / substeps)
                call_value(f, (stage.ctypes.data, u.ctypes.data, c, k2.ctypes.data))
                for i in range(n_s):
                    for lane in range(L):
                        stage[i, lane] = x[i, lane] + step / 2 * k2[i, lane]
                call_value(f, (stage.ctypes.data, u.ctypes.data, c, k3.ctypes.data))
                for i in range(n_s):
                    for lane in range(L):
                        stage[i, lane] = x[i, lane] + step * k3[i, lane]
                _inputs_at(u, U[group], k, (sub + 1.0) / substeps)
                call_value(f, (stage.ctypes.data, u.ctypes.data, c, k4.ctypes.data))
                for i in range(n_s):
                    for lane in range(L):
                        x[i, lane] += step / 6 * (k1[i, lane] + 2 * k2[i, lane] + 2 * k3[i, lane] + k4[i, lane])
            _stop_diverged(x, start, alive[group], k + 1)


@njit(cache=True)
def _columns_now(column_of, always, k, w_parameter, w_column, w_first, w_last):
    """Columns that differentiate with respect to a parameter during step k: those of the whole segment and those of a window."""
    for j in range(column_of.shape[0]):
        column_of[j] = always[j]
    for i in range(w_parameter.shape[0]):
        if w_first[i] <= k < w_last[i]:
            column_of[w_parameter[i]] = w_column[i]


@njit(cache=True)
def _axpy(out, a, scale, b, n):
    """out[:n] = a[:n] + scale b[:n], flat"""
    o, x, y = out.reshape(-1), a.reshape(-1), b.reshape(-1)
    for i in range(n):
        o[i] = x[i] + scale * y[i]


@njit(cache=True)
def _weighted_sum(x, scale, a, b, c, d, n):
    """x[:n] += scale (a + 2 b + 2 c + d)[:n], flat"""
    o, p, q, r, s = x.reshape(-1), a.reshape(-1), b.reshape(-1), c.reshape(-1), d.reshape(-1)
    for i in range(n):
        o[i] += scale * (p[i] + 2.0 * q[i] + 2.0 * r[i] + s[i])


@njit(parallel=True, cache=True)
def sensitivities(f, g, initial, law, n_s, X0, SP, U, C, h, substeps, state_columns, always, w_parameter, w_column, w_first, w_last,
                  n_col, rows, X, Y, J, alive):  # fmt: skip
    """`rollout`, and the exact derivative of its outputs: J (G*L, K+1, len(rows), n_col) = dY[rows] / d columns.

    f, g, initial, law: addresses of `tangent` functions. state_columns (12,): column of each initial state, or -1;
    always (n_wrt,): column of each parameter over the whole segment, or -1; w_*: columns of a parameter in steps first..last-1.
    """
    G, samples, n_x, L = X.shape
    n_y = Y.shape[2]
    step = h / substeps
    for group in prange(G):
        x, u, stage = np.zeros((n_x, L)), np.empty((U.shape[2], L)), np.empty((n_x, L))
        k1, k2, k3, k4 = np.empty((n_x, L)), np.empty((n_x, L)), np.empty((n_x, L)), np.empty((n_x, L))
        S, T = np.zeros((n_x, n_col, L)), np.zeros((n_x, n_col, L))
        d1, d2, d3, d4 = np.zeros((n_x, n_col, L)), np.zeros((n_x, n_col, L)), np.zeros((n_x, n_col, L)), np.zeros((n_x, n_col, L))
        D = np.empty((n_y, n_col, L))
        column_of = np.empty(always.shape[0], np.int64)
        c, columns = C[group].ctypes.data, column_of.ctypes.data
        n, m = n_s * L, n_s * n_col * L
        for i in range(12):
            x[i] = X0[group, i]
            if state_columns[i] >= 0:
                S[i, state_columns[i], :] = 1.0
        _sample(x, 0, SP[group], n_s)
        _columns_now(column_of, always, 0, w_parameter, w_column, w_first, w_last)
        u0 = U[group, 0].ctypes.data
        if law:
            call_tangent(law, (x.ctypes.data, u0, c, k1.ctypes.data, S.ctypes.data, d1.ctypes.data, n_col, columns))
            x[n_s:] = k1[: n_x - n_s]
            S[n_s:] = d1[: n_x - n_s]
        if n_s > 12:
            call_tangent(initial, (x.ctypes.data, u0, c, k1.ctypes.data, S.ctypes.data, d1.ctypes.data, n_col, columns))
            x[12:n_s] = k1[: n_s - 12]
            S[12:n_s] = d1[: n_s - 12]
        start = x.copy()
        for k in range(samples):
            _columns_now(column_of, always, k, w_parameter, w_column, w_first, w_last)
            u_k = U[group, k].ctypes.data
            _sample(x, k, SP[group], n_s)
            if law:
                call_tangent(law, (x.ctypes.data, u_k, c, k1.ctypes.data, S.ctypes.data, d1.ctypes.data, n_col, columns))
                x[n_s:] = k1[: n_x - n_s]
                S[n_s:] = d1[: n_x - n_s]
            X[group, k] = x
            call_tangent(g, (x.ctypes.data, u_k, c, Y[group, k].ctypes.data, S.ctypes.data, D.ctypes.data, n_col, columns))
            for lane in range(L):
                segment = group * L + lane
                if segment < J.shape[0]:
                    for i in range(rows.shape[0]):
                        for j in range(n_col):
                            J[segment, k, i, j] = D[rows[i], j, lane]
            if k == samples - 1:
                break
            for sub in range(substeps):
                _inputs_at(u, U[group], k, sub / substeps)
                call_tangent(f, (x.ctypes.data, u.ctypes.data, c, k1.ctypes.data, S.ctypes.data, d1.ctypes.data, n_col, columns))
                stage[:] = x
                T[n_s:] = S[n_s:]
                _axpy(stage, x, step / 2, k1, n)
                _axpy(T, S, step / 2, d1, m)
                _inputs_at(u, U[group], k, (sub + 0.5) / substeps)
                call_tangent(f, (stage.ctypes.data, u.ctypes.data, c, k2.ctypes.data, T.ctypes.data, d2.ctypes.data, n_col, columns))
                _axpy(stage, x, step / 2, k2, n)
                _axpy(T, S, step / 2, d2, m)
                call_tangent(f, (stage.ctypes.data, u.ctypes.data, c, k3.ctypes.data, T.ctypes.data, d3.ctypes.data, n_col, columns))
                _axpy(stage, x, step, k3, n)
                _axpy(T, S, step, d3, m)
                _inputs_at(u, U[group], k, (sub + 1.0) / substeps)
                call_tangent(f, (stage.ctypes.data, u.ctypes.data, c, k4.ctypes.data, T.ctypes.data, d4.ctypes.data, n_col, columns))
                _weighted_sum(x, step / 6, k1, k2, k3, k4, n)
                _weighted_sum(S, step / 6, d1, d2, d3, d4, m)
            if _stop_diverged(x, start, alive[group], k + 1) > 0:
                for lane in range(L):
                    if alive[group, lane] == k + 1:
                        S[:, :, lane] = 0.0
