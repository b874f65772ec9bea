"""What a network learned: its correction over the flight, its share of the motion, and the short formula that comes nearest to it."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from awescli.flightlog.log import FlightLog
from awescli.flightlog.split import Range
from awescli.learning.correction import CORRECTED, ROWS, Correction, evaluate
from awescli.learning.normalisation import input_signals, instants, samples_of
from awescli.physics.kite import Kite

SLIM_GAIN = 0.01
"""A term must raise the R2 on validation by this to enter a formula."""


@dataclass(frozen=True)
class Along:
    """The correction along a flight. values: (N, 6) [m/s2, rad/s2]; physics: (N, 6) derivatives without it; fade: (N,)."""

    values: np.ndarray
    physics: np.ndarray
    fade: np.ndarray

    def shares(self, use: np.ndarray) -> dict[str, float]:
        """Root mean square of the correction over that of the corrected derivative, per channel, on samples `use` (N,) bool."""
        size = lambda a: np.sqrt((a[use] ** 2).mean(0))  # noqa: E731
        share = size(self.values) / np.maximum(size(self.values + self.physics), 1e-12)
        return dict(zip(CORRECTED, (float(s) for s in share), strict=True))


def along(log: FlightLog, kite: Kite, correction: Correction) -> Along:
    """Evaluate a correction at the smoothed measured states of a flight."""
    signals = input_signals(log, kite, correction.inputs)
    values, fade = evaluate(list(signals.T), correction)
    at, *_ = instants(log, kite)
    n = len(log)
    full = lambda v: np.broadcast_to(np.asarray(v, dtype=float), (n,))  # noqa: E731
    physics = np.stack([full(at.derivative[r]) for r in ROWS], axis=1)
    return Along(np.stack([full(v) for v in values], axis=1), physics, np.array(full(fade)))


@dataclass(frozen=True)
class Formula:
    """channel ~ sum_i coefficients_i terms_i, in SI; r2: share of the correction's variance that it explains on validation samples."""

    channel: str
    terms: tuple[str, ...]
    coefficients: tuple[float, ...]
    r2: float

    def __str__(self) -> str:
        parts = [f"{c:+.4g}{'' if t == '1' else f' {t}'}" for c, t in zip(self.coefficients, self.terms, strict=True)]
        return f"d{self.channel}/dt += {' '.join(parts) or '0'}   (R2 {self.r2:.2f})"


def dictionary(log: FlightLog, kite: Kite) -> dict[str, np.ndarray]:
    """Physical terms that a learned rest may be made of, each (N,): motions, flow angles and their usual products with q = rho V_a^2/2."""
    at, *_ = instants(log, kite)
    n, z = len(log), at.z
    q = at.dynamic_pressure / 100.0
    base = {
        "1": 1.0, "u": z.u, "v": z.v, "w": z.w, "p": z.p, "q": z.q, "r": z.r, "V_a": at.V_a,
        **({"tension": at.tension, "stretch": at.distance - at.inputs["tether_length"]} if kite.tether else {}),
        "qbar": q, "qbar alpha": q * at.alpha, "qbar alpha^2": q * at.alpha**2, "qbar beta": q * at.beta, "qbar beta^2": q * at.beta**2,
        **{f"qbar {name}": q * at.setpoints[name] for name in ("rudder", "elevator", "aileron")},
        "qbar rudder_rate": q * at.inputs["rudder_rate"], "V_a p": at.V_a * z.p, "V_a q": at.V_a * z.q, "V_a r": at.V_a * z.r,
        "gravity_x": at.R[2][0], "gravity_y": at.R[2][1], "gravity_z": at.R[2][2],
    }  # fmt: skip
    signals = {name: np.broadcast_to(np.asarray(v, dtype=float), (n,)) for name, v in base.items()}
    return {name: v for name, v in signals.items() if name == "1" or v.std() > 1e-9 * max(1.0, np.abs(v).max())}


def distil(
    log: FlightLog,
    kite: Kite,
    correction: Correction,
    train_ranges: Sequence[Range],
    validation_ranges: Sequence[Range],
    most: int = 3,
) -> list[Formula]:
    """The shortest formula per channel: orthogonal matching pursuit on training samples, stopped where validation no longer gains.

    `qbar` is the dynamic pressure in 100 Pa. A high R2 with one term is a learned rest that may become a named effect.
    """
    learned, terms = along(log, kite, correction).values, dictionary(log, kite)
    train, validation = (samples_of(r, log.valid) for r in (train_ranges, validation_ranges))
    names = [n for n in terms if n != "1"]
    A = np.stack([terms[n] for n in names], axis=1)
    return [_pursuit(c, names, A, learned[:, i], train, validation, most) for i, c in enumerate(CORRECTED)]


def _pursuit(
    channel: str, names: Sequence[str], A: np.ndarray, y: np.ndarray, train: np.ndarray, validation: np.ndarray, most: int
) -> Formula:
    spread = float(y[validation].var())
    if spread < 1e-18 or y[train].var() < 1e-18:
        return Formula(channel, (), (), 0.0)
    chosen: list[int] = []
    best = Formula(channel, ("1",), (float(y[train].mean()),), _r2(y[validation], y[train].mean(), spread))
    centred = A[train] - A[train].mean(0)
    size = np.sqrt((centred**2).sum(0)) + 1e-300
    rest = y[train] - y[train].mean()
    for _ in range(most):
        match = np.abs(centred.T @ rest) / size
        match[chosen] = -1
        chosen.append(int(match.argmax()))
        B = np.column_stack([np.ones(len(y)), A[:, chosen]])
        solution, *_ = np.linalg.lstsq(B[train], y[train], rcond=None)
        rest = y[train] - B[train] @ solution
        r2 = _r2(y[validation], B[validation] @ solution, spread)
        if r2 < best.r2 + SLIM_GAIN:
            break
        best = Formula(channel, ("1", *(names[j] for j in chosen)), tuple(float(s) for s in solution), r2)
    return best


def _r2(y: np.ndarray, modelled: float | np.ndarray, spread: float) -> float:
    return float(1 - ((y - modelled) ** 2).mean() / spread)
