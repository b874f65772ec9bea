"""Dryden gusts of unit variance: what the inputs `turbulence_n/e/d` of a kite are filled with (the effect `turbulence` scales them).

A Gaussian process per axis with the Dryden autocorrelation (MIL-F-8785C, section 3.7), seen from a kite that flies through a frozen
field with airspeed V_a. The horizontal axes take the longitudinal form, the vertical axis the transversal one:

    R_long(t) = exp(-t V/L)                               x' = -x V/L + white
    R_trans(t) = (1 - t V/(2 L)) exp(-t V/L)              the form (1 + sqrt(3) s L/V) / (1 + s L/V)^2

Stepped exactly (matrix exponential and the stationary covariance), so the variance does not depend on the sampling interval and
the first sample is as turbulent as the last. Across the span the vertical gust has a gradient, the roll gust p_g (the specification's
sigma_p and corner frequency pi V / 4 b):

    R_roll(t) = exp(-t pi V / 4 b)

A kite turns and the gusts' axes do not: what is lost is the difference between the two forms.
"""

import numpy as np
from scipy.linalg import expm, solve_continuous_lyapunov

LENGTH = 150.0
"""[m] length scale at 150-300 m height (MIL-F-8785C: L = h up to 305 m for the vertical; 145 m is its low-altitude horizontal value)."""
VERTICAL_SHARE = 0.4
"""Vertical over horizontal length scale at low altitude (the specification's ratio runs from 0.2 to 1 between 60 m and 305 m)."""


def dryden(samples: int, dt: float, airspeed: float, seed: int, length: float = LENGTH, vertical_length: float | None = None) -> np.ndarray:
    """(samples, 3) gusts north, east, down of unit variance [-]. dt [s], airspeed [m/s], lengths [m]."""
    random = np.random.default_rng(seed)
    vertical = VERTICAL_SHARE * length if vertical_length is None else vertical_length
    horizontal_axes = [_shaped(*_longitudinal(airspeed / length), samples, dt, random) for _ in range(2)]
    return np.stack([*horizontal_axes, _shaped(*_transversal(airspeed / vertical), samples, dt, random)], axis=1)


def roll_gust(samples: int, dt: float, airspeed: float, span: float, seed: int) -> np.ndarray:
    """(samples,) roll gust of unit variance [-]. dt [s], airspeed [m/s], span [m]."""
    return _shaped(*_longitudinal(roll_corner(airspeed, span)), samples, dt, np.random.default_rng(seed))


def roll_corner(airspeed: float, span: float) -> float:
    """[rad/s] corner frequency of the roll gust's spectrum, and of the pitch gust's."""
    return np.pi * airspeed / (4 * span)


def yaw_corner(airspeed: float, span: float) -> float:
    """[rad/s] corner frequency of the yaw gust's spectrum."""
    return np.pi * airspeed / (3 * span)


def longitudinal(time: np.ndarray, a: float) -> np.ndarray:
    """Correlation over a time difference >= 0 [s]; a = V/L [1/s]."""
    return np.exp(-a * time)


def transversal(time: np.ndarray, a: float) -> np.ndarray:
    """Correlation over a time difference >= 0 [s]; a = V/L [1/s]."""
    return (1 - a * time / 2) * np.exp(-a * time)


def _longitudinal(a: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(A, B, C) of sqrt(2 a) / (s + a): unit variance; a = V/L [1/s]."""
    return np.array([[-a]]), np.array([[np.sqrt(2 * a)]]), np.array([1.0])


def _transversal(a: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(A, B, C) of sqrt(a) (a + sqrt(3) s) / (s + a)^2: unit variance; controller form."""
    return np.array([[0.0, 1.0], [-a * a, -2 * a]]), np.array([[0.0], [1.0]]), np.sqrt(a) * np.array([a, np.sqrt(3.0)])


def _shaped(A: np.ndarray, B: np.ndarray, C: np.ndarray, samples: int, dt: float, random: np.random.Generator) -> np.ndarray:
    """White noise through dx = A x dt + B dW, y = C x: (samples,), stationary from the first sample."""
    stationary = solve_continuous_lyapunov(A, -B @ B.T)
    F = expm(A * dt)
    step = _root(stationary - F @ stationary @ F.T)
    x = _root(stationary) @ random.standard_normal(len(A))
    y, noise = np.empty(samples), random.standard_normal((samples, len(A)))
    for k in range(samples):
        y[k] = C @ x
        x = F @ x + step @ noise[k]
    return y


def _root(covariance: np.ndarray) -> np.ndarray:
    """M with M M' = covariance, which may be singular to rounding."""
    values, vectors = np.linalg.eigh((covariance + covariance.T) / 2)
    return vectors * np.sqrt(np.maximum(values, 0.0))
