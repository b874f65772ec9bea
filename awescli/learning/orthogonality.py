"""How much of a correction the free physical parameters could do themselves, and a penalty that keeps the network from doing it.

Along the training flight, the derivatives of (u, v, w, p, q, r) change with the free parameters by the columns of a matrix P. The part of
the network's correction c that lies in the span of P says nothing that other parameter values would not say. With Q an orthonormal basis
of that span, the penalty is weight * |Q' c|^2 / (number of samples and channels), c in units of the network's output scale.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from awescli.flightlog.log import FlightLog
from awescli.flightlog.split import Range
from awescli.learning.correction import ROWS, Correction, evaluate
from awescli.learning.normalisation import input_signals, instants, samples_of
from awescli.physics.kite import Kite

STEP = 1e-3
"""Central differences take this share of a parameter's prior standard deviation: derivatives are nearly linear in every parameter."""
NEGLIGIBLE = 1e-6
"""Directions of the span that are this much weaker than the strongest are no directions."""
EVERY = 5
"""Every so many samples of the flight are looked at: neighbours at 50 Hz say the same."""


@dataclass(frozen=True)
class Parametric:
    """The span of what the free parameters do along a flight. signals: (N, n_in) network inputs; basis: (6 N, k) orthonormal columns, of
    corrections in units of their scale, channel after channel."""

    signals: np.ndarray
    basis: np.ndarray

    def share(self, correction: Correction) -> float:
        """Share (0 to 1) of the correction's power along the flight that the parameters could take over; 0 for a null correction."""
        values, _ = evaluate(list(self.signals.T), correction)
        c = np.concatenate([np.broadcast_to(v, len(self.signals)) / s for v, s in zip(values, correction.scale, strict=True)])
        return float(((self.basis.T @ c) ** 2).sum() / max((c**2).sum(), 1e-300))

    def penalty(self, correction: Correction, weights: np.ndarray) -> tuple[float, np.ndarray]:
        """(|Q' c|^2 / size of c, its gradient (n,)) of the network with these weights."""
        import torch

        from awescli.simulation.hybrid_torch import network

        w = torch.tensor(weights, requires_grad=True)
        values = network(torch.as_tensor(self.signals), correction.sizes, correction.constants, w) / torch.as_tensor(correction.scale)
        inside = torch.as_tensor(self.basis.T) @ values.T.reshape(-1)
        cost = (inside @ inside) / len(self.basis)
        (gradient,) = torch.autograd.grad(cost, w)
        return float(cost.detach()), gradient.numpy()


def parametric(log: FlightLog, kite: Kite, correction: Correction, ranges: Sequence[Range]) -> Parametric:
    """What the kite's free parameters can do on the samples of the ranges."""
    use = np.flatnonzero(samples_of(ranges, log.valid))[::EVERY]

    def derivatives(values):
        at, *_ = instants(log, kite, values)
        full = [np.broadcast_to(np.asarray(at.derivative[r], dtype=float), (len(log),))[use] for r in ROWS]
        return np.concatenate([f / s for f, s in zip(full, correction.scale, strict=True)])

    columns = []
    for name in kite.parameters.free:
        p = kite.parameters[name]
        step = STEP * p.prior_std
        change = (derivatives({name: p.value + step}) - derivatives({name: p.value - step})) / (2 * STEP)
        if np.isfinite(change).all() and change.any():
            columns.append(change / np.linalg.norm(change))
    if not columns:
        return Parametric(input_signals(log, kite, correction.inputs)[use], np.zeros((len(ROWS) * len(use), 0)))
    U, size, _ = np.linalg.svd(np.stack(columns, axis=1), full_matrices=False)
    return Parametric(input_signals(log, kite, correction.inputs)[use], U[:, size > NEGLIGIBLE * size[0]])
