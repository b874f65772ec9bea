"""Elimination of the segments' own unknowns equals weighting with the dense covariance that they cause."""

import numpy as np
import pytest
from oracles import marginal_least_squares

from awescli.estimation.chain import Chain
from awescli.estimation.information import reduce

K, N, OUT, OWN, GLOBAL = 3, 6, 4, 5, 3


def eliminated(J, e, sigma, precision, own):
    """`reduce` of J = [own, globals], all of it one link."""
    n_own = own.shape[1]
    r = np.where(np.isfinite(sigma), e / sigma, 0.0)
    return reduce(Chain(J, np.zeros((len(J), 0, n_own, n_own)), r, 1 / sigma, np.zeros(1, int), n_own, n_own), precision, own)


def case(seed):
    random = np.random.default_rng(seed)
    J = random.standard_normal((K, N, OUT, OWN + GLOBAL))
    sigma = random.uniform(0.1, 2.0, (K, N, OUT))
    e = random.standard_normal((K, N, OUT))
    A = random.standard_normal((OWN, OWN))
    return J, e, sigma, A @ A.T + np.eye(OWN), random.standard_normal((K, OWN))


@pytest.mark.parametrize("seed", range(6))
def test_elimination_is_the_dense_covariance(seed):
    """Guards the Schur complement: H, b and cost equal those of R = R_y + S P S' written out, for a full prior and own values != 0."""
    J, e, sigma, precision, own = case(seed)
    found = eliminated(J, e, sigma, precision, own)
    for k in range(K):
        flat = J[k].reshape(-1, OWN + GLOBAL)
        H, b, cost = marginal_least_squares(flat[:, :OWN], flat[:, OWN:], e[k].ravel(), sigma[k].ravel(), np.linalg.inv(precision), own[k])
        assert found.H[k] == pytest.approx(H, rel=1e-9, abs=1e-9) and found.b[k] == pytest.approx(b, rel=1e-9, abs=1e-9)
        assert found.cost[k] == pytest.approx(cost, rel=1e-9)


def test_unknowns_without_a_prior_are_projected_out():
    """Guards a start of which nothing is known: its columns take no share in H, and count as lost degrees of freedom."""
    J, e, sigma, _, own = case(7)
    found = eliminated(J, e, sigma, np.zeros((OWN, OWN)), own)
    for k in range(K):
        A = (J[k] / sigma[k][..., None]).reshape(-1, OWN + GLOBAL)
        Q = np.linalg.qr(A[:, :OWN])[0]
        B, r = (M - Q @ (Q.T @ M) for M in (A[:, OWN:], (e[k] / sigma[k]).ravel()))
        assert found.H[k] == pytest.approx(B.T @ B, rel=1e-7) and found.b[k] == pytest.approx(B.T @ r, rel=1e-6, abs=1e-8)
        assert found.cost[k] == pytest.approx(r @ r, rel=1e-7)
    assert found.dof.tolist() == [N * OUT - OWN] * K


@pytest.mark.parametrize("seed", range(3))
def test_own_unknowns_are_recovered(seed):
    """Guards `own`: for any change of the globals, what the segment's unknowns do is the minimiser of the joint cost."""
    J, e, sigma, precision, own = case(seed)
    found = eliminated(J, e, sigma, precision, own)
    change = np.random.default_rng(seed).standard_normal(GLOBAL)
    for k in range(K):
        A = (J[k] / sigma[k][..., None]).reshape(-1, OWN + GLOBAL)
        r = (e[k] / sigma[k]).ravel() - A[:, OWN:] @ change
        normal = A[:, :OWN].T @ A[:, :OWN] + precision
        assert found.own(k, change) == pytest.approx(np.linalg.solve(normal, A[:, :OWN].T @ r - precision @ own[k]), rel=1e-8, abs=1e-9)


def test_samples_that_do_not_count_do_not_count():
    """Guards gaps: infinite sigma removes a sample from H, b, cost and the degrees of freedom, whatever stands in its columns."""
    J, e, sigma, precision, own = case(9)
    sigma[1, 2:5] = np.inf
    J[1, 2:5] *= 1e6
    found = eliminated(J, e, sigma, precision, own)
    kept = np.r_[0, 1, 5]
    shorter = eliminated(J[1:2, kept], e[1:2, kept], sigma[1:2, kept], precision, own[1:2])
    assert found.H[1] == pytest.approx(shorter.H[0], rel=1e-9) and found.cost[1] == pytest.approx(shorter.cost[0], rel=1e-9)
    assert found.dof[1] == shorter.dof[0] == 3 * OUT


def test_an_unknown_that_nothing_sees_is_harmless():
    """Guards a state that no output reports: the elimination must not fail, nor change what the others say."""
    J, e, sigma, _, own = case(11)
    J[..., 2] = 0.0
    found = eliminated(J, e, sigma, np.zeros((OWN, OWN)), own)
    without = eliminated(np.delete(J, 2, axis=-1), e, sigma, np.zeros((OWN - 1, OWN - 1)), np.delete(own, 2, axis=1))
    assert found.H == pytest.approx(without.H, rel=1e-6) and np.isfinite(found.cost).all()


def test_a_segment_that_all_but_diverges_does_not_spoil_the_others():
    """Guards a trace that once ended with an indefinite Hessian: where everything grows by 1e9 along one direction, the difference of
    large numbers that the Schur complement is leaves only rounding; projection keeps it positive and right."""
    J, e, sigma, precision, own = case(13)
    direction = np.random.default_rng(0).standard_normal(OWN + GLOBAL)
    J[0] = J[0] + 1e9 * np.linspace(0, 1, N)[:, None, None] ** 4 * direction
    for prior in (precision, np.zeros((OWN, OWN))):
        found = eliminated(J, e, sigma, prior, own)
        A = (J[0] / sigma[0][..., None]).reshape(-1, OWN + GLOBAL)
        root = np.linalg.cholesky(prior).T if prior.any() else prior
        Q = np.linalg.qr(np.vstack([A[:, :OWN], root]))[0]
        B = np.vstack([A[:, OWN:], np.zeros((OWN, GLOBAL))])
        B = B - Q @ (Q.T @ B)
        B = B - Q @ (Q.T @ B)
        assert found.H[0] == pytest.approx(B.T @ B, rel=1e-4)
        assert np.linalg.eigvalsh(found.H[0])[0] > 0
        assert found.H[1:] == pytest.approx(eliminated(J[1:], e[1:], sigma[1:], prior, own[1:]).H)
        assert np.isfinite(found.own(0, np.zeros(GLOBAL))).all()
