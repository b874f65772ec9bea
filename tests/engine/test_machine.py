"""Compiled code against plain floats, its Jacobian against complex step, finite differences and its own reverse."""

import ctypes

import numpy as np
import pytest
from engine.expressions import ARITHMETIC, SMOOTH, random_function

from awescli.engine.adjoint import compile_reversible
from awescli.engine.machine import LANES, compile_program, evaluate
from awescli.engine.record import evaluate as on_tape
from awescli.engine.record import record
from awescli.notation.scalars import absolute, maximum, select

N_X, N_U, N_C = 4, 2, 3


def lanes(seed):
    random = np.random.default_rng(seed)
    return tuple(random.uniform(0.2, 2.0, (n, LANES)) for n in (N_X, N_U, N_C))


def call(address, *arguments):
    """Call a compiled function: arrays by address, whole numbers, doubles."""
    kinds = {np.ndarray: ctypes.c_void_p, int: ctypes.c_int64, float: ctypes.c_double}
    function = ctypes.CFUNCTYPE(None, *(kinds[type(a)] for a in arguments))(address)
    function(*(a.ctypes.data if isinstance(a, np.ndarray) else a for a in arguments))


def linearise(program, address, rows, x, u, c):
    """(y, E) of one call of a compiled `linearised` or `rates`: E (rows, n_x + n_wrt + 1, LANES)."""
    y, E = np.full((program.n_y, LANES), np.nan), np.zeros((rows, program.n_x + len(program.wrt) + 1, LANES))
    call(address, *(np.ascontiguousarray(a, dtype=float) for a in (x, u, c)), y, E)
    return y, E


def tangent(program, x, u, c, S, parameter_of):
    """(y, dS) = (f, df/dx S + df/dc): S (n_x, columns, LANES)."""
    y, E = linearise(program, program.linearised, program.n_y, x, u, c)
    S, dS = np.ascontiguousarray(S, dtype=float), np.empty((program.n_y, S.shape[1], LANES))
    call(program.columns, E, S, dS, S.shape[1], np.asarray(parameter_of, dtype=np.int64))
    return y, dS


def jacobian(program, x, u, c):
    """(n_y, n_x + n_wrt, LANES) by identity seeds."""
    S = np.zeros((program.n_x, program.n_x + len(program.wrt), LANES))
    S[: program.n_x, : program.n_x] = np.eye(program.n_x)[:, :, None]
    parameter_of = np.r_[np.full(program.n_x, len(program.wrt)), np.arange(len(program.wrt))]
    return tangent(program, x, u, c, S, parameter_of)[1]


@pytest.mark.parametrize("seed", range(8))
def test_arithmetic_is_exact_on_every_lane(seed):
    """Guards against fused or reordered operations, and against lanes that mix: + - * / sqrt select are right to the last bit."""
    f = random_function(seed, ops=80, allowed=(*ARITHMETIC, "select"))
    x, u, c = lanes(seed)
    y = evaluate(compile_program(f, N_X, N_U, N_C, linearised=False), x, u, c)
    tape, out = record(f, x=N_X, u=N_U, c=N_C)
    for lane in range(LANES):
        assert y[:, lane].tolist() == on_tape(tape, out, x=x[:, lane], u=u[:, lane], c=c[:, lane])


@pytest.mark.parametrize("seed", range(8))
def test_compiled_functions_are_the_functions(seed):
    """Guards the printed calls (argument order of atan2, sign of neg): everything to rounding of the approximations."""
    f = random_function(seed, ops=60)
    x, u, c = lanes(seed)
    y = evaluate(compile_program(f, N_X, N_U, N_C, linearised=False), x, u, c)
    expected = np.array([f(*(a[:, lane].tolist() for a in (x, u, c))) for lane in range(LANES)]).T
    # 60 operations of a few units in the last place each, values of order one
    assert np.abs(y - expected).max() < 1e-13


@pytest.mark.parametrize("seed", range(6))
def test_the_jacobian_is_that_of_the_complex_step(seed):
    """Guards every smooth derivative rule and the vertex elimination: complex step has no truncation error to hide behind."""
    f = random_function(seed, ops=50, allowed=SMOOTH)
    x, u, c = lanes(seed)
    J = jacobian(compile_program(f, N_X, N_U, N_C, range(N_C)), x, u, c)
    for lane in range(LANES):
        z = [*x[:, lane].astype(complex), *u[:, lane].astype(complex), *c[:, lane].astype(complex)]
        for column, i in enumerate([*range(N_X), *range(N_X + N_U, N_X + N_U + N_C)]):
            moved = list(z)
            moved[i] += 1e-200j
            d = np.imag(f(moved[:N_X], moved[N_X : N_X + N_U], moved[N_X + N_U :])) / 1e-200
            assert J[:, column, lane] == pytest.approx(d, rel=1e-11, abs=1e-12)


