"""The gradient of the corrected rollout: against differences, against torch on the same physics source, and at null weights."""

from dataclasses import replace

import numpy as np
import pytest
from learning.small_flight import small_kite, small_segments

from awescli.learning.correction import ROWS, Correction, HybridKite, evaluate, initial_weights
from awescli.learning.network_inputs import inputs_of_instant, network_inputs
from awescli.notation.quantities import OUTPUTS
from awescli.simulation.hybrid import CorrectedSimulator
from awescli.simulation.rollout import Simulator

INPUTS = ("u", "w", "q", "sin_phi", "alpha", "beta", "V_a", "rudder", "stretch")
COMPARED = ("p_n", "p_e", "p_d", "v_n", "v_e", "v_d", "phi", "theta", "psi", "p", "q", "r")
LAG = {"actuator_lag:rudder.tau": 0.1, "actuator_lag:rudder.rate": 50.0}
PLACES = [OUTPUTS.index(name) for name in COMPARED]


def some_correction(seed=0, hidden=(5, 4), half=3.0):
    rng = np.random.default_rng(seed)
    n = len(INPUTS)
    weights = initial_weights((n, *hidden, 6), seed)
    weights += 0.2 * rng.normal(size=weights.size)
    deviation = np.array([10.0, 3.0, 0.3, 0.4, 0.1, 0.2, 10.0, 0.05, 0.5])
    mean = np.array([25.0, 3.0, 0.0, -0.3, 0.1, 0.0, 28.0, 0.0, 0.0])
    return Correction(INPUTS, hidden, weights, mean, deviation, np.zeros(n), half * np.ones(n), np.array([1, 1, 1, 0.3, 0.3, 0.3]))


def follow(x, u, c):
    """A law of the state: rudder against roll rate and roll."""
    return [0.0 * x[0], 0.0 * x[0], -0.05 * x[9] + 0.02 * x[6], 0.0 * x[0]]


@pytest.mark.parametrize(
    ("effects", "values", "law", "half", "every"),
    [
        (("gravity", "aerodynamics", "tether"), {}, None, 5.0, 1),
        (("gravity", "aerodynamics", "tether"), {}, None, 1.6, 1),  # partly outside the box: the fade has a gradient of its own
        (("gravity", "aerodynamics", "actuator_lag:rudder", "tether"), LAG, follow, 5.0, 1),
        (("gravity", "aerodynamics", "tether"), {}, None, 5.0, 3),  # several steps to a sample, with set-points of their own
        (("gravity", "aerodynamics", "actuator_lag:rudder", "tether"), LAG, follow, 5.0, 3),
    ],
    ids=["plain", "fading", "lag and law", "slow log", "slow log, lag and law"],
)
def test_gradient_is_that_of_the_discretised_rollout(effects, values, law, half, every):
    kite, c = small_kite(effects, **values), some_correction(half=half)
    segments = small_segments(kite, 5, 30)
    kept = slice(None, None, every)
    segments = replace(segments, setpoints=segments.setpoints[:, kept], inputs=segments.inputs[:, kept], dt=every * segments.dt)
    simulator = CorrectedSimulator(kite, network_inputs(kite, INPUTS), c.sizes, ROWS, COMPARED, law, step=0.01)
    target = simulator.rollout(simulator.prepare(segments), 0 * c.weights, c.constants).outputs
    size = target.std((0, 1)) + 1e-2

    def cost(weights, starts):
        run = simulator.rollout(simulator.prepare(segments.starting_at(starts)), weights, c.constants)
        error = (run.outputs - target) / size
        return float((error**2).sum()), run, 2 * error / size

    value, run, bar = cost(c.weights, segments.starts)
    assert value > 1e-2, "a correction that has faded everywhere has no gradient to test"
    g_weights, g_starts = simulator.gradient(run, bar)
    rng = np.random.default_rng(1)
    for _ in range(3):
        dw, dx, h = rng.normal(size=c.weights.size), rng.normal(size=segments.starts.shape), 1e-5
        up, down = (cost(c.weights + s * h * dw, segments.starts + s * h * dx)[0] for s in (1, -1))
        # central differences at h = 1e-5: truncation and rounding both about 1e-9 relative
        assert (up - down) / (2 * h) == pytest.approx(g_weights @ dw + (g_starts * dx).sum(), rel=3e-7)


SOLVERS = {
    # the same steps: rounding; other methods with steps of 20 ms, or of their own: the error that goes with their order
    "rk4_classical": ({}, 1e-11), "rk4": ({}, 2e-3), "heun3": ({}, 1e-2), "midpoint": ({}, 5e-2), "heun2": ({}, 5e-2), "euler": ({}, 0.5),
    **dict.fromkeys(("dopri5", "dopri8"), ({}, 2e-3)),
    # low orders would take thousands of steps for as much
    **dict.fromkeys(("bosh3", "adaptive_heun", "fehlberg2"), ({"rtol": 1e-4, "atol": 1e-4}, 1e-2)),
}  # fmt: skip


