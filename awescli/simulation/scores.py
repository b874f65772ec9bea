"""NRMSE and relatives: one metric per function. Arrays are (K, N) or (K, N, ...): segments, samples."""

import numpy as np

from awescli.notation.angles import wrap
from awescli.notation.quantities import ANGLES


def error(measured: np.ndarray, simulated: np.ndarray, name: str) -> np.ndarray:
    """measured - simulated; differences of angles wrapped to (-pi, pi]."""
    difference = measured - simulated
    return wrap(difference) if name in ANGLES else difference


def rmse(e: np.ndarray) -> float:
    """Root of the mean squared error, in the quantity's unit."""
    return float(np.sqrt(np.mean(e * e)))


def span(measured: np.ndarray, name: str) -> float:
    """y_max - y_min of the measured signal; of an angle that wraps around, of its unwrapped-to-one-turn values (2 pi at most)."""
    return float(np.ptp(measured)) or 1.0


def nrmse(e: np.ndarray, measured_span: float) -> float:
    """RMSE / (y_max - y_min) (seed, section 6)."""
    return rmse(e) / measured_span


def r_squared(e: np.ndarray, measured: np.ndarray) -> float:
    """1 - sum e^2 / sum (y - mean y)^2."""
    total = float(np.sum((measured - measured.mean()) ** 2))
    return 1 - float(np.sum(e * e)) / total if total else 0.0


def theil(e: np.ndarray, measured: np.ndarray, simulated: np.ndarray) -> float:
    """Theil's inequality coefficient: RMSE / (RMS measured + RMS simulated) (Jategaonkar, Flight Vehicle System Identification, ch. 11)."""
    return rmse(e) / (rmse(measured) + rmse(simulated) or 1.0)
