"""Recording: what stands on the tape is what the function computes."""

import math

import numpy as np
import pytest
from engine.expressions import random_function

from awescli.engine.record import Tape, evaluate, record
from awescli.notation.scalars import select


@pytest.mark.parametrize("seed", range(30))
def test_the_tape_computes_what_the_function_computes(seed):
    """Guards simplification and constant folding: they may not change a single bit of a plain evaluation."""
    f = random_function(seed, ops=60)
    random = np.random.default_rng(seed)
    tape, outputs = record(f, x=4, u=2, c=3)
    x, u, c = (random.uniform(0.2, 2.0, n).tolist() for n in (4, 2, 3))
    # tan and tanh are recorded by their formulae: none are in these functions
    assert evaluate(tape, outputs, x=x, u=u, c=c) == [float(y) for y in f(x, u, c)]


def test_equal_expressions_are_recorded_once():
    """Guards hash-consing: sin(x) used twice must cost once."""
    tape, _ = record(lambda x: [x[0].sin() * x[0].sin(), x[0].sin()], x=1)
    assert [n[0] for n in tape.nodes].count("sin") == 1


def test_constants_are_folded():
    """Guards the promise that what is declared constant costs nothing."""
    tape, (out,) = record(lambda x: [x[0] * 0.0 + tape_constant(x) * 3.0], x=1)
    assert tape.nodes[out] == ("const", 6.0)


def tape_constant(x):
    return x[0].tape.constant(4.0).sqrt()


@pytest.mark.parametrize("number", [0.0, 1.0, -1.0, 2.0])
def test_simpler_is_equal(number):
    """Guards every rule of simplification (x + 0, 1 * x, x / -1, 0 - x, ...): the value may not change, and 0 and 1 must cost nothing."""

    def f(x):
        a = x[0]
        opposite = -a
        twice = -opposite
        return [a + number, number + a, a - number, number - a, a * number, number * a, number / a, -(a * number), twice]

    for x in (3.7, -0.4):
        tape, out = record(f, x=1)
        assert evaluate(tape, out, x=[x]) == f([x])
        if number:
            tape, out = record(lambda x: [x[0] / number], x=1)
            assert evaluate(tape, out, x=[x]) == [x / number]
    product, (out,) = record(lambda x: [x[0] * number], x=1)
    assert product.nodes[out][0] == {0.0: "const", 1.0: "input", -1.0: "neg", 2.0: "mul"}[number]


def test_zero_has_one_sign():
    """Guards against a result that depends on whether 0.0 or -0.0 was met first."""
    tape = Tape()
    assert tape.constant(-0.0).index == tape.constant(0.0).index
    assert math.copysign(1.0, tape.nodes[tape.constant(-0.0).index][1]) == 1.0


def test_a_branch_on_a_recorded_scalar_is_refused():
    """Guards against physics that silently freezes one branch into the program."""
    with pytest.raises(TypeError, match="select"):
        record(lambda x: [x[0] if x[0] else 0.0], x=1)
    with pytest.raises(TypeError, match="whole"):
        record(lambda x: [x[0] ** 0.5], x=1)


def test_select_takes_the_other_side_at_zero():
    """Guards the convention of `select` on tapes and on floats: > 0, not >= 0."""
    tape, out = record(lambda x: [select(x[0], 1.0, 2.0)], x=1)
    for value in (-1.0, 0.0, 1.0):
        assert evaluate(tape, out, x=[value]) == [select(value, 1.0, 2.0)] == [1.0 if value > 0 else 2.0]
