"""Coloured residuals: the correction equals the dense covariance, and intervals hold where the noise is not white."""

import numpy as np
import pytest
from kites import lively, truly
from scipy.linalg import toeplitz
from scipy.signal import lfilter

from awescli.estimation.coloured import LAGS, coloured_information, excess, spectrum, surpluses
from awescli.estimation.fit import fit
from awescli.estimation.misfit import Misfit
from awescli.simulation.rollout import Simulator
from awescli.simulation.segments import Observed


def autoregressive(random, shape, rho):
    """Unit-variance noise along the second axis with correlation rho from sample to sample."""
    white = random.standard_normal((shape[0], shape[1] + 300, *shape[2:]))
    return lfilter([np.sqrt(1 - rho**2)], [1, -rho], white, axis=1)[:, 300:]


def test_the_excess_is_that_of_the_dense_covariance():
    """Guards the Fourier form: sum of J'(R - 1)J with R written out as a Toeplitz matrix, where no frequency lies below white noise."""
    random = np.random.default_rng(0)
    K, N, n = 5, 60, 3
    columns, r = random.standard_normal((K, N, 1, n)), 3 * random.standard_normal((K, N, 1))
    counted = np.ones((K, N, 1), bool)
    lags = int(LAGS * N)
    flat = r[..., 0]
    R = [np.mean(flat[:, : N - k] * flat[:, k:]) * (1 - k / lags) for k in range(lags)] + [0.0] * (N - lags)
    assert spectrum(flat, counted[..., 0], lags, 128).min() > 1
    dense = sum(J[:, 0].T @ (toeplitz(R) - np.eye(N)) @ J[:, 0] for J in columns)
    assert excess(columns, surpluses(r, counted)).sum(axis=0) == pytest.approx(dense, rel=1e-10)


def test_gaps_do_not_count():
    """Guards logs with gaps: an autocorrelation over pairs that are both there is unbiased by the zeros between."""
    random = np.random.default_rng(1)
    r = autoregressive(random, (200, 200), 0.9)
    counted = random.uniform(size=r.shape) > 0.4
    whole, holed = spectrum(r, np.ones_like(counted), 50, 256), spectrum(r * counted, counted, 50, 256)
    assert holed == pytest.approx(whole, rel=0.1, abs=0.1)


def test_white_noise_adds_little():
    """Guards calm flights: the estimated spectrum of white noise scatters about 1, and only its upper half counts."""
    random = np.random.default_rng(2)
    columns, r = np.cumsum(random.standard_normal((30, 250, 4, 5)), axis=1), random.standard_normal((30, 250, 4))
    white = np.einsum("ktcn,ktcm->nm", columns, columns)
    added = np.linalg.eigvalsh(np.linalg.solve(white, excess(columns, surpluses(r, np.ones_like(r, bool))).sum(axis=0)))
    assert 0 <= added[0] and added[-1] < 0.2


def test_intervals_hold_under_coloured_noise(kite, calm):
    """Guards the standard deviations: with noise correlated over 0.2 s the normalised errors are chi-square with the correction, and far
    too large without."""
    simulator = Simulator(kite)
    observed = truly(lively(kite, calm.log, count=16, seconds=2.5), simulator)
    names = ("CLa", "CL0", "CD0", "CYb", "Clb", "Clp", "Cma", "Cnb", "CtD", "dl")
    table, plain, corrected = simulator.kite.parameters, [], []
    for seed in range(12):
        noise = observed.sigma * autoregressive(np.random.default_rng(seed), observed.measured.shape, 0.9)
        noisy = Observed(observed.segments, observed.outputs, observed.measured + noise, observed.sigma)
        found = fit(Misfit(simulator, noisy, names), table, prior=False)
        added = coloured_information(found)
        e = found.parameters.vector(names) - table.vector(names)
        C = found.covariance
        plain.append(e**2 / np.diag(C))
        corrected.append(e**2 / np.diag(C + C @ added @ C))
    assert np.mean(plain) > 3
    # mean of 120 squares of unit normals, correlated among parameters: 1 +- 0.3
    assert 0.5 < np.mean(corrected) < 1.6
    assert np.mean(np.array(corrected) < 1.96**2) > 0.88
