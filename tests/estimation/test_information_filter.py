"""Eliminating nuisances node by node is generalised least squares with the dense covariance that they cause."""

from dataclasses import replace

import numpy as np
import pytest

from awescli.estimation.axes import Axes
from awescli.estimation.information_filter import eliminate
from awescli.estimation.links import Links

DT = 0.1
N_S, N_START, A, N_OUT, GLOBALS = 5, 3, 2, 4, 3
SPREAD = np.array([0.4])  # of the last state that is free at the start


def system(seed: int, nodes=(0, 2, 3, 6), last=8, begins=(0.0, 0.8, 2.0), drifts=(1, 3), acts=(0, 1, 0)):
    """(links, axes, path, begins): random links; two axes act on the first disturbance, others drift; the second segment begins where the
    first one ends, the third 0.4 s after the second."""
    random = np.random.default_rng(seed)
    K, L, W = len(begins), len(nodes), len(acts) + len(drifts)
    width = N_S + 2 * A
    J = random.standard_normal((K, last + 1, N_OUT, width + GLOBALS))
    J[:, : nodes[1] if L > 1 else last + 1, :, N_START:N_S] = 0.0  # own states of effects follow from the start
    ends = 0.5 * random.standard_normal((K, L - 1, N_S, width))
    weight = random.uniform(0.5, 2.0, (K, last + 1, N_OUT))
    weight[0, 3:5, 2] = 0.0
    r = random.standard_normal((K, last + 1, N_OUT)) * (weight > 0)
    offsets = 0.3 * random.standard_normal((K, len(SPREAD)))
    links = Links(J, ends, r, weight, np.array(nodes), tuple(drifts), offsets, SPREAD, N_START - len(SPREAD))
    axes = Axes(
        np.array([*acts, *(-1 for _ in drifts)], int), np.array([*(-1 for _ in acts), *range(len(drifts))], int),
        random.uniform(0.3, 2.0, W), random.uniform(0.2, 3.0, W),
    )  # fmt: skip
    path = 0.3 * random.standard_normal((K, L + 1, W))
    for k in range(K - 1):
        if abs(begins[k + 1] - begins[k] - last * DT) < 1e-9:
            path[k + 1, 0] = path[k, L]
    return links, axes, path, np.array(begins)


def written_out(links: Links, axes: Axes, begins):
    """(columns (K, N, n_out, unknowns) of all starts and of w at every distinct time, times of these)."""
    K, L, W = len(links), len(links.nodes), len(axes)
    times = np.unique(np.round(begins[:, None] + links.bounds * DT, 9))
    place = np.searchsorted(times, np.round(begins[:, None] + links.bounds * DT, 9))
    unknowns = K * N_START + len(times) * W
    acting, drifting, states = (np.zeros((K, m, rows, unknowns)) for m, rows in ((L + 1, A), (L + 1, len(links.drifts)), (L, N_S)))
    for k in range(K):
        for m in range(L + 1):
            for w in range(W):
                column = K * N_START + place[k, m] * W + w
                if axes.acts[w] >= 0:
                    acting[k, m, axes.acts[w], column] = 1.0
                else:
                    drifting[k, m, axes.drifts[w], column] = 1.0
        states[k, 0, :N_START, k * N_START : (k + 1) * N_START] = np.eye(N_START)
        for m in range(L - 1):
            order = links.order(m)
            E = links.ends[k, m][:, order]
            states[k, m + 1] = E @ np.concatenate([states[k, m], acting[k, m], acting[k, m + 1]])
    flat = links.changed(states, acting, drifting, np.zeros((GLOBALS, unknowns)))
    return flat, times


