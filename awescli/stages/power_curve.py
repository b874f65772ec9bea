"""The power curve of a plan's pumping cycles: every physical one of the nested models, in closed loop, over a range of winds."""

import csv
import io
from typing import TYPE_CHECKING, Annotated

from pydantic import BaseModel, ConfigDict, Field

from awescli.notation.present import present
from awescli.stages.base import Context

if TYPE_CHECKING:
    from awescli.control.law import Law
    from awescli.flightlog.log import FlightLog
    from awescli.stages.simulate import SimulateConfig

FILE = "power_curve.csv"
COLUMNS = ("wind_m_s", "mean_W", "low_W", "high_W", "flown", "draws")
LONGEST = 200.0
"""[s] for a cycle: one that lasts longer counts as lost."""


class PowerCurve(BaseModel):
    """Settings of a power curve."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    speeds: tuple[Annotated[float, Field(gt=0, le=60)], ...] = Field(
        tuple(float(v) for v in range(6, 17)), min_length=1, max_length=100, description="winds at `wind.height` [m/s]"
    )
    draws: int = Field(12, ge=0, le=1000, description="kites drawn from what is known of the parameters, for the band; 0: none")
    cycles: int = Field(3, ge=2, le=20, description="cycles flown in each wind; the first does not count")


def write_power_curve(context: Context, config: "SimulateConfig", log: "FlightLog", fitted: "Law | None") -> dict[str, list[dict]]:
    """power_curve.csv in the stage's folder; model -> its rows (`simulation.power_curve`)."""
    from awescli.artifacts import write_text
    from awescli.simulation.power_curve import power_curve
    from awescli.simulation.pumping import Pumping
    from awescli.stages.nested_models import kite_files, known_of
    from awescli.stages.pumping import pumping_phases
    from awescli.stages.simulate import in_wanted_wind, kite_to_fly

    asked = present(config.power_curve, "what is asked of a power curve")
    winds = {speed: in_wanted_wind(log, config.wind.model_copy(update={"speed": speed})).recorded_wind for speed in asked.speeds}
    heights = next(iter(winds.values())).height
    models = [name for name in kite_files(context) if name != "hybrid"]
    task = context.progress.task("power curve", total=len(models))
    curve = {}
    for model in models:
        task.update(model)
        _, kite = kite_to_fly(context, config.model_copy(update={"model": model}), heights, fitted)
        phases = pumping_phases(config.phases, log, kite, fitted)
        circle = present(phases[0].pattern, "the circle of the first phase")
        pumping, known = Pumping.of(kite, phases, config.step), known_of(context, model, kite)
        curve[model] = power_curve(
            pumping, winds, circle, known.draws(kite, asked.draws, context.seed), dt=log.dt, cycles=asked.cycles,
            length=float(log["tether_length"].min()), longest=LONGEST * asked.cycles,
        )  # fmt: skip
        task.advance()
    write_text(context.folder / FILE, _text(curve))
    return curve


def _text(curve: dict[str, list[dict]]) -> str:
    """CSV; an empty cell where a wind is not flown."""
    text = io.StringIO()
    rows = csv.writer(text, lineterminator="\n")
    rows.writerow(("model", *COLUMNS))
    rows.writerows((model, *("" if row[c] is None else row[c] for c in COLUMNS)) for model, points in curve.items() for row in points)
    return text.getvalue()


def told_of_curve(curve: dict[str, list[dict]]) -> list[str]:
    """In how many winds each model flies, and where the last one's power is greatest; nothing without a curve."""
    if not curve:
        return []
    flown = {model: sum(row["mean_W"] is not None for row in rows) for model, rows in curve.items()}
    said = ", ".join(f"{model} flies {n} of {len(curve[model])} winds" for model, n in flown.items())
    points = [row for row in [*curve.values()][-1] if row["mean_W"] is not None]
    best = max(points, key=lambda row: row["mean_W"], default=None)
    most = f"; at most {best['mean_W'] / 1000:.3g} kW, at {best['wind_m_s']:g} m/s" if best else ""
    return [f"power curve: {said}{most}"]
