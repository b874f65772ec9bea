"""Local quadratics through a sampled signal: smoothed values and rates of change (Savitzky & Golay 1964)."""

import numpy as np
from scipy.signal import savgol_filter

LEAST_SAMPLES = 5
"""A quadratic through three points smooths nothing."""


def local_quadratic(signal: np.ndarray, dt: float, span: float, derivative: int = 0) -> np.ndarray:
    """Values (derivative 0) or rates of change (1) of a signal (N, ...), by a quadratic through `span` seconds around each sample; dt [s].

    At either end the last whole window is evaluated beside its middle. A signal shorter than a window is left as it is, its rate taken from
    its differences.
    """
    window = max(LEAST_SAMPLES, 2 * int(round(span / dt / 2)) + 1)
    if len(signal) < window:
        return np.asarray(np.gradient(signal, dt, axis=0)) if derivative else signal
    return np.asarray(savgol_filter(signal, window, 2, deriv=derivative, delta=dt, axis=0))
