"""What parameters could do themselves: recognised where it is so, absent where it cannot be, and its penalty has the right gradient."""

from dataclasses import replace

import numpy as np
import pytest
from learning.small_flight import declaration, small_flight, small_kite

from awescli.learning.correction import CORRECTED, ROWS, Correction, evaluate
from awescli.learning.normalisation import instants, samples_of, untrained
from awescli.learning.orthogonality import EVERY, parametric
from awescli.notation.parameters import ParameterTable
from awescli.physics.kite import Kite

FREE = ("CD0", "CLa", "Cmq")


@pytest.fixture(scope="module")
def scene():
    """(kite with FREE parameters, flight, ranges, an untrained correction)"""
    log, ranges = small_flight(small_kite(), flights=3)
    plain = declaration()
    rows = (replace(p, free=p.name in FREE, std=0.1 * abs(p.value) or 1.0) for p in plain.table().rows)
    kite = Kite(plain.with_parameters(ParameterTable(rows)), (10.0,))
    return kite, log, ranges, untrained(log, kite, ranges, ("u", "w", "q", "alpha", "V_a"), (6,), 0)


def along(kite, log, values=None):
    """(N, 6) derivatives of the physics along a flight."""
    at, *_ = instants(log, kite, values)
    return np.stack([np.broadcast_to(np.asarray(at.derivative[r], dtype=float), (len(log),)) for r in ROWS], axis=1)


def test_span_holds_finite_changes_of_parameters_and_nothing_else(scene):
    kite, log, ranges, correction = scene
    span = parametric(log, kite, correction, ranges)
    use = np.flatnonzero(samples_of(ranges, log.valid))[::EVERY]
    inside = lambda c: ((span.basis.T @ c) ** 2).sum() / (c @ c)  # noqa: E731
    flat = lambda change: (change[use] / correction.scale).T.reshape(-1)  # noqa: E731
    # 20 % more drag and less pitch damping at once is what parameters can do; a steady yaw acceleration is not
    other = {"CD0": 1.2 * kite.parameters["CD0"].value, "Cmq": 0.7 * kite.parameters["Cmq"].value}
    assert inside(flat(along(kite, log, other) - along(kite, log))) == pytest.approx(1, abs=1e-6)
    yaw = np.zeros((len(log), 6))
    yaw[:, CORRECTED.index("r")] = 1.0
    assert inside(flat(yaw)) < 0.02
    assert span.basis.shape[1] == len(FREE) and np.allclose(span.basis.T @ span.basis, np.eye(len(FREE)), atol=1e-10)


def test_penalty_is_the_projected_power_and_its_gradient_is_exact(scene):
    kite, log, ranges, correction = scene
    span = parametric(log, kite, correction, ranges)
    assert span.share(correction) == 0.0
    weights = correction.weights + 0.3 * np.random.default_rng(0).normal(size=correction.weights.size)
    some: Correction = correction.with_weights(weights)
    values, _ = evaluate(list(span.signals.T), some)
    c = np.concatenate([v / s for v, s in zip(values, some.scale, strict=True)])
    cost, gradient = span.penalty(correction, weights)
    assert cost == pytest.approx(span.share(some) * (c @ c) / c.size, rel=1e-10) and 0 < span.share(some) < 1
    d, h = np.random.default_rng(1).normal(size=weights.size), 1e-5
    slope = (span.penalty(correction, weights + h * d)[0] - span.penalty(correction, weights - h * d)[0]) / (2 * h)
    assert slope == pytest.approx(gradient @ d, rel=1e-6)
