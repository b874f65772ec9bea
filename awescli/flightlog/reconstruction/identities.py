"""What one group of channels says of another: attitude of rates, position of velocity, velocity of acceleration. Each as a Series.

Let a channel be measured as y_m = y + drift + white, and its rate of change as x_m = x + bias + white. Then y_m less the integral of x_m
holds no motion: only the drift and the white noise of the one, the bias and the random walk of the other, and the delay between them times
the rate of change (Jategaonkar, Flight Vehicle System Identification, ch. 10; Klein & Morelli, ch. 10). Linear, so nothing is iterated.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.ndimage import uniform_filter1d

from awescli.flightlog.quality import white_noise
from awescli.flightlog.reconstruction.gauss_markov import Law, Series
from awescli.flightlog.reconstruction.levels import Known
from awescli.flightlog.reconstruction.motion_of import Motion, turn, turned_by

STEEP = np.deg2rad(80.0)
"""Pitch beyond which roll and yaw are not distinguished."""
MEMORY = 6.0
KNOWN = 0.005
"""Spread of the logarithm of white noise that differences have shown."""
WIDE = 1.0
"""Spread of the logarithm of what is known of drifts: a factor of 2.7."""

DELAYS = {"delay": ("late", "late_quick"), "acceleration delay": ("acceleration late", "acceleration late_quick")}
"""Delay -> its shapes: of all motion, and of quick motion alone, which is zero of a delay."""
IRONS, IRON = ("iron sin", "iron cos"), 0.05
"""rad: prior of the parts of a heading's error that go with the sine and the cosine of the heading, as iron near a compass makes them."""
TILTS, TILTED = ("tilt x", "tilt y", "tilt z"), 0.03
"""rad: prior of how far gyros, or accelerometers, are turned against the axes of the attitude: told as no error, and taken for none."""
FILTERED = 0.1
"""s: prior of the delay of an acceleration, by its filter; on a straight flight it is that of the velocity with the other sign."""
SMOOTH = 1.0
"""s over which a channel is smoothed for what its own scale does."""
SLOW = 2.0
"""s: motion that is slower is separated from motion that is quicker, for a delay delays both alike."""


@dataclass(frozen=True)
class Lag:
    """A lag of first order with its standard deviation [s]; clear: worth more than what a flight's answer to gusts may pass for."""

    size: float
    std: float
    clear: bool


@dataclass(frozen=True)
class Identity:
    """A Series with what it is made of. channels: the m measured ones; laws: of its states, at their start, with `known` of white levels,
    laws and memories; drifts: law -> channels that drift; moved: of `DELAYS`, what was taken out before [s]; asks: what is reported beside
    the columns, as sums of columns with weights; white_by_differences: white noise was found by them beforehand; lag: how slowly the sensor
    answers, as far as it was asked; singly: error of one signal (`scale X`, `offset X`) -> (n, m) what a unit of it adds, a shape where it
    is asked."""

    name: str
    channels: tuple[str, ...]
    series: Series
    white: tuple[float, ...]
    laws: tuple[Law, ...]
    known: tuple[Known, ...]
    drifts: dict[str, tuple[str, ...]]
    moved: Mapping[str, float] = field(default_factory=dict)
    asks: tuple[tuple[str, dict[str, float]], ...] = ()
    white_by_differences: bool = False
    lag: Lag | None = None
    singly: Mapping[str, np.ndarray] = field(default_factory=dict)


