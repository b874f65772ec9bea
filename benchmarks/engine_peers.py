"""Who `engine_speed.py` compares with: the same physics flown by torchdiffeq, scipy and CasADi."""

try:  # before awescli, which asks OpenMP's threads to sleep while they wait: torch as a peer is faster without
    import torch
    from torchdiffeq import odeint
except ImportError:
    torch = None
import math
import os
import subprocess
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np
from engine_problem import COMPARED, Problem

from awescli.control.features import evaluate
from awescli.control.gaussian_law import LOWEST_EXPONENT
from awescli.engine.record import record
from awescli.notation.quantities import OUTPUTS, STATES, SURFACES
from awescli.simulation.closed_loop import loop
from awescli.simulation.rollout import Segments

CORES = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()


def driven(recorded, rudder) -> list:
    """The recorded set-points (in the order of SURFACES), the rudder's by the law."""
    return [rudder if name == "rudder" else setpoint for name, setpoint in zip(SURFACES, recorded, strict=True)]


def seconds_of(run: Callable) -> float:
    begun = time.perf_counter()
    run()
    return time.perf_counter() - begun


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
        return driven(self.SP[:, k].unbind(-1), rudder.clamp(*self.p.law.limits["rudder"]))

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
            return self.f([*x, *driven(sp, rudder)], (U[k] + (t / dt - k) * differences[k]).tolist(), c)

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
            rates = self.f([*x, *driven(SP[k], rudder)], U[k] + (t / dt - k) * (U[k + 1] - U[k]), c)
            return np.concatenate([np.broadcast_to(r, lanes) for r in rates])

        start = np.tile(s.starts, (P + 1, 1)).T.ravel()
        found = solve_ivp(right_hand_side, (0, N * dt), start, t_eval=dt * np.arange(N + 1), rtol=1e-6, atol=1e-8)
        y = found.y.T.reshape(N + 1, 12, P + 1, K)
        return np.moveaxis((y[:, :, 1:] - y[:, :, :1]) / step[:, None], -1, 0)


class CasadiPeer:
    """The recorded programs replayed on casadi.SX; one RK4 step with its sensitivities is one SX function, folded over the samples.

    way: "rollout": no sensitivities; "forward": CasADi differentiates the step in 20 directions; "recursion": dS/dt = A S + B in every
    stage, with CasADi's sparse A and B. outputs: with what awes gives, the outputs COMPARED and their sensitivities at each sample, not
    only the states after each step. generated: a folder for the step as C, gcc -O3 -march=native, instead of the virtual machine.
    """

    def __init__(self, problem: Problem, segments: Segments, way: str, generated: Path | None = None, outputs: bool = False):
        import casadi as ca

        self.ca, self.p, self.s = ca, problem, segments
        self.way, self.P, self.outputs = way, len(problem.free), outputs
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
        self.threads = min(self.runs, key=lambda n: min(seconds_of(partial(self.runs[n], *self.arguments)) for _ in range(2)))

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
        v, p = ca.SX.sym("v", 2 * n_u + len(SURFACES)), ca.SX.sym("p", P)
        c = ca.SX(self.p.c)
        for j, place in enumerate(self._places()):
            c[place] = p[j]
        u0, u1, recorded = v[:n_u], v[n_u : 2 * n_u], v[2 * n_u :]
        X, S = z[:12], ca.reshape(z[12:], 12, P) if self.way != "rollout" else None
        h = self.s.dt
        # the derivative once, as a function: the step calls it four times
        x, sp, u = ca.SX.sym("x", 12), ca.SX.sym("sp", len(SURFACES)), ca.SX.sym("u", n_u)
        rates = self._replay(kite.derivative, x=ca.vertcat(x, sp), u=u, c=c)
        law = ca.Function("law", [x, sp, u], [self._replay(loop(self.p.law, kite, 0.0), x=ca.vertcat(x, sp), u=u, c=ca.SX(self.p.c))])
        held, um = law(X, recorded, u0), (u0 + u1) / 2
        kept = (OUTPUTS.index(name) for name in COMPARED)
        reported = self._replay(kite.outputs, x=ca.vertcat(x, sp), u=u, c=c)[list(kept)]
        if self.way != "recursion":
            f, g = ca.Function("f", [x, sp, u, p], [rates]), ca.Function("g", [x, sp, u, p], [reported])
            after = _rk4(lambda at, y: f(y, held, (u0, um, u1)[at], p), X, h)
            if self.way == "rollout":
                return ca.Function("step", [z, v, p], [after])
            found = ca.vertcat(after, g(X, held, u0, p)) if self.outputs else after
            D = ca.jtimes(found, ca.vertcat(X, p), ca.vertcat(S, ca.SX.eye(P)))
            columns = ca.horzcat(found, D)
            return ca.Function("step", [z, v, p], [ca.vec(columns[:12, :]), *([ca.vec(columns[12:, :])] if self.outputs else [])])
        f = ca.Function("f", [x, sp, u, p], [rates, ca.jacobian(rates, x), ca.jacobian(rates, sp), ca.jacobian(rates, p)])
        slope = ca.Function("slope", [x, sp, u], [ca.jacobian(law(x, sp, u), x)])
        d_held = ca.mtimes(slope(X, recorded, u0), S)

        def augmented(at, y):
            r, A, H, B = f(y[:, 0], held, (u0, um, u1)[at], p)
            return ca.horzcat(r, ca.mtimes(A, y[:, 1:]) + ca.mtimes(H, d_held) + B)

        after = [ca.vec(_rk4(augmented, ca.horzcat(X, S), h))]
        if self.outputs:
            g = ca.Function("g", [x, sp, u, p], [reported, *(ca.jacobian(reported, to) for to in (x, sp, p))])
            y, C, H, D = g(X, held, u0, p)
            after.append(ca.vec(ca.horzcat(y, ca.mtimes(C, S) + ca.mtimes(H, d_held) + D)))
        return ca.Function("step", [z, v, p], after)

    def _as_c(self, step, folder: Path):
        name = f"step_{self.way}{'_outputs' if self.outputs else ''}"
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
        """(K, N, 12, 1 + P): states after each step, or outputs at each sample but the last, and their derivatives"""
        found = self()
        z = np.array(found[1] if self.outputs else found)
        return z.reshape(-1, 12, len(self.s), self.s.steps).transpose(2, 3, 1, 0)


def _rk4(derivative, y, h):
    k1 = derivative(0, y)
    k2 = derivative(1, y + h / 2 * k1)
    k3 = derivative(1, y + h / 2 * k2)
    k4 = derivative(2, y + h * k3)
    return y + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
