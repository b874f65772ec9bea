"""The recorded wind's own error, as it changes over a flight."""

from dataclasses import dataclass

import numpy as np

from awescli.estimation.processes.base import Group, Process
from awescli.flightlog.log import FlightLog
from awescli.physics.declaration import KiteDeclaration
from awescli.physics.disturbances import GUSTS

SHARE = 0.7
"""Of the declared standard deviation: what lasts the whole flight is a parameter (`kite.record_errors`), and the entries, each with an
error of its own, differ from that."""
SPACING = 1.25
SLOW = 0.1
"""[m/s] a kite that climbs slower stays at its height."""
LEAST = 10.0
"""[s] a record with closer entries is a wind that is known better than its stations."""


@dataclass(frozen=True)
class WindRecord(Process):
    """On each axis a share of the kite file's `wind.std`. Every entry of a station has an error of its own, so that what the kite sees of
    them lasts as long as it takes from one station's height to the next, or as long as an entry where there is one station."""

    name = "wind_record"
    doc = "slow error of the recorded wind"
    certain = True

    @classmethod
    def of(cls, declaration: KiteDeclaration, log: FlightLog) -> "WindRecord":
        entries = np.diff(log.recorded_wind.time)
        memory = max(float(np.median(entries)), LEAST) if len(entries) else 60.0
        memory = min(memory, passing_time(log))
        # not estimated: half a flight knows one or two entries, and the other half has others
        return cls((Group.known("wind record", GUSTS, max(SHARE * declaration.wind.std, 1e-3), memory),), SPACING)


def passing_time(log: FlightLog) -> float:
    """[s] that the kite takes from one station's height to the next; infinite where there is one station, or the kite flies level."""
    height, climb = np.asarray(log.recorded_wind.height, float), float(np.sqrt(np.mean(log["v_d"][log.valid] ** 2)))
    flown = -log["p_d"][log.valid]
    between = np.diff(height)[(height[1:] > flown.min()) & (height[:-1] < flown.max())]
    return float(np.median(between)) / max(climb, SLOW) if len(between) else np.inf
