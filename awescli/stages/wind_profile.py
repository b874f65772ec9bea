"""What a fitted model says of the wind that it was flown in."""

from typing import TYPE_CHECKING

from awescli.stages.base import Context
from awescli.stages.nested_models import MADE_BY, known_of, levels_of

if TYPE_CHECKING:
    from awescli.flightlog.log import FlightLog


def wind_seen(context: Context, models: dict, log: "FlightLog") -> dict | None:
    """{"model", "rows" (`estimation.wind_seen.wind_profile`)} of the last fitted physical model; None without one, without a record, or
    where the flight holds nothing long enough to smooth. models: name -> Simulator."""
    from awescli.estimation.phase_power import flown_ranges
    from awescli.estimation.wind_seen import processes_at, wind_profile
    from awescli.flightlog.phases import phases
    from awescli.notation.errors import BadInput
    from awescli.notation.phases import WORKING

    fitted = [name for name in models if name in MADE_BY and name != "hybrid"]
    if not fitted or log.wind is None:
        return None
    model = fitted[-1]
    simulator, (levels, factors) = models[model], levels_of(context, model)
    if levels is None:
        return None
    ranges = flown_ranges(phases(log), log.valid, (*WORKING, "flight"))
    known, processes = known_of(context, model, simulator.kite), processes_at(simulator.kite.declaration, log, levels)
    try:
        rows = wind_profile(simulator, log, ranges, processes, known, factors, seed=context.seed)
    except BadInput:
        return None
    return {"model": model, "rows": rows} if rows else None


def wind_line(rows: list[dict]) -> str:
    """The wind at the height that is flown most, from the kite and the station."""
    most = max(rows, key=lambda row: row["seconds"])
    kite = f"{most['speed_m_s']:.1f} m/s (90 %: +-{1.645 * most['speed_std']:.1f}) from {most['direction_deg']:.0f} deg"
    station = f"{most['station_speed_m_s']:.1f} m/s from {most['station_direction_deg']:.0f} deg"
    pitot = f", pitot {most['pitot_speed_m_s']:.1f} +-{1.645 * most['pitot_speed_std']:.1f} m/s" if "pitot_speed_m_s" in most else ""
    return f"wind at {most['height_m']:.0f} m: the kite says {kite}{pitot}; station {station}"
