"""Mean cycle power against wind speed: one kite through its phases in each wind, with a band over what its parameters might be."""

from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from awescli.control.pattern import Pattern
from awescli.flightlog.log import WindRecord
from awescli.simulation.groups import each_group
from awescli.simulation.pumping import Pumped, Pumping, energies
from awescli.simulation.rollout import inputs_of
from awescli.simulation.synthetic import Commanded, circle_starts

BAND = (0.05, 0.95)
"""Quantiles of the draws between which the band lies."""
TRIES = 4
"""Starts on the circle that are tried before a wind counts as not flown."""
LOAD = 2000.0
"""[N] on the line where a flight begins; forgotten before the first cycle ends, which is not counted."""


def power_curve(
    pumping: Pumping, winds: Mapping[float, WindRecord], pattern: Pattern, draws: Sequence[Mapping[str, float]], *, length: float,
    dt: float, cycles: int, longest: float,
) -> list[dict]:  # fmt: skip
    """A row for each wind [m/s]: mean_W of the kite as it is over its cycles but the first (None where it does not fly them), low_W and
    high_W: BAND over the draws (parameter -> value) that fly, flown of draws.

    length: of line at the start [m]; longest: seconds after which a flight that has not ended its cycles counts as lost. It begins on the
    circle, at up to TRIES places in turn until one flies.
    """
    speeds = list(winds)
    rows: list[dict] = [{} for _ in speeds]

    def of_wind(i: int) -> Iterator:
        wind = winds[speeds[i]]
        starts = starts_on(pumping, wind, pattern, length)
        means: list[float | None] = []
        for values in ({}, *draws):
            how = {"length": length, "dt": dt, "cycles": cycles, "duration": longest, "load": LOAD, "values": values}
            means.append(next((m for s in starts if (m := settled(pumping.fly(wind, start=s, **how))) is not None), None))
            yield
        own, others = means[0], [m for m in means[1:] if m is not None]
        low, high = np.quantile(others, BAND).tolist() if others else (None, None)
        rows[i] = {"wind_m_s": speeds[i], "mean_W": own, "low_W": low, "high_W": high, "flown": len(others), "draws": len(draws)}

    each_group(of_wind, len(speeds))
    return rows


def starts_on(pumping: Pumping, wind: WindRecord, pattern: Pattern, length: float) -> np.ndarray:
    """(TRIES, 12) states on the circle, spread over phases and speeds."""
    time = 0.02 * np.arange(50)
    line = {"tether_length": np.full(len(time), length), "reel_out_speed": np.zeros(len(time))}
    inputs = inputs_of(Commanded(time, 0.02, line, wind), pumping.kite)
    starts = circle_starts(pattern, pumping.kite, inputs[0], {n: i for i, n in enumerate(pumping.kite.input_names)})
    return starts[:: max(1, len(starts) // TRIES)][:TRIES]


def settled(pumped: Pumped) -> float | None:
    """[W] over all cycles but the first; None for a flight that was lost, or ended before its last cycle."""
    if pumped.ended is None:
        return None
    _, whole = energies(pumped, [""] * (int(pumped.phase.max()) + 1))
    seconds = whole[-1]["to_s"] - whole[0]["to_s"]
    return sum(row["energy_J"] for row in whole[1:]) / seconds
