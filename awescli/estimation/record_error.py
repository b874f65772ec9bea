"""What the wind record's errors add to the covariance of parameters.

A station's entry is wrong by a fixed amount for as long as it is interpolated, a minute, and meets the kite in every loop of that minute:
such errors do not average out over segments as the windows of nuisance wind do. Their part that lasts the whole flight is fitted
(`kite.record_errors`); the part that changes from entry to entry is propagated here.
"""

from dataclasses import replace

import numpy as np

from awescli.estimation.fit import Fit


def record_influence(fit: Fit, record: tuple[str, ...], knots: np.ndarray, times: np.ndarray) -> np.ndarray:
    """(n, M i) columns std_i B_mi, B_mi = sum_k w_m(t_k) H_k[:, i]: with the covariance C of a fit, C B B' C is what errors that change
    from entry to entry add to it.

    record: names of the station errors among the fitted ones; knots: (M,) times of the record's entries; times: (K,) mid-times of the
    segments, on the same clock; w_m: the hat functions of linear interpolation between knots, less their mean over the segments
    (the constant part is fitted).
    """
    fitted = [n for n in record if n in fit.names]
    if not fitted or len(knots) < 2:
        return np.zeros((len(fit.names), 0))
    hats = np.stack([np.interp(times, knots, row) for row in np.eye(len(knots))])
    hats -= hats.mean(axis=1, keepdims=True)
    index = [fit.names.index(n) for n in fitted]
    std = np.array([fit.parameters[n].prior_std for n in fitted])
    B = np.einsum("mk,kij->mij", hats, fit.information.H[:, :, index]) * std
    return np.moveaxis(B, 1, 0).reshape(len(fit.names), -1)


def with_record_errors(fit: Fit, record: tuple[str, ...], knots: np.ndarray, times: np.ndarray) -> Fit:
    """The fit of one flight with the influence of such errors added to its covariance; arguments of `record_influence`."""
    influence = fit.covariance @ record_influence(fit, record, knots, times)
    return replace(fit, covariance=fit.covariance + influence @ influence.T)


def mid_times(segments, log) -> np.ndarray:
    """(K,) time at the middle of each segment, on the log's clock [s]."""
    return log.time[segments.first] + segments.steps * segments.dt / 2