@pytest.mark.parametrize("seed", range(6))
def test_the_jacobian_is_that_of_finite_differences(seed):
    """Guards atan2 and select, which complex step cannot reach."""
    f = random_function(100 + seed, ops=50)
    x, u, c = lanes(seed)
    program = compile_program(f, N_X, N_U, N_C, range(N_C))
    J, h = jacobian(program, x, u, c), 1e-5
    for block, column in [(x, i) for i in range(N_X)] + [(c, i) for i in range(N_C)]:
        saved = block[column].copy()
        block[column] = saved + h
        above = evaluate(program, x, u, c)
        block[column] = saved - h
        below = evaluate(program, x, u, c)
        block[column] = saved
        d = (above - below) / (2 * h)
        where = column + (N_X if block is c else 0)
        # h^2 truncation and 1e-16/h rounding, both below 1e-9; a kink inside h hits at most a lane in thousands
        assert np.abs(J[:, where] - d).max() < 1e-7


def test_a_tangent_carries_seeds_and_adds_only_the_parameters_that_are_asked_for():
    """Guards dS = df/dx S + df/dc: columns of no parameter must stay out, and S must be multiplied from the right side."""
    f = random_function(3, ops=40)
    program = compile_program(f, N_X, N_U, N_C, range(N_C))
    x, u, c = lanes(3)
    J = jacobian(program, x, u, c)
    S = np.random.default_rng(0).standard_normal((N_X, 5, LANES))
    y, dS = tangent(program, x, u, c, S, [3, 3, 3, 3, 1])
    expected = np.einsum("ijl,jcl->icl", J[:, :N_X], S)
    expected[:, 4] += J[:, N_X + 1]
    assert np.abs(dS - expected).max() < 1e-13 * np.abs(expected).max()
    assert np.array_equal(y, evaluate(program, x, u, c))


@pytest.mark.parametrize("seed", range(3))
def test_a_step_of_the_columns_is_the_derivative_of_the_step(seed):
    """Guards the four stages, their weights, and what is held: S after the step is that of S by complex step through the same step."""
    f, h, held = random_function(seed, ops=40, allowed=SMOOTH, outputs=3), 0.2, 1
    program = compile_program(f, N_X, N_U, N_C, range(N_C), rows=(0, 1, 2), rates=N_X - held)
    x, u, c = lanes(seed)
    S = np.random.default_rng(seed).standard_normal((N_X, 4, LANES))

    def step(x, c, keep=None):
        """One Runge-Kutta step from x (4, LANES), whose last component is held."""
        rates = lambda x: np.array([f(x[:, lane], u[:, lane], c[:, lane]) for lane in range(LANES)]).T  # noqa: E731
        stages = [x]
        for far in (h / 2, h / 2, h):
            k = rates(stages[-1])
            stages.append(np.concatenate([x[:-1] + far * k, x[-1:]]))
        if keep is not None:
            keep += stages
        k = [rates(z) for z in stages]
        return x[:-1] + h / 6 * (k[0] + 2 * k[1] + 2 * k[2] + k[3])

    stages = []
    step(x, c, stages)
    E = [linearise(program, program.rates, N_X - held, z, u, c)[1] for z in stages]
    after = S.copy()
    call(program.step, *E, after, 4, np.array([0, N_C, 2, 1]), h)
    for column, parameter in enumerate((0, None, 2, 1)):
        moved = c.astype(complex)
        if parameter is not None:
            moved[parameter] += 1e-200j
        d = np.imag(step(x + 1e-200j * S[:, column], moved)) / 1e-200
        assert after[:-1, column] == pytest.approx(d, rel=1e-11, abs=1e-12)
    assert np.array_equal(after[-1], S[-1])


def test_only_what_is_asked_for_is_differentiated():
    """Guards the order of rows: rates first, then some outputs, whose columns begin behind the rates in E."""
    f = random_function(5, ops=40)
    x, u, c = lanes(5)
    J = jacobian(compile_program(f, N_X, N_U, N_C, range(N_C)), x, u, c)
    program = compile_program(f, N_X, N_U, N_C, range(N_C), rows=(0, 1, 4, 2), rates=2)
    y, E = linearise(program, program.linearised, 4, x, u, c)
    assert E[:, :-1] == pytest.approx(J[[0, 1, 4, 2]], rel=1e-11, abs=1e-12) and (E[:, -1] == 0).all()
    first, only = linearise(program, program.rates, 2, x, u, c)
    assert np.array_equal(only[:2], E[:2]) and np.array_equal(first[:2], y[:2]) and np.isnan(first[2:]).all()
    S, dS = np.ascontiguousarray(np.eye(N_X)[:, :, None] * np.ones(LANES)), np.empty((2, N_X, LANES))
    call(program.columns, np.ascontiguousarray(E[2:]), S, dS, N_X, np.full(N_X, N_C))
    assert np.array_equal(dS, E[2:, :N_X])


