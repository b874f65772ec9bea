"""Does the kite answer its surfaces as declared, and pull as declared? Signs, factors and units of set-points and load, before any fit.

Equation error (Klein & Morelli, Aircraft System Identification, ch. 5): the declared model gives the derivatives of the measured states at
every sample, by numpy, without a simulation. What a surface contributes by moving is put beside the angular acceleration that the flight
shows; all other free parameters may be wrong by their declared standard deviations, and an actuator may lag. The load is
put beside what the declared air forces leave for the line.
"""

from collections.abc import Iterator, Mapping

import numpy as np
from scipy.ndimage import uniform_filter1d
from scipy.signal import lfilter

from awescli.flightlog.consistency import Check, most
from awescli.flightlog.log import FlightLog
from awescli.flightlog.phases import phases
from awescli.flightlog.smoothing import local_quadratic
from awescli.notation.quantities import ANGLES, CONTROL_SURFACES, STATES, SURFACES
from awescli.physics.declaration import KiteDeclaration
from awescli.physics.effects.aerodynamics import parse_monomial
from awescli.physics.instant import Instant
from awescli.physics.kite import Kite, has_line, surfaces_used
from awescli.simulation.rollout import inputs_of, setpoints_of

SPAN = 0.3
"""[s] over which states and their derivatives are taken: rates are smooth for so long, noise of 0.1 deg/s is 3 deg/s2 then."""

MOST = 2500
"""Samples that are looked at."""

LEAST_TIME = 5.0
"""[s] of flight below which nothing is said."""

LATE = (0.0, 0.05, 0.1, 0.2, 0.35)
"""[s] of lag that an actuator may have, unknown before any fit: the one that fits best is taken."""

TOGETHER = 0.5
"""[s] that an error of the model lasts."""

PART, WINDOW = 0.5, (2.0, 10.0)
"""Of a full turn, and [s] at least and at most: what lasts longer is not asked. A model that is wrong is so for whole phases of a flight:
with positions 0.15 s late a pumping flight's elevator, held in each phase, seemed to work five times as declared."""

ANY = 25.0
"""Standard deviation of the factor of a surface where it is held: nothing tells it from the model's error. With a line 1 % too long a
pumping flight's flaps, never moved in a phase, seemed to work the other way round."""

NEARER = 4.0
"""Bounds are wide, so that a fit may search them; the guesses between them are mostly nearer the truth, by so much."""

CONSTANT = 0.3
"""rad/s2: standard deviation of a moment that is always there: a bent wing, a mass off centre."""

KNOWN, SHOWN = 0.15, 0.25
"""Standard deviation of a factor above which, and share of what is left that a surface must explain below which nothing is judged:
where a model misses far more than the surface does, the factor is that of the model's error."""

TRAVEL, EDGE = (1.1, 2.0), 99.0
"""Times the declared travel that a set-point may reach in 99 % of the samples."""

FACTOR = (0.3, 2.2)
"""A declared derivative is a guess to some 30 %, a lag and gusts take some of it: beyond is another sign, factor or unit ..."""
NO_FACTOR = (-0.2, 4.0)
"""... and beyond, surely: a surface never works the other way round."""

LOAD = (0.65, 1.5)
"""Measured load over what the declared forces leave for the line: lift is guessed to 30 %, load cells are off by some per cent ..."""
NO_LOAD = (0.4, 2.0)
"""... and in lbf it is 2.2 times, in N 9.8, in kN 0.01 times as large."""

DO = "Look at {} in the log and in the kite file."


