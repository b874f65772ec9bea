"""One spelling of elementary functions for floats, arrays, tensors and recorded scalars."""

import numpy as np
import pytest
import torch

from awescli.engine.record import evaluate, record
from awescli.notation import scalars

ONE = ("sin", "cos", "tan", "exp", "log", "sqrt", "tanh", "asin")


@pytest.mark.parametrize("name", ONE)
def test_every_kind_of_number_gives_the_same(name):
    """Guards physics that differs by caller: float, array, tensor and tape must agree to rounding."""
    f, x = getattr(scalars, name), np.array([0.11, 0.5, 0.93])
    expected = getattr(np, {"asin": "arcsin"}.get(name, name))(x)
    tape, out = record(lambda x: [f(x[0])], x=1)
    assert [f(v) for v in x.tolist()] == pytest.approx(expected, rel=1e-15)
    assert f(x) == pytest.approx(expected, rel=1e-15)
    assert f(torch.tensor(x)).numpy() == pytest.approx(expected, rel=1e-15)
    assert [evaluate(tape, out, x=[v])[0] for v in x] == pytest.approx(expected, rel=3e-15)


def test_atan2_takes_y_first():
    """Guards the order of arguments for every kind, mixed ones included."""
    y, x = np.array([1.0, -1.0, 0.5]), np.array([0.2, -0.3, -2.0])
    expected = np.arctan2(y, x)
    assert [scalars.atan2(a, b) for a, b in zip(y.tolist(), x.tolist(), strict=True)] == pytest.approx(expected)
    assert scalars.atan2(y, x) == pytest.approx(expected)
    assert scalars.atan2(torch.tensor(y), torch.tensor(x)).numpy() == pytest.approx(expected)
    tape, out = record(lambda x: [scalars.atan2(x[0], x[1])], x=2)
    assert evaluate(tape, out, x=[-1.0, -0.3])[0] == expected[1]


def test_select_maximum_and_absolute():
    """Guards the branch on every kind: > 0 takes the first, 0 the second; torch's own `select` method must not be called."""
    p, a, b = np.array([1.0, 0.0, -2.0]), np.array([1.0, 2.0, 3.0]), np.array([10.0, 20.0, 30.0])
    expected = np.array([1.0, 20.0, 30.0])
    assert [scalars.select(*v) for v in zip(p.tolist(), a.tolist(), b.tolist(), strict=True)] == expected.tolist()
    assert (scalars.select(p, a, b) == expected).all()
    assert (scalars.select(torch.tensor(p), torch.tensor(a), torch.tensor(b)).numpy() == expected).all()
    assert (scalars.select(torch.tensor(p), 1.0, 2.0).numpy() == [1, 2, 2]).all()
    assert scalars.select(1.0, torch.tensor(3.0), 2.0) == 3.0
    assert (scalars.maximum(p, 0.5) == np.maximum(p, 0.5)).all() and (scalars.absolute(p) == np.abs(p)).all()


def test_complex_numbers_pass_through():
    """Guards the complex step, which every smooth part of the physics offers."""
    for name in ("sin", "cos", "exp", "log", "sqrt", "tanh"):
        f, h = getattr(scalars, name), 1e-200
        slope = np.imag(f(np.complex128(0.4 + h * 1j))) / h
        assert slope == pytest.approx((f(0.4 + 1e-6) - f(0.4 - 1e-6)) / 2e-6, rel=1e-9)
