"""Rollouts and exact Jacobians of a kite in closed loop: awes beside torchdiffeq, scipy and CasADi.

    python benchmarks/engine_speed.py [--rounds 5] [--quick]

One process, float64: 36 segments of a synthetic flight of the development kite x 250 classical RK4 steps of 20 ms, 20 free parameters,
a rudder law of 50 Gaussians in the loop, sampled at 50 Hz and held. Everybody runs the same physics: torch the source itself, CasADi
and scipy the program that was recorded from it. Runs are interleaved and medians compared; peers get their better thread setting.
Results go to benchmarks/results/engine_speed.md. A peer that cannot be imported (casadi, gcc) is reported as not installed.
"""

import argparse
import importlib.util
import json
import os
import re
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from functools import partial
from itertools import product
from pathlib import Path

import numpy as np
from engine_peers import ARRAYS, CORES, FLOATS, CasadiPeer, ScipyPeer, TorchPeer, seconds_of, torch  # before awescli: see there
from engine_problem import COMPARED, GAUSSIANS, KITE, PARAMETERS, SEGMENTS, STEPS, Problem, make_problem

from awescli.artifacts import write_text
from awescli.notation.quantities import STATES
from awescli.physics.declaration import read_kite

HERE = Path(__file__).parent
RESULT = HERE / "results" / "engine_speed.md"
README = HERE.parent / "README.md"
BEGIN, END = "<!-- made by benchmarks/engine_speed.py -->", "<!-- end -->"
SAME = tuple(n for n in COMPARED if n in STATES)
"""Rows in which Jacobians of states are compared with those of outputs: velocities are simulated in body axes and reported in NED."""


def interleaved(runs: dict[str, Callable], rounds: int, ours: str = "awes") -> dict[str, float]:
    """Median seconds of each; ours runs around every other one."""
    found = {name: [] for name in runs}
    for _ in range(rounds):
        for name, run in runs.items():
            if name != ours:
                found[ours] += [seconds_of(runs[ours]) for _ in range(3)]
                found[name].append(seconds_of(run))
    found[ours] += [seconds_of(runs[ours]) for _ in range(3)]
    return {name: float(np.median(v)) for name, v in found.items()}


def _difference(a, b) -> float:
    """Largest difference, relative to the size of each column."""
    size = np.abs(b).max(axis=(0, 1), keepdims=True)
    return float((np.abs(a - b) / np.where(size > 0, size, 1.0)).max())


def best_threads(run: Callable) -> None:
    """Leave torch at the thread count that is fastest for this run."""
    seconds = {}
    for n in {1, CORES}:
        torch.set_num_threads(n)
        seconds[n] = seconds_of(run)
    torch.set_num_threads(min(seconds, key=seconds.get))


def first_call(folder: Path) -> dict:
    """Run in a fresh process: seconds of imports, and of everything from a kite to its first rollout and Jacobian."""
    problem = Problem.read(folder)
    segments = problem.segments(SEGMENTS)
    begun = time.perf_counter()
    simulator, columns = problem.simulator()
    simulator.rollout(segments)
    rollout = time.perf_counter() - begun
    simulator.sensitivities(segments, columns, COMPARED)
    return {"rollout": rollout, "both": time.perf_counter() - begun}


def measure_first_calls(problem: Problem, rounds: int) -> dict:
    """Cold (empty caches) and cached, in subprocesses."""
    found = {"cold": [], "cached": []}
    for _ in range(rounds):
        with tempfile.TemporaryDirectory() as folder:
            problem.write(Path(folder))
            environment = {**os.environ, "AWES_CACHE": f"{folder}/awes"}
            for kind in found:
                command = [sys.executable, __file__, "--first-call", folder]
                answer = subprocess.run(command, env=environment, capture_output=True, text=True, check=True).stdout
                found[kind].append(json.loads(answer))
    return {kind: {k: float(np.median([f[k] for f in all_])) for k in all_[0]} for kind, all_ in found.items()}


def identification(rounds: int) -> tuple[float, int, int]:
    """(median seconds, segments, parameters) of a whole identification of a 150 s flight, from the declared guess: three horizons."""
    from awescli.estimation.problem import build, simulator_of
    from awescli.estimation.staged_fit import Flight, fit_flights
    from awescli.flightlog.loops import find_loops
    from awescli.flightlog.split import split
    from awescli.simulation.campaign_flights import dev_like

    flight = dev_like(read_kite(KITE), 2)
    parts = split(find_loops(flight.log), log=flight.log)
    seconds = []
    for _ in range(rounds):
        begun = time.perf_counter()
        problem = build(simulator_of(flight.declared, flight.log), flight.log, parts, 5.0, tuple(flight.log.measured))
        fit_flights([Flight(problem)], (1.0, 2.5))
        seconds.append(time.perf_counter() - begun)
    return float(np.median(seconds)), len(problem.fitted.segments), len(problem.kite.parameters.free)


