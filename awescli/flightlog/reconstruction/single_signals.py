"""Errors of single signals, asked of an identity where they are clearly there: a gyro that reads a tenth too little, a position in feet, a
pitch angle with a constant added.

They stand beside the biases only then. Where a kite circles, a rate is much the same all the time, and its scale says nearly what its bias
says: with both in every solution no bias would be known well. Of height and climb nothing is asked: they may be a barometer's.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from awescli.flightlog.reconstruction.gauss_markov import BandedLikelihood, Series
from awescli.flightlog.reconstruction.identities import Identity
from awescli.flightlog.reconstruction.result import SensorError
from awescli.flightlog.reconstruction.solve import ENOUGH, Solution, solve, thinned
from awescli.notation.errors import NumericalFailure


@dataclass(frozen=True)
class Kind:
    """Of an error. name: as it is reported; unit; has_target: the signal is its target; prior: of its size, about zero; least: size below
    which it is not asked; matters: size from which it is told; of_flown: of the part of what is reported that is the error, the share of
    what is flown (and its slope)."""

    name: str
    unit: str
    has_target: bool
    prior: float
    least: float
    matters: float
    of_flown: Callable[[float], tuple[float, float]]


DEG = np.pi / 180
KINDS = {
    "scale": Kind("scale", "-", False, 0.3, 0.01, 0.05, lambda b: (b / (1 - b), 1 / (1 - b) ** 2)),
    "offset": Kind("attitude_bias", "rad", True, 0.1, 1 * DEG, 2 * DEG, lambda b: (b, 1.0)),
}
"""First word of a shape -> what it is. A scale of less leaves less than noise, an offset of less no more than a drift."""
BLURRED = dict.fromkeys((f"scale {n}" for n in ("v_n", "v_e", "a_x", "a_y", "a_z")), 0.1)
"""Size below which these are not asked: between velocity and acceleration errors of the attitude, and an antenna that is not where the
accelerometers are, pass for some per cent."""
WORTH, LIKELY = 30.0, 8.0
"""Deviance that an error must be worth, and its standard deviations: noise may be of another form than is assumed ..."""
SURE = 12.0
"""... and in the end, beside all others of its sensor."""
SENSORS = tuple(
    tuple(f"{kind} {signal}" for signal in signals)
    for kind, signals in (
        ("scale", ("p", "q", "r")), ("scale", ("phi", "theta")), ("scale", ("v_n", "v_e")), ("scale", ("a_x", "a_y", "a_z")),
        ("scale", ("p_n", "p_e")), ("offset", ("theta",)),
    )
)  # fmt: skip
"""Errors at once are of one sensor: with both sides of an identity times zero nothing is left of it, noise included."""


def solve_with_single_signals(identity: Identity) -> Solution:
    """The solution, with a shape for every signal that is clearly off by itself. Raises NumericalFailure."""
    best = solve(identity)
    while (shape := _likeliest(best.identity)) is not None:
        try:
            more = solve(_with_shape(best.identity, shape))
        except NumericalFailure:
            # what is said without that error stands
            return best
        gain = best.levels.deviance - more.levels.deviance - 2 * np.log(_kind(shape).prior)
        size, std = more.values[shape], more.std[shape]
        if gain < WORTH or abs(size) < max(LIKELY * std, _least(shape)):
            return best
        best = more
    return best


def errors_of_single_signals(solution: Solution) -> list[SensorError]:
    """Of each signal that is off by itself, what share it reads too much, or how much."""
    found = []
    for shape in solution.identity.singly:
        b, std = (of.get(shape) for of in (solution.values, solution.std))
        if b is not None and std is not None and abs(b) > SURE * std:
            kind, signal = _kind(shape), shape.split()[1]
            size, slope = kind.of_flown(b)
            target, matters = signal if kind.has_target else None, max(kind.matters, _least(shape))
            found.append(SensorError(kind.name, target, (signal,), size, slope * std, kind.unit, matters))
    return found


def _likeliest(identity: Identity) -> str | None:
    """The shape that the levels of the start make likeliest, if any is worth a solution."""
    series = thinned(identity.series, ENOUGH)
    before = BandedLikelihood(series).at(np.array(identity.white), identity.laws).deviance
    gains, beside = {}, [s for s in identity.singly if s in series.columns]
    for shape in (s for s in identity.singly if s not in beside and any({s, *beside} <= set(sensor) for sensor in SENSORS)):
        with_it = thinned(_with_shape(identity, shape).series, ENOUGH)
        found = BandedLikelihood(with_it).at(np.array(identity.white), identity.laws)
        gain = before - found.deviance - 2 * np.log(_kind(shape).prior)
        gains[shape] = gain if abs(found.beta[-1]) > _least(shape) / 2 else 0.0
    best = max(gains, key=lambda shape: gains[shape], default=None)
    return best if best is not None and gains[best] > WORTH else None


def _with_shape(identity: Identity, shape: str) -> Identity:
    series: Series = identity.series
    X = np.concatenate([series.X, identity.singly[shape][:, :, None]], axis=2)
    prior = np.append(series.prior, _kind(shape).prior)
    return replace(identity, series=replace(series, X=X, columns=(*series.columns, shape), prior=prior))


def _kind(shape: str) -> Kind:
    return KINDS[shape.split()[0]]


def _least(shape: str) -> float:
    return BLURRED.get(shape, _kind(shape).least)
