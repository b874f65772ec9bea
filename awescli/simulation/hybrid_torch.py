"""The slow path of the corrected kite, oracle of the fast one: the same physics source on torch tensors, torchdiffeq, autograd."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import torch
from torchdiffeq import odeint
from torchdiffeq._impl.fixed_grid import RK4
from torchdiffeq._impl.misc import Perturb
from torchdiffeq._impl.odeint import SOLVERS
from torchdiffeq._impl.rk_common import rk4_step_func

from awescli.engine.dense import FARTHEST, layer_slices
from awescli.engine.machine import LANES
from awescli.notation.errors import BadInput, did_you_mean
from awescli.notation.quantities import OUTPUTS, STATES
from awescli.physics.kite import Kite
from awescli.simulation.kernels import LIMIT
from awescli.simulation.rollout import Segments
from awescli.simulation.stepping import Stepping, longest_step


class ClassicalRK4(RK4):
    """The classical tableau in torchdiffeq's own stepping (its `rk4` is the 3/8 rule): steps as `kernels.rollout` does."""

    def _step_func(
        self, func: Callable, t0: torch.Tensor, dt: torch.Tensor, t1: torch.Tensor, y0: torch.Tensor
    ) -> tuple[torch.Tensor, torch.Tensor]:
        f0 = func(t0, y0, perturb=Perturb.NEXT if self.perturb else Perturb.NONE)
        return rk4_step_func(func, t0, dt, t1, y0, f0=f0, perturb=self.perturb), f0


OURS = "rk4_classical"
FIXED = (OURS, "euler", "midpoint", "heun2", "heun3", "rk4")


ADAPTIVE = ("dopri8", "dopri5", "bosh3", "fehlberg2", "adaptive_heun")
TOLERANCE = {"rtol": 1e-5, "atol": 1e-6}
"""What adaptive solvers are asked for: the error of RK4 at 20 ms. torchdiffeq's own 1e-7 costs minutes and gigabytes for the low orders."""


def solver_names() -> tuple[str, ...]:
    """Names that the slow path knows: torchdiffeq's one-step methods. Its Adams methods want a past, and set-points that are held from
    sample to sample leave none; scipy's have no gradient."""
    return (*FIXED, *ADAPTIVE)


def network(inputs: torch.Tensor, sizes: Sequence[int], constants: np.ndarray, weights: torch.Tensor) -> torch.Tensor:
    """`engine.dense` on tensors: inputs (..., n) -> corrections (..., m)."""
    n, m = sizes[0], sizes[-1]
    c = torch.as_tensor(constants, dtype=inputs.dtype)
    mean, inverse, middle, inverse_half = (c[i * n : (i + 1) * n] for i in range(4))
    z = (inputs - mean) * inverse
    e = torch.clamp((z - middle).abs() * inverse_half - 1, min=0) * c[-1]
    fade = torch.exp(-torch.clamp((e * e).sum(-1, keepdim=True), max=FARTHEST))
    layer, places = z, layer_slices(sizes)
    for number, (W, b) in enumerate(places):
        layer = layer @ weights[W].reshape(sizes[number + 1], -1).T + weights[b]
        if number < len(places) - 1:
            layer = torch.tanh(layer)
    return c[4 * n : 4 * n + m] * fade * layer


