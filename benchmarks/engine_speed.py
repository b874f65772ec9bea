"""Rollouts and exact Jacobians of a kite in closed loop: awes beside torchdiffeq, scipy and CasADi.

    python benchmarks/engine_speed.py [--rounds 5] [--quick]

One process, float64: 36 segments of a synthetic flight of the development kite x 250 classical RK4 steps of 20 ms, 20 free parameters,
a rudder law of 50 Gaussians in the loop, sampled at 50 Hz and held. Everybody runs the same physics: torch the source itself, CasADi
and scipy the program that was recorded from it. Runs are interleaved and medians compared; peers get their better thread setting.
Results go to benchmarks/results/engine_speed.md. A peer that cannot be imported (casadi, gcc) is reported as not installed.
"""

try:  # before awescli, which asks OpenMP's threads to sleep while they wait: torch as a peer is faster without
    import torch
    from torchdiffeq import odeint
except ImportError:
    torch = None
import argparse
import importlib.util
import json
import math
import os
import re
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np

from awescli.artifacts import read_arrays, read_json, write_arrays, write_json, write_text
from awescli.control.features import evaluate
from awescli.control.gaussian_law import LOWEST_EXPONENT, GaussianLaw, design
from awescli.control.law import state_mapping
from awescli.engine.record import record
from awescli.notation.quantities import STATES
from awescli.physics.declaration import KiteDeclaration, kite_text, read_kite
from awescli.physics.kite import Kite
from awescli.simulation.closed_loop import loop
from awescli.simulation.rollout import Columns, Segments, Simulator, inputs_of, setpoints_of
from awescli.stages.controller_artifact import read_controller, write_controller

HERE = Path(__file__).parent
RESULT = HERE / "results" / "engine_speed.md"
README = HERE.parent / "README.md"
BEGIN, END = "<!-- made by benchmarks/engine_speed.py -->", "<!-- end -->"
SEGMENTS, STEPS, PARAMETERS, GAUSSIANS = 36, 250, 20, 50
FEATURES = ("radius_error", "sin_course_error", "r", "p", "speed", "wing_along_line")
COMPARED = ("p_n", "p_e", "p_d", "v_n", "v_e", "v_d", "phi", "theta", "psi", "p", "q", "r")
SAME = tuple(n for n in COMPARED if n in STATES)
"""Rows in which Jacobians are compared: velocities are simulated in body axes and reported in NED."""
SAVED = ("first", "starts", "setpoints", "inputs", "dt")
CORES = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()


# --- the problem ---


@dataclass
class Problem:
    """What is simulated. base: segments of 500 steps, of which others are made."""

    declaration: KiteDeclaration
    heights: tuple[float, ...]
    law: GaussianLaw
    base: Segments

    def __post_init__(self):
        self.kite = Kite(self.declaration, self.heights)
        self.free = tuple(self.kite.parameters.free)[:PARAMETERS]
        self.c = [float(v) for v in self.kite.parameters.vector()]

    def segments(self, count: int, steps: int = STEPS) -> Segments:
        """`count` segments; beyond the flight's 36 they are repeated with slightly other starts."""
        which = np.arange(count) % SEGMENTS
        noise = 1e-3 * np.random.default_rng(0).normal(size=(count, 12)) * (np.arange(count) >= SEGMENTS)[:, None]
        s = self.base.pick(which)
        return replace(s, starts=s.starts + noise, setpoints=s.setpoints[:, : steps + 1], inputs=s.inputs[:, : steps + 1])

    def simulator(self, parameters: int = PARAMETERS) -> tuple[Simulator, Columns]:
        free = tuple(self.kite.parameters.free)[:parameters]
        return Simulator(self.kite, free, law=loop(self.law, self.kite, 0.0)), Columns(parameters=free)


    def write(self, folder: Path) -> None:
        """For another process."""
        write_text(folder / "kite.yaml", kite_text(self.declaration))
        write_json(folder / "heights.json", list(self.heights))
        write_controller(folder, self.law)
        write_arrays(folder / "base.npz", {n: getattr(self.base, n) for n in SAVED})

    @classmethod
    def read(cls, folder: Path) -> "Problem":
        arrays = read_arrays(folder / "base.npz")
        base = Segments(**{n: arrays[n] for n in SAVED[:-1]}, dt=float(arrays["dt"]))
        return cls(read_kite(folder / "kite.yaml"), tuple(read_json(folder / "heights.json")), read_controller(folder), base)


