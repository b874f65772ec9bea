"""Scales of single signals, asked of an identity where they are clearly there: a gyro that reads a tenth too little, a position in feet.

They stand beside the biases only then. Where a kite circles, a rate is much the same all the time, and its scale says nearly what its bias
says: with both in every solution no bias would be known well. Of height and climb nothing is asked: they may be a barometer's.
"""

from dataclasses import replace

import numpy as np

from awescli.flightlog.reconstruction.gauss_markov import BandedLikelihood, Series
from awescli.flightlog.reconstruction.identities import Identity
from awescli.flightlog.reconstruction.result import SensorError
from awescli.flightlog.reconstruction.solve import ENOUGH, Solution, solve, thinned
from awescli.notation.errors import NumericalFailure

PRIOR = 0.3
"""Of a scale's error, about zero."""
BLURRED: dict[str, float] = {n: 0.1 for n in ("v_n", "v_e", "a_x", "a_y", "a_z")}
"""Size of a scale below which it is not asked: between velocity and acceleration errors of the attitude, and an antenna that is not where
the accelerometers are, pass for some per cent ..."""
LEAST = 0.01
"""... and of all others: less leaves less than noise."""
MATTERS = 0.05
"""Size of a scale from which it is told."""
WORTH, LIKELY = 30.0, 8.0
"""Deviance that a scale must be worth, and its standard deviations: noise may be of another form than is assumed ..."""
SURE = 12.0
"""... and in the end, beside all others of its sensor."""
SENSORS = (("p", "q", "r"), ("phi", "theta"), ("v_n", "v_e"), ("a_x", "a_y", "a_z"), ("p_n", "p_e"))
"""Scales at once are of one sensor: with both sides of an identity times zero nothing is left of it, noise included."""


def solve_with_scales(identity: Identity) -> Solution:
    """The solution, with the shape `scale X` for every signal X whose scale is clearly off. Raises NumericalFailure."""
    best = solve(identity)
    while (signal := _likeliest(best.identity)) is not None:
        try:
            more = solve(_with_scale(best.identity, signal))
        except NumericalFailure:
            # what is said without that scale stands
            return best
        gain = best.levels.deviance - more.levels.deviance - 2 * np.log(PRIOR)
        size, std = more.values[f"scale {signal}"], more.std[f"scale {signal}"]
        if gain < WORTH or abs(size) < max(LIKELY * std, _least(signal)):
            return best
        best = more
    return best


def scales_of(solution: Solution) -> list[SensorError]:
    """Of each signal that has one, what share it reads too much: with b the part of what is reported that is none, b / (1 - b)."""
    found = []
    for signal in solution.identity.scales:
        b, std = (of.get(f"scale {signal}") for of in (solution.values, solution.std))
        if b is not None and std is not None and abs(b) > SURE * std:
            found.append(SensorError("scale", None, (signal,), b / (1 - b), std / (1 - b) ** 2, "-", max(MATTERS, _least(signal))))
    return found


def _likeliest(identity: Identity) -> str | None:
    """The signal whose scale the levels of the start make likeliest, if any is worth a solution."""
    series = thinned(identity.series, ENOUGH)
    before = BandedLikelihood(series).at(np.array(identity.white), identity.laws).deviance
    gains, beside = {}, [n for n in identity.scales if f"scale {n}" in series.columns]
    for signal in (n for n in identity.scales if n not in beside and any({n, *beside} <= set(sensor) for sensor in SENSORS)):
        with_it = thinned(_with_scale(identity, signal).series, ENOUGH)
        found = BandedLikelihood(with_it).at(np.array(identity.white), identity.laws)
        gains[signal] = before - found.deviance - 2 * np.log(PRIOR) if abs(found.beta[-1]) > _least(signal) / 2 else 0.0
    best = max(gains, key=lambda signal: gains[signal], default=None)
    return best if best is not None and gains[best] > WORTH else None


def _with_scale(identity: Identity, signal: str) -> Identity:
    series: Series = identity.series
    X = np.concatenate([series.X, identity.scales[signal][:, :, None]], axis=2)
    more = replace(series, X=X, columns=(*series.columns, f"scale {signal}"), prior=np.append(series.prior, PRIOR))
    return replace(identity, series=more)


def _least(signal: str) -> float:
    return BLURRED.get(signal, LEAST)
