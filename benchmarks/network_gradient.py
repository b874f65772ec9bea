"""Gradient of a trajectory cost with respect to the weights of a network in a kite's dynamics: awes beside torchdiffeq, and jax if there.

    python benchmarks/network_gradient.py [--rounds 3] [--threads 1]

One process, the same kite, segments and network; runs are interleaved and medians compared. Classical RK4 at 20 ms and float64, but for the
thesis' own training step: 120 segments of 400 samples, 45 ms, an 8-8 network, torchdiffeq's rk4 in float32, against ours in float64. The
flights are synthetic and made here. The table goes to benchmarks/results/network_gradient.md. jax is no dependency: where it cannot be
imported the table says so (pip install jax, somewhere on PYTHONPATH).
"""

import argparse
import importlib.util
import os
import platform
import resource
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import torch

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE.parent / "tests"))
from learning.small_flight import small_kite, small_segments  # noqa: E402

from awescli.artifacts import write_text  # noqa: E402
from awescli.engine.dense import layer_slices  # noqa: E402
from awescli.engine.record import record  # noqa: E402
from awescli.learning.correction import ROWS, Correction, initial_weights  # noqa: E402
from awescli.learning.network_inputs import inputs_of_instant, network_inputs  # noqa: E402
from awescli.learning.problem import COMPARED  # noqa: E402
from awescli.notation.quantities import OUTPUTS, STATES  # noqa: E402
from awescli.simulation.hybrid import CorrectedSimulator  # noqa: E402
from awescli.simulation.hybrid_torch import TorchHybrid  # noqa: E402
from awescli.simulation.rollout import Segments  # noqa: E402

INPUTS = (
    "u", "v", "w", "p", "q", "r", "sin_phi", "cos_phi", "sin_theta", "cos_theta", "alpha", "beta", "V_a", "rudder", "stretch",
    "tension",
)  # fmt: skip
ASKED = {"36 x 250": 25.0, "256 x 50": 5.0}
"""Least times faster than torchdiffeq rk4 + backward (the aim at 36 x 250 is 50)."""


def correction(inputs: tuple[str, ...], hidden: tuple[int, ...], size: float = 0.3) -> Correction:
    """A network with random weights, so that nothing is null; size: of what it adds [m/s2]."""
    rng = np.random.default_rng(0)
    weights = initial_weights((len(inputs), *hidden, 6), 0)
    weights += 0.1 * rng.normal(size=weights.size)
    scale = {"V_a": 30.0, "u": 30.0, "tension": 3000.0}
    deviation = np.array([scale.get(name, 3.0) for name in inputs])
    zero, one = np.zeros(len(inputs)), np.ones(len(inputs))
    return Correction(inputs, hidden, weights, zero, deviation, zero, 5 * one, size * np.array([1, 1, 1, 1 / 3, 1 / 3, 1 / 3]))


