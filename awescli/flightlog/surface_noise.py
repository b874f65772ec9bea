"""Control surfaces that were read with noise, as potentiometers read them. What a record says beside a smooth motion is noise where the
kite does not answer it; where it does, the surface moved."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.ndimage import uniform_filter1d

from awescli.flightlog.log import FlightLog, Unknown
from awescli.flightlog.smooth_motion import AVERAGE, SmoothMotion, density, hardest, lasting, likeliest, not_known, roughness, step_of
from awescli.notation.quantities import CONTROL_SURFACES

LEAST_NOISE = np.radians(0.05)
"""[rad] of noise that no kite feels: a surface with less is left as it is, to the bit."""

GUESS = (0.005, 10.0)
"""[rad], [rad/s3] noise, and the jerk of the surface, from where the search sets out."""

LEAST, MOST = (1e-5, 1e-2), (0.5, 1e6)
"""Bounds of the search."""

SHORTEST = 20.0
"""[s] of a log from which anything is said of its surfaces."""

ANSWER = 0.2
"""[s] within which a kite answers a surface, actuators included."""

APART = 2.0
"""[s] by which the record is turned, at least, for what chance does."""

CHANCE = 0.01
"""Probability with which chance would be answered as much: less, and the surface moved."""

SLOWER = 3.0
"""Samples that what is not known of the motion must last: a motion as quick as the noise cannot be told from it. Commands of AP2 and Thor,
which have no noise, come to 1.3 to 2.6, a potentiometer's 0.1 deg on a kite's rudder to 4 and more."""

LASTING = 0.75
"""Share of the noise that may outlast `AVERAGE`, for it to be called one."""

BENT = 10.0
"""Times the noise that a record may be off the motion anywhere: more, and a surface that steps, as flaps do from phase to phase, is bent.
No rate may answer a flap. The quickest move of a development flight's rudder comes to 6 in 0.3 deg of noise, a step of 10 deg to 14."""

COARSE = np.radians(0.2)
"""[rad] Steps from which on a record is coarse: what it rounds off goes with the motion, and comes again in every loop."""


def with_smooth_surfaces(log: FlightLog) -> FlightLog:
    """The log with the smooth motion of its surfaces in their place, and what is not known of it, where they were read with noise; as it
    is, otherwise."""
    rates = [log[n] for n in "pqr" if n in log]
    if not rates or log.valid.sum() * log.dt < SHORTEST:
        return log
    rough = [n for n in CONTROL_SURFACES if n in log.inputs and roughness(log[n][log.valid]) >= LEAST_NOISE]
    inputs, notes, unknown = dict(log.inputs), [], {}
    for name in rough:
        motion = smooth_surface(log[name], log.dt, log.valid & log.is_new(name))
        if motion is None or answered(log[name] - motion[0], rates, log.dt, log.valid) < CHANCE:
            continue
        inputs[name], noise, unknown[name] = motion
        said = f"The {name} was read with noise of {np.degrees(noise):.2f} deg, which the kite does not answer"
        notes.append(f"{said}: its smooth motion stands in its place.")
    return replace(log, inputs=inputs, notes=(*log.notes, *notes), unknown={**log.unknown, **unknown}) if notes else log


def smooth_surface(signal: np.ndarray, dt: float, seen: np.ndarray) -> tuple[np.ndarray, float, Unknown] | None:
    """(the likeliest motion (N,), the noise [rad] beside it, what is not known of the motion) of a signal (N,) at `dt` [s] whose third
    derivative is white noise and that was recorded with noise, both levels by marginal likelihood; None where what is beside a smooth
    motion is too little, or no noise. seen: (N,) bool, where it was recorded.
    """
    if seen.sum() * dt < SHORTEST:
        return None
    rows, never = np.arange(len(signal)), np.zeros(len(signal), bool)
    signal = np.where(seen, signal, np.interp(rows, rows[seen], signal[seen]))
    part = hardest(signal, dt)
    some = SmoothMotion.of(signal[part], np.zeros(len(rows[part])), dt, seen[part], never[part])
    noise, jerk = likeliest(lambda levels: some.solve(np.array([levels[0], 1.0, levels[1]]))[0], GUESS, LEAST, MOST)
    deviance, motion = SmoothMotion.of(signal, np.zeros(len(rows)), dt, seen, never).solve(np.array([noise, 1.0, jerk]))
    left = signal - motion
    if not np.isfinite(deviance) or noise < LEAST_NOISE:
        return None
    if lasting(left, dt, seen)[0] > LASTING * noise or np.abs(left[seen]).max() > BENT * noise:
        return None
    unknown = not_known(noise, jerk, dt, density(left[seen]))
    if unknown.memory < SLOWER * dt:
        return None
    coarse = step_of(signal[seen]) >= COARSE  # smoothing takes nothing off what comes again in every loop
    return motion, float(noise), replace(unknown, std=float(noise)) if coarse else unknown


def answered(left: np.ndarray, rates: Sequence[np.ndarray], dt: float, valid: np.ndarray) -> float:
    """Probability with which chance would correlate the changes of angular rates so much with what a record says beside a smooth motion,
    within `ANSWER` after it: how often the record, turned by any time, does.

    left (N,); rates: each (N,); valid: (N,) bool.
    """
    width, later = max(3, int(round(AVERAGE / dt))), int(round(ANSWER / dt)) + 1
    left, total = np.where(valid, left, 0.0), np.zeros(len(left))
    for rate in rates:
        change = np.diff(rate, append=rate[-1])
        change = np.where(valid & np.roll(valid, -1), change - uniform_filter1d(change, width), 0.0)
        found = np.fft.irfft(np.fft.rfft(change) * np.conj(np.fft.rfft(left)), len(left))
        total += found**2 / max(float(change @ change), 1e-300)
    turns = np.arange(0, len(left), later)
    within = np.add.reduceat(total, turns)
    far = within[(turns * dt > APART) & (turns * dt < len(left) * dt - APART)]
    return float((1 + np.count_nonzero(far >= within[0])) / (1 + len(far)))
