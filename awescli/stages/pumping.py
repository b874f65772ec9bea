"""Pumping cycles in a plan: what `simulate` asks of phases, and the flight through them."""

import math
from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Literal, Self

from pydantic import BaseModel, ConfigDict, Field, model_validator

from awescli.notation.errors import BadInput
from awescli.notation.present import present

if TYPE_CHECKING:
    from awescli.control.held import Held
    from awescli.control.law import Law
    from awescli.estimation.known import Known
    from awescli.flightlog.log import FlightLog, WindRecord
    from awescli.physics.declaration import KiteDeclaration
    from awescli.physics.flight_model import FlightModel
    from awescli.simulation.pumping import Pumping, PumpingPhase
    from awescli.simulation.switching import Guard
    from awescli.simulation.synthetic import Flown
    from awescli.stages.simulate import SimulateConfig

Degrees = float


class Settings(BaseModel):
    """Base of the blocks of a phase."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)


class Circle(Settings):
    """The pattern that path_following flies in a phase."""

    elevation: Degrees | None = Field(
        default=None, ge=0, le=90, description="of the centre, seen from the winch [deg]; default as the log flies"
    )
    azimuth: Degrees | None = Field(
        default=None, ge=-360, le=360, description="of the centre, from north over east [deg]; default as the log flies"
    )
    radius: float | None = Field(default=None, gt=1, le=1000, description="along the sphere [m]; default as the log flies")


class WinchLaw(Settings):
    """How fast the winch is asked to pay out: v + kv sqrt(load) + k (load above f_high - load below f_low)."""

    v: float = Field(default=0.0, ge=-20, le=20, description="reel-out speed, negative inwards [m/s]")
    kv: float = Field(default=0.0, ge=0, le=1, description="further speed per root of the load [m/s/sqrt(N)]")
    k: float = Field(default=0.0, ge=0, le=0.1, description="further speed per load beyond a limit [m/s/N]")
    f_low: float = Field(default=0.0, ge=0, le=1e6, description="load below which it reels in [N]")
    f_high: float = Field(default=1e6, ge=0, le=1e6, description="load above which it pays out [N]")
    tau: float = Field(default=0.3, ge=0.02, le=10, description="lag of the load that it answers [s]")
    fitted: bool = Field(default=False, description="what is not named here is as fit-controller (winch: true) found it in this phase")

    @model_validator(mode="after")
    def _limits_in_order(self) -> Self:
        if self.f_low > self.f_high:
            raise ValueError(f"f_low {self.f_low:g} lies above f_high {self.f_high:g}")
        return self


class Limit(Settings):
    """A limit that a quantity passes upwards or downwards."""

    above: float | None = Field(default=None, description="ends the phase where it comes to this from below")
    below: float | None = Field(default=None, description="ends the phase where it comes to this from above")

    @model_validator(mode="after")
    def _one_way(self) -> Self:
        if (self.above is None) == (self.below is None):
            raise ValueError("give above or below")
        return self

    @property
    def value(self) -> float:
        """The limit itself."""
        return present(self.below if self.above is None else self.above, "one of above and below")


WINCH_UNITS = {"v": "m/s", "kv": "m/s/sqrt(N)", "k": "m/s/N", "f_low": "N", "f_high": "N"}
LIMIT_UNITS = {"time_in_phase": "s", "tether_length": "m", "height": "m", "elevation": "rad", "tension": "N", "V_a": "m/s"}
"""Units of a phase's settings, as the simulation has them."""
Ending = Literal["time_in_phase", "tether_length", "height", "elevation", "tension", "V_a"]