def dense(links, axes, path, begins, which):
    """H, b, cost, log det by normal equations of everything at once."""
    links, path, begins = links.pick(which), path[which], begins[which]
    columns, times = written_out(links, axes, begins)
    K, W = len(links), len(axes)
    A_own = columns.reshape(-1, columns.shape[-1])
    B = (links.J[..., N_S + 2 * A :] * links.weight[..., None]).reshape(-1, GLOBALS)
    r = links.r.ravel()
    P = np.zeros((A_own.shape[1],) * 2)
    log_prior = 0.0
    for w in range(W):
        C = axes.level[w] ** 2 * np.exp(-np.abs(times[:, None] - times) / axes.memory[w])
        at = K * N_START + np.arange(len(times)) * W + w
        P[np.ix_(at, at)] = np.linalg.inv(C)
        log_prior += np.linalg.slogdet(C)[1]
    present = np.zeros(A_own.shape[1])
    for k in range(K):
        last = k * N_START + N_START - 1
        P[last, last] = 1 / SPREAD[0] ** 2
        log_prior += 2 * np.log(SPREAD[0])
        present[last] = links.offsets[k, 0]
        for m, t in enumerate(np.round(begins[k] + links.bounds * DT, 9)):
            present[K * N_START + np.searchsorted(times, t) * W : K * N_START + (np.searchsorted(times, t) + 1) * W] = path[k, m]
    M = A_own.T @ A_own + P
    u = A_own.T @ r - P @ present
    cross = A_own.T @ B
    best = np.linalg.solve(M, np.column_stack([cross, u]))
    H = B.T @ B - cross.T @ best[:, :-1]
    b = B.T @ r - cross.T @ best[:, -1]
    cost = r @ r + present @ P @ present - u @ best[:, -1]
    return H, b, cost, np.linalg.slogdet(M)[1] + log_prior, best, M


@pytest.mark.parametrize(
    "how",
    [
        {}, {"nodes": (0,), "last": 5, "begins": (0.0, 0.5, 1.5)}, {"nodes": (0, 4), "last": 8},
        {"nodes": (0, 1, 2, 3), "last": 4, "begins": (0.0, 0.4, 0.8)}, {"drifts": ()}, {"acts": ()}, {"acts": (), "drifts": ()},
    ],
    ids=["unequal links", "one link", "two links", "links of one sample", "no drift", "drift alone", "no process"],
)  # fmt: skip
def test_elimination_is_dense_least_squares(how):
    links, axes, path, begins = system(1, **how)
    for which in (np.arange(3), np.array([0, 2]), np.array([1])):
        found = eliminate(links.gram(), axes, path, begins, DT, which)
        H, b, cost, log_det, best, _ = dense(links, axes, path, begins, which)
        assert found.H == pytest.approx(H, rel=1e-8, abs=1e-8) and found.b == pytest.approx(b, rel=1e-8, abs=1e-8)
        assert found.cost.sum() == pytest.approx(cost, rel=1e-9)
        assert found.log_det.sum() == pytest.approx(log_det, rel=1e-9, abs=1e-8)
        change = np.array([0.3, -0.2, 0.5])
        own = best[:, -1] - best[:, :-1] @ change
        back = found.nuisances(change)
        for i, k in enumerate(which):
            assert back.starts(N_START)[k, :, 0] == pytest.approx(own[i * N_START : (i + 1) * N_START], rel=1e-6, abs=1e-7)
        assert back.path[which[-1], -1, :, 0] == pytest.approx(own[len(own) - len(axes) :], rel=1e-6, abs=1e-7)


def test_drifts_alone_are_eliminated_where_nothing_acts_on_the_kite(monkeypatch):
    """Guards the columns of a link without any disturbance: those of drifts follow those of states there, and the state knows none."""
    monkeypatch.setitem(globals(), "A", 0)
    links, axes, path, begins = system(1, acts=())
    found, (H, b, *_) = eliminate(links.gram(), axes, path, begins, DT), dense(links, axes, path, begins, np.arange(3))
    assert found.H == pytest.approx(H, rel=1e-8, abs=1e-10) and found.b == pytest.approx(b, rel=1e-8, abs=1e-10)


def test_increments_are_those_of_flights_that_grow_to_the_front():
    """Guards the cost of a segment: what a flight costs with it, less what the segments behind it cost alone."""
    links, axes, path, begins = system(2)
    found = eliminate(links.gram(), axes, path, begins, DT)
    for k in range(3):
        *_, cost, log_det, _, _ = dense(links, axes, path, begins, np.arange(k, 3))
        assert found.cost[k:].sum() == pytest.approx(cost) and found.log_det[k:].sum() == pytest.approx(log_det)


def test_draws_have_the_covariance_of_what_is_not_known():
    """Guards `samples`: their covariance is the inverse of the dense normal matrix, to the chance of 4000 draws."""
    links, axes, path, begins = system(3)
    draws = eliminate(links.gram(), axes, path, begins, DT).samples(4000, seed=1)
    spread = np.linalg.inv(dense(links, axes, path, begins, np.arange(3))[-1])
    for k in range(3):
        own = draws.starts(N_START)[k]
        assert np.cov(own) == pytest.approx(spread[k * N_START : (k + 1) * N_START, k * N_START : (k + 1) * N_START], rel=0.12, abs=0.02)
    last = draws.path[2, -1]
    assert np.cov(last) == pytest.approx(spread[-len(axes) :, -len(axes) :], rel=0.12, abs=0.02)