# --- the report ---


class Report:
    """Lines of the result, and the few figures that the README shows."""

    def __init__(self):
        self.lines: list[str] = []
        self.summary: list[tuple[str, str, str]] = []

    def note(self, what: str, reached: str, asked: str) -> None:
        """A row of the README's table."""
        self.summary.append((what, reached, asked))

    def write(self) -> None:
        """The result file, and the README's table between its two marks."""
        write_text(RESULT, "\n".join(self.lines) + "\n")
        rows = "\n".join(f"| {what} | {reached} | {asked} |" for what, reached, asked in self.summary)
        table = f"{BEGIN}\n| on {machine()}, load {load():.0f} | reached | asked: floor / aim |\n|---|---|---|\n{rows}\n{END}"
        text = README.read_text()
        write_text(README, re.sub(f"{re.escape(BEGIN)}.*{re.escape(END)}", lambda _: table, text, flags=re.DOTALL))

    def add(self, *lines: str) -> None:
        for line in lines:
            self.lines.append(line)
            print(line, flush=True)

    def table(self, *head: str) -> None:
        self.add("", "| " + " | ".join(head) + " |", "|" + "---|" * len(head))

    def row(self, *cells) -> None:
        self.add("| " + " | ".join(str(c) for c in cells) + " |")


def _ms(seconds: float) -> str:
    return f"{1e3 * seconds:.3g} ms" if seconds < 0.9995 else f"{seconds:.3g} s"


def machine() -> str:
    try:
        text = Path("/proc/cpuinfo").read_text()
        model = next(line.split(":")[1].strip() for line in text.splitlines() if line.startswith("model name"))
    except (OSError, StopIteration):
        model = "unknown processor"
    return f"{model}, {CORES} cores"


def load() -> float:
    """Processes that wanted to run during the last 15 minutes, on average."""
    return os.getloadavg()[2] if hasattr(os, "getloadavg") else 0.0


