"""Gradient of a trajectory cost with respect to the weights of a network in a kite's dynamics: awes beside torchdiffeq + backward.

    python benchmarks/network_gradient.py [--rounds 3]

One process, the same kite, segments, network and classical RK4 at 20 ms, float64; runs are interleaved and medians compared. The
flight is synthetic and made here. Targets: 25 x at 36 x 250, 5 x at 256 x 50, gradients equal to 1e-9.
"""

import argparse
import json
import sys
import time
from pathlib import Path

import numpy as np
import torch

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
from learning.small_flight import small_kite, small_segments  # noqa: E402

from awescli.learning.correction import ROWS, Correction, initial_weights  # noqa: E402
from awescli.learning.network_inputs import inputs_of_instant, network_inputs  # noqa: E402
from awescli.learning.problem import COMPARED  # noqa: E402
from awescli.simulation.hybrid import CorrectedSimulator  # noqa: E402
from awescli.simulation.hybrid_torch import TorchHybrid  # noqa: E402

INPUTS = (
    "u", "v", "w", "p", "q", "r", "sin_phi", "cos_phi", "sin_theta", "cos_theta", "alpha", "beta", "V_a", "rudder", "stretch",
    "tension",
)  # fmt: skip
HIDDEN = (32, 32)


def correction() -> Correction:
    rng = np.random.default_rng(0)
    weights = initial_weights((len(INPUTS), *HIDDEN, 6), 0)
    weights += 0.1 * rng.normal(size=weights.size)
    scale = {"V_a": 30.0, "u": 30.0, "tension": 3000.0}
    deviation = np.array([scale.get(name, 3.0) for name in INPUTS])
    zero, one = np.zeros(len(INPUTS)), np.ones(len(INPUTS))
    return Correction(INPUTS, HIDDEN, weights, zero, deviation, zero, 5 * one, np.array([0.3, 0.3, 0.3, 0.1, 0.1, 0.1]))


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--threads", type=int, default=1, help="torch's threads (small eager batches run best on one)")
    arguments = parser.parse_args()
    torch.set_num_threads(arguments.threads)
    torch.set_default_dtype(torch.float64)
    kite, results = small_kite(), {}
    c = correction()
    inputs = network_inputs(kite, c.inputs)
    ours = CorrectedSimulator(kite, inputs, c.sizes, ROWS, COMPARED)
    peers = {"torchdiffeq rk4 + backward": "rk4", "torchdiffeq, our tableau + backward": "rk4_classical"}
    for segments, steps in ((36, 250), (256, 50)):
        flown = small_segments(kite, segments, steps)
        prepared = ours.prepare(flown)
        target = ours.rollout(prepared, 0 * c.weights, c.constants).outputs
        size = target.std((0, 1)) + 1e-3

        def fast(prepared=prepared, target=target, size=size):
            run = ours.rollout(prepared, c.weights, c.constants)
            error = (run.outputs - target) / size
            return ours.gradient(run, 2 * error / size / error.size)[0]

        def slow(solver, flown=flown, target=target, size=size):
            w = torch.tensor(c.weights, requires_grad=True)
            y = TorchHybrid(kite, inputs_of_instant(c.inputs), c.sizes, ROWS, COMPARED, solver=solver).rollout(flown, w, c.constants)
            (((y - torch.as_tensor(target)) / torch.as_tensor(size)) ** 2).mean().backward()
            return w.grad.numpy()

        t = time.perf_counter()
        gradient = fast()
        first = time.perf_counter() - t
        times, answers = {"awes": []} | {name: [] for name in peers}, {}
        for _ in range(arguments.rounds):
            for _ in range(5):
                t = time.perf_counter()
                gradient = fast()
                times["awes"].append(time.perf_counter() - t)
            for name, solver in peers.items():
                t = time.perf_counter()
                answers[name] = slow(solver)
                times[name].append(time.perf_counter() - t)
        medians = {name: float(np.median(v)) for name, v in times.items()}
        same = {name: float(np.abs(a - gradient).max() / np.abs(gradient).max()) for name, a in answers.items()}
        results[f"{segments} x {steps}"] = {
            "weights": int(c.weights.size), "first_call_s": first, "median_s": medians,
            "ratio": {name: medians[name] / medians["awes"] for name in peers}, "relative_difference": same,
        }  # fmt: skip
    json.dump(results, sys.stdout, indent=2)
    print()
    return 0


if __name__ == "__main__":
    sys.exit(main())