def attitude_of_rates(motion: Motion, late: float = 0.0) -> Identity:
    """Euler angles less the integrated rates. Shapes: biases of p, q, r, how far the gyros are turned, and the delay of the
    attitude beyond `late` [s].

    Small rotations e in NED, R_true = exp(e) R_measured, go on by e' = e + log(R exp(w dt) R'^T) - dt R (bias + noise), R as measured.
    """
    w = motion.three("p", "q", "r")
    w = _delayed(motion, w, late) if late else w
    R, angles = motion.rotation, motion.three("phi", "theta", "psi")
    after, R_after = np.concatenate([w[1:], w[-1:]]), np.concatenate([R[1:], R[-1:]])
    # second term of the Magnus series: rates that change their axis within a step
    moved = motion.steps(w) + motion.dt**2 / 12 * np.cross(w, after)
    last = np.append(motion.restart[1:], True)
    turned = np.where(last[:, None], 0.0, turned_by(R @ turn(moved) @ R_after.transpose(0, 2, 1)))
    phi, theta, psi = angles.T
    s_t, c_t, s_p, c_p, zero = np.sin(theta), np.cos(theta), np.sin(psi), np.cos(psi), 0 * phi
    safe = np.where(np.abs(c_t) < 0.05, 0.05, c_t)
    # NED rotation of a unit error of phi, theta, psi is the column of J; this is its inverse
    rows = [[c_p / safe, s_p / safe, zero], [-s_p, c_p, zero], [c_p * s_t / safe, s_p * s_t / safe, zero + 1]]
    to_euler = np.array(rows).transpose(2, 0, 1)
    y = -np.einsum("nij,nj->ni", to_euler, motion.run(turned))
    bias, tilted = -to_euler @ motion.run(motion.steps(R)), to_euler @ _tilted(motion, w)
    rates = np.einsum("nij,nj->ni", to_euler, np.einsum("nij,nj->ni", R, w))
    seen = motion.seen("phi", "theta", "psi") & (np.abs(theta) < STEEP)[:, None]
    X = np.concatenate([bias, tilted, _delays(motion, rates)], axis=2)
    H = np.concatenate([np.repeat(np.eye(3)[None], len(motion), 0), to_euler], axis=2)
    deg = np.pi / 180
    laws = (
        Law("roll and pitch drift", (0, 1), 0.3 * deg, MEMORY),
        Law("yaw drift", (2,), 0.5 * deg, MEMORY),
        Law("rate noise", (3, 4, 5), _noise(motion, ("p", "q", "r"), 0.05 * deg) * np.sqrt(motion.dt)),
    )
    series = Series(y, X, H, seen, motion.restart, motion.time, ("p", "q", "r", *TILTS, *DELAYS["delay"]),
                    np.array([*[0.5] * 3, *[TILTED] * 3, 0.5, 0.5]))  # fmt: skip
    drifts = {"roll and pitch drift": ("phi", "theta"), "yaw drift": ("psi",)}
    own = motion.run(motion.steps(R * w[:, None, :]))
    singly = {f"scale {n}": -np.einsum("nij,nj->ni", to_euler, own[:, :, i]) for i, n in enumerate(("p", "q", "r"))}
    singly |= _scales(motion, ("phi", "theta"))
    # of a pitch angle alone: what a roll angle has added is a tilt about the body's x
    singly["offset theta"] = np.einsum("nij,nj->ni", to_euler, _from_begin(motion, _level_axis(motion)))
    found = _identity("attitude", ("phi", "theta", "psi"), series, laws, drifts, 0.002 * deg)
    return replace(found, moved={"delay": late}, singly=singly)


def position_of_velocity(motion: Motion, late: float = 0.0) -> Identity:
    """Position less the integrated velocity. Shapes: constant errors of the velocity, and the delay of the position beyond `late` [s]."""
    v = motion.three("v_n", "v_e", "v_d")
    place = motion.run(motion.steps(v))
    if late:
        place, v = _delayed(motion, place, late), _delayed(motion, v, late)
    X = np.concatenate([_drift_in_time(motion), _delays(motion, v)], axis=2)
    laws = (
        Law("position drift", (0, 1, 2), 0.3, MEMORY),
        Law("velocity noise", (3, 4, 5), _noise(motion, ("v_n", "v_e", "v_d"), 0.005) * np.sqrt(motion.dt)),
    )
    channels = ("p_n", "p_e", "p_d")
    series = Series(
        _from_begin(motion, motion.three(*channels) - place), X, _two_states(motion), motion.seen(*channels), motion.restart, motion.time,
        ("v_n", "v_e", "v_d", *DELAYS["delay"]), np.array([0.5, 0.5, 0.5, 1.0, 1.0]),
    )  # fmt: skip
    found = _identity("position", channels, series, laws, {"position drift": channels}, 0.0005)
    return replace(found, moved={"delay": late}, singly=_scales(motion, channels[:2]))


