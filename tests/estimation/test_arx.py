"""ARX: what was simulated is recovered, k steps ahead are what the closed form says, gaps are not bridged, an unstable model runs away."""

import numpy as np
import pytest
from scipy.linalg import expm

from awescli.estimation.arx import Arx, each, fitted

N = 600


def excited(n_u: int = 2, samples: int = N) -> np.ndarray:
    return np.random.default_rng(3).standard_normal((samples, n_u))


def simulated_arx(order: int, step: int, samples: int = N):
    """(weights, y, u) of an ARX system with two outputs and two inputs, simulated sample by sample from the equation itself."""
    draw = np.random.default_rng(order * 10 + step)
    own = 0.3 / order * draw.standard_normal((order, 2, 2)) - 0.4 / order * np.eye(2)
    forced, constant = draw.standard_normal((order, 2, 2)), np.array([0.1, -0.2])
    u, y = excited(samples=samples), np.zeros((samples, 2))
    y[: order * step] = draw.standard_normal((order * step, 2))
    for k in range(order * step, samples):
        change = constant.copy()
        for i in range(order):
            change += y[k - (i + 1) * step] @ own[i] + u[k - (i + 1) * step : k - i * step].mean(axis=0) @ forced[i]
        y[k] = y[k - step] + change
    return np.concatenate([*own, *forced, constant[None]]), y, u


@pytest.mark.parametrize(("order", "step"), [(1, 1), (3, 1), (2, 4)])
def test_a_simulated_arx_system_is_recovered_and_predicted(order, step):
    """Guards the regression and the simulation by the equation in the file's head, written out a second time here: without noise and
    ridge the weights return, and simulating from the middle repeats the record."""
    weights, y, u = simulated_arx(order, step)
    (model,) = each(fitted(y, u, np.ones(N, bool), order, step, (0.0,)))
    assert model.weights == pytest.approx(weights, abs=1e-8)
    H, first = model.history, 200
    ahead = model.simulate(y[None, first - H : first], u[None, first - H : first + 101])
    assert ahead[0] == pytest.approx(y[first : first + 101], abs=1e-7)


def test_k_steps_ahead_of_a_linear_system_are_the_closed_form():
    """Guards multi-step prediction against x(k) = A^k x + sum A^(k-1-i) B u_i, A = exp(F dt): a lightly damped oscillation (the dutch roll
    of a light aeroplane) and an integrator, all states measured, so that order 1 is exact."""
    F = np.array([[-0.4, 0.9, 0.0], [-9.0, -0.8, 0.0], [0.0, 1.0, 0.0]])
    A, B = expm(0.02 * F), 0.02 * np.array([[0.1, 0.0], [4.0, 1.0], [0.0, 0.2]])
    u, x = excited(), np.zeros((N, 3))
    for k in range(N - 1):
        x[k + 1] = A @ x[k] + B @ u[k]
    (model,) = each(fitted(x, u, np.ones(N, bool), 1, 1, (0.0,)))
    k, first = 60, 300
    ahead = model.simulate(x[None, first : first + 1], u[None, first : first + 1 + k])[0, -1]
    power = np.linalg.matrix_power
    closed = power(A, k) @ x[first] + sum(power(A, k - 1 - i) @ B @ u[first + i] for i in range(k))
    assert ahead == pytest.approx(closed, abs=1e-9)


def test_a_hidden_state_needs_as_many_lags_as_the_system_has_states():
    """Guards the order: of an oscillator only the position is measured; two lags are exact, one is not."""
    A, B = expm(0.05 * np.array([[0.0, 1.0], [-4.0, -0.5]])), np.array([[0.0], [0.05]])
    u, x = excited(1), np.zeros((N, 2))
    for k in range(N - 1):
        x[k + 1] = A @ x[k] + B @ u[k]
    y = x[:, :1]
    errors = {}
    for order in (1, 2):
        (model,) = each(fitted(y, u, np.ones(N, bool), order, 1, (0.0,)))
        ahead = model.simulate(y[None, 300 - order : 300], u[None, 300 - order : 341])[0]
        errors[order] = np.abs(ahead - y[300:341]).max()
    assert errors[2] < 1e-9 < 0.01 < errors[1]


def test_no_row_reaches_over_a_gap():
    """Guards gappy logs: samples that may not be used are nonsense here, and the weights return all the same."""
    weights, y, u = simulated_arx(2, 3)
    usable = np.ones(N, bool)
    usable[[50, 51, 52, 300]] = False
    y = np.where(usable[:, None], y, 1e6)
    (model,) = each(fitted(y, u, usable, 2, 3, (0.0,)))
    assert model.weights == pytest.approx(weights, abs=1e-6)
    assert fitted(y, u, np.arange(N) < 8, 2, 3, (0.0,)) is None


def test_still_columns_and_a_strong_ridge_leave_the_drift():
    """Guards normalisation: an input that never moves gets no weight; with a ridge beyond all measure what remains is the mean change."""
    t = np.arange(N)
    y, u = (0.5 * t)[:, None], np.column_stack([np.full(N, 3.0), np.sin(t)])
    strong, weak = each(fitted(y, u, np.ones(N, bool), 1, 1, (1e9, 0.0)))
    assert strong.weights[-1] == pytest.approx(0.5) and strong.weights[:-1] == pytest.approx(0, abs=1e-6)
    assert weak.weights[1] == 0.0


def test_an_unstable_model_runs_away_and_raises_nothing():
    ahead = Arx(1, 1, np.array([[9.0], [0.0], [0.0]])).simulate(np.ones((2, 1, 1)), np.zeros((2, 402, 1)))
    assert ahead[0, 2, 0] == pytest.approx(1000.0) and not np.isfinite(ahead[:, -1]).any()
