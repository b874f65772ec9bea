"""The linear model that every other one is set beside: ARX of the same inputs and outputs, predicting from the same samples, scored alike.

Linear in what a flight mechanic would linearise in, for one that goes round in circles is linear in nothing else: body velocities, rates,
the directions of gravity and of north in the body's horizon, velocity over ground and what the air data and the load cell say. Order, time
between lags, penalty, and whether the place counts, are those with the smallest error on the validation part.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from awescli.estimation.arx import Arx, each, fitted
from awescli.estimation.prediction import SCORED, Prediction, beside
from awescli.flightlog.log import FlightLog
from awescli.flightlog.split import WARM_UP, Split, prediction_starts
from awescli.notation.errors import BadInput
from awescli.notation.frames import rotate, rotation_body_to_ned
from awescli.notation.quantities import OF_LINE, STATES, SURFACES
from awescli.physics.declaration import Noise
from awescli.physics.flight_model import FlightModel
from awescli.physics.kite import needed_by
from awescli.simulation.rollout import wind_inputs

PLACE, ATTITUDE = ("p_n", "p_e", "p_d"), ("phi", "theta", "psi")
ORDERS, STEPS, RIDGES = (1, 2, 3, 5, 10), (0.0, 0.04, 0.1, 0.2), (1e-6, 1e-5, 1e-4, 1e-3, 1e-2, 1e-1, 1.0)
"""Lags; time between them [s], one sample at least, together no longer than a warm-up; penalties on weights of normalised regressors."""
FARTHEST = 10.0
"""Ranges of the training part from its middle: a prediction that is farther away has left everything that could be a flight."""
CHOSEN_ON = 60
"""Validation predictions that a choice is made on, at most: of a long log evenly many."""
OUTCOMES = ("fitted", "unstable", "too_short")
"""fitted: as it should be; unstable: even the best choice runs away on validation; too_short: fewer rows than regressors, there is none."""


@dataclass(frozen=True)
class Signals:
    """outputs: names of the columns of y (N, n_y), Euler angles unwrapped; inputs: names of the columns of u (N, n_u)."""

    outputs: tuple[str, ...]
    y: np.ndarray
    inputs: tuple[str, ...]
    u: np.ndarray

    def seen(self, place: bool) -> Callable[[np.ndarray], np.ndarray]:
        """What of the outputs is regressed on; place: the position too."""
        at = {name: self.outputs.index(name) for name in self.outputs}
        kept = [at[n] for n in self.outputs if n not in (*PLACE, *ATTITUDE) or (place and n in PLACE)]

        def seen(y: np.ndarray) -> np.ndarray:
            phi, theta, psi = (y[..., at[n]] for n in ATTITUDE)
            R = rotation_body_to_ned(phi, theta, psi)
            over_ground = rotate(R, tuple(y[..., at[n]] for n in "uvw"))
            return np.concatenate([y[..., kept], np.stack([*over_ground, *R[2], np.cos(psi), np.sin(psi)], axis=-1)], axis=-1)

        return seen


@dataclass(frozen=True)
class LinearBaseline:
    """model: chosen; signals: of the flight; place: whether the position counts; ridge, error: the penalty and the mean NRMSE on validation
    of the choice; outcome: one of OUTCOMES but the last; bounds: (2, n_y), beyond which a prediction has diverged."""

    model: Arx
    signals: Signals
    place: bool
    ridge: float
    error: float
    outcome: str
    bounds: np.ndarray

    def predict(
        self, log: FlightLog, noise: Noise, ranges: Sequence[tuple[int, int]], horizon: float, every: float | None = None
    ) -> Prediction:
        """As `prediction.predict`, from the same samples; it knows no more than the second before a prediction. What stands at the start is
        predicted too, from what was measured before it."""
        before, ahead = int(round(WARM_UP / log.dt)), int(round(horizon / log.dt))
        first = prediction_starts(log, ranges, horizon, every=every) + before
        if not first.size:
            raise BadInput(f"no prediction of {horizon:g} s fits into the ranges of flight '{log.name}'")
        return _beside(log, self.signals, self.forecast(first, ahead), self.bounds, first, ranges, noise)

    def forecast(self, first: np.ndarray, ahead: int) -> np.ndarray:
        """(K, ahead + 1, n_y) from the samples `first` on; it may run away."""
        return np.concatenate([_ahead(self.model, self.signals, first, 1), _ahead(self.model, self.signals, first + 1, ahead)], axis=1)


def linear_baseline(log: FlightLog, parts: Split, kite: FlightModel, horizon: float, closed: bool = False) -> LinearBaseline | None:
    """Fitted to train, chosen by errors `horizon` seconds ahead on validation; closed: it predicts the surfaces too, instead of being given
    them. None where the parts are too short for any order, or for a prediction on validation ("too_short")."""
    signals = signals_of(log, kite, closed)
    usable = np.zeros(len(log), bool)
    for a, b in parts.train:
        usable[a:b] = True
    usable &= log.valid
    before, ahead = int(round(WARM_UP / log.dt)), int(round(horizon / log.dt))
    first = prediction_starts(log, parts.validation, horizon) + before
    if not usable.any() or not first.size:
        return None
    first = first[:: -(-len(first) // CHOSEN_ON)]
    train, noise = signals.y[usable], kite.declaration.noise
    low, high = train.min(axis=0), train.max(axis=0)
    bounds = (low + high) / 2 + FARTHEST * np.maximum(high - low, 1e-9) * np.array([[-1], [1]])
    # turns are counted on and on, so an angle has no range that it must stay in
    bounds[:, [n in ATTITUDE for n in signals.outputs]] = [[-np.inf], [np.inf]]
    steps = sorted({max(1, round(seconds / log.dt)) for seconds in STEPS})
    best, least = None, (True, np.inf)
    # measured channels and their spans once, for some hundred choices
    judge = _beside(log, signals, signals.y[first[:, None] + np.arange(ahead + 1)[None]], bounds, first, parts.validation, noise)
    for place in (False, True):
        seen = signals.seen(place)
        for step, order in ((s, n) for s in steps for n in ORDERS if s * n <= before):
            models = fitted(signals.y, signals.u, usable, order, step, RIDGES, seen)
            if models is None:
                continue
            for ridge, model, y in zip(RIDGES, each(models), _ahead(models, signals, first, ahead + 1), strict=True):
                y, alive = _held(y, bounds)
                p = replace(judge, simulated=_scored(signals, y), alive=alive)
                reached = (p.diverged > 0, p.nrmse()["mean"])
                if reached < least:
                    least, outcome = reached, "unstable" if reached[0] else "fitted"
                    best = LinearBaseline(model, signals, place, ridge, reached[1], outcome, bounds)
    return best


def signals_of(log: FlightLog, kite: FlightModel, closed: bool) -> Signals:
    """Outputs: the scored channels that the log has. Inputs: what the kite's own rollouts are given: surfaces, winch, wind, and what its
    effects ask the log for. Where the loop is closed the surfaces are outputs."""
    moved = [n for n in SURFACES if n in log.inputs and np.ptp(log.inputs[n]) > 0]
    given = ["tension"] if "tension" in log and kite.declaration.tether.tension == "measured" else []
    given += [n for n in (*OF_LINE, *needed_by(kite.declaration)) if n in log.inputs and n not in moved]
    outputs = [n for n in SCORED if n in STATES or n in log] + (moved if closed else [])
    y = np.stack([np.unwrap(log[n]) if n in ATTITUDE else log[n] for n in outputs], axis=1)
    named: list[str] = [*([] if closed else moved), *given]
    inputs: dict[str, np.ndarray] = {n: log[n] for n in dict.fromkeys(named)} | _wind(log)
    u = np.stack(list(inputs.values()), axis=1)
    return Signals(tuple(outputs), y, tuple(inputs), u)


def _wind(log: FlightLog) -> dict[str, np.ndarray]:
    """The recorded wind at the height nearest to the flight's middle: velocity of the air, north, east, down [m/s]."""
    if log.wind is None:
        return {}
    record = wind_inputs(log)
    i = int(np.argmin(np.abs(log.wind.height + np.median(log["p_d"]))))
    speed, direction = record[f"wind_speed_{i}"], record[f"wind_direction_{i}"]
    return {"wind_n": -speed * np.cos(direction), "wind_e": -speed * np.sin(direction), "wind_d": record[f"wind_down_{i}"]}