def velocity_of_acceleration(motion: Motion, late: float = 0.0, filtered: float = 0.0) -> Identity:
    """Velocity less the integrated acceleration, turned by the attitude. Shapes: biases of a_x, a_y, a_z, of the heading (the
    same everywhere, and with its own sine and cosine), how far the accelerometers are turned, the delay of the acceleration beyond
    `filtered` and that of the velocity beyond `late` [s].

    An acceleration late by tau is turned by the attitude of now: it misses tau (R a - int R' a dt), a velocity late by tau tau R a alone.
    """
    a, R = motion.three("a_x", "a_y", "a_z"), motion.rotation
    a = _delayed(motion, a, -filtered) if filtered else a
    ahead = np.einsum("nij,nj->ni", R, a)
    gained = motion.run(motion.steps(ahead))
    turned = np.zeros_like(ahead)
    turned[:-1] = np.einsum("nij,nj->ni", R[1:] - R[:-1], (a[1:] + a[:-1]) / 2)
    missed = ahead - motion.run(np.where(np.append(motion.restart[1:], True)[:, None], 0.0, turned))
    if late:
        gained, ahead = _delayed(motion, gained, late), _delayed(motion, ahead, late)
    # a heading that is too large turns the acceleration clockwise
    sideways = np.stack([-ahead[:, 1], ahead[:, 0], 0 * ahead[:, 2]], axis=1)
    psi = motion.log["psi"][motion.rows]
    shares = np.stack([np.ones(len(motion)), np.sin(psi), np.cos(psi)])
    heading = -np.stack([motion.run(motion.steps(sideways * share[:, None])) for share in shares], axis=2)
    tilted = _tilted(motion, a)
    if late:
        tilted = np.stack([_delayed(motion, tilted[:, :, i], late) for i in range(3)], axis=2)
    delays = [-_delays(motion, missed), _delays(motion, ahead)]
    X = np.concatenate([-motion.run(motion.steps(R)), heading, tilted, *delays], axis=2)
    wobble = np.deg2rad(0.2) * np.sqrt((ahead**2).mean())
    laws = (
        Law("velocity drift", (0, 1, 2), 0.1, MEMORY),
        Law("acceleration noise", (3, 4, 5), np.hypot(_noise(motion, ("a_x", "a_y", "a_z"), 0.02), wobble) * np.sqrt(motion.dt)),
    )
    channels = ("v_n", "v_e", "v_d")
    series = Series(
        _from_begin(motion, motion.three(*channels) - gained), X, _two_states(motion), motion.seen(*channels),
        motion.restart, motion.time,
        ("a_x", "a_y", "a_z", "heading", *IRONS, *TILTS, *DELAYS["acceleration delay"], *DELAYS["delay"]),
        np.array([2.0, 2.0, 2.0, 0.5, *[IRON] * 2, *[TILTED] * 3, *[FILTERED] * 2, 0.5, 0.5]),
    )  # fmt: skip
    # a drift here is that of the velocity, or of the attitude times the acceleration: it is nobody's
    found = _identity("velocity", channels, series, laws, {}, 0.0005)
    # errors of attitude times acceleration are no random walk: the white noise is what differences of high order leave
    white = tuple(max(white_noise(series.y[:, i], series.seen[:, i]) or w, 0.0005) for i, w in enumerate(found.white))
    known = (*(Known(w, KNOWN) for w in white), *found.known[len(white) :])
    moved = {"delay": late, "acceleration delay": filtered}
    of_accelerations = -motion.run(motion.steps(R * a[:, None, :]))
    singly = {f"scale {n}": of_accelerations[:, :, i] for i, n in enumerate(("a_x", "a_y", "a_z"))}
    singly |= _scales(motion, channels[:2])
    singly["offset theta"] = -motion.run(motion.steps(np.cross(_level_axis(motion), ahead)))
    return replace(found, white_by_differences=True, white=white, known=known, moved=moved, singly=singly)


def _identity(
    name: str, channels: tuple[str, ...], series: Series, laws: Sequence[Law], drifts: dict[str, tuple[str, ...]], least: float
) -> Identity:
    white = tuple(max(_first_white(series, i), least) for i in range(len(channels)))
    known = [Known(w, 1.5) for w in white] + [Known(law.level, 0.5 if law.walks else WIDE) for law in laws]
    known += [Known(law.memory, WIDE) for law in laws if not law.walks]
    return Identity(name, channels, series, white, tuple(laws), tuple(known), drifts)


