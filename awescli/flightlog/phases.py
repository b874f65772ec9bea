"""What the kite is doing at every sample: ground, hover, traction, retraction, or transition; flight, where it flies free of a line."""

import numpy as np
from scipy.ndimage import median_filter

from awescli.flightlog.clocks import moving_average
from awescli.flightlog.log import FlightLog, runs_of

PHASES = ("ground", "hover", "traction", "retraction", "transition", "flight")

GROUND_SPEED = 2.0
"""m/s: slower, and low, is standing (a hovering kite drifts and climbs faster, a GPS at rest shows 0.1)."""

GROUND_HEIGHT = 15.0
"""m above the winch: launchers and masts are lower."""

FLYING_SPEED = 8.0
"""m/s over ground: slower than a wing in crosswind flight, faster than a climb on rotors."""

FLYING_AIRSPEED = 12.0
"""m/s by the pitot tube: a wing on its way in against the wind is slow over ground, but no rotor craft hovers so fast."""

ROLLING = 5.0
"""m above or below where it started: within, a fast aircraft without a line rolls, takes off or lands, with the ground in its equations."""

SLACK = 0.15
"""Share of the flight's high tension (95th percentile): below, a slow kite hangs on its rotors, a fast one is between phases."""

REEL_IN = -0.7
"""m/s of the range: faster inward is retraction; tension control within a loop stays above (smoothed over LOOP)."""

LOOP = 5.0
"""s of smoothing of speed, range rate and tension: about half a loop, so that a loop does not fall into phases."""

SHORTEST = 3.0
"""s: a phase is longer; shorter ones belong to what is around them."""


def phases(log: FlightLog) -> np.ndarray:
    """(N,) array of names out of PHASES; all "transition" where the log has no position or velocity."""
    if not all(name in log.measured for name in ("p_n", "p_e", "p_d", "v_n", "v_e", "v_d")):
        return np.full(len(log), "transition", dtype="<U10")
    if not log.on_line:
        return _of_free_flight(log)
    width = max(1, int(round(LOOP / log.dt)))
    speed = moving_average(np.sqrt(log["v_n"] ** 2 + log["v_e"] ** 2 + log["v_d"] ** 2), width)
    inward = moving_average(range_rate(log), width) < REEL_IN
    if "tension" in log.measured:
        tension = moving_average(log["tension"], width)
        pulled = tension > SLACK * np.percentile(log["tension"], 95)
        working = pulled if log["tension"].max() > 0 else np.ones(len(log), bool)
    else:
        working = np.ones(len(log), bool)
    low = -log["p_d"] < GROUND_HEIGHT
    fast = moving_average(log["V_a"], width) > FLYING_AIRSPEED if "V_a" in log.measured else np.zeros(len(log), bool)
    flying = (speed > FLYING_SPEED) | ((working | fast) & ~low)
    code = np.full(len(log), PHASES.index("transition"))
    code[~flying] = PHASES.index("hover")
    code[~flying & low & (speed < GROUND_SPEED)] = PHASES.index("ground")
    code[flying & working & ~inward] = PHASES.index("traction")
    code[flying & inward] = PHASES.index("retraction")
    return np.array(PHASES)[_without_short(code, max(1, int(round(SHORTEST / log.dt))))]


def _of_free_flight(log: FlightLog) -> np.ndarray:
    """Phases of a log without a line: flight where air or ground pass fast and the ground is away, else hover or ground."""
    width = max(1, int(round(LOOP / log.dt)))
    speed = moving_average(np.sqrt(log["v_n"] ** 2 + log["v_e"] ** 2 + log["v_d"] ** 2), width)
    if "V_a" in log.measured:
        speed = np.maximum(speed, moving_average(log["V_a"], width))
    fast, away = speed > FLYING_SPEED, np.abs(log["p_d"]) > ROLLING
    code = np.full(len(log), PHASES.index("ground"))
    code[~fast & (-log["p_d"] > GROUND_HEIGHT)] = PHASES.index("hover")
    code[fast & away] = PHASES.index("flight")
    return np.array(PHASES)[_without_short(code, max(1, int(round(SHORTEST / log.dt))))]


def apart_from_changes(labels: np.ndarray, dt: float) -> np.ndarray:
    """(N,) bool: samples so far from a change of phase, and from both ends of the flight, that what is smoothed over LOOP cannot have
    misplaced a change past them."""
    around, near = int(round(LOOP / 2 / dt)), np.zeros(len(labels), bool)
    for edge in (0, *(np.flatnonzero(labels[1:] != labels[:-1]) + 1), len(labels)):
        near[max(edge - around, 0) : edge + around] = True
    return ~near


def phase_durations(labels: np.ndarray, dt: float) -> dict[str, float]:
    """Seconds spent in every phase that occurs, in the order of PHASES."""
    return {name: float((labels == name).sum() * dt) for name in PHASES if (labels == name).any()}


def range_rate(log: FlightLog) -> np.ndarray:
    """d|p|/dt (N,) m/s from the position alone, whose lag against the velocity would otherwise show as reeling."""
    distance = np.sqrt(log["p_n"] ** 2 + log["p_e"] ** 2 + log["p_d"] ** 2)
    return np.gradient(median_filter(distance, 5, mode="nearest"), log.dt)


def _without_short(code: np.ndarray, shortest: int) -> np.ndarray:
    """Runs of one code shorter than `shortest` samples take the code of the longer neighbour."""
    code = code.copy()
    while True:
        edges = np.flatnonzero(np.diff(code)) + 1
        first, last = np.concatenate([[0], edges]), np.concatenate([edges, [code.size]])
        length = last - first
        short = np.flatnonzero(length < shortest)
        if short.size == 0 or length.size == 1:
            return code
        # all runs that are shorter than both neighbours at once: each pass at least removes the shortest run of all
        padded = np.concatenate([[code.size + 1], length, [code.size + 1]])
        smallest = short[(length[short] <= padded[short]) & (length[short] <= padded[short + 2])]
        # neighbours are not both changed in one pass, else two would swap codes
        smallest = smallest[np.concatenate([[True], np.diff(smallest) > 1])]
        for k in smallest:
            left, right = (length[k - 1] if k else -1), (length[k + 1] if k + 1 < length.size else -1)
            code[first[k] : last[k]] = code[first[k - 1]] if left >= right else code[first[k + 1]]


def runs_of_phase(labels: np.ndarray, name: str) -> np.ndarray:
    """(K, 2) half-open sample ranges of one phase."""
    return runs_of(labels == name)
