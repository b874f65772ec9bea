"""Angles: differences across a full turn, and means of directions."""

import numpy as np


def wrap(angle: np.ndarray) -> np.ndarray:
    """Angles [rad] in (-pi, pi]; those that already lie there keep every bit."""
    outside = (angle > np.pi) | (angle <= -np.pi)
    return np.where(outside, np.pi - np.mod(np.pi - angle, 2 * np.pi), angle) if np.any(outside) else angle


def mean_direction(angle: np.ndarray) -> float:
    """Direction [rad] of the sum of unit vectors at these angles: a mean that does not mind where a turn begins."""
    return float(np.arctan2(np.sin(angle).mean(), np.cos(angle).mean()))