def _first_white(series: Series, i: int) -> float:
    """White noise of a series from its structure function: E (y(t + l) - y(t))^2 = 2 white^2 + slope l for short l."""
    y = series.y[series.seen[:, i], i]
    first, second = ((np.median(np.abs(y[k:] - y[:-k])) * 1.4826) ** 2 for k in (1, 2))
    return float(np.sqrt(max(first - second / 2, 0.05 * first)))


def _noise(motion: Motion, names: Sequence[str], least: float) -> float:
    """White noise of inputs, by their differences: quadratic mean."""
    found = [white_noise(motion.log[n][new], motion.log.valid[new]) for n in names if (new := motion.log.is_new(n)).any()]
    return max(float(np.sqrt(np.mean([f**2 for f in found if f is not None] or [0.0]))), least)


def _tilted(motion: Motion, x: np.ndarray) -> np.ndarray:
    """(n, 3, 3): what turning the axes of a vector x (n, 3), body, by a unit about each of them adds to its integral, NED."""
    return np.stack([motion.run(motion.steps(np.einsum("nij,nj->ni", motion.rotation, np.cross(axis, x)))) for axis in np.eye(3)], axis=2)


def _delays(motion: Motion, rate: np.ndarray) -> np.ndarray:
    """(n, 3, 2): minus the rate of change (n, 3), which is what a delay takes away per second; and the same of the quick motion alone."""
    ends = np.flatnonzero(motion.restart)[1:]
    slow = np.concatenate([uniform_filter1d(part, max(int(SLOW / motion.dt), 1), axis=0, mode="nearest") for part in np.split(rate, ends)])
    return -np.stack([rate, rate - slow], axis=2)


def _drift_in_time(motion: Motion) -> np.ndarray:
    """(n, 3, 3): what a constant error of a rate leaves on each of three axes."""
    return motion.run(motion.steps(np.ones(len(motion))))[:, None, None] * np.eye(3) * -1.0


def _scales(motion: Motion, names: Sequence[str]) -> dict[str, np.ndarray]:
    """`scale X` -> (n, 3) what a unit of it too much adds, of some channels of an identity, each on its own axis; smooth: its noise is in
    the channel, too, and would pass for a part of it (errors in variables; Fuller, Measurement Error Models, 1987, ch. 1)."""
    smooth = motion.smoothed(motion.three(*names), SMOOTH)
    return {f"scale {name}": _from_begin(motion, smooth[:, [i]] * np.eye(3)[i]) for i, name in enumerate(names)}


def _level_axis(motion: Motion) -> np.ndarray:
    """(n, 3) the axis, NED, about which a rotation turns where its pitch angle alone changes (Beard & McLain 2012, ch. 2)."""
    psi = motion.log["psi"][motion.rows]
    return np.stack([-np.sin(psi), np.cos(psi), 0 * psi], axis=1)


def _from_begin(motion: Motion, y: np.ndarray) -> np.ndarray:
    """y (n, 3) less its first value in each stretch: a random walk that begins anywhere sees no difference, and rounding stays small."""
    return y - y[np.maximum.accumulate(np.where(motion.restart, np.arange(len(motion)), 0))]


def _two_states(motion: Motion) -> np.ndarray:
    """(n, 3, 6): each series is seen through a drift and a random walk."""
    return np.repeat(np.concatenate([np.eye(3), np.eye(3)], axis=1)[None], len(motion), 0)


def _delayed(motion: Motion, x: np.ndarray, late: float) -> np.ndarray:
    """x (n, 3) as it was `late` seconds before, within each stretch (held at its ends)."""
    out = x.copy()
    bounds = [*np.flatnonzero(motion.restart), len(motion)]
    for a, b in zip(bounds, bounds[1:], strict=False):
        t = np.arange(b - a) * motion.dt
        for i in range(x.shape[1]):
            out[a:b, i] = np.interp(t - late, t, x[a:b, i])
    return out