@dataclass
class Setting:
    """A problem, with what all peers share. target, unit: of the cost, mean(((y - target) / unit)^2) over all outputs."""

    name: str
    kite: object
    segments: Segments
    correction: Correction

    def __post_init__(self):
        c = self.correction
        self.ours = CorrectedSimulator(self.kite, network_inputs(self.kite, c.inputs), c.sizes, ROWS, COMPARED)
        self.prepared = self.ours.prepare(self.segments)
        run = self.ours.rollout(self.prepared, 0 * c.weights, c.constants)
        assert (run.alive > self.segments.steps).all(), "a segment diverged: its peers would compute with what is no number"
        self.target = run.outputs
        self.unit = self.target.std((0, 1)) + 1e-3

    def fast(self) -> np.ndarray:
        c = self.correction
        run = self.ours.rollout(self.prepared, c.weights, c.constants)
        error = (run.outputs - self.target) / self.unit
        return self.ours.gradient(run, 2 * error / self.unit / error.size)[0]

    def torch(self, solver: str, dtype=torch.float64) -> Callable[[], np.ndarray]:
        c, s, kind = self.correction, self.segments, {torch.float32: np.float32, torch.float64: np.float64}[dtype]
        segments = replace(s, starts=s.starts.astype(kind), setpoints=s.setpoints.astype(kind), inputs=s.inputs.astype(kind))
        slow = TorchHybrid(self.kite, inputs_of_instant(c.inputs), c.sizes, ROWS, COMPARED, solver=solver)
        target, unit = (torch.as_tensor(a, dtype=dtype) for a in (self.target, self.unit))

        def gradient():
            w = torch.tensor(c.weights, requires_grad=True, dtype=dtype)
            (((slow.rollout(segments, w, c.constants) - target) / unit) ** 2).mean().backward()
            return w.grad.numpy()

        return gradient

    def jax(self) -> Callable[[], np.ndarray]:
        """jit(grad(scan)) with a checkpointed step: the fastest form of it that we know."""
        import jax
        import jax.numpy as jnp

        jax.config.update("jax_enable_x64", True)
        kite, c, s = self.kite, self.correction, self.segments
        sizes = {"x": len(kite.x_names), "u": len(kite.input_names), "c": len(kite.parameter_names)}
        parameters = [float(v) for v in kite.parameters.vector()]
        inputs = network_inputs(kite, c.inputs)
        rates = record(lambda x, u, c: [*kite.derivative(x, u, c), *inputs(x, u, c)], **sizes)
        reported = record(lambda x, u, c: _compared(kite, x, u, c), **sizes)
        operations = {
            "add": jnp.add, "sub": jnp.subtract, "mul": jnp.multiply, "div": jnp.divide, "neg": jnp.negative, "sqrt": jnp.sqrt,
            "sin": jnp.sin, "cos": jnp.cos, "exp": jnp.exp, "log": jnp.log, "atan2": jnp.arctan2, "round": jnp.round,
            "select": lambda p, a, b: jnp.where(p > 0, a, b),
        }  # fmt: skip

        def replayed(tape, outputs, x, u):
            blocks, done = {"x": x, "u": u, "c": parameters}, []
            for op, *arguments in tape.nodes:
                if op in ("const", "input"):
                    done.append(arguments[0] if op == "const" else blocks[arguments[0]][arguments[1]])
                else:
                    done.append(operations[op](*(done[a] for a in arguments)))
            return jnp.stack([jnp.broadcast_to(done[i], x[0].shape) for i in outputs])

        def network(z, weights):
            n, k = len(c.inputs), len(ROWS)
            mean, inverse, middle, inverse_half = (jnp.asarray(c.constants[i * n : (i + 1) * n])[:, None] for i in range(4))
            layer = (z - mean) * inverse
            excess = jnp.maximum(jnp.abs(layer - middle) * inverse_half - 1, 0) * c.constants[-1]
            fade = jnp.exp(-(excess**2).sum(0))
            places = layer_slices(c.sizes)
            for number, (W, b) in enumerate(places):
                layer = weights[W].reshape(c.sizes[number + 1], -1) @ layer + weights[b][:, None]
                layer = jnp.tanh(layer) if number < len(places) - 1 else layer
            return jnp.asarray(c.constants[4 * n : 4 * n + k])[:, None] * fade * layer

        n_s, rows, h = len(kite.state_names), jnp.array(ROWS), s.dt
        U, SP = jnp.asarray(np.moveaxis(s.inputs, 0, -1)), jnp.asarray(np.moveaxis(s.setpoints, 0, -1))

        def slope(x, sp, u, weights):
            y = replayed(*rates, list(x) + list(sp), list(u))
            return y[:n_s].at[rows].add(network(y[n_s:], weights))

        @jax.checkpoint
        def step(x, weights, sp, u, after):
            k1 = slope(x, sp, u, weights)
            k2 = slope(x + h / 2 * k1, sp, (u + after) / 2, weights)
            k3 = slope(x + h / 2 * k2, sp, (u + after) / 2, weights)
            k4 = slope(x + h * k3, sp, after, weights)
            return x + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)

        target, unit = jnp.asarray(np.moveaxis(self.target, 0, -1)), jnp.asarray(self.unit)[:, None]

        def error(x, sp, u, wanted):
            return (((replayed(*reported, list(x) + list(sp), list(u)) - wanted) / unit) ** 2).sum()

        def cost(weights):
            def scanned(x, at):
                sp, u, after, wanted, sp_after = at
                x = step(x, weights, sp, u, after)
                return x, error(x, sp_after, after, wanted)

            x0 = jnp.asarray(s.starts.T)
            _, errors = jax.lax.scan(scanned, x0, (SP[:-1], U[:-1], U[1:], target[1:], SP[1:]))
            return (errors.sum() + error(x0, SP[0], U[0], target[0])) / target.size

        compiled, weights = jax.jit(jax.grad(cost)), jnp.asarray(c.weights)
        return lambda: np.asarray(compiled(weights))


def _compared(kite, x, u, c) -> list:
    reported = dict(zip(OUTPUTS, kite.outputs(x, u, c), strict=True))
    reported |= {name: x[i] for i, name in enumerate(STATES) if name not in reported}
    return [reported[name] for name in COMPARED]


def timed(function: Callable) -> tuple[np.ndarray, np.ndarray]:
    """((wall time, processor time of all threads) [s], what the function gave)"""
    wall, processor = time.perf_counter(), time.process_time()
    answer = function()
    return np.array([time.perf_counter() - wall, time.process_time() - processor]), answer


