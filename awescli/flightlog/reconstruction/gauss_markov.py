"""The likelihood of series that are a sum of known shapes, Gauss-Markov processes and white noise, in O(n).

    y_k = X_k beta + H_k z_k + e_k,     e white,     z_{k+1} = phi_k z_k + w_k

with each state on its own (Gelb, Applied Optimal Estimation, ch. 3). The states are integrated out: their precision is banded, so one
banded Cholesky factorisation gives the log determinant and the generalised least squares of beta (Rue & Held, Gaussian Markov Random
Fields, ch. 2). The likelihood is the restricted one (Harville 1977): beta is integrated out too, so that levels are not too small by what
beta has fitted. It is what a Rauch-Tung-Striebel smoother with beta among its states gives, to rounding.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import cho_factor, cho_solve, get_lapack_funcs
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components

from awescli.notation.errors import NumericalFailure

dpbtrf, dpbtrs, dtbtrs = get_lapack_funcs(("pbtrf", "pbtrs", "tbtrs"), dtype=np.float64)
"""Of LAPACK: Cholesky factor of a band matrix, solution with it, and with a triangular band."""
FAR = 1e3
"""Standard deviation with which a random walk begins, in its unit: knows nothing, and stays far from rounding."""


@dataclass(frozen=True)
class Law:
    """States that share one law: Ornstein-Uhlenbeck of standard deviation `level` and `memory` [s]; with an infinite memory a random walk
    of `level` per root second."""

    name: str
    states: tuple[int, ...]
    level: float
    memory: float = np.inf

    @property
    def walks(self) -> bool:
        return not np.isfinite(self.memory)


@dataclass(frozen=True)
class Series:
    """m series of n samples at `time` (n,) [s], with what they may be made of.

    y (n, m); X (n, m, k) shapes, named `columns`, each with the standard deviation of its prior about zero (`inf`: nothing known);
    H (n, m, s); seen (n, m) bool: where y counts; restart (n,) bool: where the states begin anew, the first sample among them.
    """

    y: np.ndarray
    X: np.ndarray
    H: np.ndarray
    seen: np.ndarray
    restart: np.ndarray
    time: np.ndarray
    columns: tuple[str, ...]
    prior: np.ndarray


@dataclass(frozen=True)
class Estimate:
    """beta (k,) with its covariance (k, k); deviance: -2 log of the restricted likelihood but for a constant; left (n, m): y less shapes
    and smoothed states."""

    beta: np.ndarray
    covariance: np.ndarray
    deviance: float
    left: np.ndarray | None = None


class BandedLikelihood:
    """The restricted likelihood of one Series for any levels; everything that no level changes is computed once."""

    def __init__(self, series: Series):
        self.series = series
        D = np.concatenate([series.y[:, :, None], series.X], axis=2) * series.seen[:, :, None]
        H = series.H * series.seen[:, :, None]
        # D'D of each series
        self._gram = np.einsum("nia,nib->iab", D, D)
        self._blocks = [_Block.of(H, D, *together) for together in _apart(series.H)]
        self._count = series.seen.sum(0)
        self._elapsed = np.where(series.restart, 1.0, np.diff(series.time, prepend=series.time[0] - 1.0))

    def _prior(self, laws: Sequence[Law]) -> tuple[dict[int, tuple[np.ndarray, np.ndarray]], float]:
        """State -> its own precision (n,) and that between it and the next sample's (n,), and the log determinant of all."""
        found, log_determinant = {}, 0.0
        restart, elapsed = self.series.restart, self._elapsed
        for law in laws:
            begin = FAR**2 if law.walks else law.level**2
            phi = np.ones(len(elapsed)) if law.walks else np.exp(-elapsed / law.memory)
            variance = law.level**2 * (elapsed if law.walks else -np.expm1(-2 * elapsed / law.memory))
            variance[restart], phi[restart] = begin, 0.0
            # a step is seen by both of its ends
            ahead, share = np.append(phi[1:], 0.0), np.append(1 / variance[1:], 0.0)
            found |= dict.fromkeys(law.states, (1 / variance + ahead**2 * share, -ahead * share))
            log_determinant -= len(law.states) * np.log(variance).sum()
        return found, log_determinant

    def at(self, white: np.ndarray, laws: Sequence[Law], smooth: bool = False) -> Estimate:
        """The estimate where the white noise of the series is `white` (m,) and states follow `laws`. Raises NumericalFailure."""
        weights = 1.0 / np.asarray(white) ** 2
        prior, log_determinant = self._prior(laws)
        factors = [block.factor(weights, prior) for block in self._blocks]
        G = np.einsum("i,iab->ab", weights, self._gram) - sum(half.T @ half for _, _, half in factors)
        A = G[1:, 1:] + np.diag(1.0 / self.series.prior**2)
        try:
            lower = cho_factor(A, lower=True)
        except np.linalg.LinAlgError:
            what = "shapes of the flight path cannot be distinguished"
            raise NumericalFailure("singular", what, do="Look at the log's channels.") from None
        beta = cho_solve(lower, G[1:, 0])
        deviance = (
            G[0, 0] - G[1:, 0] @ beta + 2 * sum(np.log(factor[0]).sum() for factor, _, _ in factors)
            - log_determinant - self._count @ np.log(weights) + 2 * np.log(np.diag(lower[0])).sum()
        )  # fmt: skip
        left = None
        if smooth:
            states = np.zeros((len(self._elapsed), self.series.H.shape[2]))
            for block, (factor, cross, _) in zip(self._blocks, factors, strict=True):
                solved, _ = dpbtrs(factor, cross, lower=1)
                states[:, block.states] = (solved[:, 0] - solved[:, 1:] @ beta).reshape(len(states), -1)
            left = self.series.y - self.series.X @ beta - np.einsum("nms,ns->nm", self.series.H, states)
        return Estimate(beta, cho_solve(lower, np.eye(len(beta))), float(deviance), left)


