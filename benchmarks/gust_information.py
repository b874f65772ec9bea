"""What a turbulent flight says about parameters, starts and gusts: sensitivities from node to node beside a column for every node.

    python benchmarks/gust_information.py [--rounds 7]

One process: a synthetic flight of 150 s in turbulence, 28 segments of 5 s, 20 free parameters, the kite carrying effects with states of
their own (18 states), gusts at nodes 0.1 and 0.05 s apart. Both ways give the Gram matrices of all own unknowns, all parameters and the
residual; the other one carries a column for every node through the whole segment and multiplies all columns at every sample, on all
cores. Runs are interleaved and medians compared. The table goes to benchmarks/results/gust_information.md.
"""

import argparse
import os
import platform
import sys
import time
from pathlib import Path

import numpy as np

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE.parent / "tests"))
from kites import DEVELOPMENT, flight, gust_windows  # noqa: E402

from awescli.artifacts import write_text  # noqa: E402
from awescli.estimation.nuisance_wind import Gusts  # noqa: E402
from awescli.estimation.simulation_error import SimulationError  # noqa: E402
from awescli.notation.quantities import MEASURED, STATES  # noqa: E402
from awescli.physics.kite import Kite  # noqa: E402
from awescli.simulation.groups import each_group  # noqa: E402
from awescli.simulation.rollout import Columns, Simulator  # noqa: E402
from awescli.simulation.segments import observe  # noqa: E402

EFFECTS = ("unsteady_lift", "actuator_lag:rudder", "load_cell_lag")
SEGMENTS, SECONDS = 28, 5.0
NODES = (0.1, 0.05)


def problem(window: float) -> SimulationError:
    """The fit of the development kite to a flight in turbulence, at its declared parameters."""
    log = flight(1, 150.0, True, (("turbulence", (("sigma", 0.9),)),)).log
    kite = Kite(DEVELOPMENT, log.wind.height, EFFECTS)
    steps = round(SECONDS / log.dt)
    first = np.linspace(50, len(log) - steps - 2, SEGMENTS).astype(int)
    names = tuple(n for n in kite.parameters.free if n in DEVELOPMENT.table().free)
    return SimulationError(Simulator(kite), observe(log, kite, first, steps, MEASURED), names, Gusts(0.9, window))


def in_columns(at: SimulationError, gusts: Gusts, x: np.ndarray) -> np.ndarray:
    """(K, n, n) Gram matrices of [own unknowns, parameters, residual], with a column for every node at every sample."""
    segments = at.observed.segments
    columns = Columns(STATES, at.names, gust_windows(gusts, segments.steps, segments.dt))
    trajectories, J = at.simulator.sensitivities(at.segments(at.own), columns, at.observed.outputs, at.values(x))
    r, weight, n = at.observed.residual(trajectories), 1 / at.observed.sigma, J.shape[-1]
    grams = np.empty((len(r), n + 1, n + 1))
    order = np.r_[:12, 12 + len(at.names) : n, 12 : 12 + len(at.names), n]

    def gram(k: int):
        A = np.empty((r[k].size, n + 1))
        np.multiply(J[k].reshape(-1, n), weight[k].reshape(-1, 1), out=A[:, :n])
        A[:, n] = r[k].ravel()
        grams[k] = (A.T @ A)[np.ix_(order, order)]
        yield

    each_group(gram, len(r))
    return grams


def from_node_to_node(at: SimulationError, x: np.ndarray):
    return at.chain(x).gram()


def difference(found, whole: np.ndarray) -> float:
    """Largest difference of correlations."""
    own, cross, of_globals = found
    n, size = own.shape[1], np.sqrt(np.einsum("kii->ki", whole))
    blocks = ((own, whole[:, :n, :n], size[:, :n], size[:, :n]), (cross, whole[:, :n, n:], size[:, :n], size[:, n:]))
    blocks += ((of_globals, whole[:, n:, n:], size[:, n:], size[:, n:]),)
    return max(float(np.abs((a - b) / i[:, :, None] / j[:, None]).max()) for a, b, i, j in blocks)


def main(arguments=None) -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--rounds", type=int, default=7)
    options = parser.parse_args(arguments)
    lines = [
        "# Information of a turbulent flight", "",
        f"`python benchmarks/gust_information.py --rounds {options.rounds}` on {platform.machine()}, {len(os.sched_getaffinity(0))} cores: "
        f"{SEGMENTS} segments of {SECONDS:g} s at 50 Hz, sensitivities and Gram matrices; one process, medians of interleaved runs. "
        "Ratio: how many times faster sensitivities from node to node are. Difference: largest one of all correlations.", "",
        "| nodes | own unknowns | from node to node | a column for every node | ratio | difference |", "|---|---|---|---|---|---|",
    ]  # fmt: skip
    for window in NODES:
        at = problem(window)
        x, gusts = at.simulator.kite.parameters.vector(at.names), Gusts(0.9, window)
        ways = (lambda: from_node_to_node(at, x), lambda: in_columns(at, gusts, x))  # noqa: B023
        apart = difference(*(way() for way in ways))
        took = [[], []]
        for _ in range(options.rounds):
            for way, times in zip(ways, took, strict=True):
                begun = time.perf_counter()
                way()
                times.append(time.perf_counter() - begun)
        own, every = (float(np.median(t)) for t in took)
        lines.append(
            f"| {window:g} s | {at.own.shape[1]} | {1e3 * own:.0f} ms | {1e3 * every:.0f} ms | **{every / own:.1f}** | {apart:.0e} |"
        )
        print(lines[-1])
    write_text(HERE / "results" / "gust_information.md", "\n".join([*lines, ""]))
    return 0


if __name__ == "__main__":
    sys.exit(main())