def rollouts(report: Report, problem: Problem, rounds: int, counts) -> None:
    simulator, _ = problem.simulator()
    asked = {36: "30 / 60", 3600: "3 / -"}
    report.add("", "## Rollout")
    if torch is None:
        report.add("", "torchdiffeq: not installed")
        return
    report.table("segments", "awes", "torchdiffeq rk4", "ratio", "asked: floor / aim")
    torch.set_default_dtype(torch.float64)
    for count in counts:
        s = problem.segments(count)
        # minutes at the large counts: there torchdiffeq, whose steps are all alike, takes a tenth of the steps
        cut = 1 if count <= SEGMENTS else 10
        peer = TorchPeer(problem, problem.segments(count, STEPS // cut))
        best_threads(peer)
        t = interleaved({"awes": partial(simulator.rollout, s), "torch": peer}, rounds)
        t["torch"] *= cut
        report.row(count, _ms(t["awes"]), _ms(t["torch"]), f"**{t['torch'] / t['awes']:.0f}**", asked.get(count, "-"))
        if count in asked:
            report.note(f"rollout of {count} segments, times torchdiffeq rk4", f"**{t['torch'] / t['awes']:.0f}**", asked[count])
    s = problem.segments(SEGMENTS)
    ours = simulator.rollout(s).states[:, :, :12]
    same = _difference(ours, TorchPeer(problem, s, "rk4_classical")())
    other = _difference(ours, TorchPeer(problem, s)())
    report.add(
        "", f"Same answers: {same:.0e} relative with the classical tableau in torchdiffeq's stepping (asked 1e-8). "
        f"torchdiffeq's own `rk4` is the 3/8 rule and differs by {other:.0e}, the error of either rule at 20 ms. "
        f"Beyond {SEGMENTS} segments torchdiffeq ran {STEPS // 10} steps, scaled to {STEPS}.",
    )  # fmt: skip


def jacobians(report: Report, problem: Problem, rounds: int, folder: Path) -> None:
    simulator, columns = problem.simulator()
    s = problem.segments(SEGMENTS)
    report.add("", f"## Jacobian of the 12 states at {STEPS} samples with respect to {PARAMETERS} parameters")
    report.table("who", "median", "ratio", "asked: floor / aim", "differs from awes", "before the first run")
    trajectories, J = simulator.sensitivities(s, columns, COMPARED)
    ours = lambda: simulator.sensitivities(s, columns, COMPARED)  # noqa: E731
    rows = [COMPARED.index(n) for n in SAME]
    theirs = [STATES.index(n) for n in SAME]
    runs, extra = {"awes": ours}, {"awes": ("-", "-", "see below")}
    scale = {}
    part = s.pick(np.array([SEGMENTS // 2]))
    scalar = ScipyPeer(problem, FLOATS)
    name = slow = "scipy approx_fprime over solve_ivp, segment by segment"
    runs[name], scale[name] = lambda: scalar.jacobian(part), SEGMENTS / len(part)
    extra[name] = ("150 / 300", _difference(scalar.jacobian(part)[:, :, theirs], J[[SEGMENTS // 2]][:, :, rows]), "-")
    lanes = ScipyPeer(problem, ARRAYS)
    name = together = "scipy, all segments and perturbed copies in one solve_ivp"
    runs[name] = lambda: lanes.jacobian_in_one(s)
    extra[name] = ("-", _difference(lanes.jacobian_in_one(s)[:, :, theirs], J[:, :, rows]), "-")
    missing, rolled = [], {}
    noted = {slow: slow, together: together}
    if importlib.util.find_spec("casadi"):
        gcc = shutil.which("gcc")
        ways = {"forward": "its forward sensitivities", "recursion": "dS/dt = A S + B written by hand"}
        for (way, note), c, outputs in product(ways.items(), (None, folder), (False, True)):
            if c and not gcc:
                missing.append("gcc: not installed")
                continue
            peer = CasadiPeer(problem, s, way, c, outputs)
            compared = "the same outputs" if outputs else "states only"
            where = f"CasADi {'generated C' if c else 'virtual machine'}"
            name = f"{where}, {compared}, {note}, {peer.threads} thread{'s' * (peer.threads > 1)}"
            runs[name] = peer
            theirs_found = peer.answer()[..., 1:]
            difference = _difference(theirs_found, J[:, :-1]) if outputs else _difference(theirs_found[:, :, theirs], J[:, 1:, rows])
            asked = "2.5 / 6" if c else "20 / 40"
            extra[name] = (asked if way == "forward" else "-", difference, f"{peer.first:.3g} s")
            if way == "forward":
                noted[name] = f"{where}, {compared}"
        for c in (None, folder if gcc else None):
            if c or not rolled:
                peer = CasadiPeer(problem, s, "rollout", c)
                rolled[f"CasADi {'generated C' if c else 'virtual machine'}"] = peer
    else:
        missing.append("CasADi: not installed")
    t = interleaved(runs, rounds)
    for name, run in runs.items():
        if name not in t or run is None:
            continue
        seconds = t[name] * scale.get(name, 1.0)
        asked, difference, before = extra[name]
        ratio = "1" if name == "awes" else f"**{seconds / t['awes']:.3g}**"
        if name in noted:
            report.note(f"Jacobian, times {noted[name]}", ratio, asked)
        report.row(name, _ms(seconds), ratio, asked, difference if isinstance(difference, str) else f"{difference:.0e}", before)
    report.add(*(f"\n{m}" for m in missing))
    report.add(
        "", f"scipy: RK45, rtol 1e-6, {scalar.evaluations} evaluations a segment, the law in every stage instead of held, which is faster "
        "(a loop and an integrator of its own: hence the difference, to which finite differences add theirs); segment by segment it runs "
        f"on floats, on one segment, scaled to {SEGMENTS}. awes computes the 23 outputs at every sample and the sensitivities of 12: "
        "positions, attitude, rates, and the velocity in NED axes. CasADi: `the same outputs` are those 12 and their sensitivities; "
        f"`states only` are the 12 states alone, which is less work than awes does. Where a peer has only states, the {len(SAME)} that are "
        "also outputs are compared; differences are relative to the largest value of each column.",
    )  # fmt: skip
    if rolled:
        t = interleaved({"awes": lambda: simulator.rollout(s), **rolled}, rounds)
        report.add("", "Rollout alone: " + ", ".join(f"{n} {_ms(t[n])} (**{t[n] / t['awes']:.3g}** x awes)" for n in rolled) + ".")
        answer = next(iter(rolled.values())).answer()[..., 0]
        report.add(f"States differ by {_difference(answer, trajectories.states[:, 1:, :12]):.0e} relative.")


def linearity(report: Report, problem: Problem, rounds: int) -> None:
    simulator, columns = problem.simulator()
    report.add("", "## Linear cost")
    report.table("what", "run", "median", "CPU time, least", "CPU time per segment x step (x parameter)")
    cases = {}
    for count in (36, 360, 3600):
        cases[f"{count} segments"] = ("rollout", partial(simulator.rollout, problem.segments(count)), count * STEPS)
    for steps in (125, 250, 500):
        cases[f"{steps} steps"] = ("rollout", partial(simulator.rollout, problem.segments(360, steps)), 360 * steps)
    s = problem.segments(SEGMENTS)
    for count in (36, 360, 3600):
        # 25 steps: at 250 the Jacobian of 3600 segments is 1.7 GB
        run = partial(simulator.sensitivities, problem.segments(count, 25), columns, COMPARED)
        cases[f"{count} segments "] = ("Jacobian, 25 steps", run, count * 25 * PARAMETERS)
    for n in (5, 10, 20, 40):
        sim, own = problem.simulator(n)
        cases[f"{n} parameters"] = ("Jacobian", partial(sim.sensitivities, s, own, COMPARED), SEGMENTS * STEPS * n)
    for _, run, _ in cases.values():
        run()
    found = {name: [] for name in cases}
    cpu = {name: [] for name in cases}
    for _ in range(rounds):
        for name, (_, run, _) in cases.items():
            begun = time.process_time()
            found[name].append(seconds_of(run))
            cpu[name].append(time.process_time() - begun)
    for name, (what, _, size) in cases.items():
        least = min(cpu[name])
        report.row(name.strip(), what, _ms(float(np.median(found[name]))), _ms(least), f"{1e9 * least / size:.0f} ns")
    report.add("", "CPU time of all threads: what others run on the machine hardly changes it.")


def main(arguments=None) -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--quick", action="store_true", help="without the long runs of peers at 360 and 3600 segments")
    parser.add_argument("--first-call", type=Path, help=argparse.SUPPRESS)
    options = parser.parse_args(arguments)
    if options.first_call:
        print(json.dumps(first_call(options.first_call)))
        return 0
    problem, report = make_problem(), Report()
    report.add(
        "# Speed of the engine", "", f"`python benchmarks/engine_speed.py --rounds {options.rounds}` on {machine()}.", "",
        f"{SEGMENTS} segments x {STEPS} RK4 steps of 20 ms, development kite, {PARAMETERS} parameters, a law of {GAUSSIANS} Gaussians in "
        "the loop, float64, one process, medians of interleaved runs. Ratio: how many times faster awes is.",
    )  # fmt: skip
    rollouts(report, problem, options.rounds, (1, 36) if options.quick else (1, 36, 360, 3600))
    with tempfile.TemporaryDirectory() as folder:
        jacobians(report, problem, options.rounds, Path(folder))
    linearity(report, problem, options.rounds)
    first = measure_first_calls(problem, min(options.rounds, 3))
    report.add("", "## First call")
    report.table("caches", "rollout", "rollout and Jacobian", "asked: floor / aim")
    for kind, asked in (("cold", "10 s / 5 s"), ("cached", "1 s / 0.5 s")):
        report.row(kind, f"{first[kind]['rollout']:.2f} s", f"**{first[kind]['both']:.2f} s**", asked)
        filled = "empty" if kind == "cold" else "filled"
        report.note(f"first rollout and Jacobian of a kite, caches {filled}", f"**{first[kind]['both']:.2f} s**", asked)
    report.add("", "From a declared kite: recording, differentiating, compiling, running; in a fresh process, after imports.")
    seconds, segments, parameters = identification(min(options.rounds, 3))
    text = f"a 150 s flight, {segments} segments of 5 s, {parameters} parameters, horizons 1, 2.5 and 5 s"
    report.add("", "## A whole identification", "", f"{text}: **{seconds:.1f} s** (asked: under 60 s).")
    report.note(f"whole identification of {text}", f"**{seconds:.1f} s**", "60 s")
    report.add("", f"Mean load of the machine over the last 15 minutes: {load():.1f} on {CORES} cores.")
    report.write()
    return 0


if __name__ == "__main__":
    sys.exit(main())