@pytest.fixture(scope="module")
def small_rollout(request):
    """(kite, correction, segments, outputs and gradient of the fast path); request.param: steps of 20 ms between two samples"""
    kite, c = small_kite(), some_correction()
    segments = small_segments(kite, 3, 6)
    segments = replace(segments, dt=request.param * segments.dt)
    simulator = CorrectedSimulator(kite, network_inputs(kite, INPUTS), c.sizes, ROWS, COMPARED)
    run = simulator.rollout(simulator.prepare(segments), c.weights, c.constants)
    outputs = run.outputs
    return kite, c, segments, outputs, simulator.gradient(run, 2 * outputs)[0]


@pytest.mark.parametrize(("solver", "small_rollout"), [*((s, 1) for s in SOLVERS), ("rk4_classical", 3)], indirect=["small_rollout"])
def test_gradient_agrees_with_autograd_through_torchdiffeq(solver, small_rollout):
    torch = pytest.importorskip("torch")
    from awescli.simulation.hybrid_torch import TorchHybrid

    kite, c, segments, outputs, gradient = small_rollout
    options, tolerance = SOLVERS[solver]
    weights = torch.tensor(c.weights, requires_grad=True)
    slow = TorchHybrid(kite, inputs_of_instant(INPUTS), c.sizes, ROWS, COMPARED, solver=solver, options=options)
    y = slow.rollout(segments, weights, c.constants)
    (y**2).sum().backward()
    assert np.abs(y.detach().numpy() - outputs).max() < 100 * tolerance
    assert np.abs(weights.grad.numpy() - gradient).max() < tolerance * np.abs(gradient).max()


def test_every_solver_can_be_chosen_and_is_checked():
    pytest.importorskip("torch")
    from awescli.simulation.hybrid_torch import solver_names
    from awescli.stages.train_hybrid import TORCHDIFFEQ

    assert set(SOLVERS) == set(solver_names()) == {*TORCHDIFFEQ, "rk4"}


def test_null_network_is_physics_to_the_last_bit():
    kite, c = small_kite(), some_correction()
    null = c.with_weights(initial_weights(c.sizes, 0))
    assert null.is_zero and not c.is_zero
    segments = small_segments(kite, 9, 40)
    physics = Simulator(kite, ()).rollout(segments)
    fast = CorrectedSimulator(kite, network_inputs(kite, INPUTS), c.sizes, ROWS, COMPARED)
    assert np.array_equal(fast.rollout(fast.prepare(segments), null.weights, null.constants).outputs, physics.outputs[:, :, PLACES])
    assert np.array_equal(Simulator(HybridKite(kite, null), ()).rollout(segments).outputs, physics.outputs)


def test_hybrid_kite_flies_as_the_fast_path_and_shows_in_the_accelerometer():
    kite, c = small_kite(), some_correction()
    segments = small_segments(kite, 3, 40)
    fast = CorrectedSimulator(kite, network_inputs(kite, INPUTS), c.sizes, ROWS, COMPARED)
    hybrid = HybridKite(kite, c)
    flown = Simulator(hybrid, ()).rollout(segments)
    assert np.allclose(fast.rollout(fast.prepare(segments), c.weights, c.constants).outputs, flown.outputs[:, :, PLACES], rtol=0, atol=1e-9)
    x, u, p = list(flown.states[0, 20]), list(segments.inputs[0, 20]), list(kite.parameters.vector())
    a_x = OUTPUTS.index("a_x")
    extra = hybrid.outputs(x, u, list(hybrid.parameters.vector()))[a_x] - kite.outputs(x, u, p)[a_x]
    inputs = network_inputs(kite, INPUTS)(x, u, p)
    assert extra == pytest.approx(evaluate(inputs, c)[0][0], rel=1e-9) and abs(extra) > 1e-3


def test_diverged_segments_stop_and_the_gradient_stays_finite():
    kite, c = small_kite(), some_correction()
    segments = small_segments(kite, 4, 60)
    segments.starts[1, 3:6] = 4e3  # a speed at which the step is far too long
    fast = CorrectedSimulator(kite, network_inputs(kite, INPUTS), c.sizes, ROWS, COMPARED)
    run = fast.rollout(fast.prepare(segments), c.weights, c.constants)
    assert run.alive[1] < 61 and (np.delete(run.alive, 1) == 61).all()
    reached = np.arange(61)[None] < run.alive[:, None]
    gradient, at_starts = fast.gradient(run, np.where(reached[..., None], 1.0, 0.0) * np.ones_like(run.outputs))
    assert np.isfinite(gradient).all() and np.isfinite(at_starts).all()