@pytest.mark.parametrize("seed", range(6))
def test_what_rates_leave_behind_changes_no_output(seed):
    """Guards the halves of a linearised program: what its outputs take from the rates is what they would compute, to the last bit; entries
    are those of a program in one piece."""
    f = random_function(seed, ops=60, allowed=(*ARITHMETIC, "select"))
    x, u, c = lanes(seed)
    whole, halves = (compile_program(f, N_X, N_U, N_C, range(N_C), rates=rates) for rates in (0, 2))
    y, E = linearise(halves, halves.linearised, halves.n_y, x, u, c)
    assert np.array_equal(y, evaluate(halves, x, u, c))
    assert E == pytest.approx(linearise(whole, whole.linearised, whole.n_y, x, u, c)[1], rel=1e-12, abs=1e-14)


@pytest.mark.parametrize("order", range(8))
def test_an_output_takes_nothing_that_formed_fma_in_a_derivative(order):
    """Guards an output that is the derivative of a rate, in whichever order that is written: read from there, it would be rounded less."""

    def f(x, u, c):
        a, b = x[0] * x[1], x[0] * x[2]
        p, q = (b * x[1], x[1] * b)[order & 1], (a * x[2], x[2] * a)[order >> 1 & 1]
        return [a * b, p + q if order < 4 else q + p]

    x, u, c = lanes(3)
    halves = compile_program(f, N_X, N_U, N_C, rates=1)
    assert np.array_equal(linearise(halves, halves.linearised, 2, x, u, c)[0], evaluate(halves, x, u, c))


@pytest.mark.parametrize("seed", range(4))
def test_the_reverse_is_the_transposed_tangent(seed):
    """Guards reverse accumulation: w' (J v) = v' (J' w) for the same recorded function."""
    f = random_function(seed, ops=50)
    x, u, c = lanes(seed)
    J = jacobian(compile_program(f, N_X, N_U, N_C, ()), x, u, c)
    program = compile_reversible(f, N_X, N_U, N_C)
    w = np.random.default_rng(seed).standard_normal((J.shape[0], LANES))
    v = np.empty((N_X, LANES))
    ctypes.CFUNCTYPE(None, *[ctypes.c_void_p] * 5)(program.adjoint)(*(a.ctypes.data for a in (x, u, c, w, v)))
    assert v == pytest.approx(np.einsum("ijl,il->jl", J, w), rel=1e-11, abs=1e-12)


def test_the_derivative_of_a_select_is_that_of_the_chosen_side():
    """Guards against a derivative through the condition, and against 0 * inf from the side that was not taken."""
    f = lambda x, u, c: [select(x[0], x[0] * x[0], -3.0 * x[0]), maximum(x[0], 0.5), absolute(x[1]), select(x[0], x[0].sqrt(), x[0])]  # noqa: E731
    program = compile_program(f, 2, 0, 0)
    x = np.zeros((2, LANES))
    x[:, 0], x[:, 1], x[:, 2] = (2.0, -1.0), (-2.0, 3.0), (0.0, 0.0)
    J = jacobian(program, x, np.zeros((0, LANES)), np.zeros((0, LANES)))
    assert J[:3, 0, 0].tolist() == [4.0, 1.0, 0.0] and J[2, 1, 0] == -1.0
    assert J[:3, 0, 1].tolist() == [-3.0, 0.0, 0.0] and J[2, 1, 1] == 1.0
    assert J[0, 0, 2] == -3.0 and J[2, 1, 2] == -1.0  # at the kink: the "otherwise" side


def test_an_output_that_is_an_input_or_feeds_another_output():
    """Guards two special cases of the elimination: outputs are never eliminated, even where they are inner vertices."""
    f = lambda x, u, c: [x[0], x[0] * c[0], (x[0] * c[0]) * x[1], 7.0]  # noqa: E731
    program = compile_program(f, 2, 0, 1, (0,))
    x, c = np.full((2, LANES), 3.0), np.full((1, LANES), 5.0)
    J = jacobian(program, x, np.zeros((0, LANES)), c)[:, :, 0]
    assert J.tolist() == [[1, 0, 0], [5, 0, 3], [15, 15, 9], [0, 0, 0]]


def test_the_cache_knows_a_changed_function(tmp_path, monkeypatch):
    """Guards caching by content: same text same object, another constant another result, a lost cache only costs time."""
    monkeypatch.setenv("AWES_CACHE", str(tmp_path / "cache"))
    objects = tmp_path / "cache" / "objects"
    one = np.ones((1, LANES))

    def run(factor):
        return evaluate(compile_program(lambda x, u, c: [factor * x[0].sin()], 1, 1, 1, linearised=False), one, one, one)[0, 0]

    first = run(2.0)
    kept = sorted(objects.iterdir())
    assert run(2.0) == first and sorted(objects.iterdir()) == kept and len(kept) == 1
    assert run(3.0) == pytest.approx(1.5 * first, rel=1e-15)
    assert len(list(objects.iterdir())) == 2
    for file in objects.iterdir():
        file.unlink()
    assert run(2.0) == first
    monkeypatch.setenv("AWES_CACHE", "/proc/nowhere")
    assert run(5.0) == pytest.approx(2.5 * first, rel=1e-15)
