"""What a segment says about its start and its wind, put together from links, is what it says at every sample."""

from dataclasses import replace

import numpy as np
import pytest
from kites import DEVELOPMENT, gust_windows, lively, truly

from awescli.estimation.chain import Chain
from awescli.estimation.nuisance_wind import Gusts, RecordError
from awescli.estimation.simulation_error import SimulationError
from awescli.notation.quantities import STATES
from awescli.physics.kite import Kite
from awescli.simulation.rollout import Columns, Simulator

WINDS = {
    "none": RecordError(0.0),
    "constant": RecordError(0.8),
    "few nodes": RecordError(0.8, 0.5),
    "links of two and three samples": Gusts(0.8, 0.05),
    "with roll": Gusts(0.8, 0.07, roll=1.0),
}


@pytest.fixture(scope="module")
def simulator(calm):
    """Of a kite whose surfaces lag: what a link knows of the one before it is more than twelve states."""
    kite = Kite(DEVELOPMENT, calm.log.wind.height, ("actuator_lag:rudder", "unsteady_lift"))
    return Simulator(kite.with_values({"actuator_lag:rudder.tau": 0.1, "unsteady_lift.tau": 0.05}))


def problem(simulator, calm, gusts):
    """Nine segments of 1.3 s, of which one lacks some samples, at a wind that is not zero."""
    observed = truly(lively(simulator.kite, calm.log, count=9, seconds=1.3), simulator, noise_seed=1)
    sigma = observed.sigma.copy()
    sigma[2, 20:33] = np.inf
    found = SimulationError(simulator, observed.with_sigma(sigma), ("CLa", "Cndr"), gusts)
    found.own[:, 12:] = np.random.default_rng(2).normal(0, 0.05, found.own[:, 12:].shape)
    return found


def at_every_sample(problem, simulator, gusts):
    """Whitened sensitivities to [own, globals] with a column for every node at every sample."""
    segments = problem.observed.segments
    columns = Columns(STATES, problem.names, gust_windows(gusts, segments.steps, segments.dt))
    _, J = simulator.sensitivities(problem.segments(problem.own), columns, problem.observed.outputs)
    order = np.r_[:12, 14 : J.shape[-1], 12:14]
    return J[..., order] * np.where(np.isfinite(problem.observed.sigma), 1 / problem.observed.sigma, 0.0)[..., None]


@pytest.mark.parametrize("wind", WINDS)
def test_links_say_what_columns_for_every_node_say(simulator, calm, wind):
    """Guards Gram matrices and gradients from links against sums over all samples of columns that were carried all the way: links of
    equal and unequal lengths, no wind, one node, roll gusts, states of effects, samples that do not count."""
    at = problem(simulator, calm, WINDS[wind])
    chain = at.chain(simulator.kite.parameters.vector(at.names))
    dense = at_every_sample(at, simulator, WINDS[wind])
    A = np.concatenate([dense, chain.r[..., None]], axis=-1).reshape(len(chain), -1, chain.n_own + 3)
    whole, n = np.matmul(A.swapaxes(1, 2), A), chain.n_own
    scale = np.sqrt(np.einsum("kii->ki", whole))
    of_own, cross, of_globals = (a.copy() for a in chain.gram())
    for found, expected in ((of_own, whole[:, :n, :n]), (cross, whole[:, :n, n:]), (of_globals, whole[:, n:, n:])):
        rows, cols = (scale[:, :n] if a == n else scale[:, n:] for a in found.shape[1:])
        assert np.abs((found - expected) / rows[:, :, None] / cols[:, None]).max() < 1e-10
    assert np.abs((chain.gradient() - whole[:, :-1, -1]) / scale[:, :-1] / scale[:, -1:]).max() < 1e-10
    assert np.abs(chain.own() - dense[..., :n]).max() < 1e-10 * np.abs(dense).max()
    assert np.abs(chain.globals() - dense[..., n:]).max() < 1e-12 * np.abs(dense).max()


@pytest.mark.parametrize("last", [1, 2])
def test_any_linear_system_in_links(last):
    """Guards the recursions without a kite: random links against the same system written out, with a last link shorter and longer."""
    random = np.random.default_rng(last)
    K, n_s, n_start, axes, n, n_out = 3, 5, 2, 2, 2, 3
    nodes = np.array([0, 2, 3, 6])
    N = 6 + last + (last == 2) * 3
    chain = Chain(
        random.standard_normal((K, N, n_out, n_s + 2 * axes + n)), random.standard_normal((K, 3, n_s, n_s + 2 * axes)),
        random.standard_normal((K, N, n_out)), random.uniform(0.5, 2.0, (K, N, n_out)), nodes, n_start + 5 * axes, n_start,
    )  # fmt: skip
    own = np.zeros((K, N, n_out, chain.n_own))
    state = np.zeros((K, n_s, chain.n_own))
    state[:, :n_start, :n_start] = np.eye(n_start)
    for m, (first, until) in enumerate(zip(nodes, [2, 3, 6, N], strict=True)):
        # even nodes have the first columns of the wind, odd ones the second
        wind = np.zeros((2 * axes, chain.n_own))
        for node in (m, m + 1):
            place = n_start + node * axes
            wind[node % 2 * axes : (node % 2 + 1) * axes, place : place + axes] = np.eye(axes)
        three = np.concatenate([state, np.broadcast_to(wind, (K, *wind.shape))], axis=1)
        own[:, first:until] = np.matmul(chain.J[:, first:until, :, : n_s + 2 * axes], three[:, None])
        if m < 3:
            state = np.matmul(chain.ends[:, m], three)
    own *= chain.weight[..., None]
    assert chain.own() == pytest.approx(own)
    flat, globals_ = own.reshape(K, -1, chain.n_own), chain.globals().reshape(K, -1, n)
    of_own, cross, _ = chain.gram()
    assert of_own == pytest.approx(np.matmul(flat.swapaxes(1, 2), flat))
    assert cross[..., :n] == pytest.approx(np.matmul(flat.swapaxes(1, 2), globals_))
    pull = np.matmul(flat.swapaxes(1, 2), chain.r.reshape(K, -1, 1))[..., 0]
    assert cross[..., n] == pytest.approx(pull) and chain.gradient()[:, : chain.n_own] == pytest.approx(pull)
    one = replace(chain, J=chain.J[1:2], ends=chain.ends[1:2], r=chain.r[1:2], weight=chain.weight[1:2])
    assert chain.pick([1]).gradient() == pytest.approx(one.gradient(), rel=1e-14)


def test_a_segment_that_diverges_says_what_it_saw(simulator, calm):
    """Guards numbers: links behind the end of a rollout carry nothing back, and its neighbours do not notice."""
    at = problem(simulator, calm, WINDS["links of two and three samples"])
    x = simulator.kite.parameters.vector(at.names)
    before = at.chain(x)
    at.own[5, 3:6] = (400.0, -300.0, 900.0)
    after = at.chain(x)
    lost = after.weight[5, :, 0] == 0
    assert lost.any() and not lost[0]
    others = [k for k in range(9) if k != 5]
    for a, b in zip(before.gram(), after.gram(), strict=True):
        assert np.isfinite(b).all() and np.array_equal(a[others], b[others])
    of_nodes = np.diag(after.gram()[0][5])[12:].reshape(-1, 3)
    rises_behind = np.append(False, after.nodes >= np.flatnonzero(lost)[0])
    assert rises_behind.any() and (of_nodes[rises_behind] == 0).all() and (of_nodes[0] > 0).all()