def make_problem() -> Problem:
    """A flight of the development kite, a Gaussian law fitted to its rudder, and segments that start in its states."""
    from awescli.simulation.campaign_flights import dev_like

    flight = dev_like(read_kite(HERE.parent / "data" / "kites" / "development.yaml"), 1, noise=False, duration=60.0)
    log, pattern = flight.log, flight.law.pattern
    z = state_mapping(log)
    F = np.stack([np.broadcast_to(f, len(log)) for f in evaluate(FEATURES, z, pattern)], axis=1)
    centre, scale = F.mean(0), F.std(0)
    X = (F - centre) / scale
    centres, width = X[np.linspace(0, len(log) - 1, GAUSSIANS).astype(int)], 1.5
    D = design(X, centres, width)
    w = np.linalg.solve(D.T @ D + 1e-3 * len(log) * np.eye(D.shape[1]), D.T @ log["rudder"])[None]
    law = GaussianLaw(
        surfaces=("rudder",), features=FEATURES, centre=tuple(centre), scale=tuple(scale), limits={"rudder": (-0.44, 0.44)},
        pattern=pattern, centres=centres, width=width, coefficients=w[:, :GAUSSIANS], affine=w[:, GAUSSIANS:],
    )  # fmt: skip
    kite = Kite(flight.flown, log.wind.height)
    first = np.linspace(0, len(log) - 502, SEGMENTS).astype(int)
    rows = first[:, None] + np.arange(501)
    Z = np.stack([z[name] for name in STATES], axis=1)
    base = Segments(first, Z[first], setpoints_of(log)[rows], inputs_of(log, kite)[rows], log.dt)
    return Problem(flight.flown, tuple(log.wind.height), law, base)


# --- peers ---


class TorchPeer:
    """torchdiffeq over all segments in one batch; the physics is the source itself on tensors (K,), the law one matrix product."""

    def __init__(self, problem: Problem, segments: Segments, method: str = "rk4"):
        from torchdiffeq._impl.odeint import SOLVERS

        from awescli.simulation import hybrid_torch

        SOLVERS.setdefault(hybrid_torch.OURS, hybrid_torch.ClassicalRK4)
        self.p, self.s, self.method = problem, segments, method
        law = problem.law
        self.slope, self.offset, self.g = (torch.as_tensor(a) for a in law._exponents())
        self.weights, self.affine = torch.as_tensor(law.coefficients[0]), torch.as_tensor(law.affine[0])
        self.centre, self.scale = torch.tensor(law.centre), torch.tensor(law.scale)
        self.U, self.SP = torch.as_tensor(segments.inputs), torch.as_tensor(segments.setpoints)

    def set_points(self, x, k):
        columns = x.unbind(-1)
        f = evaluate(self.p.law.features, dict(zip(STATES, columns, strict=True)), self.p.law.pattern)
        X = (torch.stack(torch.broadcast_tensors(*f), -1) - self.centre) / self.scale
        e = X @ self.slope.T + self.offset - self.g * (X * X).sum(-1, keepdim=True)
        rudder = torch.exp(e.clamp(min=LOWEST_EXPONENT)) @ self.weights + self.affine[0] + X @ self.affine[1:]
        aileron, elevator, _, flaps = self.SP[:, k].unbind(-1)
        return [aileron, elevator, rudder.clamp(*self.p.law.limits["rudder"]), flaps]

    def __call__(self) -> np.ndarray:
        N, dt, held = self.s.steps, self.s.dt, {}

        def right_hand_side(t, x):
            t = float(t)
            k = min(max(math.floor(t), 0), N - 1)
            if k not in held:  # the first stage of a step: the law sees the sample
                held.clear()
                held[k] = self.set_points(x, k)
            u = (self.U[:, k] + (t - k) * (self.U[:, k + 1] - self.U[:, k])).unbind(-1)
            rates = self.p.kite.derivative([*x.unbind(-1), *held[k]], list(u), self.p.c)
            return dt * torch.stack(torch.broadcast_tensors(*rates), -1)

        with torch.no_grad():
            times = torch.arange(N + 1, dtype=torch.float64)
            # perturb: the last stage of a step is evaluated just before the next sample
            states = odeint(right_hand_side, torch.as_tensor(self.s.starts), times, method=self.method, options={"perturb": True})
        return states.transpose(0, 1).numpy()


