"""What a disturbance does to a kite, in closed form."""

import numpy as np
import pytest
from kites import DEVELOPMENT, at_point, declared

from awescli.notation.frames import rotate_back
from awescli.notation.quantities import OUTPUTS
from awescli.physics.disturbances import DISTURBANCES, FORCES, MOMENTS, PHASE, both, even, odd
from awescli.physics.kite import Kite

KITE = Kite(DEVELOPMENT)


def moved(kite: Kite, changes: dict[str, float]) -> tuple[np.ndarray, np.ndarray]:
    """By how much inputs move the derivative and the outputs."""
    x, u, c = at_point(kite)
    there = list(u)
    for name, value in changes.items():
        there[kite.input_names.index(name)] = value
    return tuple(np.array(f(x, there, c), float) - np.array(f(x, u, c), float) for f in (kite.derivative, kite.outputs))


@pytest.mark.parametrize("axis", range(3))
def test_an_angular_acceleration_is_added_and_nothing_else(axis):
    derivative, outputs = moved(KITE, {MOMENTS[axis]: 0.7})
    assert derivative == pytest.approx(np.eye(12)[9 + axis] * 0.7, abs=1e-12) and outputs == pytest.approx(np.zeros(len(OUTPUTS)), abs=1e-9)


def test_a_taut_line_answers_a_force_along_it_and_no_other():
    """A specific force e adds m (e . p) to the tension, and what is left of it across the line to the acceleration (d_t = 0: no drag, so
    that the line pulls straight)."""
    kite = Kite(declared(d_t=0.0, rtx=0.0, rty=0.0, rtz=0.0))
    x, u, c = at_point(kite)
    at, m, e = kite.instant(x, u, c), kite.parameters["m"].value, np.array([0.5, -0.3, 0.8])
    along = np.array(rotate_back(at.R, at.p_hat))
    derivative, outputs = moved(kite, dict(zip(FORCES, e, strict=True)))
    assert outputs[OUTPUTS.index("tension")] == pytest.approx(m * e @ along, rel=1e-9)
    across = e - (e @ along) * along
    assert derivative[3:6] == pytest.approx(across, abs=1e-9) and derivative[9:] == pytest.approx(0, abs=1e-9)
    assert outputs[[OUTPUTS.index(n) for n in ("a_x", "a_y", "a_z")]] == pytest.approx(across, abs=1e-9)


@pytest.mark.parametrize("name", DISTURBANCES)
def test_both_parameters_are_the_disturbance_shared_by_the_phase(name):
    """With phase s, `even` counts 1 - s and `odd` counts s: a disturbance that is linear in time from node to node."""
    x, u, c = at_point(KITE)
    size, phase = 0.3, 0.25
    signal, through = list(u), list(c)
    signal[KITE.input_names.index(name)] = size
    place = KITE.parameter_names.index
    through[place(even(name))], through[place(odd(name))] = 2.0, (size - (1 - phase) * 2.0) / phase
    there = list(u)
    there[KITE.input_names.index(PHASE)] = phase
    assert KITE.derivative(x, there, through) == pytest.approx(KITE.derivative(x, signal, c), rel=1e-12)
    assert both([name]) == (even(name), odd(name))
