"""What the colour of the residual adds to the covariance of parameters.

Gauss-Newton's covariance takes the noise for white. Residuals of a real flight are not: filters, vibration and what no process follows
leave errors of which neighbouring samples say the same thing again. After Morelli & Klein, "Determining the accuracy of maximum likelihood
parameter estimates with colored residuals" (NASA CR 194893, 1994): with the residual's own autocorrelation R in place of the identity,
cov = C (sum_ij s_i' R(i - j) s_j) C. Two differences, with reasons: nuisances are projected out of the sensitivities s first, because they
are fitted along; and the spectrum of R counts as at least that of white noise of the estimated level, because slow errors that the
nuisances have taken up are missing in the residual, and a fit can be no surer than its sensors.
"""

import numpy as np

from awescli.estimation.fitted import Fit

LAGS = 0.25
"""Lags that count, as a share of a segment: longer ones are averages of too few samples (Morelli & Klein take a fifth)."""


def coloured_information(fit: Fit) -> np.ndarray:
    """(n, n) by how much the variance of the gradient J'r exceeds that of white noise; to be put between two covariances."""
    misfit, n = fit.misfit, len(fit.names)
    total = np.zeros((n, n))
    if not len(fit.counted) or not n:
        return total
    x, responses = fit.parameters.vector(fit.names), fit.information.responses()
    r, counted = (of_all[fit.counted] for of_all in misfit.whitened(x, fit.own))
    surplus, counts = surpluses(r, counted), np.isin(np.arange(len(fit.alive)), fit.counted)
    for which, links, _ in misfit.parts(x, fit.own):
        # one by one: the sum is the same to the last bit however many segments come at once
        for of_segment in excess(misfit.changed(links, responses.of(which), np.eye(n))[counts[which]], surplus):
            total += of_segment
    return total


def surpluses(r: np.ndarray, counted: np.ndarray) -> np.ndarray:
    """(c, size / 2 + 1) by how much the spectrum of each channel's residual exceeds that of white noise, pooled over segments. r: (K, N, c)
    whitened residual, 0 where a sample does not count; counted: (K, N, c)."""
    lags = max(int(LAGS * r.shape[1]), 1)
    size = 1 << (r.shape[1] + lags).bit_length()
    found = np.zeros((r.shape[2], size // 2 + 1))
    for c in np.flatnonzero(counted.any(axis=(0, 1))):
        found[c] = np.maximum(spectrum(r[..., c], counted[..., c], lags, size), 1.0) - 1.0
    return found


def excess(columns: np.ndarray, surplus: np.ndarray) -> np.ndarray:
    """(K, n, n) sum over channels of J'(R - 1)J in each segment, R the autocorrelation of the residual, whose spectrum `surpluses` says.
    columns: (K, N, c, n) whitened, 0 where a sample does not count."""
    K, n, size = len(columns), columns.shape[3], 2 * (surplus.shape[1] - 1)
    total = np.zeros((K, n, n))
    # the conjugate half of the spectrum is counted by its weight
    weight = np.r_[1.0, np.full(size // 2 - 1, 2.0), 1.0] / size
    for c in np.flatnonzero(surplus.any(axis=1)):
        A = np.fft.rfft(columns[:, :, c], size, axis=1) * np.sqrt(weight * surplus[c])[:, None]
        A = np.concatenate([A.real, A.imag], axis=1)
        total += np.matmul(A.swapaxes(1, 2), A)
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