_OPERATORS = {"add": "{} + {}", "sub": "{} - {}", "mul": "{} * {}", "div": "{} / {}", "neg": "-{}"}


def python_function(function: Callable, names: dict, **sizes: int) -> Callable:
    """A recorded function as straight-line Python, the fastest form that plain Python has; names: what sin, select, ... mean."""
    tape, outputs = record(function, **sizes)
    lines = [f"def f({', '.join(sizes)}):"]
    for i, (op, *args) in enumerate(tape.nodes):
        if op == "const":
            lines.append(f" v{i} = {args[0]!r}")
        elif op == "input":
            lines.append(f" v{i} = {args[0]}[{args[1]}]")
        else:
            v = [f"v{a}" for a in args]
            lines.append(f" v{i} = " + (_OPERATORS[op].format(*v) if op in _OPERATORS else f"{op}({', '.join(v)})"))
    lines.append(f" return [{', '.join(f'v{o}' for o in outputs)}]")
    space = dict(names)
    exec("\n".join(lines), space)
    return space["f"]


FLOATS = {n: getattr(math, n) for n in ("sqrt", "sin", "cos", "exp", "log", "atan2")} | {"select": lambda p, a, b: a if p > 0 else b}
ARRAYS = {n: getattr(np, n) for n in ("sqrt", "sin", "cos", "exp", "log")} | {
    "atan2": np.arctan2, "select": lambda p, a, b: np.where(p > 0, a, b),
}  # fmt: skip