class PhaseConfig(Settings):
    """One phase of a cycle."""

    name: Literal["traction", "transition", "retraction"] = Field(description="what it is")
    law: Literal["path_following", "controller"] = Field(
        default="path_following", description="who steers: a built-in law on the circle, or the fitted controller"
    )
    pattern: Circle = Field(default=Circle(), description="circle of path_following: elevation, azimuth, radius")
    surfaces: dict[str, Degrees] = Field(
        default={}, description="surfaces held [deg], e.g. {elevator: 3, flaps: 0}; default as the log's median"
    )
    winch: WinchLaw = Field(default=WinchLaw(), description="winch law: v, kv, k, f_low, f_high, tau, or fitted")
    until: dict[Ending, Limit] = Field(
        min_length=1, description="what ends it, the first that is passed: {tether_length: {above: 400}}; m, s, N, m/s, deg"
    )


class Drum(Settings):
    """The winch that follows its reference: lag and limits of `winch_tracking`."""

    tau: float = Field(default=0.3, ge=0.02, le=3, description="lag [s]")
    v_max: float = Field(default=10.0, gt=0, le=100, description="fastest line [m/s]")
    a_max: float = Field(default=5.0, gt=0, le=100, description="torque over inertia [m/s2]")


def check_phases(phases: tuple[PhaseConfig, ...], declared: "KiteDeclaration", log: "FlightLog") -> Iterator[tuple[str, BadInput]]:
    """What cannot be flown of a plan's phases."""
    from awescli.physics.kite import has_line, surfaces_used

    if phases and not has_line(declared):
        yield "phases", BadInput("phases pay a line out and reel it in, and this kite flies free", do="Leave them out.")
        return
    for i, phase in enumerate(phases):
        for surface in phase.surfaces:
            if surface not in surfaces_used(declared) | set(log.inputs):
                known = ", ".join(sorted(surfaces_used(declared)))
                yield (
                    "phases",
                    BadInput(f"phase {i + 1} ({phase.name}) holds '{surface}', which this kite does not have", do=f"It has {known}."),
                )
        for name, limit in phase.until.items():
            if name == "time_in_phase" and limit.above is None:
                yield "phases", BadInput(f"phase {i + 1} ({phase.name}): time in a phase only grows", do="Use above.")


def guards_of(until: Mapping[Ending, Limit]) -> "tuple[Guard, ...]":
    """The guards of a phase, SI."""
    from awescli.simulation.switching import Guard

    scale = {"elevation": math.pi / 180}
    return tuple(Guard(name, scale.get(name, 1.0) * limit.value, limit.above is not None) for name, limit in until.items())


def laws_of(phases: tuple[PhaseConfig, ...], log: "FlightLog", declaration: "KiteDeclaration", fitted: "Law | None") -> "Iterator[Held]":
    """A law (`deflections`) for each phase: who steers, and what is held."""
    from dataclasses import replace

    import numpy as np

    from awescli.control.held import Held
    from awescli.notation.quantities import SURFACES
    from awescli.stages.follower import follower_of

    follower = follower_of(log, declaration) if any(p.law == "path_following" for p in phases) else None
    medians = {name: float(np.median(log[name])) for name in SURFACES if name in log.inputs}
    for phase in phases:
        held = {name: math.radians(value) for name, value in phase.surfaces.items()}
        if phase.law == "controller":
            law = present(fitted, "the fitted law")
            rest = {n: v for n, v in medians.items() if n not in (*law.surfaces, *law.constants)}
            yield Held(law, rest | held)
            continue
        circle = {n: v if n == "radius" else math.radians(v) for n, v in phase.pattern.model_dump().items() if v is not None}
        here = present(follower, "the law that flies a circle")
        yield Held(replace(here, pattern=replace(here.pattern, **circle)), held)


def pumping_phases(phases: tuple[PhaseConfig, ...], log: "FlightLog", kite: "FlightModel", fitted: "Law | None") -> "list[PumpingPhase]":
    """The phases as the simulation flies them, made for a kite."""
    from awescli.simulation.closed_loop import loop
    from awescli.simulation.pumping import PumpingPhase
    from awescli.stages.controller_artifact import wind_direction

    laws = laws_of(phases, log, kite.declaration, fitted)
    return [
        PumpingPhase(p.name, loop(law, kite, wind_direction(log)), p.winch.model_dump(exclude={"fitted"}), guards_of(p.until), law.pattern)
        for p, law in zip(phases, laws, strict=True)
    ]


