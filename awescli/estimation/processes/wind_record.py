"""The recorded wind's own error, as it changes over a flight."""

from dataclasses import dataclass

import numpy as np

from awescli.estimation.processes.base import Group, Process
from awescli.physics.disturbances import GUSTS

SHARE = 0.7
"""Of the declared standard deviation: what lasts the whole flight is a parameter (`kite.record_errors`), and the entries, each with an error of its
own, differ from that."""
SPACING = 1.25
LEAST = 10.0
"""[s] a record with closer entries is a wind that is known better than its stations."""


@dataclass(frozen=True)
class WindRecord(Process):
    """On each axis a share of the kite file's `wind.std`, lasting as long as an entry of the record does."""

    name = "wind_record"
    doc = "slow error of the recorded wind"
    certain = True

    @classmethod
    def of(cls, declaration, log) -> "WindRecord":
        entries = np.diff(log.wind.time)
        memory = max(float(np.median(entries)), LEAST) if len(entries) else 60.0
        # not estimated: half a flight knows one or two entries, and the other half has others
        return cls((Group.known("wind record", GUSTS, max(SHARE * declaration.wind.std, 1e-3), memory),), SPACING)