class ScipyPeer:
    """solve_ivp (RK45, rtol 1e-6) with the law evaluated in every stage: faster than stopping at every sample to hold the set-point.

    On floats one segment at a time; on arrays (`lanes`) all segments and all perturbed copies in one call.
    """

    def __init__(self, problem: Problem, names: dict):
        kite, law = problem.kite, problem.law
        sizes = {"x": len(kite.x_names), "u": len(kite.input_names), "c": len(problem.c)}
        self.f = python_function(kite.derivative, names, **sizes)

        def features(x):
            values = evaluate(law.features, dict(zip(STATES, x, strict=True)), law.pattern)
            return [(f - m) / s for f, m, s in zip(values, law.centre, law.scale, strict=True)]

        self.features = python_function(features, names, x=12)
        self.p, (self.slope, self.offset, self.g) = problem, law._exponents()
        self.places = [kite.parameter_names.index(n) for n in problem.free]
        self.evaluations = 0

    def rudder(self, X: np.ndarray) -> np.ndarray:
        """X (..., F)"""
        law = self.p.law
        e = X @ self.slope.T + self.offset - self.g * (X * X).sum(-1)[..., None]
        y = np.exp(np.maximum(e, LOWEST_EXPONENT)) @ law.coefficients[0] + law.affine[0, 0] + X @ law.affine[0, 1:]
        return np.minimum(np.maximum(y, law.limits["rudder"][0]), law.limits["rudder"][1])

    def rollout(self, start, SP, U, dt, c) -> np.ndarray:
        """(N+1, 12) one segment, on floats"""
        from scipy.integrate import solve_ivp

        N, differences, recorded = len(SP) - 1, np.diff(U, axis=0), SP.tolist()

        def right_hand_side(t, x):
            k = min(int(t / dt), N - 1)
            x, sp = x.tolist(), recorded[k]
            rudder = float(self.rudder(np.array(self.features(x))))
            return self.f([*x, sp[0], sp[1], rudder, sp[3]], (U[k] + (t / dt - k) * differences[k]).tolist(), c)

        found = solve_ivp(right_hand_side, (0, N * dt), start, t_eval=dt * np.arange(N + 1), rtol=1e-6, atol=1e-8)
        self.evaluations = found.nfev
        return found.y.T

    def jacobian(self, s: Segments) -> np.ndarray:
        """(K, N+1, 12, P), 2-point differences, segment by segment"""
        from scipy.optimize import approx_fprime

        at = np.array([self.p.c[i] for i in self.places])
        found = []
        for i in range(len(s)):

            def simulated(values, i=i):
                c = list(self.p.c)
                for place, value in zip(self.places, values.tolist(), strict=True):
                    c[place] = value
                return self.rollout(s.starts[i], s.setpoints[i], s.inputs[i], s.dt, c).ravel()

            step = math.sqrt(np.finfo(float).eps) * np.maximum(1e-3, np.abs(at))
            found.append(approx_fprime(at, simulated, step).reshape(s.steps + 1, 12, -1))
        return np.stack(found)

    def jacobian_in_one(self, s: Segments) -> np.ndarray:
        """(K, N+1, 12, P), 2-point differences, all segments and copies as lanes of one solve_ivp"""
        from scipy.integrate import solve_ivp

        K, P, N, dt = len(s), len(self.places), s.steps, s.dt
        lanes = K * (P + 1)
        c = [np.full(lanes, v) for v in self.p.c]
        step = math.sqrt(np.finfo(float).eps) * np.array([max(1e-3, abs(self.p.c[i])) for i in self.places])
        for j, place in enumerate(self.places):
            c[place][(j + 1) * K : (j + 2) * K] += step[j]
        # a parameter that nobody perturbs stays a plain number
        c = [v if i in self.places else self.p.c[i] for i, v in enumerate(c)]
        copies = lambda a: np.ascontiguousarray(np.tile(a, (P + 1, 1)).T)  # noqa: E731
        U = [copies(s.inputs[:, k]) for k in range(N + 1)]
        SP = [copies(s.setpoints[:, k]) for k in range(N + 1)]

        def right_hand_side(t, x):
            k = min(int(t / dt), N - 1)
            x = x.reshape(12, lanes)
            rudder = self.rudder(np.stack(np.broadcast_arrays(*self.features(x)), -1))
            aileron, elevator, _, flaps = SP[k]
            rates = self.f([*x, aileron, elevator, rudder, flaps], U[k] + (t / dt - k) * (U[k + 1] - U[k]), c)
            return np.concatenate([np.broadcast_to(r, lanes) for r in rates])

        start = np.tile(s.starts, (P + 1, 1)).T.ravel()
        found = solve_ivp(right_hand_side, (0, N * dt), start, t_eval=dt * np.arange(N + 1), rtol=1e-6, atol=1e-8)
        y = found.y.T.reshape(N + 1, 12, P + 1, K)
        return np.moveaxis((y[:, :, 1:] - y[:, :, :1]) / step[:, None], -1, 0)


