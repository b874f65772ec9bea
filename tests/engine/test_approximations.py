"""sin, cos, exp, atan2 of the compiled code against libm."""

import numpy as np
import pytest

from awescli.engine.machine import LANES, compile_program, evaluate
from awescli.notation.scalars import atan2, cos, exp, log, sin, sqrt, tanh


def compiled(function, *arguments: np.ndarray) -> np.ndarray:
    """A function of one or two scalars, compiled and run over arrays."""
    program = compile_program(lambda x, u, c: [function(*x)], len(arguments), 0, 0, linearised=False)
    n = len(arguments[0])
    padded = [np.concatenate([a, np.ones(-n % LANES)]).reshape(-1, LANES) for a in arguments]
    nothing = np.zeros((0, LANES))
    rows = [evaluate(program, np.array(block), nothing, nothing)[0] for block in zip(*padded, strict=True)]
    return np.concatenate(rows)[:n]


def units(found: np.ndarray, exact: np.ndarray) -> float:
    """Largest error in units in the last place of the exact value."""
    return float(np.max(np.abs(found - exact) / np.spacing(np.abs(exact))))


RANGES = {
    "quarter turns": np.linspace(-10, 10, 4001),
    "whole numbers of quarter turns": np.pi / 2 * np.arange(-40, 41) + 1e-3,
    "small": np.geomspace(1e-12, 1, 2000),
    "many turns": np.linspace(-1e5, 1e5, 4001),
}


@pytest.mark.parametrize("where", RANGES)
@pytest.mark.parametrize("name, function, exact", [("sin", sin, np.sin), ("cos", cos, np.cos)])
def test_sine_and_cosine(name, function, exact, where):
    """Guards quadrants and range reduction. Near a zero of the function the error is absolute: 1e-16 of the reduced argument."""
    x = RANGES[where]
    found, expected = compiled(function, x), exact(x)
    assert np.abs(found - expected).max() <= 2.3e-16
    if where == "small":
        assert units(found, expected) <= 4


def test_exponential():
    """Guards the splitting into powers of two over the whole range of doubles, and that it never overflows."""
    x = np.linspace(-700, 700, 8001)
    assert units(compiled(exp, x), np.exp(x)) <= 4
    assert np.isfinite(compiled(exp, np.array([-1e6, -800.0, 800.0, 1e6]))).all()


def test_arc_tangent_in_every_quadrant_and_on_the_axes():
    """Guards the octants of atan2: an angle of attack of 180 degrees is a sign error waiting to happen."""
    angle = np.linspace(-np.pi, np.pi, 4003)[1:-1]
    for radius in (1e-9, 1.0, 1e6):
        y, x = radius * np.sin(angle), radius * np.cos(angle)
        assert units(compiled(atan2, y, x), np.arctan2(y, x)) <= 4
    y, x = np.array([0.0, 0.0, 1.0, -1.0, 1e-300, 5.0]), np.array([1.0, -1.0, 0.0, 0.0, -1.0, 5.0])
    assert compiled(atan2, y, x) == pytest.approx(np.arctan2(y, x), rel=1e-15)


def test_logarithm_square_root_and_tanh():
    """Guards the calls that go to the processor or to libm, and tanh's saturation without overflow."""
    x = np.geomspace(1e-6, 1e6, 1000)
    assert units(compiled(log, x), np.log(x)) <= 2 and units(compiled(sqrt, x), np.sqrt(x)) == 0
    x = np.array([-1e4, -40.0, -2.0, -1e-3, 0.0, 1e-3, 2.0, 40.0, 1e4])
    assert compiled(tanh, x) == pytest.approx(np.tanh(x), abs=2e-16)
