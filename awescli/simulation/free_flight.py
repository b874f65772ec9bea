"""A long simulated flight beside the log that it set out from: in which wind it flies, and how far apart the two are."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from awescli.flightlog.log import FlightLog
from awescli.notation.quantities import STATES
from awescli.simulation import scores
from awescli.simulation.made_wind import wind_record
from awescli.simulation.synthetic import Flown

HEIGHTS = np.array([2.0, 10.0, 25.0, 50.0, 100.0, 150.0, 200.0, 300.0, 400.0, 600.0, 800.0])
"""[m] where a made wind is given; between them a model interpolates."""
DENSITY = 1.225
"""[kg/m3] where the log has none: ISA at sea level."""


def in_wind(log: FlightLog, speed: float | None, direction: float, height: float, shear: float) -> FlightLog:
    """The log with another wind: `speed` [m/s] at `height` [m], growing with height to the power `shear`, from `direction` [rad].
    speed None: as recorded, only from `direction`."""
    if speed is None:
        return replace(log, wind=replace(log.recorded_wind, direction=np.full_like(log.recorded_wind.direction, direction)))
    density = DENSITY if log.recorded_wind.density is None else float(log.recorded_wind.density.mean())
    profile = speed * (HEIGHTS / height) ** shear
    return replace(log, wind=wind_record(HEIGHTS, profile, direction, float(log.time[-1]), density=density))


def side_by_side(log: FlightLog, first: int, flown: Flown) -> dict[str, np.ndarray]:
    """time (N,) s from the flight's start, simulated_* (N,), and measured_* (M,), M <= N, where the log reaches: states, V_a, tension."""
    reach = min(len(flown.time), len(log) - first)
    arrays = {"time": log.time[first] + flown.time}
    for name in _names(log):
        arrays |= {f"measured_{name}": log[name][first : first + reach], f"simulated_{name}": flown.outputs[name]}
    return arrays


def compared(log: FlightLog, first: int, flown: Flown, horizons: Sequence[float]) -> dict[str, Mapping]:
    """nrmse: horizon [s, as text] -> channel -> NRMSE of the true (noise-free) simulated flight against the log, mean of the 12 states;
    path_error_m: horizon -> root mean square distance [m]. Horizons that both reach, and all that both reach."""
    reach = min(len(flown.time), len(log) - first)
    longest = (reach - 1) * log.dt
    nrmse, path = {}, {}
    for horizon in [*(h for h in horizons if h < longest), longest]:
        count = int(round(horizon / log.dt)) + 1
        errors = {n: scores.error(log[n][first : first + count], flown.outputs[n][:count], n) for n in _names(log)}
        block = {n: scores.nrmse(e, scores.span(log[n])) for n, e in errors.items()}
        nrmse[f"{horizon:g}"] = block | {"mean": float(np.mean([block[n] for n in STATES]))}
        path[f"{horizon:g}"] = float(np.sqrt(sum(scores.rmse(errors[n]) ** 2 for n in ("p_n", "p_e", "p_d"))))
    return {"nrmse": nrmse, "path_error_m": path}


def _names(log: FlightLog) -> tuple[str, ...]:
    return *STATES, *(n for n in ("V_a", "tension") if n in log)