@dataclass(frozen=True)
class _Block:
    """Series and the states that only these see. bands, cross: of each series, the band of H'H and H'D."""

    series: tuple[int, ...]
    states: tuple[int, ...]
    bands: tuple[np.ndarray, ...]
    cross: tuple[np.ndarray, ...]

    @classmethod
    def of(cls, H: np.ndarray, D: np.ndarray, series: tuple[int, ...], states: tuple[int, ...]) -> "_Block":
        n, s = len(H), len(states)
        bands, cross = [], []
        for i in series:
            own, band = H[:, i, states], np.zeros((s + 1, n, s))
            for a in range(s):
                for b in range(a, s):
                    band[b - a, :, a] = own[:, a] * own[:, b]
            bands.append(np.asfortranarray(band.reshape(s + 1, n * s)))
            cross.append(np.asfortranarray(np.einsum("ns,na->nsa", own, D[:, i]).reshape(n * s, -1)))
        return cls(series, states, tuple(bands), tuple(cross))

    def factor(
        self, weights: np.ndarray, prior: Mapping[int, tuple[np.ndarray, np.ndarray]]
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:  # fmt: skip
        """(Cholesky factor L of the band of the states' precision P, C = H'D with its weights, L^-1 C)."""
        s = len(self.states)
        own = np.zeros((s + 1, self.bands[0].shape[1] // s, s))
        for j, state in enumerate(self.states):
            own[0, :, j], own[s, :, j] = prior[state]
        band = np.asfortranarray(own.reshape(s + 1, -1))
        for i, seen in zip(self.series, self.bands, strict=True):
            band += weights[i] * seen
        cross = np.asfortranarray(sum(weights[i] * c for i, c in zip(self.series, self.cross, strict=True)))
        factor, info = dpbtrf(band, lower=1, overwrite_ab=1)
        if info:
            raise NumericalFailure("singular", "noise levels of the flight path cannot be distinguished", do="Look at the log's channels.")
        return factor, cross, dtbtrs(factor, cross, uplo="L")[0]


def _apart(H: np.ndarray) -> list[tuple[tuple[int, ...], tuple[int, ...]]]:
    """(series, states) of H (n, m, s) that have nothing to do with the others: position along north says nothing of drifts along east."""
    sees = (H != 0).any(0)
    m, s = sees.shape
    links = np.block([[np.zeros((m, m)), sees], [np.zeros((s, m + s))]])
    count, of = connected_components(csr_array(links), directed=False)
    found = [(np.flatnonzero(of[:m] == k), np.flatnonzero(of[m:] == k)) for k in range(count)]
    return [(tuple(series.tolist()), tuple(states.tolist())) for series, states in found if len(series) and len(states)]