def with_fitted_winch(config: "SimulateConfig", metrics: Mapping) -> "SimulateConfig":
    """The settings of simulate with the winch laws that fit-controller found, and the lag of the drum behind them where the plan names
    none. metrics: its metrics.json. Raises BadInput where it has found none for a phase."""
    laws, phases, lags = metrics.get("winch", {}), [], []
    for i, phase in enumerate(config.phases):
        named = phase.winch.model_dump(exclude_unset=True, exclude={"fitted"})
        if phase.winch.fitted:
            if phase.name not in laws:
                found = f"it has one for {' and '.join(laws)}" if laws else "it has none"
                do = "Run awes fit-controller with winch: true, and split.of: cycles, so that its loops hold the phase."
                raise BadInput(f"fit-controller found no winch law for {phase.name} ({found})", f"simulate.phases.{i}.winch", do)
            rows = laws[phase.name]["parameters"]
            named = {n: row["value"] for n, row in rows.items() if n != "tau_d"} | named
            lags.append(rows["tau_d"]["value"])
        phases.append(phase.model_copy(update={"winch": WinchLaw(**named)}))
    drum = config.drum
    if lags and "tau" not in drum.model_fields_set:
        drum = Drum(**drum.model_dump(exclude_unset=True) | {"tau": sorted(lags)[len(lags) // 2]})
    return config.model_copy(update={"phases": tuple(phases), "drum": drum})


def on_winch(declaration: "KiteDeclaration", drum: Drum) -> "KiteDeclaration":
    """The kite on the plan's winch; what a kite file says of its own drum stays, unless the plan says otherwise."""
    from awescli.simulation.pumping import DRUM, with_winch

    return with_winch(declaration, drum.model_dump(exclude_unset=DRUM in declaration.effects))


def fly_phases(
    config: "SimulateConfig", log: "FlightLog", first: int, kite: "FlightModel", fitted: "Law | None", wind: "WindRecord", how: Mapping,
    known: "Known | None" = None,
) -> "tuple[Flown, list[str], dict]":  # fmt: skip
    """(the flight through the plan's phases, the name of the phase of every sample, what metrics.json says of the flight), from sample
    `first` of the log, its line and its load on.

    known: of the parameters (`power_interval.Known`), for the interval of the mean power of all cycles that were asked for: 5 to 95 % of
    those drawn kites that fly them.
    """
    from awescli.flightlog.cycles import cycles
    from awescli.flightlog.phases import phases
    from awescli.simulation.pumping import Pumping, energies

    line = {"length": float(log["tether_length"][first]), "speed": float(log["reel_out_speed"][first])}
    line["load"] = max(float(log["tension"][first]), 0.0) if "tension" in log else 0.0
    pumping = Pumping.of(kite, pumping_phases(config.phases, log, kite, fitted), config.step)
    pumped = pumping.fly(wind, cycles=config.cycles, **line, **how)
    names = [p.name for p in config.phases]
    rows, whole = energies(pumped, names)
    summary = {"phases": rows, "cycles": whole, "cycles_flown": pumped.done, "mean_cycle_W": mean_power(whole)}
    if known is not None and config.draws and config.cycles == pumped.done:
        kites = known.draws(kite, config.draws, how["seed"])
        flown = [pumping.fly(wind, cycles=config.cycles, **line, **how, values=values) for values in kites]
        means = [mean_power(energies(f, names)[1]) for f in flown if f.ended]
        summary |= {"mean_cycle_interval_W": band([w for w in means if w is not None]), "draws": config.draws}
        summary["draws_flown"] = sum(f.ended is not None for f in flown)
    if known is not None and config.draws and config.cycles == pumped.done:
        summary |= slopes(config, pumping, wind, known, line | {k: how[k] for k in ("start", "duration", "dt", "begins")})
    power = log["tension"] * log["reel_out_speed"] if "tension" in log else None
    measured = [float(power[a:b].mean()) for a, b in cycles(phases(log))] if power is not None else []
    return pumped.flown, [names[i] for i in pumped.phase.tolist()], summary | ({"measured_cycle_W": measured} if measured else {})


def slopes(config: "SimulateConfig", pumping: "Pumping", wind: "WindRecord", known: "Known", how: Mapping) -> dict:
    """{"slopes"}: exact derivatives of the mean cycle power in calm air with respect to each parameter and to each setting of a phase;
    nothing where the flight cannot be differentiated, or its cycles do not come to their end.

    They are those of small changes: a larger one moves the place on the loop at which a phase ends, and with it the power back and forth.
    """
    from awescli.simulation.pumping import CONTROL, Pumping
    from awescli.simulation.pumping_sensitivities import differentiated, held, parameters_of

    kite = pumping.kite
    if "turbulence.sigma" in kite.parameters or not held(pumping, how["dt"]):
        return {}
    names = [n for n, of_record in zip(known.names, known.record, strict=True) if not of_record and n in kite.parameter_names]
    settings = [
        (what, i, value, unit)
        for i, phase in enumerate(config.phases)
        for what, value, unit in (
            *((f"{CONTROL}.{n}", v, WINCH_UNITS[n]) for n, v in phase.winch.model_dump(exclude_unset=True).items() if n in WINCH_UNITS),
            *((g.quantity, g.limit, LIMIT_UNITS[g.quantity]) for g in guards_of(phase.until)),
        )
    ]
    asked = [*names, *((what, i) for what, i, _, _ in settings)]
    made = Pumping.of(kite, pumping.phases, config.step, wrt=parameters_of(asked))
    cycles = present(config.cycles, "a number of cycles")
    flown = differentiated(made, wind, asked, cycles=cycles, **how)
    if flown.cycles < cycles:
        return {}
    mean, moved, _ = flown.mean_power()
    rows = [
        *({"name": name, "value": kite.parameters[name].value, "unit": kite.parameters[name].unit} for name in names),
        *({"name": what.removeprefix(f"{CONTROL}."), "phase": i + 1, "value": value, "unit": unit} for what, i, value, unit in settings),
    ]
    return {"slopes": {"mean_W": mean, "rows": [row | {"W_per_unit": float(w)} for row, w in zip(rows, moved, strict=True)]}}


def band(means: list[float]) -> list[float] | None:
    """[low, high] of the BAND of some means; None of fewer than two."""
    import numpy as np

    from awescli.simulation.power_curve import BAND

    return np.quantile(means, BAND).tolist() if len(means) > 1 else None


def mean_power(whole: list[dict]) -> float | None:
    """[W] over whole cycles; None where none was flown."""
    seconds = sum(row["to_s"] - row["from_s"] for row in whole)
    return sum(row["energy_J"] for row in whole) / seconds if seconds else None


def told_of_cycles(pumped: Mapping) -> list[str]:
    """What was earned, in a line: mean cycle power and the power of each phase; nothing for a flight without phases."""
    if not pumped:
        return []
    if pumped["mean_cycle_W"] is None:
        return ["no pumping cycle came to its end"]
    whole = pumped["cycles_flown"]
    of: dict[str, list[dict]] = {}
    for row in pumped["phases"]:
        if row["cycle"] <= whole:
            of.setdefault(row["phase"], []).append(row)
    shares = ", ".join(f"{name} {(mean_power(rows) or 0.0) / 1000:.3g}" for name, rows in of.items())
    seconds = sum(row["to_s"] - row["from_s"] for row in pumped["cycles"]) / whole
    interval = pumped.get("mean_cycle_interval_W")
    between = " (90 %: {:.3g} to {:.3g})".format(*(w / 1000 for w in interval)) if interval else ""
    return [f"{whole} pumping cycles of {seconds:.0f} s: mean power {pumped['mean_cycle_W'] / 1000:.3g} kW{between}; {shares}"]
