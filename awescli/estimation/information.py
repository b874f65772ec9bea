"""What each segment knows: Gram matrices of whitened sensitivities and residuals, with the segment's own unknowns eliminated.

A segment k has unknowns of its own: its initial state z0 (nothing known beforehand) and the wind beside the record (with a Gaussian
prior). Eliminating them exactly (Schur complement) is the same as weighting with R_k = R_y + S_x0 P0 S_x0' + S_w P_w S_w' with
P0 -> infinity, and costs a factorisation of 50 x 50, in gusts 315 x 315, instead of one of 4000 x 4000.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import cho_factor, cho_solve, solve_triangular

from awescli.estimation.chain import Chain

PROBE = 0.5
"""Size of the probes that integrate over the own unknowns, in standard deviations: small enough not to lose a segment."""
CANCELLED = 1e8
"""Where eliminating the own unknowns takes away all but this share of a column's information, rounding is left: then the elimination
is done again by projection, which loses half as many digits and cannot become indefinite. (A segment that all but diverges.)"""


@dataclass(frozen=True)
class Information:
    """Reduced Gram matrices of [global columns, residual] per segment.

    H: (K, n, n) information on the global columns; b: (K, n) gradient J' r; cost: (K,) squared whitened residual that is left
    when the segment's own unknowns are at their best; dof: (K,) number of samples less number of own unknowns;
    back: per segment (factor, M_lg, M_lr) to recover the own unknowns for a change of the globals.
    volume: (K,) log determinant of the Hessian of half the cost in the own unknowns: what integrating them out adds to the cost; and tilt:
    (K, n) -1/2 of its gradient with respect to the globals: what that adds to b. Both are 0 where a fit does not integrate, nan where it
    was not asked for or the own unknowns are too far from their best to say.
    """

    H: np.ndarray
    b: np.ndarray
    cost: np.ndarray
    dof: np.ndarray
    back: list
    volume: np.ndarray
    tilt: np.ndarray

    @property
    def deviance(self) -> np.ndarray:
        """(K,) -2 log likelihood up to a constant: the own unknowns integrated out (Laplace), not only at their best."""
        return self.cost + self.volume

    def own(self, k: int, change: np.ndarray) -> np.ndarray:
        """The own unknowns of segment k that go with a change of the globals."""
        factor, M_lg, M_lr = self.back[k]
        return cho_solve(factor, M_lr - M_lg @ change)


def reduce(chain: Chain, own_prior: np.ndarray, own_value: np.ndarray) -> Information:
    """Eliminate the own unknowns of every segment.

    own_prior: (n_own, n_own) prior precision of the own unknowns (0: nothing known), mean 0; own_value: (K, n_own) their present values.
    """
    K, n = len(chain), chain.n
    (of_own, cross, of_globals), pull = chain.gram(), own_value @ own_prior
    cross[..., -1] -= pull
    H, b, cost, back = np.zeros((K, n, n)), np.zeros((K, n)), np.zeros(K), []
    for k, (M, M_l, G) in enumerate(zip(of_own, cross, of_globals, strict=True)):
        factor = _factor(M + own_prior)
        root, lower = factor
        known = solve_triangular(root, M_l, trans=int(not lower), lower=lower, check_finite=False)
        whole = G - known.T @ known
        H[k], b[k], cost[k] = whole[:-1, :-1], whole[:-1, -1], whole[-1, -1] + own_value[k] @ pull[k]
        if (np.diag(G)[:-1] > CANCELLED * np.diag(H[k])).any():
            H[k], b[k], cost[k] = _projected(chain.pick([k]), own_prior, own_value[k])
        back.append((factor, M_l[:, :-1], M_l[:, -1]))
    dof = (chain.weight > 0).sum(axis=(1, 2)) - float(np.count_nonzero(np.diag(own_prior) == 0))
    return Information(H, b, cost, dof, back, np.zeros(K), np.zeros((K, n)))


def integrated(information: Information, around: Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]], seed: int = 0) -> Information:
    """The information with the own unknowns integrated out (Laplace's approximation) instead of taken at their best: its volume and tilt.

    Unknowns that are many and known badly, as gusts are, pull the globals towards values under which they would matter more: the fit then
    explains noise by them. What corrects that is the log determinant of the Hessian. With M = J'J + prior, d = PROBE M^(-1/2) z and random
    signs z, E[cost(best + d) + cost(best - d) - 2 cost(best)] / 2 PROBE^2 is its trace in units of M, and the same difference of
    b is, by Fisher's identity, -1/2 the gradient of the log determinant; both to second order in d, on average over z (Hutchinson).

    around: change of the own unknowns (K, n_own) -> (cost (K,), gradient J'r less the pull of the prior (K, n_own + n)), nan where a
    segment diverges.
    """
    factors = [factor for factor, _, _ in information.back]
    n_own = len(factors[0][0])
    unknown = replace(information, volume=np.full_like(information.cost, np.nan), tilt=np.full_like(information.b, np.nan))
    cost, pull = around(np.zeros((len(factors), n_own)))
    near = cost - information.cost < PROBE**2 * n_own
    if not near.any():
        return unknown
    signs = np.random.default_rng(seed).choice((-1.0, 1.0), (len(factors), n_own))
    d = np.stack([PROBE * solve_triangular(c, z, trans=int(lower), lower=lower) for (c, lower), z in zip(factors, signs, strict=True)])
    (cost_there, pull_there), (cost_back, pull_back) = around(d), around(-d)
    trace = (cost_there + cost_back - 2 * cost) / (2 * PROBE**2)
    bent = (pull_there + pull_back - 2 * pull) / (2 * PROBE**2)
    log_det = np.array([2 * np.log(np.diag(c)).sum() for c, _ in factors])
    volume, tilt = log_det + trace - n_own, unknown.tilt
    known = near & np.isfinite(volume) & np.isfinite(bent).all(axis=1)
    for k in np.flatnonzero(known):
        factor, M_lg, _ = information.back[k]
        tilt[k] = bent[k, n_own:] - M_lg.T @ cho_solve(factor, bent[k, :n_own])
    return replace(information, volume=np.where(known, volume, np.nan), tilt=tilt)


def _projected(chain: Chain, own_prior: np.ndarray, own_value: np.ndarray):
    """(H, b, cost) of one segment with its own unknowns projected out of the whitened columns of the globals and the residual."""
    values, vectors = np.linalg.eigh(own_prior)
    root = (vectors * np.sqrt(np.maximum(values, 0.0))).T
    own = np.vstack([chain.own().reshape(-1, chain.n_own), root])
    rest = np.vstack([np.column_stack([chain.globals().reshape(chain.r.size, -1), chain.r.ravel()]), np.zeros((len(root), chain.n + 1))])
    rest[chain.r.size :, -1] = -root @ own_value
    U, s, _ = np.linalg.svd(own / np.maximum(np.linalg.norm(own, axis=0), 1e-300), full_matrices=False)
    U = U[:, s > 1e-11 * s[0]]
    for _ in range(2):
        rest -= U @ (U.T @ rest)
    G = rest.T @ rest
    return G[:-1, :-1], G[:-1, -1], G[-1, -1]


def _factor(M: np.ndarray):
    """Cholesky factor of M + ridge diag(1 + M), the least ridge that rounding asks for.

    An own unknown that nothing depends on (a state that no output sees), or a segment that all but diverges and so knows its start in
    one direction 1e8 times better than in another, must not make the factorisation fail.
    """
    place, diagonal = np.diag_indices(len(M)), 1 + np.diag(M)
    for ridge in (1e-12, 1e-10, 1e-8, 1e-6):
        firm = M.copy()
        firm[place] += ridge * diagonal
        try:
            return cho_factor(firm)
        except np.linalg.LinAlgError:
            continue
    return cho_factor(np.diag(diagonal))
