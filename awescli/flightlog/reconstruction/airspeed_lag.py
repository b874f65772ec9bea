"""How slowly a pitot answers: the lag of first order behind |v - w| that makes the measured airspeed likeliest.

Levels of noise and gusts are estimated anew for every lag (profile likelihood; Pawitan, In All Likelihood, 2001, ch. 3): to first order
about no lag, one that is longer than the motion it smooths passes for a scale.
"""

from dataclasses import replace

import numpy as np
from scipy.optimize import minimize_scalar

from awescli.flightlog.reconstruction.air import airspeed_of_motion
from awescli.flightlog.reconstruction.gauss_markov import BandedLikelihood
from awescli.flightlog.reconstruction.identities import Identity, Lag
from awescli.flightlog.reconstruction.levels import estimate_levels
from awescli.flightlog.reconstruction.motion_of import Motion
from awescli.flightlog.reconstruction.solve import ENOUGH, MOST, thinned, without_outliers

LAGS = (0.0, 0.1, 0.2, 0.4, 0.8, 1.6, 3.2)
"""[s] that are tried first; the best is searched between its neighbours ..."""
NEAR = 0.02
"""... to so many seconds, which its standard deviation counts."""
CLEAR_GAIN = 120.0
"""Deviance that a lag must be worth. A flight answers to its gusts, and that passes for a lag: of 0.15 s and 36 on UMN's Thor, of 0.3 s and
78 on Ampyx' AP2, which may be slow indeed. A lag of 0.3 s gains 190 to 350."""
STEP = 0.25
"""Share of a lag by which it is changed for the curvature of the likelihood; at least `NEAR`."""


def airspeed_lag(motion: Motion, wind: np.ndarray | None) -> Lag:
    """Of the airspeed of a motion; wind: (n, 3) NED [m/s] to be linear about, None: the record. Raises NumericalFailure."""
    tried = {lag: _deviance(motion, wind, lag) for lag in LAGS}
    best = min(LAGS, key=lambda lag: tried[lag])
    i = LAGS.index(best)
    ends = LAGS[max(i - 1, 0)], LAGS[min(i + 1, len(LAGS) - 1)]
    found = minimize_scalar(lambda lag: _deviance(motion, wind, lag), bounds=ends, method="bounded", options={"xatol": NEAR})
    size, least = (float(found.x), float(found.fun)) if found.fun < tried[best] else (best, tried[best])
    step = max(STEP * size, NEAR)
    first = max(size - step, 0.0)
    around = [_deviance(motion, wind, first + k * step) for k in range(3)]
    curvature = (around[0] - 2 * around[1] + around[2]) / step**2
    std = float(np.hypot(np.sqrt(2 / curvature), NEAR)) if curvature > 0 else LAGS[-1]
    # the noise of velocities is averaged by a lag, too, and as much by the same filter backwards in time, which no sensor is
    without = min(tried[0.0], _deviance(motion, wind, -size))
    return Lag(size, std, without - least > CLEAR_GAIN)


def _deviance(motion: Motion, wind: np.ndarray | None, lag: float) -> float:
    identity = _without_rate(airspeed_of_motion(motion, wind, lag, smooth=True))
    series = thinned(without_outliers(identity, thinned(identity.series, MOST)), ENOUGH)
    return estimate_levels(BandedLikelihood(series), identity.white, identity.laws, identity.known, how_well=False).deviance


def _without_rate(identity: Identity) -> Identity:
    """Without the shape that stands for a lag to first order."""
    series = identity.series
    kept = [i for i, name in enumerate(series.columns) if name != "late"]
    columns = tuple(series.columns[i] for i in kept)
    return replace(identity, series=replace(series, X=series.X[:, :, kept], columns=columns, prior=series.prior[kept]))
