"""Are position, velocity and heading in the frames they are said to be in? A frame that another one beats by far is refused by name."""

from collections.abc import Iterable, Mapping

import numpy as np

from awescli.flightlog.motion import IN_WORDS, changes, columns_of, frame_fits
from awescli.flightlog.resample import usable_stamps
from awescli.notation.errors import BadInput, BadInputs

WRONG = 0.25
"""Share of the speed by which a velocity misses the change of position, from which its frame is doubted ..."""
RIGHT = 0.25
"""... if another frame's misfit is at most this share of that."""
FAST = 15.0
"""m/s over ground from which a wing points where it goes, but for the wind."""
ASTRAY, ALONG = 0.3, 0.8
"""Mean cosine between heading and course: as it is, and as it would be with another heading, for the heading to be refused."""
FEWEST = 50

POSITION, VELOCITY = ("p_n", "p_e", "p_d"), ("v_n", "v_e", "v_d")


def check_frames(
    seconds: np.ndarray,
    signals: Mapping[str, np.ndarray],
    places: Mapping[str, tuple[str, str]],
    believed: Iterable[str],
    frames: Mapping[str, str],
    cure: str,
) -> None:
    """Raise BadInput(s) where another frame fits far better than the one that was declared.

    seconds: (N,) stamps; signals: quantity -> (N,) SI, NED as read, NaN where missing; places: quantity -> (where, column); believed:
    columns that are not to be doubted; frames: `position`, `velocity` -> declared frame (default NED); cure: what to do, with {column}.
    """
    rows, _ = usable_stamps(seconds)
    s = {name: values[rows] for name, values in signals.items()}
    # a heading cannot be judged by a velocity that is wrong itself
    found = _velocity(seconds[rows], s, frames) or _heading(s)
    errors = []
    for quantity, why, do in found:
        where, column = places.get(quantity, (quantity, quantity))
        if column not in believed:
            errors.append(BadInput(why, where, f"{do} {cure.format(column=column, unit='')}".strip()))
    if errors:
        raise errors[0] if len(errors) == 1 else BadInputs(errors)


Finding = tuple[str, str, str]  # quantity, why, what to do


def _velocity(seconds: np.ndarray, s: Mapping[str, np.ndarray], frames: Mapping[str, str]) -> list[Finding]:
    """The velocity against the change of position, each read in every frame."""
    if not {*POSITION, *VELOCITY} <= s.keys():
        return []
    position, velocity = (np.array([s[n] for n in names]) for names in (POSITION, VELOCITY))
    # which of the two is at fault: a kite flies above its winch
    speed = np.sqrt((velocity**2).sum(0))
    flying = (speed > 0.5 * np.nanmedian(speed)) & np.isfinite(position[2])
    below = bool(flying.any() and np.median(position[2][flying]) > 5.0)
    group, quantity = ("position", "p_n") if below else ("velocity", "v_n")
    declared = frames.get(group, "NED")
    if declared == "BODY":
        return []
    change, mean = changes(seconds, position, velocity)
    # the change of a position is a vector as the velocity is: whichever is doubted is read anew
    moved, fixed = (change, mean) if below else (mean, change)
    fits = frame_fits(fixed, columns_of(declared, moved)) if moved.shape[1] else {}
    if not fits:
        return []
    as_read, best = fits[declared], min(fits.values(), key=lambda f: f.misfit)
    if as_read.share < WRONG or best.misfit > RIGHT * as_read.misfit:
        return []
    why = (
        f"read as {declared} the {group} misses the {'velocity' if below else 'change of position'} by {as_read.misfit:.2g} m/s, "
        f"as {best.frame} ({IN_WORDS[best.frame]}) it fits to {best.misfit:.2g} m/s"
    )
    if below:
        why += f"; read as {declared} the kite flies {np.median(position[2][flying]):.0f} m below its winch"
    do = f"Write `frame: {best.frame}`."
    if best.frame not in ("NED", "ENU"):
        do = f"The columns hold {IN_WORDS[best.frame]}: map them so in signals."
    return [(quantity, why, do)]


def _heading(s: Mapping[str, np.ndarray]) -> list[Finding]:
    """The heading against the course over ground, as it is and counted otherwise."""
    if not {"psi", *VELOCITY} <= s.keys():
        return []
    speed, course = np.hypot(s["v_n"], s["v_e"]), np.arctan2(s["v_e"], s["v_n"])
    fast = (speed > FAST) & np.isfinite(s["psi"])
    if fast.sum() < FEWEST or np.ptp(np.unwrap(course[fast])) < 2 * np.pi:
        return []
    psi, course = s["psi"][fast], course[fast]
    others = {
        "counted from east and counter-clockwise (or north and east are exchanged in position and velocity)": np.pi / 2 - psi,
        "counted counter-clockwise": -psi,
        "90 deg ahead": psi - np.pi / 2,
        "90 deg behind": psi + np.pi / 2,
        "that of the tail": psi + np.pi,
    }
    as_read = float(np.cos(psi - course).mean())
    says, best = max(((word, float(np.cos(other - course).mean())) for word, other in others.items()), key=lambda f: f[1])
    if as_read > ASTRAY or best < ALONG:
        return []
    off, left = (np.degrees(np.arccos(np.clip(c, -1, 1))) for c in (as_read, best))
    why = f"the heading lies {off:.0f} deg off the course on average; it fits to {left:.0f} deg if it is {says}"
    return [("psi", why, "A heading counts clockwise from north; write its `sign` and `offset`, or the frame of position and velocity.")]
