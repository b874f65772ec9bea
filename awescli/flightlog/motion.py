"""What position, velocity, attitude and rates say of each other: which frame and unit make them one motion. No model of a kite enters."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from awescli.notation.frames import rotate_back, rotation_body_to_ned

STRIDE = 0.4
"""s over which a change of position is compared with the velocity: noise of 0.1 m is 0.3 m/s then, a turn of 1 rad/s still smooth."""

FEWEST = 50
"""Comparisons below which nothing is said."""

ENOUGH = 20_000
"""Samples from which a median is taken: hours of flight have many more."""

FRAMES: dict[str, tuple[tuple[int, int], ...]] = {
    "NED": ((0, 1), (1, 1), (2, 1)),
    "ENU": ((1, 1), (0, 1), (2, -1)),
    "NEU": ((0, 1), (1, 1), (2, -1)),
    "END": ((1, 1), (0, 1), (2, 1)),
    "NWU": ((0, 1), (1, -1), (2, -1)),
}
"""Frame -> (column, sign) of north, east and down."""

IN_WORDS = {
    "NED": "north, east, down",
    "ENU": "east, north, up",
    "NEU": "north, east, up",
    "END": "east, north, down",
    "NWU": "north, west, up",
}


@dataclass(frozen=True)
class FrameFit:
    """How well a velocity read in a frame is the change of position: |dp/dt - scale v|, root mean square [m/s]; speed: RMS of dp/dt."""

    frame: str
    scale: float
    misfit: float
    speed: float

    @property
    def share(self) -> float:
        """Of the speed that is missed."""
        return self.misfit / max(self.speed, 1e-9)


def read_in(frame: str, columns: Sequence[np.ndarray] | np.ndarray) -> np.ndarray:
    """Three columns in a frame as (north, east, down), (3, N)."""
    return np.array([sign * columns[i] for i, sign in FRAMES[frame]])


def columns_of(frame: str, ned: Sequence[np.ndarray] | np.ndarray) -> np.ndarray:
    """The inverse of `read_in`: what the columns of a frame hold, (3, N)."""
    columns = np.empty((3, len(ned[0])))
    for value, (i, sign) in zip(ned, FRAMES[frame], strict=True):
        columns[i] = sign * value
    return columns


def changes(seconds: np.ndarray, position: np.ndarray, velocity: np.ndarray, most: int = 20_000) -> tuple[np.ndarray, np.ndarray]:
    """(change of position per second, mean velocity), (3, K) each, over STRIDE seconds; columns in whatever unit and order they have.

    seconds: (N,) rising stamps; position, velocity: (3, N), NaN where missing; most: comparisons, spread over the whole.
    """
    step = np.diff(seconds)
    dt = float(np.median(step[step > 0])) if (step > 0).any() else np.nan
    stride = 2 * max(1, int(round(STRIDE / dt / 2))) if np.isfinite(dt) else 2
    i = np.arange(0, seconds.size - stride, max(1, stride // 2))
    elapsed = seconds[i + stride] - seconds[i]
    # over gaps and strange stamps nothing is compared
    i = i[np.abs(elapsed / (stride * dt) - 1) < 0.1] if i.size else i
    i = i[:: max(1, i.size // most)]
    D = (position[:, i + stride] - position[:, i]) / (seconds[i + stride] - seconds[i])
    V = (velocity[:, i] + 4 * velocity[:, i + stride // 2] + velocity[:, i + stride]) / 6  # Simpson's rule
    good = np.isfinite(D.sum(0)) & np.isfinite(V.sum(0))
    return D[:, good], V[:, good]


def frame_fits(change: np.ndarray, velocity: np.ndarray) -> dict[str, FrameFit]:
    """Frame -> how well velocity columns (3, K) read in it are the change of position (3, K, north, east, down); empty where too little
    moves. The half of the samples that fits best counts twice over: a burst of bad cells is no frame."""
    speed = float(np.sqrt(np.median((change**2).sum(0)))) if change.shape[1] >= FEWEST else 0.0
    if speed < 1.0:
        return {}
    fits = {}
    for frame in FRAMES:
        v = read_in(frame, velocity)
        scale = _scale(change, v)
        errors = ((change - scale * v) ** 2).sum(0)
        fits[frame] = FrameFit(frame, scale, float(np.sqrt(np.median(errors))), speed)
    return fits


def _scale(change: np.ndarray, v: np.ndarray) -> float:
    """The factor that makes v the change of position, from the medians of both speeds; its sign from their product."""
    size = np.sqrt(np.median((change**2).sum(0)) / max(np.median((v**2).sum(0)), 1e-12))
    return float(size * (np.sign(np.median((change * v).sum(0))) or 1.0))


def euler_rates(phi: np.ndarray, theta: np.ndarray, psi: np.ndarray, seconds: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(p, q, r) (N,) [rad/s] that Euler angles [rad] perform, averaged over STRIDE (Beard & McLain eq. 3.3)."""
    width = max(2, int(round(STRIDE / float(np.median(np.diff(seconds))))))
    d_phi, d_theta, d_psi = (_slope(np.unwrap(angle), seconds, width) for angle in (phi, theta, psi))
    return (
        d_phi - d_psi * np.sin(theta),
        d_theta * np.cos(phi) + d_psi * np.sin(phi) * np.cos(theta),
        -d_theta * np.sin(phi) + d_psi * np.cos(phi) * np.cos(theta),
    )


def _slope(x: np.ndarray, seconds: np.ndarray, width: int) -> np.ndarray:
    """Central difference over `width` samples; at the ends over what there is."""
    i = np.arange(x.size)
    low, high = np.maximum(i - width // 2, 0), np.minimum(i + (width + 1) // 2, x.size - 1)
    return (x[high] - x[low]) / np.maximum(seconds[high] - seconds[low], 1e-9)


def forwardness(angles: Mapping[str, np.ndarray], velocity: np.ndarray) -> float:
    """Median share of the velocity (3, N, NED) that goes forward in body axes: near 1 for a wing in flight, whatever the wind."""
    thin = slice(None, None, max(1, velocity.shape[1] // ENOUGH))
    velocity = velocity[:, thin]
    R = rotation_body_to_ned(*(angles[n][thin] for n in ("phi", "theta", "psi")))
    u = rotate_back(R, tuple(velocity))[0]
    speed = np.sqrt((velocity**2).sum(0))
    fast = (speed > np.nanmedian(speed) * 0.5) & np.isfinite(u)
    return float(np.median(u[fast] / speed[fast])) if fast.sum() >= FEWEST else np.nan