def compared(setting: Setting, peers: dict[str, Callable[[], np.ndarray]], rounds: int, ours_per_round: int = 5) -> list[str]:
    """Rows of the table; rounds = 0: peers are timed at their only call."""
    first, gradient = timed(setting.fast)
    firsts, growth, times, answers = {}, {}, {name: [] for name in ("awes", *peers)}, {}
    for name, peer in peers.items():
        before = _peak()
        firsts[name], answers[name] = timed(peer)
        growth[name] = _peak() - before
    if rounds == 0:
        times = {name: [taken] for name, taken in firsts.items()} | {"awes": [timed(setting.fast)[0] for _ in range(ours_per_round)]}
    for _ in range(rounds):
        for _ in range(ours_per_round):
            times["awes"].append(timed(setting.fast)[0])
        for name, peer in peers.items():
            times[name].append(timed(peer)[0])
    medians = {name: np.median(t, axis=0) for name, t in times.items()}
    print(setting.name, medians, flush=True)
    wall, processor = 1e3 * medians["awes"]
    rows = [f"| {setting.name}, {gradient.size} weights | awes | {wall:.0f} ms | 1 | {processor:.0f} ms | 1 | - | {first[0]:.1f} s | |"]
    for name in peers:
        difference = np.abs(answers[name] - gradient).max() / np.abs(gradient).max()
        ratios, (wall, processor) = medians[name] / medians["awes"], 1e3 * medians[name]
        rows.append(
            f"| | {name} | {wall:.0f} ms | **{ratios[0]:.1f}** | {processor:.0f} ms | **{ratios[1]:.1f}** | {difference:.0e} | "
            f"{firsts[name][0]:.1f} s | {growth[name]:.0f} MB |"
        )
    return rows


def _peak() -> float:
    """[MB] most memory this process has held."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


def thesis() -> Setting:
    """120 segments x 400 samples of 45 ms, an 8-8 network that sees 16 inputs."""
    kite = small_kite()
    flown = small_segments(kite, 120, 400)
    return Setting("thesis: 120 x 400, 45 ms", kite, replace(flown, dt=0.045), correction(INPUTS, (8, 8), size=0.03))


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--threads", type=int, default=1, help="torch's threads (small eager batches run best on one)")
    arguments = parser.parse_args()
    torch.set_num_threads(arguments.threads)
    kite, has_jax = small_kite(), importlib.util.find_spec("jax") is not None
    command = f"python benchmarks/network_gradient.py --rounds {arguments.rounds} --threads {arguments.threads}"
    lines = [
        "# Gradient with respect to the weights of a network in the dynamics", "",
        f"`{command}` on {platform.processor() or platform.machine()}, {len(os.sched_getaffinity(0))} cores: rollout, cost, "
        "exact gradient; one process, medians of interleaved runs. Ratio: how many times faster awes is. Processor time is that of all "
        "threads together; on a busy machine its ratio is the one to trust. Difference: of the gradient, relative to its largest "
        "component. Memory: by how much the first call raised the peak of the process.", "",
        "| problem | who | median | ratio | processor time | ratio | difference | first call | memory |", f"|{9 * '---|'}",
    ]  # fmt: skip
    # the thesis' step last: the peak of memory only grows
    for segments, steps in ((36, 250), (256, 50)):
        setting = Setting(f"{segments} x {steps}", kite, small_segments(kite, segments, steps), correction(INPUTS, (32, 32)))
        peers = {"torchdiffeq rk4 + backward": setting.torch("rk4")}
        if has_jax:
            peers["jax jit grad(scan), checkpointed"] = setting.jax()
        lines += compared(setting, peers, arguments.rounds)
    short = Setting("short", kite, small_segments(kite, 36, 25), correction(INPUTS, (32, 32)))
    same, ours = short.torch("rk4_classical")(), short.fast()
    equal = np.abs(same - ours).max() / np.abs(ours).max()
    setting = thesis()
    lines += compared(setting, {"torchdiffeq rk4, float32": setting.torch("rk4", torch.float32)}, rounds=0)
    asked = ", ".join(f"{ratio:g} at {name}" for name, ratio in ASKED.items())
    lines += [
        "", f"Asked of the ratio with torchdiffeq rk4 + backward: {asked}. Same answers: {equal:.0e} with our tableau in torchdiffeq's "
        "stepping (36 x 25; asked 1e-9); torchdiffeq's own rk4 is the 3/8 rule and differs by the error of either. The thesis' step: ours "
        "in float64, recorded set-points for both, under 0.5 s asked.", "" if has_jax else "jax: not installed.",
    ]  # fmt: skip
    write_text(HERE / "results" / "network_gradient.md", "\n".join(lines).rstrip() + "\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
