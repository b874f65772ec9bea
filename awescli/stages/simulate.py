"""simulate: fly a model on its own and write the flight as a log; compare it with the flight it set out from."""

from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Any, Literal, Self

from pydantic import BaseModel, ConfigDict, Field, model_validator

from awescli.notation.errors import BadInput
from awescli.notation.present import present
from awescli.stages.answers import ANSWER, number
from awescli.stages.base import Context, Inputs, Need, Stage, StageConfig
from awescli.stages.nested_models import MADE_BY
from awescli.stages.power_curve import PowerCurve
from awescli.stages.pumping import Drum, PhaseConfig

if TYPE_CHECKING:
    import numpy as np

    from awescli.control.law import Law
    from awescli.control.pattern import Pattern
    from awescli.flightlog.log import FlightLog
    from awescli.physics.flight_model import FlightModel

BY = {"controller": "the fitted controller", "recorded": "the log", "path_following": "a built-in law"}
"""Who moves the surfaces, in words."""
HORIZONS = (0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 30.0, 60.0, 120.0, 300.0)
"""[s] after the start at which the simulated flight is compared with the measured one."""
CYCLE, LONGEST = 300.0, 3600.0
"""[s] for a pumping cycle where only their number is asked for; no flight is longer than LONGEST."""


class Wind(BaseModel):
    """A wind of one's own instead of the recorded one."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    speed: float | None = Field(default=None, ge=0, le=60, description="speed at `height` [m/s]; default as recorded")
    direction: float | None = Field(default=None, ge=-360, le=360, description="where it comes from [deg]; default as recorded")
    height: float = Field(default=10.0, gt=0, le=1000, description="where it has that speed [m]")
    shear: float = Field(default=1 / 7, ge=-1, le=1, description="exponent of the power law over height [-]")


class SimulateConfig(StageConfig):
    """Settings of simulate."""

    surfaces: Literal["controller", "recorded", "path_following"] = Field(
        default="controller",
        description="who moves the surfaces: the fitted controller, the log, or a built-in law that follows the flown circle",
    )
    model: Literal["newest", "initial", "identified", "with_effects", "hybrid"] = Field(default="newest", description="which model flies")
    effects: dict[str, dict[str, float]] = Field(default={}, description="effects switched on, e.g. {actuator_lag:rudder: {tau: 0.2}}")
    wind: Wind = Field(default=Wind(), description="wind of one's own: speed, direction, height, shear; default as recorded")
    start: float | None = Field(
        default=None,
        ge=0,
        description="where in the flight it sets out [s], from the states, set-points and their rates there; default where the longest "
        "test stretch begins",
    )
    duration: float = Field(
        default=60.0, ge=0.5, le=LONGEST, description="how long it flies [s]; beyond the log winch and wind go on as they were"
    )
    phases: tuple[PhaseConfig, ...] = Field(
        default=(), description="phases of a pumping cycle, flown in this order again and again: name, law, pattern, surfaces, winch, until"
    )
    cycles: int | None = Field(default=None, ge=1, le=1000, description="pumping cycles it flies; default as many as `duration` holds")
    draws: int = Field(
        default=12,
        ge=0,
        le=1000,
        description="kites drawn from what is known of the parameters, for the interval of the mean cycle power; 0: none",
    )
    drum: Drum = Field(default=Drum(), description="the winch of pumping cycles: tau, v_max, a_max")
    power_curve: PowerCurve | None = Field(
        default=None, description="mean cycle power against wind speed, of every physical model: {speeds: [6, 8, 10], draws: 12, cycles: 3}"
    )
    noise: bool = Field(default=True, description="add the kite file's sensor noise to the written log")
    seed: int | None = Field(default=None, ge=0, description="seed of noise and turbulence; default the plan's")
    step: float = Field(default=0.01, ge=1e-4, le=0.02, description="longest step of the integration [s]")

    @model_validator(mode="after")
    def _phases_can_be_flown(self) -> Self:
        if self.phases and self.model == "hybrid":
            raise ValueError("phases are flown by physical models, a network was not trained in a retraction: use with_effects")
        if self.power_curve and not self.phases:
            raise ValueError("a power curve is that of pumping cycles: give their phases")
        return self


class Simulate(Stage):
    """Set out from a measured state, fly on, write what the sensors would say."""

    name = "simulate"
    help = "Fly any model of the run in closed loop (or with replayed surfaces) and write the flight as a log."
    Config = SimulateConfig
    makes = ("flight/kite.csv", "flight/wind.csv", "trajectory.npz", "metrics.json")

    def needs(self, config: SimulateConfig) -> tuple[Need, ...]:
        upstream = [Need("fit-controller")] if steered_by_controller(config) or has_fitted_winch(config) else []
        upstream += [Need(s, required=config.model == model) for model, s in MADE_BY.items() if config.model in (model, "newest")]
        return tuple(upstream)

    def check(self, inputs: Inputs, config: SimulateConfig) -> Iterator[tuple[str, BadInput]]:
        from awescli.notation.errors import BadInput
        from awescli.physics.kite import has_line
        from awescli.simulation.synthetic import refuse_measured, with_effects
        from awescli.stages.pumping import check_phases

        log, _ = inputs.log, inputs.parts
        if config.start is not None and int(round(config.start / log.dt)) >= len(log) - 1:
            do = f"Start before {log.time[-1]:.1f} s."
            yield "start", BadInput(f"the flight is only {log.time[-1]:.1f} s long", do=do)
        if config.surfaces == "path_following" and not has_line(inputs.declared):
            what = "path_following flies a circle around a winch, and this kite flies free"
            yield "surfaces", BadInput(what, do="Use recorded or controller.")
        yield from check_phases(config.phases, inputs.declared, log)
        refuse_measured(inputs.declared)
        for key, values in config.effects.items():
            try:
                refuse_measured(with_effects(inputs.declared, {key: values}))
            except BadInput as e:
                yield "effects", e

    def run(self, context: Context, config: SimulateConfig) -> dict[str, Any]:
        from dataclasses import replace

        from awescli.artifacts import read_json, write_arrays, write_json, write_text
        from awescli.flightlog.kitemill_csv import to_kitemill_csv
        from awescli.flightlog.plausible_units import YEARS
        from awescli.simulation.free_flight import compared, side_by_side
        from awescli.simulation.rollout import rates_at, setpoints_of
        from awescli.simulation.segments import smooth_states
        from awescli.simulation.synthetic import EPOCH, LoggedReelOut, as_recorded, simulate_flight
        from awescli.stages.controller_artifact import read_controller
        from awescli.stages.flight_parts import flight_parts
        from awescli.stages.nested_models import known_of
        from awescli.stages.power_curve import told_of_curve, write_power_curve
        from awescli.stages.pumping import fly_phases, told_of_cycles, with_fitted_winch

        if has_fitted_winch(config):
            config = with_fitted_winch(config, read_json(context.made_by("fit-controller") / "metrics.json"))
        log, parts = flight_parts(context)
        log = in_wanted_wind(log, config.wind)
        first = max(parts.test, key=lambda r: r[1] - r[0])[0] if config.start is None else int(round(config.start / log.dt))
        fitted = read_controller(context.made_by("fit-controller")) if steered_by_controller(config) else None
        model, kite = kite_to_fly(context, config, log.recorded_wind.height, fitted)
        duration = config.duration
        if config.surfaces == "recorded" and not config.phases:
            duration = min(duration, (len(log) - 1 - first) * log.dt)
        if config.phases and config.cycles and "duration" not in config.model_fields_set:
            duration = min(CYCLE * config.cycles, LONGEST)
        samples = int(round(duration / log.dt)) + 1
        recorded = setpoints_of(log)[[min(first + k, len(log) - 1) for k in range(samples)]]
        wind = replace(log.recorded_wind, time=log.recorded_wind.time - log.time[first])
        seed = context.seed if config.seed is None else config.seed
        context.progress.task(f"flying {duration:g} s, {model}")
        how = {"duration": duration, "dt": log.dt, "start": smooth_states(log)[first], "seed": seed}
        how |= {"begins": float(log.time[first]), "rates": rates_at(log, kite, first)}
        if config.phases:
            known = known_of(context, model, kite)
            flown, phases, pumped = fly_phases(config, log, first, kite, fitted, wind, how, known)
            duration = min(duration, flown.time[-1]) if pumped["cycles_flown"] == config.cycles else duration
        else:
            law, pattern = law_to_fly(config, log, kite, fitted)
            reel_out, phases, pumped = LoggedReelOut(log, first) if kite.tether else None, None, {}
            flown = simulate_flight(kite, law, wind, reel_out, pattern=pattern, setpoints=recorded, step=config.step, **how)
        # a log that knows no date (seconds since boot) gets one that the format can hold
        epoch = (0.0 if log.start > YEARS[0] else EPOCH) + log.start + float(log.time[first])
        written = as_recorded(flown, kite.declaration, wind, seed=seed, noise=config.noise, name="flight", epoch=epoch)
        kite_csv, wind_csv = to_kitemill_csv(written, phases)
        write_text(context.folder / "flight" / "kite.csv", kite_csv)
        write_text(context.folder / "flight" / "wind.csv", wind_csv)
        write_arrays(context.folder / "trajectory.npz", side_by_side(log, first, flown))
        survived = (len(flown.time) - 1) * flown.dt
        metrics = {
            "outcome": "departed" if flown.departed else "flew_on", "survived_s": survived, "asked_s": duration,
            "start_s": float(log.time[first]),
            # how long it is compared with flight that no stage was fitted to
            "unseen_s": max(((b - first) * log.dt for a, b in parts.test if a <= first < b), default=0.0),
            "seed": seed, "model": model, "surfaces": moved_by(config), "effects": config.effects, "wind": config.wind.model_dump(),
            **compared(log, first, flown, HORIZONS), **pumped,
        }  # fmt: skip
        curve = {}
        if config.power_curve:
            curve = write_power_curve(context, config, log, fitted)
            metrics["power_curve"] = curve
        write_json(context.folder / "metrics.json", metrics)
        errors = {f"error over {horizon} s": block["mean"] for horizon, block in metrics["nrmse"].items()}
        flew = f"{survived:.1f} of {duration:g} s"
        shown = ", ".join(f"{number(block['mean'])} over {horizon} s" for horizon, block in metrics["nrmse"].items())
        return {
            "model": model, "outcome": metrics["outcome"], "flew": flew, **errors,
            ANSWER: [
                f"{metrics['outcome'].replace('_', ' ')}: the {model} model flew {flew}, surfaces by {steered(config)}",
                *([f"error against the measured flight: {shown}"] if shown and not pumped else []),
                *told_of_cycles(pumped), *told_of_curve(curve),
                f"flight as a log: {context.out / self.name / 'flight'}",
            ],
        }  # fmt: skip


def moved_by(config: SimulateConfig) -> str:
    """Who moves the surfaces; of phases, the fitted controller where it flies in one of them."""
    steering = [p.law for p in config.phases] or [config.surfaces]
    return "controller" if "controller" in steering else steering[0]


def steered_by_controller(config: SimulateConfig) -> bool:
    """Whether the fitted controller moves surfaces."""
    return moved_by(config) == "controller"


def has_fitted_winch(config: SimulateConfig) -> bool:
    """Whether a phase is flown by the winch law that fit-controller found."""
    return any(phase.winch.fitted for phase in config.phases)


def steered(config: SimulateConfig) -> str:
    """Who moves the surfaces, in words."""
    return " and ".join(dict.fromkeys(BY[p.law] for p in config.phases)) if config.phases else BY[config.surfaces]


def in_wanted_wind(log: "FlightLog", wanted: Wind) -> "FlightLog":
    """The flight's log, with the wind that is wanted in place of the recorded one."""
    import math

    from awescli.simulation.free_flight import in_wind
    from awescli.stages.controller_artifact import wind_direction

    if wanted.speed is None and wanted.direction is None:
        return log
    direction = wind_direction(log) if wanted.direction is None else math.radians(wanted.direction)
    return in_wind(log, wanted.speed, direction, wanted.height, wanted.shear)