def declared_checks(declaration: KiteDeclaration, log: FlightLog) -> list[Check]:
    """The response to every control surface that moves, and the load on the line, where the flight shows them."""
    where = np.flatnonzero(log.valid & ~np.isin(phases(log), ("ground", "hover")))
    if log.wind is None or where.size * log.dt < LEAST_TIME or any(n not in log for n in STATES if n not in "uvw"):
        return []
    seen = _Seen(declaration, log, where[:: max(1, where.size // MOST)])
    with np.errstate(all="ignore"):  # a declaration may be so wrong that nothing finite comes of it, which is then not judged
        return [check for check in (*_travel(seen), *_responses(seen), *_load(seen)) if np.isfinite(check.value)]


class _Seen:
    """The smoothed states of a log at some samples, their derivatives, and what the declared kite makes of them."""

    def __init__(self, declaration: KiteDeclaration, log: FlightLog, rows: np.ndarray):
        self.kite, self.log, self.rows = Kite(declaration, log.recorded_wind.height), log, rows
        z = np.stack([np.unwrap(log[n]) if n in ANGLES else log[n] for n in STATES], axis=1)
        self.states, self.rates = local_quadratic(z, log.dt, SPAN)[rows], local_quadratic(z, log.dt, SPAN, derivative=1)[rows]
        self.setpoints = {0.0: self.late(0.0)}
        self.inputs = inputs_of(log, self.kite)[rows]
        self.c = list(self.kite.parameters.vector())
        self.step = log.dt * max(1.0, float(np.median(np.diff(rows))))
        turn = 2 * np.pi / max(float(np.median(np.linalg.norm(self.states[:, 9:12], axis=1))), 1e-3)
        self.window = max(3, round(float(np.clip(PART * turn, *WINDOW)) / self.step))

    def slow(self, signal: np.ndarray) -> np.ndarray:
        """What lasts longer than the window in samples (N, ...)."""
        return uniform_filter1d(signal, self.window, axis=0, mode="nearest")

    def late(self, tau: float) -> np.ndarray:
        """(N, 5) the set-points behind a lag of first order of `tau` [s], on average over the span."""
        setpoints = setpoints_of(self.log)
        if tau > 0:
            keep = np.exp(-self.log.dt / tau)
            setpoints = lfilter([1 - keep], [1, -keep], setpoints - setpoints[0], axis=0) + setpoints[0]
        return local_quadratic(setpoints, self.log.dt, SPAN)[self.rows]

    def instant(self, setpoints: np.ndarray, values: Mapping[str, float] | None = None) -> Instant:
        """The declared kite at all samples, with other set-points and values; its effects at rest where they would be."""
        c = [(values or {}).get(name, value) for name, value in zip(self.kite.parameter_names, self.c, strict=True)]
        u = list(self.inputs.T)
        own = len(self.kite.state_names) - 12
        none = [np.zeros(len(self.rows))] * own
        if own:
            none = self.kite.initial([*self.states.T, *none, *setpoints.T], u, c)
        return self.kite.instant([*self.states.T, *none, *setpoints.T], u, c)


def _travel(seen: _Seen) -> Iterator[Check]:
    """The surface that goes farthest beyond its declared travel."""
    declared = seen.kite.declaration.surfaces
    times = {}
    for name in CONTROL_SURFACES:
        if name in seen.log and name in declared:
            limit = max(abs(declared[name].lower), abs(declared[name].upper))
            if np.isfinite(limit) and limit > 0:
                times[name] = float(np.percentile(np.abs(seen.log[name][seen.rows]), EDGE)) / limit
    if times:
        worst = max(times, key=lambda name: times[name])
        sentence = f"Deflection over declared travel of the surface that goes farthest ({worst})."
        yield most("surface travel", times[worst], "times", *TRAVEL, sentence, DO.format(f"the unit of the {worst} and its limits"))


def _responses(seen: _Seen) -> Iterator[Check]:
    used = surfaces_used(seen.kite.declaration)
    moving = [s for s in CONTROL_SURFACES if s in seen.log and s in used and seen.setpoints[0][:, SURFACES.index(s)].std() > 1e-4]
    if not moving:
        return
    columns = [SURFACES.index(s) for s in moving]
    nuisances = _nuisances(seen)
    found = []
    for late in LATE:
        moved, held, missing = _effects(seen, seen.late(late), columns)
        found.append(_regressed(moved, missing, np.concatenate([nuisances, NEARER * ANY * held], axis=2), seen))
    factors, stds, shares, _ = min(found, key=lambda f: f[3])
    for surface, factor, std, share in zip(moving, factors, stds, shares, strict=True):
        yield _response(surface, float(factor), float(std), float(share))


def _effects(seen: _Seen, setpoints: np.ndarray, columns: list[int]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(what each surface contributes to the angular acceleration by moving, and by being held where it is on average, (N, 3, S) both; what
    the kite without them lacks, (N, 3))."""
    without, slow, moving, held = setpoints.copy(), seen.slow(setpoints), [], []
    without[:, columns] = 0.0
    still = _angular(seen.instant(without))
    for column in columns:
        alone, mean = without.copy(), without.copy()
        alone[:, column], mean[:, column] = setpoints[:, column], slow[:, column]
        at_mean = _angular(seen.instant(mean))
        moving.append(_angular(seen.instant(alone)) - at_mean)
        held.append(at_mean - still)
    return np.stack(moving, axis=-1), np.stack(held, axis=-1), seen.rates[:, 9:12] - still


def _nuisances(seen: _Seen) -> np.ndarray:
    """(N, 3, n): what one standard deviation of every free derivative that is no surface's, and of a constant moment, does to the angular
    acceleration. Not of the inertia: it would scale the surfaces with all else, and may take their sign."""
    kite, still = seen.kite, np.zeros((len(seen.rows), len(SURFACES)))
    terms = kite.declaration.aerodynamics.terms
    others = {p for of in terms.values() for text, p in of.items() if not {v for v, *_ in parse_monomial(text)} & set(SURFACES)}
    as_is, found = _angular(seen.instant(still)), []
    for row in kite.parameters.rows:
        std = row.std if row.std else (row.upper - row.lower) / 4
        if row.free and row.name in others and np.isfinite(std) and std > 0:
            moved = _angular(seen.instant(still, {row.name: row.value + 0.01 * std})) - as_is
            if np.abs(moved).max() > 0:
                found.append(100 * moved)
    q = np.asarray(seen.instant(still).dynamic_pressure)
    for axis in range(3):
        constant = np.zeros((len(q), 3))
        constant[:, axis] = NEARER * CONSTANT * q / q.mean()
        found.append(constant)
    return np.stack(found, axis=-1)


def _angular(at: Instant) -> np.ndarray:
    """(N, 3) angular acceleration of instants."""
    return np.stack(np.broadcast_arrays(*at.derivative[9:12]), axis=1)


def _regressed(
    effects: np.ndarray, missing: np.ndarray, nuisances: np.ndarray, seen: _Seen
) -> tuple[np.ndarray, np.ndarray, np.ndarray, float]:
    """(factors (S,), standard deviations, shares that they explain, cost) of the surfaces' effects (N, 3, S) in what is missing (N, 3),
    beside nuisances (N, 3, n) of variance 1 / NEARER^2, all beside their own mean over a window; axes weighted by what they leave, one
    error lasting for half a second."""
    surfaces = effects.shape[2]
    together = max(1.0, TOGETHER / seen.step)
    effects, missing, nuisances = (x - seen.slow(x) for x in (effects, missing, nuisances))
    prior = np.r_[np.zeros(surfaces), np.full(nuisances.shape[2], NEARER**2)]
    A, scale = np.concatenate([effects, nuisances], axis=2), np.maximum(missing.std(axis=0), 1e-6)
    if not np.isfinite(A).all() or not np.isfinite(missing).all():
        return *(np.full(surfaces, np.nan) for _ in range(3)), np.inf
    H, x, y = np.zeros((A.shape[2], A.shape[2])), np.zeros(A.shape[2]), np.zeros(0)
    for _ in range(4):
        W = 1 / (scale * np.sqrt(together))
        B, y = (A * W[None, :, None]).reshape(-1, A.shape[2]), (missing * W).reshape(-1)
        H = B.T @ B + np.diag(prior)
        x = np.linalg.lstsq(H, B.T @ y, rcond=None)[0]
        left = missing - A @ x
        scale = np.maximum(left.std(axis=0), 1e-6)
    cost = float(len(missing) / together * np.log(scale).sum() * 2 + (prior * x**2).sum())
    # without one surface: by how much the sum of squares, priors included, grows
    inverse = np.linalg.pinv(H)
    least = float(y @ y - x @ H @ x)
    gain = x[:surfaces] ** 2 / np.diag(inverse)[:surfaces]
    return x[:surfaces], np.sqrt(np.maximum(np.diag(inverse)[:surfaces], 0.0)), gain / (gain + least), cost


def _response(surface: str, factor: float, std: float, share: float) -> Check:
    name = f"{surface} response"
    known = f"(+-{2 * std:.2g}), {100 * share:.0f} % of what is left without it"
    sentence = f"Times what is declared that the flight shows of the {surface} {known}."
    if std > KNOWN * max(abs(factor), 1.0) or share < SHOWN:
        return Check(name, factor, "", FACTOR[0], True, f"{sentence} Too uncertain to judge.")
    ok = FACTOR[0] <= factor <= FACTOR[1]
    stops = (factor < NO_FACTOR[0] and factor + 3 * std < 0) or factor - 3 * std > NO_FACTOR[1]
    limit, stop = (FACTOR[1], NO_FACTOR[1]) if factor > FACTOR[1] else (FACTOR[0], NO_FACTOR[0])
    if not ok:
        sentence += f" It looks like {_looks(factor, surface)}."
    return Check(name, factor, "", limit, ok, sentence, stop, stops, DO.format(f"sign, unit and scale of the {surface}"))


def _looks(factor: float, surface: str) -> str:
    if factor < 0:
        return f"a {surface} of the other sign" + ("" if 0.3 < -factor < 3 else f", and {abs(1 / factor):.2g} times as large as it was")
    if factor < 0.04:
        return "deg that were taken for rad"
    if factor > 25:
        return "rad that were taken for deg"
    if factor < 1:
        return f"a column that is {1 / factor:.2g} times the deflection, or an actuator that is slow"
    return f"a column that is 1/{factor:.2g} of the deflection"


def _load(seen: _Seen) -> Iterator[Check]:
    """Measured load over m (a_free - a) . p_hat, the pull that declared weight and air forces leave at the measured acceleration."""
    if "tension" not in seen.log or not has_line(seen.kite.declaration):
        return
    at = seen.instant(seen.setpoints[0])
    u, v, w, p, q, r = seen.states[:, [3, 4, 5, 9, 10, 11]].T
    velocity, spin = np.stack([u, v, w], axis=1), np.stack([p, q, r], axis=1)
    measured = seen.rates[:, 3:6] + np.cross(spin, velocity)
    declared = np.stack(np.broadcast_arrays(*at.derivative[3:6]), axis=1) + np.cross(spin, velocity)
    along = np.stack([sum(at.R[i][k] * at.p_hat[i] for i in range(3)) for k in range(3)], axis=1)
    line = np.asarray(at.tension) + at.body.mass * ((declared - measured) * along).sum(axis=1)
    logged = local_quadratic(seen.log["tension"], seen.log.dt, SPAN)[seen.rows]
    taut = line > 0.5 * np.percentile(line, 90)
    if taut.sum() < 50 or np.percentile(line, 90) <= 0:
        return
    factor = float((logged[taut] @ line[taut]) / (line[taut] @ line[taut]))
    ok, stops = LOAD[0] <= factor <= LOAD[1], not NO_LOAD[0] <= factor <= NO_LOAD[1]
    limit, stop = (LOAD[1], NO_LOAD[1]) if factor > LOAD[1] else (LOAD[0], NO_LOAD[0])
    sentence = "Measured load over the pull that declared weight and air forces leave for the line."
    if not ok:
        sentence += _unit_of(factor)
    yield Check("load as declared", factor, "", limit, ok, sentence, stop, stops, DO.format("the unit of the load, S and lift"))


def _unit_of(factor: float) -> str:
    """Which unit of the load explains a factor, where the log says kgf or N."""
    units = {"lbf taken for kgf": 2.2046, "N taken for kgf": 9.80665, "kgf taken for N": 1 / 9.80665, "lbf taken for N": 1 / 4.4482,
             "N taken for lbf": 4.4482, "kN taken for kgf": 0.0098, "kN taken for N": 0.001}  # fmt: skip
    near = min(units, key=lambda said: abs(np.log(max(factor, 1e-9) / units[said])))
    return f" It looks like {near}." if factor > 0 and abs(np.log(factor / units[near])) < 0.35 else ""
