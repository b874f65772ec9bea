"""reconstruct: the flight path of a log from its kinematics, without any model of forces.

    path = reconstruct(log);  path.noise, path.errors, path.findings

The noise and the errors of all channels, from five identities between them (`identities.py`, `air.py`), each solved in O(n) (`solve.py`).
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from awescli.flightlog.held import stands
from awescli.flightlog.log import FlightLog
from awescli.flightlog.quality import white_noise
from awescli.flightlog.reconstruction import identities
from awescli.flightlog.reconstruction.air import airspeed_of_motion, recorded, vanes_of_motion, with_offset
from awescli.flightlog.reconstruction.airspeed_lag import airspeed_lag
from awescli.flightlog.reconstruction.gauss_markov import BandedLikelihood
from awescli.flightlog.reconstruction.identities import DELAYS, IRONS, TILTS, Identity
from awescli.flightlog.reconstruction.motion_of import Motion, motion_of
from awescli.flightlog.reconstruction.result import ChannelNoise, FlightPath, Level, SensorError
from awescli.flightlog.reconstruction.single_signals import LIKELY, errors_of_single_signals, solve_with_single_signals
from awescli.flightlog.reconstruction.solve import Solution, delay_by_channel, thinned
from awescli.notation.errors import NumericalFailure
from awescli.notation.present import present
from awescli.notation.quantities import ANGLES, UNITS

DEG = np.pi / 180
FEWEST, SHORTEST = 200, 10.0
"""Samples and seconds below which nothing is said."""
UNKNOWN = 0.7
"""Spread of a logarithm from which a level is not determined: a factor of four either way."""
REAL = 12.0
"""Deviance that a drift must be worth: one that is not there has two parameters to fit noise with."""
SHARE = 0.25
"""Of the white noise, below which a drift is not worth a word."""
MOVED = 0.02
"""s: a longer delay is taken out first, so that the rest is linear."""
NEAREST = 0.75
"""Samples: of a shorter delay no whole one is taken out, or two neighbours would take turns."""
PLACED = 0.01
"""Of a sample, to which interpolation places a signal in time: no delay is known better."""
SMOOTHED = 1 / 3
"""Of a delay that slow motion tells, by which quick motion may differ: receivers smooth it (UMN's Thor: by a quarter)."""
LEFT = 0.5 * DEG
"""Of an angle that is off, from which what is left of that is taken out, too."""
STEPS = 8
"""Looks at how much of a delay is left, before it counts as none."""
FAR = (-0.4, -0.2, 0.2, 0.4, 0.6, 0.8)
"""s: delays from one of which the looks begin where that is clearly likelier than none: a kite turns half a radian in half a second, and
what is linear in a delay of none says nothing of a longer one. Velocities 0.35 s late made an accelerometer seem to read 12 % low."""
DIFFERENCES_SPREAD = 1.9
"""Standard deviation of the logarithm of `quality.white_noise` times the root of the samples: the median of differences of order four."""

MATTERS = {
    "rates": 0.5 * DEG, "accelerations": 0.5, "attitude_latency": 0.03, "rate latency": 0.03, "velocity latency": 0.05,
    "acceleration latency": 0.05, "position_latency": 0.05, "attitude_bias": 2.5 * DEG, "rates turned": 2.5 * DEG,
    "accelerations turned": 5 * DEG,
    "velocity bias": 0.3, "heading_bias": 1.5 * DEG, "airspeed_scale": 0.03, "airspeed_lag": 0.25, "vane_bias": 1.5 * DEG,
}  # fmt: skip
"""Sizes from which an error changes what a model learns [SI]: those at which the library's effects begin (`source` of their parameters).
Errors of a drifting attitude pass for accelerometers that are turned by 3 deg (flights of JSBSim with an attitude that drifts by 1 deg). A
lag of the airspeed only from where gusts, to which the flight answers, do not pass for one (0.15 s on UMN's Thor)."""


def reconstruct(log: FlightLog) -> FlightPath:
    """Noise and errors of the sensors of a log, as `read_flight` gives it; empty, with a note, where the log hardly flies."""
    motion = motion_of(log)
    if motion is None or len(motion) * log.dt < SHORTEST or len(motion) < FEWEST:
        return FlightPath((), (), 0, 0, ("Nothing is flown for long enough in one piece.",))
    noise: dict[str, ChannelNoise] = {}
    errors: list[SensorError] = []
    held = [n for n in log.measured if stands(log[n][log.valid])]
    notes = [f"{', '.join(held)}: each value is held for several samples; of delays nothing is said there."] if held else []
    for name, needs, build, say in IDENTITIES:
        if any(n not in log for n in needs) or (build is _vanes and not {"alpha", "beta"} & set(log.measured)):
            continue
        try:
            compared = _compared(build, say, motion, noise)
        except NumericalFailure as e:
            notes.append(f"Of {name} nothing can be said: {e}")
            continue
        if compared is None:
            continue
        solution, off, told, motion = compared
        noise |= {n.channel: _beside_attitude(n, noise) for n in _noise(solution)}
        errors += off
        said = [_beside_velocity(e, errors) for e in told]
        if set(held) & set(needs):
            said = [replace(e, agrees=False) if e.unit == "s" else e for e in said]
        errors += said
        motion = without(motion, said)
    for channel in log.measured:
        if channel not in noise or noise[channel].white is None:
            by_differences = _by_differences(log, motion, channel)
            if by_differences is not None:
                old = noise.get(channel)
                noise[channel] = by_differences if old is None else _with_drift(by_differences, old)
    ordered = tuple(noise[c] for c in log.measured if c in noise)
    return FlightPath(ordered, tuple(errors), len(motion), int(motion.restart.sum()), tuple(notes))


def _compared(
    build: Callable[[Motion], Identity], say: Callable[[Solution], list[SensorError]], motion: Motion, noise: Mapping[str, ChannelNoise]
) -> tuple[Solution, list[SensorError], list[SensorError], Motion] | None:
    """(an identity solved, by what angles are off, its other errors, the motion without the former): what is linear in an angle is so about
    the angle without what it is off by. None where too little is seen. Raises NumericalFailure."""
    off: dict[tuple[str, ...], SensorError] = {}
    for _ in range(STEPS):
        identity = build(motion)
        if not _enough(identity):
            return None
        solution = solve_with_single_signals(identity)
        told = [_beside_drift(e, noise, motion) for e in (*errors_of_single_signals(solution), *say(solution))]
        offsets = [e for e in told if e.simple and e.unit == "rad" and set(e.acts_on) <= set(ATTITUDE)]
        # of an angle that is off by more, what is left is taken out, too
        left = [replace(e, matters=LEFT, agrees=True) if e.acts_on in off else e for e in offsets]
        more = [e for e in left if e.found]
        for e in offsets:
            if before := off.get(e.acts_on):
                off[e.acts_on] = replace(before, size=before.size + e.size, std=e.std)
            elif e.found:
                off[e.acts_on] = e
        if not more:
            others = [e for e in told if e not in offsets or e.acts_on not in off]
            return solution, list(off.values()), others, motion
        motion = without(motion, more)
    raise NumericalFailure("no_end", "what angles are off by comes to no end", do="Look at the attitude.")


AGAINST = {"heading_bias": "psi", "beta": "psi", "alpha": "theta"}
"""Error or vane -> the angle that it is measured against."""


def _beside_attitude(own: ChannelNoise, noise: Mapping[str, ChannelNoise]) -> ChannelNoise:
    """A vane is compared with an attitude that is noisy itself: its own white noise is what is left of the variance."""
    angle = noise.get(AGAINST.get(own.channel, ""))
    if angle is None or angle.white is None or own.white is None or angle.white.value > 0.9 * own.white.value:
        return own
    share = np.sqrt(1 - (angle.white.value / own.white.value) ** 2)
    return replace(own, white=Level(own.white.value * share, own.white.low * share, own.white.high * share))


def _beside_drift(error: SensorError, noise: Mapping[str, ChannelNoise], motion: Motion) -> SensorError:
    """What is measured against an attitude that drifts is known no better than the mean of that drift over the flight: angles themselves,
    and accelerations, which the drift turns away."""
    turns = error.target == "accelerations"
    angles = ("theta", "psi") if turns else (AGAINST.get(error.name) or AGAINST.get(error.target or "", ""),)
    size = float(np.sqrt((motion.three(*ACCELERATIONS) ** 2).sum(1).mean() / 3)) if turns else 1.0
    means = [
        n.drift.value * np.sqrt(min(2 * n.memory.value / (len(motion) * motion.dt), 1.0))
        for angle in angles if (n := noise.get(angle)) is not None and n.drift is not None and n.memory is not None
    ]  # fmt: skip
    return replace(error, std=float(np.sqrt(error.std**2 + sum((mean * size) ** 2 for mean in means))))


def _beside_velocity(error: SensorError, before: Sequence[SensorError]) -> SensorError:
    """A position is compared with a velocity whose delay was found, and taken out, no better than it is known."""
    moved = [e.std for e in before if e.name == "velocity latency" and e.found and error.name == "position_latency"]
    return replace(error, std=float(np.hypot(error.std, sum(moved))))


def without(motion: Motion, errors: Sequence[SensorError]) -> Motion:
    """The motion as its sensors would have logged it without the errors that were found, and without all scales that are there: what comes
    next is not to find them again. A roll angle that reads 2 % too little makes an accelerometer seem off."""
    signals = dict(motion.log.measured)
    there = [e for e in errors if e.simple and (e.found or e.name == "scale")]
    for e in there:
        for name in e.acts_on:
            if e.unit == "s":
                signal = np.unwrap(signals[name]) if name in ANGLES else signals[name]
                signals[name] = np.interp(motion.log.time + e.size, motion.log.time, signal)
            elif e.unit == "-":
                signals[name] = signals[name] / (1 + e.size)
            else:
                signals[name] = signals[name] - e.size
    return replace(motion, log=replace(motion.log, measured=signals)) if there else motion


def _moved(build: Callable[..., Identity], motion: Motion, whole: bool = False) -> Identity:
    """The identity with a delay taken out of its reference, which says how much: the delay's column is linear in it, about none or the
    likeliest of some far ones, where that is clearly likelier. As it is where that comes to no end, or makes it less likely by more than
    levels that are guesses may (one of deviance a sample): in rates in deg/s, or of another axis, some delay always takes a little of what
    is left. whole: by whole samples, as of a signal that is not integrated: between two of them noise is averaged, and half a sample
    passes for a delay."""
    begun = build(motion, 0.0)
    if not _enough(begun):
        return begun
    before = _first_look(begun, "late")[0]
    slack = thinned(begun.series, FEWEST * 10).seen.sum()
    looked = [_whole(late, motion) if whole else late for late in FAR]
    far = {late: _first_look(build(motion, late), "late")[0] for late in looked}
    nearest = min(far, key=lambda late: far[late])
    late = nearest if far[nearest] < before - slack else 0.0
    identity = build(motion, late) if late else begun
    for _ in range(STEPS):
        deviance, more = _first_look(identity, "late")
        if _near(more, motion):
            return identity if deviance <= before + slack else begun
        late += _whole(more, motion) if whole else more
        identity = build(motion, late)
    return begun


def _velocity(motion: Motion) -> Identity:
    """About the delay of the acceleration that a first look finds: its column is linear in it."""
    identity = _moved(identities.velocity_of_acceleration, motion)
    if not _enough(identity):
        return identity
    first, late = _first_look(identity, "acceleration late")
    if _near(late, motion):
        return identity
    again = _moved(partial(identities.velocity_of_acceleration, filtered=_whole(late, motion)), motion)
    return again if _first_look(again, "acceleration late")[0] < first else identity


def _near(delay: float, motion: Motion) -> bool:
    """Is a delay [s] small enough for what is linear in it?"""
    return abs(delay) < max(MOVED, NEAREST * motion.dt)


def _whole(delay: float, motion: Motion) -> float:
    """The delay [s] in whole samples."""
    return round(delay / motion.dt) * motion.dt


def _first_look(identity: Identity, column: str) -> tuple[float, float]:
    """(deviance at the levels of the start, a shape there) of some samples."""
    series = thinned(identity.series, FEWEST * 10)
    found = BandedLikelihood(series).at(np.array(identity.white), identity.laws)
    return found.deviance, float(found.beta[series.columns.index(column)])


def _enough(identity: Identity) -> bool:
    """Are there samples enough of all series to say anything?"""
    return bool(identity.series.seen.sum(0).min() >= FEWEST)


def _airspeed(motion: Motion) -> Identity:
    """About the wind that a first solution finds where nobody recorded one, and about the lag that is clearly there: the airspeed is linear
    in neither."""
    wind = _wind(motion)
    lag = airspeed_lag(motion, wind)
    return replace(airspeed_of_motion(motion, wind, lag.size if lag.clear else 0.0), lag=lag)


def _vanes(motion: Motion) -> Identity:
    """About the wind that the airspeed finds where nobody recorded one."""
    return vanes_of_motion(motion, _wind(motion))


def _wind(motion: Motion) -> np.ndarray | None:
    """(n, 3) the constant wind of the flight where nobody recorded one; else None."""
    if motion.log.wind is not None or "V_a" not in motion.log:
        return None
    wind = recorded(motion)
    for _ in range(3):
        identity = airspeed_of_motion(motion, wind)
        series = thinned(identity.series, FEWEST * 10)
        beta = BandedLikelihood(series).at(np.array(identity.white), identity.laws).beta
        wind = with_offset(wind, dict(zip(series.columns, beta, strict=True)))
    return wind


def _say_attitude(s: Solution) -> list[SensorError]:
    biases = [_error(s, n, "imu_bias", (n,), "rad/s", "rates", "rates") for n in RATES]
    roll, *turned = _turned(s, RATES, "rates turned")
    # gyros that are turned about the body's x, the other way, and a roll angle with a constant added are one
    roll = replace(roll, name="attitude_bias", target="phi", acts_on=("phi",), size=-roll.size, simple=True)
    # heading may be a compass's
    return [*biases, roll, *turned, _against("rate latency", RATES, _delay(s, "attitude_latency", ATTITUDE, agreeing=2))]


def _say_position(s: Solution) -> list[SensorError]:
    # height may be a barometer's; receivers smooth what is quick: in UMN's Thor and the AP2 slow motion alone tells what was put in
    late = _delay(s, "position_latency", ("p_n", "p_e", "p_d"), agreeing=2, slow=True)
    return [*(_error(s, n, "velocity bias", (n,), "m/s") for n in VELOCITY), late]


def _say_velocity(s: Solution) -> list[SensorError]:
    biases = [_error(s, n, "imu_bias", (n,), "m/s2", "accelerations", "accelerations") for n in ACCELERATIONS]
    # all of velocity is one receiver's, and an attitude that is wrong turns no two axes alike; no sensor reports what is yet to come
    late = _delay(s, "velocity latency", VELOCITY, agreeing=3)
    filtered = _delay(s, "acceleration latency", ACCELERATIONS, agreeing=3, of="acceleration delay")
    # what one of both takes from the other is no delay
    filtered = replace(filtered, agrees=filtered.agrees and late.agrees and filtered.size > 0)
    late = replace(late, agrees=late.agrees and late.size > 0)
    heading = _error(s, "heading", "heading_bias", ("psi",), "rad")
    return [*biases, *_turned(s, ACCELERATIONS, "accelerations turned"), heading, _iron(s), late, filtered]


def _iron(s: Solution) -> SensorError:
    """The largest error of the heading that goes round with it."""
    parts, spread = (np.array([of[c] for c in IRONS]) for of in (s.values, s.std))
    size = float(np.linalg.norm(parts))
    std = float(np.linalg.norm(parts * spread) / size) if size else float(spread.max())
    return _clear(SensorError("compass_deviation", None, ("psi",), size, std, "rad", MATTERS["heading_bias"]))


def _say_airspeed(s: Solution) -> list[SensorError]:
    # scale and offset are one at the speed that is flown
    scale = _error(s, "at flown speed", "airspeed_scale", ("V_a",), "-")
    lag = present(s.identity.lag, "the lag of the airspeed")
    return [scale, SensorError("airspeed_lag", None, ("V_a",), lag.size, lag.std, "s", MATTERS["airspeed_lag"], lag.clear)]


def _say_vanes(s: Solution) -> list[SensorError]:
    return [_error(s, n, "vane_bias", (n,), "rad", target=n) for n in s.identity.channels]


VELOCITY, ATTITUDE = ("v_n", "v_e", "v_d"), ("phi", "theta", "psi")
ACCELERATIONS, RATES = ("a_x", "a_y", "a_z"), ("p", "q", "r")
IDENTITIES: tuple[tuple[str, tuple[str, ...], Callable, Callable], ...] = (
    ("attitude and rates", (*ATTITUDE, *RATES), partial(_moved, identities.attitude_of_rates, whole=True), _say_attitude),
    ("velocity and acceleration", (*VELOCITY, *ACCELERATIONS, *ATTITUDE), _velocity, _say_velocity),
    ("position and velocity", ("p_n", "p_e", "p_d", *VELOCITY), partial(_moved, identities.position_of_velocity), _say_position),
    ("airspeed and motion", ("V_a", *VELOCITY), _airspeed, _say_airspeed),
    ("vanes and motion", (*VELOCITY, *ATTITUDE), _vanes, _say_vanes),
)
"""What is compared, the signals it needs, and how."""


def _error(
    s: Solution, column: str, name: str, acts_on: tuple[str, ...], unit: str, matters: str = "", target: str | None = None
) -> SensorError:
    return SensorError(name, target, acts_on, s.values[column], s.std[column], unit, MATTERS[matters or name])


def _turned(s: Solution, channels: tuple[str, ...], matters: str) -> list[SensorError]:
    """How far the sensor of these channels is turned against the attitude, about the body's x, y and z."""
    return [_clear(_error(s, tilt, "imu_misalignment", channels, "rad", matters, tilt.split()[1])) for tilt in TILTS]


def _clear(error: SensorError) -> SensorError:
    """An error for which a drift passes that is remembered for as long as the flight lasts: it has to be as likely as a signal that is off
    by itself. On UMN's Thor a pitch angle 1 deg off was a roll angle 5 deg off, by four standard deviations."""
    return replace(error, agrees=bool(abs(error.size) > LIKELY * error.std), simple=False)


def _delay(
    s: Solution, name: str, acts_on: tuple[str, ...], agreeing: int, of: str = "delay", slow: bool = False
) -> SensorError:
    """A delay delays all motion alike, and so many channels by themselves: what differs between slow and quick motion is none, and a roll
    angle that alone is late is no late attitude. of: which of `DELAYS`; slow: slow motion tells it, quick motion may differ by a share."""
    late, quick = DELAYS[of]
    size = s.values[late if slow else of] + s.identity.moved[of]
    alike = abs(s.values[quick]) < max(3 * s.std[quick], MOVED, SMOOTHED * abs(size) if slow else 0.0)
    own, std = delay_by_channel(s, of)
    differ = own - s.values[of]
    told = (np.abs(differ) < 3 * std + MOVED).sum()
    # channels, and slow and quick motion, differ more than what all tell together may (Birge 1932)
    scatter = 1.0 if slow else np.sqrt(max((((differ / std) ** 2).sum() + (s.values[quick] / s.std[quick]) ** 2) / len(own), 1.0))
    placed = PLACED * float(np.diff(s.identity.series.time[:2])[0])
    spread = float(np.hypot(scatter * s.std[late if slow else of], placed))
    return SensorError(name, None, acts_on, size, spread, "s", MATTERS[name], bool(alike and told >= agreeing))


def _against(name: str, channels: tuple[str, ...], delay: SensorError) -> SensorError:
    """No sensor reports what is yet to come: what seems early is measured against channels that are late."""
    if not delay.found or delay.size > 0:
        return delay
    return replace(delay, name=name, acts_on=channels, size=-delay.size)


def _noise(s: Solution) -> list[ChannelNoise]:
    """White noise and drift of the channels of an identity."""
    m, laws = len(s.identity.channels), s.levels.laws
    found = []
    remembers = [law.name for law in laws if not law.walks]
    for i, channel in enumerate(s.identity.channels):
        spread = s.levels.spread[i]
        if s.identity.white_by_differences:
            spread = DIFFERENCES_SPREAD / np.sqrt(s.identity.series.seen[:, i].sum())
        white = Level.of(s.levels.white[i], spread) if spread < UNKNOWN else None
        drift = memory = None
        for j, law in enumerate(laws):
            if channel not in s.identity.drifts.get(law.name, ()):
                continue
            if s.gain[law.name] > REAL and law.level > SHARE * s.levels.white[i]:
                drift = Level.of(law.level, s.levels.spread[m + j])
                memory = Level.of(law.memory, s.levels.spread[m + len(laws) + remembers.index(law.name)])
        found.append(ChannelNoise(channel, UNITS[channel], white, drift, memory, s.identity.name))
    return found


def _by_differences(log: FlightLog, motion: Motion, channel: str) -> ChannelNoise | None:
    """White noise of a channel that no other tells: what differences of high order leave."""
    new = log.is_new(channel)
    white = white_noise(log[channel][new], log.valid[new])
    if not white:
        return None
    return ChannelNoise(channel, UNITS[channel], Level.of(white, DIFFERENCES_SPREAD / np.sqrt(len(motion))), None, None, "differences")


def _with_drift(noise: ChannelNoise, old: ChannelNoise) -> ChannelNoise:
    return ChannelNoise(noise.channel, noise.unit, noise.white, old.drift, old.memory, noise.by)
