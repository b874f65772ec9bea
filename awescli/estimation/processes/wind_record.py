"""The recorded wind's own error, as it changes over a flight."""

from dataclasses import dataclass

import numpy as np

from awescli.estimation.processes.base import Group, Prior, Process
from awescli.physics.disturbances import GUSTS

SHARE = 0.3
"""Of the declared standard deviation: most of a record's error lasts the whole flight and is a parameter (`kite.record_errors`)."""
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
        level = Prior(max(SHARE * declaration.wind.std, 1e-3), 0.7)
        return cls((Group("wind record", GUSTS, level.median, memory, level, Prior(memory)),), SPACING)