class CasadiPeer:
    """The recorded programs replayed on casadi.SX; one RK4 step with its sensitivities is one SX function, folded over the samples.

    way: "rollout": no sensitivities; "forward": CasADi differentiates the step in 20 directions; "recursion": dS/dt = A S + B in every
    stage, with CasADi's sparse A and B. generated: a folder for the step as C, gcc -O3 -march=native, instead of the virtual machine.
    """

    def __init__(self, problem: Problem, segments: Segments, way: str, generated: Path | None = None):
        import casadi as ca

        self.ca, self.p, self.s = ca, problem, segments
        self.way, self.P = way, len(problem.free)
        begun = time.perf_counter()
        step = self._step()
        self.instructions = step.n_instructions()
        if generated:
            step = self._as_c(step, generated)
        inputs = np.concatenate([segments.inputs[:, :-1], segments.inputs[:, 1:], segments.setpoints[:, :-1]], axis=2)
        self.U = np.ascontiguousarray(inputs.transpose(2, 0, 1)).reshape(inputs.shape[2], -1)
        fold = step.mapaccum("fold", segments.steps)
        K = len(segments)
        self.runs = {n: fold.map(K, "thread", n) if n > 1 else fold.map(K) for n in {1, CORES}}
        x0 = segments.starts.T if way == "rollout" else np.concatenate([segments.starts.T, np.zeros((12 * self.P, K))])
        self.arguments = (ca.DM(x0), ca.DM(self.U), ca.DM(np.tile([[problem.c[i]] for i in self._places()], (1, K * segments.steps))))
        self.first = time.perf_counter() - begun
        self.threads = min(self.runs, key=lambda n: min(_seconds(partial(self.runs[n], *self.arguments)) for _ in range(2)))

    def _places(self):
        return [self.p.kite.parameter_names.index(n) for n in self.p.free]

    def _replay(self, function, **blocks):
        """A recorded function on SX."""
        ca = self.ca
        tape, outputs = record(function, **{name: b.numel() for name, b in blocks.items()})
        of = {
            "add": lambda a, b: a + b, "sub": lambda a, b: a - b, "mul": lambda a, b: a * b, "div": lambda a, b: a / b, "neg": lambda a: -a,
            "sqrt": ca.sqrt, "sin": ca.sin, "cos": ca.cos, "exp": ca.exp, "log": ca.log, "atan2": ca.atan2,
            "select": lambda p, a, b: ca.if_else(p > 0, a, b),
        }  # fmt: skip
        values = []
        for op, *args in tape.nodes:
            leaf = ca.SX(args[0]) if op == "const" else blocks[args[0]][args[1]] if op == "input" else None
            values.append(of[op](*(values[a] for a in args)) if leaf is None else leaf)
        return ca.vertcat(*(values[o] for o in outputs))

    def _step(self):
        ca, kite, n_u, P = self.ca, self.p.kite, len(self.p.kite.input_names), self.P
        z = ca.SX.sym("z", 12 if self.way == "rollout" else 12 * (1 + P))
        v, p = ca.SX.sym("v", 2 * n_u + 4), ca.SX.sym("p", P)
        c = ca.SX(self.p.c)
        for j, place in enumerate(self._places()):
            c[place] = p[j]
        u0, u1, recorded = v[:n_u], v[n_u : 2 * n_u], v[2 * n_u :]
        X, S = z[:12], ca.reshape(z[12:], 12, P) if self.way != "rollout" else None
        h = self.s.dt
        # the derivative once, as a function: the step calls it four times
        x, sp, u = ca.SX.sym("x", 12), ca.SX.sym("sp", 4), ca.SX.sym("u", n_u)
        rates = self._replay(kite.derivative, x=ca.vertcat(x, sp), u=u, c=c)
        law = ca.Function("law", [x, sp, u], [self._replay(loop(self.p.law, kite, 0.0), x=ca.vertcat(x, sp), u=u, c=ca.SX(self.p.c))])
        held, um = law(X, recorded, u0), (u0 + u1) / 2
        if self.way != "recursion":
            f = ca.Function("f", [x, sp, u, p], [rates])
            after = _rk4(lambda at, y: f(y, held, (u0, um, u1)[at], p), X, h)
            if self.way == "rollout":
                return ca.Function("step", [z, v, p], [after])
            S_after = ca.jtimes(after, ca.vertcat(X, p), ca.vertcat(S, ca.SX.eye(P)))
            return ca.Function("step", [z, v, p], [ca.vertcat(after, ca.vec(S_after))])
        f = ca.Function("f", [x, sp, u, p], [rates, ca.jacobian(rates, x), ca.jacobian(rates, sp), ca.jacobian(rates, p)])
        slope = ca.Function("slope", [x, sp, u], [ca.jacobian(law(x, sp, u), x)])
        d_held = ca.mtimes(slope(X, recorded, u0), S)

        def augmented(at, y):
            r, A, H, B = f(y[:, 0], held, (u0, um, u1)[at], p)
            return ca.horzcat(r, ca.mtimes(A, y[:, 1:]) + ca.mtimes(H, d_held) + B)

        return ca.Function("step", [z, v, p], [ca.vec(_rk4(augmented, ca.horzcat(X, S), h))])

    def _as_c(self, step, folder: Path):
        name = f"step_{self.way}"
        here = Path.cwd()
        os.chdir(folder)
        try:
            generator = self.ca.CodeGenerator(f"{name}.c")
            generator.add(step)
            generator.generate()
            command = ["gcc", "-O3", "-march=native", "-fPIC", "-shared", f"{name}.c", "-o", f"{name}.so"]
            subprocess.run(command, check=True, timeout=600)
        finally:
            os.chdir(here)
        return self.ca.external("step", str(folder / f"{name}.so"))

    def __call__(self):
        return self.runs[self.threads](*self.arguments)

    def answer(self) -> np.ndarray:
        """(K, N, 12, 1 + P): states after each step, and their derivatives"""
        z = np.array(self())
        return z.reshape(-1, 12, len(self.s), self.s.steps).transpose(2, 3, 1, 0)


