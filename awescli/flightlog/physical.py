"""Do the numbers lie where they can? Physical ranges of every channel, the weather, the load; and does the weather cover the flight?"""

import numpy as np

from awescli.flightlog.consistency import Check, least, most
from awescli.flightlog.log import FlightLog
from awescli.notation.quantities import CONTROL_SURFACES, INPUTS, MEASURED

REACH = {
    "p_n": 20e3, "p_e": 20e3, "p_d": 12e3, "v_n": 120.0, "v_e": 120.0, "v_d": 120.0, "p": 12.0, "q": 12.0, "r": 12.0,
    "a_x": 300.0, "a_y": 300.0, "a_z": 300.0, "V_a": 120.0, "alpha": 1.0, "beta": 1.0, "tension": 1e6,
    "tether_length": 20e3, "reel_out_speed": 40.0, "throttle": 1.2, "motor_speed": 1000.0,
    **dict.fromkeys(CONTROL_SURFACES, np.deg2rad(40.0)),
}  # fmt: skip
"""SI: what no kite or small aircraft exceeds: 30 g, 700 deg/s, 430 km/h, surfaces at 40 deg, the pull of a 600 kW kite times twenty. Angles
are judged when they are read."""

FAR_BEYOND = 1.5
"""Times that: beyond, it is no measurement."""

EDGE = 99.0
"""Percent of the samples that must lie within: the rest are spikes."""

DENSITY = (0.8, 1.4)
"""kg/m3: 4000 m on a hot day, sea level at -20 degC (International Standard Atmosphere) ..."""
NO_AIR = (0.6, 1.6)
"""... and what no kite flies in."""

STORM, NO_WIND = 25.0, 50.0
"""m/s of mean wind: above 25 turbines stop; 50 is a hurricane."""

LOWEST_TOP = 2.0
"""m: a record whose highest height is lower, of a kite at 20 m and more, counts its heights in another unit."""

UNCOVERED, ANOTHER_WEATHER = 900.0, 3600.0
"""s that the flight is away from the nearest weather sample: half an interval of a usual station; an hour later the wind has changed."""

PUSHED = 5.0
"""Percent of the flown time in which the line may push, by a load cell's offset ..."""
PUSHED_MOST, PULL = 50.0, 0.05
"""... and beyond which the sign is wrong; a push is more than this share of the largest load."""

LEAST_AREA = (0.3, 0.03)
"""m2, load / dynamic pressure where the load is high (75 %): kites of 3 m2 have 3 to 5; a kN taken for a kgf has 0.01."""

MAPPING = "Give the column its unit in a flight.yaml."


def physical_checks(log: FlightLog, airborne: np.ndarray) -> list[Check]:
    """All of them that the log has the signals for. airborne: (N,) bool, the flown samples."""
    where = airborne & log.valid
    return [*_channels(log), *_weather(log, where), *(_load(log, where) if where.any() else ())]


def _channels(log: FlightLog) -> list[Check]:
    """The channel that goes farthest beyond its range, in times of its range."""
    valid = log.valid if log.valid.any() else np.ones(len(log), bool)
    times = {
        name: float(np.percentile(np.abs(log[name][valid]), EDGE)) / REACH[name]
        for name in (*MEASURED, *INPUTS)
        if name in log and name in REACH
    }
    if not times:
        return []
    worst = max(times, key=lambda name: times[name])
    sentence = f"The channel that goes farthest against what is physical: {worst} reaches {times[worst] * REACH[worst]:.4g} (SI units)."
    return [most("physical ranges", times[worst], "times", 1.0, FAR_BEYOND, sentence, MAPPING)]


def _weather(log: FlightLog, where: np.ndarray) -> list[Check]:
    wind = log.wind
    if wind is None:
        return []
    checks = []
    if wind.density is not None:
        low, high = float(wind.density.min()), float(wind.density.max())
        do = "Mend the density of the weather file (kg/m3), or leave it out: 1.225 is taken then."
        if low < DENSITY[0]:
            said = "The lowest recorded; air near the ground has more."
            checks.append(least("air density", low, "kg/m3", DENSITY[0], NO_AIR[0], said, do))
        else:
            checks.append(most("air density", high, "kg/m3", DENSITY[1], NO_AIR[1], "The highest recorded.", do))
    fastest = float(np.median(wind.speed.max(axis=1)))
    checks.append(most("wind speed", fastest, "m/s", STORM, NO_WIND, "The strongest of the recorded heights, median over time.", MAPPING))
    if "p_d" in log and where.any():
        height = float(np.percentile(-log["p_d"][where], 90))
        top, low = float(wind.height.max()), float(wind.height.min())
        if height > 10 * LOWEST_TOP:
            said = f"Highest height of the wind record; the kite flies at {height:.0f} m."
            checks.append(least("wind heights", top, "m", LOWEST_TOP, LOWEST_TOP, said, "Heights are in m: mend the weather file."))
            if low > 5 * height:
                said = f"Lowest height of the wind record; the kite flies at {height:.0f} m."
                checks[-1] = most("wind heights", low, "m", 5 * height, 20 * height, said, "Heights are in m: mend the weather file.")
    ends = log.time[np.flatnonzero(where)[[0, -1]]] if where.any() else log.time[[0, -1]]
    away = max(float(np.abs(wind.time - t).min()) for t in ends)
    do = "Put the weather of this flight beside it; check its clock and time zone (unix time is UTC)."
    said = "Farthest end of the flight from the nearest weather sample."
    return [*checks, most("weather coverage", away, "s", UNCOVERED, ANOTHER_WEATHER, said, do)]


def _load(log: FlightLog, where: np.ndarray) -> list[Check]:
    if "tension" not in log:
        return []
    tension = log["tension"][where]
    size = float(np.percentile(np.abs(tension), 95))
    share = 100 * float((tension < -PULL * size).mean()) if size > 0 else 0.0
    said = "Flown time in which the load is negative."
    checks = [most("line that pushes", share, "%", PUSHED, PUSHED_MOST, said, "A line pulls: give the column its sign in a flight.yaml.")]
    speed = log["V_a"] if "V_a" in log else np.sqrt(log["v_n"] ** 2 + log["v_e"] ** 2 + log["v_d"] ** 2) if "v_d" in log else None
    fast = where & (speed > 15.0) if speed is not None else where & False
    if speed is not None and fast.sum() >= 50 and size > 0:
        area = float(np.percentile(np.abs(log["tension"][fast]) / (0.6 * speed[fast] ** 2), 75))
        said = "Load over dynamic pressure where the load is high: less than any wing that pulls."
        checks.append(least("load against airspeed", area, "m2", *LEAST_AREA, said, MAPPING))
    return checks