def kite_to_fly(context: Context, config: SimulateConfig, heights: "np.ndarray", fitted: "Law | None" = None) -> "tuple[str, FlightModel]":
    """(name of the model, the kite for a wind known at `heights`), with the effects that are switched on and the delay and limiter
    through which the `fitted` law acts."""
    from awescli.learning.correction import kite_from_artifact
    from awescli.physics.declaration import read_kite
    from awescli.physics.kite import Kite
    from awescli.simulation.closed_loop import with_setpoint_dynamics
    from awescli.simulation.synthetic import with_effects
    from awescli.stages.nested_models import kite_files, network
    from awescli.stages.pumping import on_winch

    files = kite_files(context)
    newest = [name for name in files if not (config.phases and name == "hybrid")][-1]
    model = newest if config.model == "newest" else config.model
    declaration = with_setpoint_dynamics(with_effects(read_kite(files[model]), config.effects), fitted)
    if config.phases:
        declaration = on_winch(declaration, config.drum)
    if model == "hybrid":
        return model, kite_from_artifact(*network(files[model].parent), declaration, heights)
    return model, Kite(declaration, heights)


def law_to_fly(
    config: SimulateConfig, log: "FlightLog", kite: "FlightModel", fitted: "Law | None"
) -> "tuple[Callable | None, Pattern | None]":
    """(law for the simulator or None, pattern or None)."""
    from awescli.simulation.closed_loop import loop
    from awescli.stages.controller_artifact import wind_direction
    from awescli.stages.follower import follower_of

    if config.surfaces == "controller":
        law = present(fitted, "the fitted law")
        return loop(law, kite, wind_direction(log)), law.pattern
    if config.surfaces == "path_following":
        law = follower_of(log, kite.declaration)
        return law.setpoints, law.pattern
    return None, None