def test_innovations_are_those_of_the_dense_posterior():
    """Guards what levels are estimated from: squares of the best steps and their variances, in units of the noise, written out."""
    links, axes, path, begins = system(6)
    found = eliminate(links.gram(), axes, path, begins, DT).innovations()
    *_, best, M = dense(links, axes, path, begins, np.arange(3))
    times = np.unique(np.round(begins[:, None] + links.bounds * DT, 9))
    W, spread = len(axes), np.linalg.inv(M)
    own = best[3 * N_START :, -1].reshape(len(times), W)
    for k in range(3):
        own[np.searchsorted(times, np.round(begins[k] + links.bounds * DT, 9))] += path[k] if k != 1 else 0.0
    own[np.searchsorted(times, np.round(begins[1] + links.bounds[1:] * DT, 9))] += path[1, 1:]
    for w in range(W):
        at = 3 * N_START + np.arange(len(times)) * W + w
        S, gaps = spread[np.ix_(at, at)], np.diff(times)
        F, Q = np.exp(-gaps / axes.memory[w]), axes.level[w] ** 2 * (1 - np.exp(-2 * gaps / axes.memory[w]))
        D = np.eye(len(times))[1:] - F[:, None] * np.eye(len(times))[:-1]
        e = D @ own[:, w]
        mean = (e**2 / Q).sum() + own[0, w] ** 2 / axes.level[w] ** 2
        variance = (np.diag(D @ S @ D.T) / Q).sum() + S[0, 0] / axes.level[w] ** 2
        assert found.mean[w] == pytest.approx(mean, rel=1e-7) and found.spread[w] == pytest.approx(variance, rel=1e-7)
        slope, before = gaps / axes.memory[w] * F, np.eye(len(times))[:-1]
        longer = (slope * (e * own[:-1, w] + np.diag(D @ S @ before.T)) / Q).sum()
        assert found.longer[w] == pytest.approx(longer, rel=1e-7, abs=1e-9)
        assert found.known[w] == pytest.approx((slope**2 * own[:-1, w] ** 2 / Q).sum(), rel=1e-7)
    assert found.steps == len(times)


def test_states_at_the_links_are_what_start_and_processes_make():
    links, axes, path, begins = system(4)
    found = eliminate(links.gram(), axes, path, begins, DT).nuisances()
    for m in range(len(links.nodes) - 1):
        acting = axes.summed(found.path, axes.acts, A)
        E = links.ends[:, m][..., links.order(m)]
        assert found.states[:, m + 1] == pytest.approx(
            np.matmul(E, np.concatenate([found.states[:, m], acting[:, m], acting[:, m + 1]], axis=1)), rel=1e-9, abs=1e-9
        )


def test_a_state_that_nothing_sees_is_harmless():
    links, axes, path, begins = system(5)
    J, ends = links.J.copy(), links.ends.copy()
    J[..., 1], ends[..., 1] = 0.0, 0.0
    found = eliminate(replace(links, J=J, ends=ends).gram(), axes, path, begins, DT)
    assert np.isfinite(found.H).all() and np.isfinite(found.cost).all() and np.isfinite(found.nuisances().path).all()
    assert np.linalg.eigvalsh(found.H)[0] > 0


def test_known_starts_are_a_very_firm_prior():
    """Guards `from_known_starts` over several links: what is left of starts that are known, and of all that depends on them, is nothing."""
    links, axes, path, begins = system(3)
    firm = system(3)[0].gram()
    firm.x[:, 0, np.arange(links.unknown), np.arange(links.unknown)] += 1e12
    expected = eliminate(firm, axes, path, begins, DT)
    found = eliminate(links.from_known_starts().gram(), axes, path, begins, DT)
    assert found.H == pytest.approx(expected.H, rel=1e-6, abs=1e-8) and found.b == pytest.approx(expected.b, rel=1e-6, abs=1e-8)
    assert found.cost == pytest.approx(expected.cost, rel=1e-6)
    back = found.nuisances(np.array([0.3, -0.2, 0.5])).starts(N_START)
    assert not back[:, : links.unknown].any() and back[:, links.unknown :].any()
