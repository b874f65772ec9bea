"""What the colour of the residual adds to the covariance of parameters.

Gauss-Newton's covariance takes the noise for white. Residuals of a real flight are not: filters, vibration and what no process follows
leave errors of which neighbouring samples say the same thing again. After Morelli & Klein, "Determining the accuracy of maximum likelihood
parameter estimates with colored residuals" (NASA CR 194893, 1994): with the residual's own autocorrelation R in place of the identity,
cov = C (sum_ij s_i' R(i - j) s_j) C. Two differences, with reasons: nuisances are projected out of the sensitivities s first, because they
are fitted along; and the spectrum of R counts as at least that of white noise of the estimated level, because slow errors that the
nuisances have taken up are missing in the residual, and a fit can be no surer than its sensors.
"""

import numpy as np

from awescli.estimation.fit import Fit

LAGS = 0.25
"""Lags that count, as a share of a segment: longer ones are averages of too few samples (Morelli & Klein take a fifth)."""


def coloured_information(fit: Fit) -> np.ndarray:
    """(n, n) by how much the variance of the gradient J'r exceeds that of white noise; to be put between two covariances."""
    if not len(fit.counted) or not fit.links.n:
        return np.zeros((fit.links.n,) * 2)
    columns = fit.misfit.changed(fit.links, fit.information.responses(), np.eye(fit.links.n))[fit.counted]
    return excess(columns, fit.links.r[fit.counted], fit.links.weight[fit.counted] > 0)


def excess(columns: np.ndarray, r: np.ndarray, counted: np.ndarray) -> np.ndarray:
    """(n, n) sum over segments and channels of J'(R - 1)J, R the autocorrelation of the residual r, pooled over segments.

    columns: (K, N, c, n) whitened, 0 where a sample does not count; r: (K, N, c) whitened residual, 0 there too; counted: (K, N, c).
    """
    K, N, channels, n = columns.shape
    lags = max(int(LAGS * N), 1)
    size = 1 << (N + lags).bit_length()
    total = np.zeros((n, n))
    # the conjugate half of the spectrum is counted by its weight
    weight = np.r_[1.0, np.full(size // 2 - 1, 2.0), 1.0] / size
    for c in range(channels):
        if not counted[..., c].any():
            continue
        surplus = np.maximum(spectrum(r[..., c], counted[..., c], lags, size), 1.0) - 1.0
        A = np.fft.rfft(columns[:, :, c], size, axis=1) * np.sqrt(weight * surplus)[:, None]
        A = A.reshape(-1, n)
        total += A.real.T @ A.real + A.imag.T @ A.imag
    return total


def spectrum(r: np.ndarray, counted: np.ndarray, lags: int, size: int) -> np.ndarray:
    """(size / 2 + 1,) spectrum of the autocorrelation of r (K, N) up to `lags`, tapered linearly (Bartlett); 1 for white noise."""
    products = [(r[:, : r.shape[1] - k] * r[:, k:]).sum() for k in range(lags)]
    pairs = [(counted[:, : r.shape[1] - k] & counted[:, k:]).sum() for k in range(lags)]
    R = np.array(products) / np.maximum(pairs, 1) * (1 - np.arange(lags) / lags)
    both = np.zeros(size)
    both[:lags] = R
    both[size - lags + 1 :] = R[:0:-1]
    return np.fft.rfft(both).real