class TorchHybrid:
    """Rollouts of physics + network as a differentiable torch function of the weights. Arguments as `hybrid.CorrectedSimulator`,
    but inputs_of_instant maps an `Instant` to the network's inputs: here each term is computed as it is written.

    solver: a name in `solver_names()`; options: tolerances and the like for torchdiffeq.odeint. Set-points are held over a step, so
    adaptive solvers are restarted at each.
    """

    def __init__(
        self, kite: Kite, inputs_of_instant: Callable, sizes: Sequence[int], rows: Sequence[int], outputs: Sequence[str], *,
        solver: str = OURS, options: dict | None = None,
    ):  # fmt: skip
        SOLVERS.setdefault(OURS, ClassicalRK4)
        if solver not in solver_names():
            raise BadInput(f"unknown solver '{solver}'", do=did_you_mean(solver, solver_names()))
        self.kite, self.inputs, self.sizes, self.rows = kite, inputs_of_instant, tuple(sizes), list(rows)
        self.outputs = tuple(outputs)
        self.solver, self.options = solver, options or ({} if solver in FIXED else TOLERANCE)
        self.n_s, self._longest = len(kite.state_names), None

    def _stepping(self, segments: Segments) -> Stepping:
        """As that of the first segments that were simulated."""
        if self._longest is None:
            self._longest = longest_step(self.kite, segments.starts[:, :12], segments.setpoints[:, 0], segments.inputs[:, 0])
        return Stepping.between(segments.dt, self._longest, self.kite.declaration.set_point_rate)

    def rollout(self, segments: Segments, weights: torch.Tensor, constants: np.ndarray) -> torch.Tensor:
        """(K, N+1, n_out) outputs, from recorded set-points."""
        kite, N = self.kite, segments.steps
        stepping = self._stepping(segments)
        n, step = stepping.substeps, segments.dt / stepping.substeps
        U, SP = torch.as_tensor(segments.inputs), torch.as_tensor(segments.setpoints)
        c: list[float | torch.Tensor] = [float(v) for v in kite.parameters.vector()]
        for name, value in segments.values.items():
            c[kite.parameter_names.index(name)] = torch.as_tensor(value)

        def columns(x, k, share=0.0):
            held = SP[:, k] + share * (SP[:, k + 1] - SP[:, k]) if share else SP[:, k]
            return [*x.unbind(-1), *held.unbind(-1)]

        def right_hand_side(t, x):
            # t counts steps: whole numbers are exact, so that `floor` tells before from after
            done = min(max(int(np.floor(float(t.detach()))), 0), N * n - 1)
            k, i = divmod(done, n)
            share = (t - k * n) / n
            u = list((U[:, k] + share * (U[:, k + 1] - U[:, k])).unbind(-1))
            at = kite.instant(columns(x, k, stepping.first + i * stepping.onward), u, c)
            rates = [*at.derivative, *(rate for e in kite.effects for rate in e.rates(at, e.own(at)))]
            derivative = torch.stack(torch.broadcast_tensors(*(torch.as_tensor(d) for d in rates)), -1)
            seen = [torch.as_tensor(s, dtype=x.dtype).expand(x.shape[0]) for s in self.inputs(at)]
            correction = network(torch.stack(seen, -1), self.sizes, constants, weights)
            full = torch.zeros_like(derivative)
            full[:, self.rows] = correction
            return step * (derivative + full)

        x, offsets = torch.as_tensor(segments.starts_for(self.n_s)).split([12, self.n_s - 12], dim=1)
        if self.n_s > 12:
            own = [torch.zeros(len(segments), dtype=x.dtype)] * (self.n_s - 12)
            started = kite.initial([*x.unbind(-1), *own, *SP[:, 0].unbind(-1)], list(U[:, 0].unbind(-1)), c)
            started = torch.stack([torch.as_tensor(s, dtype=x.dtype).expand(len(segments)) for s in started], -1)
            x = torch.cat([x, started + offsets], -1)
        times = torch.arange(N * n + 1, dtype=x.dtype)
        if self.solver in FIXED:
            # perturb: the last stage of a step is evaluated just before its end, where the old set-point still holds
            whole = torch.as_tensor(odeint(right_hand_side, x, times, method=self.solver, options={"perturb": True, **self.options}))
            states = whole[::n]
        else:
            found = [x]
            for k in range(N * n):
                inside = torch.stack([times[k], times[k + 1] * (1 - 1e-12)])
                found.append(torch.as_tensor(odeint(right_hand_side, found[-1], inside, method=self.solver, **self.options))[-1])
            states = torch.stack(found[::n])
        reported = []
        for k in range(N + 1):
            y = dict(zip(OUTPUTS, kite.outputs(columns(states[k], k), list(U[:, k].unbind(-1)), c), strict=True))
            y |= {name: states[k][:, i] for i, name in enumerate(STATES) if name not in y}
            reported.append(torch.stack([torch.as_tensor(y[n], dtype=x.dtype).expand(len(segments)) for n in self.outputs], -1))
        return torch.stack(reported, 1)


@dataclass(frozen=True)
class SlowPrepared:
    """Segments, in groups of LANES as `hybrid.Prepared` has them."""

    segments: Segments

    @property
    def count(self) -> np.ndarray:
        K = len(self.segments)
        return np.minimum(LANES, K - LANES * np.arange(-(-K // LANES)))

    def groups(self, which: Sequence[int]) -> "SlowPrepared":
        rows = np.concatenate([np.arange(g * LANES, min((g + 1) * LANES, len(self.segments))) for g in which])
        return SlowPrepared(self.segments.pick(rows))


@dataclass(frozen=True)
class SlowRun:
    """outputs (K, N+1, n_out), alive (K,); tensor, weights: the same with their history, for autograd."""

    outputs: np.ndarray
    alive: np.ndarray
    tensor: torch.Tensor
    weights: torch.Tensor


class SlowSimulator:
    """`TorchHybrid` behind the door of `hybrid.CorrectedSimulator`: what training with another solver uses."""

    def __init__(
        self, kite: Kite, inputs_of_instant: Callable, sizes: Sequence[int], rows: Sequence[int], outputs: Sequence[str],
        law: Callable | None = None, *, solver: str,
    ):  # fmt: skip
        if law is not None:
            raise BadInput(f"solver '{solver}' replays recorded set-points only", do="Use solver: rk4, or surfaces: recorded.")
        self.path = TorchHybrid(kite, inputs_of_instant, sizes, rows, outputs, solver=solver)

    def prepare(self, segments: Segments) -> SlowPrepared:
        return SlowPrepared(segments)

    def rollout(self, prepared: SlowPrepared, weights: np.ndarray, constants: np.ndarray) -> SlowRun:
        w = torch.tensor(weights, requires_grad=True)
        y = self.path.rollout(prepared.segments, w, constants)
        outputs = y.detach().numpy()
        good = np.asarray((np.isfinite(outputs) & (np.abs(outputs) < LIMIT)).all(axis=2))
        alive = np.where(good.all(1), outputs.shape[1], np.argmin(good, axis=1))
        return SlowRun(np.where(good[..., None], outputs, 0.0), alive, y, w)

    def gradient(self, run: SlowRun, outputs_bar: np.ndarray) -> tuple[np.ndarray, None]:
        (bar,) = torch.autograd.grad(run.tensor, run.weights, torch.as_tensor(outputs_bar))
        return bar.numpy(), None