def _rk4(derivative, y, h):
    k1 = derivative(0, y)
    k2 = derivative(1, y + h / 2 * k1)
    k3 = derivative(1, y + h / 2 * k2)
    k4 = derivative(2, y + h * k3)
    return y + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)


# --- measuring ---


def _seconds(run: Callable) -> float:
    begun = time.perf_counter()
    run()
    return time.perf_counter() - begun


def interleaved(runs: dict[str, Callable], rounds: int, ours: str = "awes") -> dict[str, float]:
    """Median seconds of each; ours runs around every other one."""
    found = {name: [] for name in runs}
    for _ in range(rounds):
        for name, run in runs.items():
            if name != ours:
                found[ours] += [_seconds(runs[ours]) for _ in range(3)]
                found[name].append(_seconds(run))
    found[ours] += [_seconds(runs[ours]) for _ in range(3)]
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
        seconds[n] = _seconds(run)
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
    from awescli.estimation.question import ask, simulator_of
    from awescli.estimation.staged_fit import Flown, fit_flights
    from awescli.flightlog.loops import find_loops
    from awescli.flightlog.split import split
    from awescli.simulation.campaign_flights import dev_like

    flight = dev_like(read_kite(HERE.parent / "data" / "kites" / "development.yaml"), 2)
    parts = split(find_loops(flight.log))
    seconds = []
    for _ in range(rounds):
        begun = time.perf_counter()
        question = ask(simulator_of(flight.declared, flight.log), flight.log, parts, 5.0, tuple(flight.log.measured))
        fit_flights([Flown(question, flight.log, parts)], (1.0, 2.5))
        seconds.append(time.perf_counter() - begun)
    return float(np.median(seconds)), len(question.fitted.segments), len(question.kite.parameters.free)


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
    name = "scipy approx_fprime over solve_ivp, segment by segment"
    runs[name], scale[name] = lambda: scalar.jacobian(part), SEGMENTS / len(part)
    extra[name] = ("150 / 300", _difference(scalar.jacobian(part)[:, :, theirs], J[[SEGMENTS // 2]][:, :, rows]), "-")
    lanes = ScipyPeer(problem, ARRAYS)
    name = "scipy, all segments and perturbed copies in one solve_ivp"
    runs[name] = lambda: lanes.jacobian_in_one(s)
    extra[name] = ("-", _difference(lanes.jacobian_in_one(s)[:, :, theirs], J[:, :, rows]), "-")
    missing = []
    rolled = {}
    if importlib.util.find_spec("casadi"):
        gcc = shutil.which("gcc")
        for way, note in (("forward", "its forward sensitivities"), ("recursion", "dS/dt = A S + B written by hand")):
            for c, asked in ((None, "20 / 40"), (folder, "2.5 / 6")):
                if c and not gcc:
                    missing.append("gcc: not installed")
                    continue
                peer = CasadiPeer(problem, s, way, c)
                name = f"CasADi {'generated C' if c else 'virtual machine'}, {note}, {peer.threads} thread{'s' * (peer.threads > 1)}"
                runs[name] = peer
                difference = _difference(peer.answer()[:, :, theirs, 1:], J[:, 1:, rows])
                extra[name] = (asked if way == "forward" else "-", difference, f"{peer.first:.3g} s")
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
        if asked != "-":
            report.note(f"Jacobian, times {name.partition(',')[0]}", ratio, asked)
        report.row(name, _ms(seconds), ratio, asked, difference if isinstance(difference, str) else f"{difference:.0e}", before)
    report.add(*(f"\n{m}" for m in missing))
    report.add(
        "", f"scipy: RK45, rtol 1e-6, {scalar.evaluations} evaluations a segment, the law in every stage instead of held, which is faster "
        "(a loop and an integrator of its own: hence the difference, to which finite differences add theirs); segment by segment it runs "
        f"on floats, on one segment, scaled to {SEGMENTS}. Compared in the {len(SAME)} states that are also outputs, "
        "relative to the largest value of each column. awes also computes its 23 outputs at every sample.",
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
            found[name].append(_seconds(run))
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
