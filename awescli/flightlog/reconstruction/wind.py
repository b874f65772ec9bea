"""The wind against height that airspeed and motion say, without any model of forces: the record, moved, steeper or less, veered."""

import numpy as np

from awescli.flightlog.log import FlightLog
from awescli.flightlog.reconstruction.air import airspeed_of_motion
from awescli.flightlog.reconstruction.gauss_markov import BandedLikelihood
from awescli.flightlog.reconstruction.motion_of import motion_of
from awescli.flightlog.reconstruction.solve import MOST, solve, thinned, without_outliers
from awescli.notation.errors import NumericalFailure

FEWEST = 200
"""Samples of the airspeed below which nothing is said."""


def wind_of_airspeed(log: FlightLog, height: np.ndarray, along: np.ndarray) -> tuple[np.ndarray, np.ndarray] | None:
    """(change of the record's wind (H, 2), its covariance (H, 2, 2)) at `height` (H,) [m]: along it, and across it towards growing
    direction of flow, [m/s]. along: (2,) unit vector north, east of the record's mean wind. None where the log tells none.

    It answers the shapes of the airspeed's identity: a constant wind, its growth and its veer with height, beside scale, offset and lag of
    the pitot; stretches of the flight that disagree widen it.
    """
    motion = motion_of(log)
    if motion is None or log.wind is None or "V_a" not in log:
        return None
    identity = airspeed_of_motion(motion)
    if identity.series.seen.sum() < FEWEST:
        return None
    try:
        solution = solve(identity)
        series = without_outliers(identity, thinned(identity.series, MOST))
        found = BandedLikelihood(series).at(solution.levels.white, solution.levels.laws)
    except NumericalFailure:
        return None
    columns = series.columns
    flown = -log["p_d"][motion.rows]
    higher = (np.asarray(height, dtype=float) - flown.mean()) / 100
    F = np.zeros((len(higher), 2, len(columns)))
    across = np.array([-along[1], along[0]])
    for i, way in enumerate((along, across)):
        for axis, part in zip("ne", way, strict=True):
            F[:, i, columns.index(f"wind_{axis}")] = part
    for i, name in enumerate(("more_wind_above", "veer_above")):
        F[:, i, columns.index(name)] = higher
    scatter = np.array([solution.scatter[c] for c in columns])
    covariance = found.covariance * np.outer(scatter, scatter)
    return F @ found.beta, np.einsum("hik,kl,hjl->hij", F, covariance, F)