def _ahead(model: Arx, signals: Signals, first: np.ndarray, count: int) -> np.ndarray:
    """(..., K, count, n_y) predictions of the samples from `first` on, of what was measured before them."""
    H = model.history
    back, over = first[:, None] + np.arange(-H, 0)[None], first[:, None] + np.arange(-H, count)[None]
    # the last input is not used, so at the end of the log any will do
    return model.simulate(signals.y[back], signals.u[np.minimum(over, len(signals.u) - 1)])


def _beside(
    log: FlightLog, signals: Signals, y: np.ndarray, bounds: np.ndarray, first: np.ndarray, ranges: Sequence[tuple[int, int]], noise: Noise
) -> Prediction:
    y, alive = _held(y, bounds)
    return beside(log, _scored(signals, y), alive, first, ranges, noise)


def _scored(signals: Signals, y: np.ndarray) -> dict[str, np.ndarray]:
    """Channel -> (K, N+1) of what is scored."""
    return {n: y[..., i] for i, n in enumerate(signals.outputs) if n in SCORED}


def _held(y: np.ndarray, bounds: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(y with what lies behind a divergence held, (K,) samples before it)."""
    with np.errstate(invalid="ignore"):
        well = np.isfinite(y).all(axis=-1) & (y >= bounds[0]).all(axis=-1) & (y <= bounds[1]).all(axis=-1)
    alive = np.where(well.all(axis=1), y.shape[1], np.argmin(well, axis=1))
    last = np.minimum(np.arange(y.shape[1])[None], np.maximum(alive - 1, 0)[:, None])
    return np.nan_to_num(np.take_along_axis(y, last[..., None], axis=1)), alive
