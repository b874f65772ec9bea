"""The form of what simulate says of its flight."""

from typing import Literal, Self

from pydantic import Field, model_validator

from awescli.artifacts.forms.words import Channels, Checked, Horizon, Interval, Number, Text


class OwnWind(Checked):
    """The wind that the plan asked for."""

    speed: Number | None = Field(description="wind speed at `height` [m/s]; nothing: as recorded")
    direction: Number | None = Field(description="where it comes from, clockwise from north [deg]; nothing: as recorded")
    height: Number | None = Field(default=None, description="height that `speed` is given at [m]")
    shear: Number | None = Field(default=None, description="exponent of the power law over height [-]")


class Earned(Checked):
    """Energy of a phase or a whole pumping cycle that was flown."""

    cycle: int = Field(description="number of the cycle, from 1")
    from_s: Number = Field(description="begin, from the start of the simulation [s]")
    to_s: Number = Field(description="where it ends, on the same clock [s]")
    energy_J: Number = Field(description="tension times reel-out speed, over time [J]; negative: spent")
    mean_W: Number = Field(description="the same over its duration [W]")
    mean_tension_N: Number = Field(description="mean tension [N]")
    from_m: Number = Field(description="length of line paid out at the begin [m]")
    to_m: Number = Field(description="and at the end [m]")


class InWind(Checked):
    """Mean cycle power in one wind."""

    wind_m_s: Number = Field(description="wind speed at the plan's `wind.height` [m/s]")
    mean_W: Number | None = Field(description="mean mechanical power of a cycle [W]; nothing where the kite is lost")
    low_W: Number | None = Field(description="5 % quantile over kites drawn from what is known of the parameters [W]")
    high_W: Number | None = Field(description="95 % quantile [W]")
    draws: int = Field(description="drawn kites that flew")


class Slope(Checked):
    """How the mean cycle power changes with a small change of one quantity."""

    name: Text = Field(description="parameter of the kite, setting of the winch, or quantity whose limit ends a phase")
    phase: int | None = Field(default=None, description="number of the phase that it belongs to, from 1; nothing for a parameter")
    value: Number = Field(description="its value [as `unit` says]")
    unit: Text = Field(description="unit of the value")
    W_per_unit: Number = Field(description="change of the mean cycle power [W per unit of the quantity]")


class Slopes(Checked):
    """Exact sensitivities of the mean cycle power, switches from phase to phase included."""

    mean_W: Number = Field(description="mean mechanical power of the cycles [W]")
    rows: list[Slope] = Field(description="quantity by quantity")


class FlownPhase(Earned):
    """Energy of one phase."""

    phase: Text = Field(description="traction, transition or retraction")
    ended_by: Text = Field(description="quantity whose limit ended it, `end` of the simulation, or `departed`")


class Flown(Checked):
    """metrics.json of simulate."""

    outcome: Literal["flew_on", "departed"] = Field(description="departed: it diverged, crashed or stalled")
    start_s: Number = Field(description="where in the measured flight it sets out [s]")
    survived_s: Number = Field(description="how long it flew [s]")
    asked_s: Number = Field(description="how long it was to fly [s]")
    unseen_s: Number = Field(default=0.0, description="how long it is compared with test loops [s]; what follows was seen by some stage")
    model: Literal["initial", "identified", "with_effects", "hybrid"] = Field(description="which model flew")
    surfaces: Literal["controller", "recorded", "path_following"] = Field(description="who moved the surfaces")
    effects: dict[str, dict[str, Number]] = Field(
        description="effect that was switched on -> parameter -> size [unit of the effect's parameter]"
    )
    wind: OwnWind = Field(description="wind of the plan")
    nrmse: dict[Horizon, Channels] = Field(description="seconds ahead -> channel -> NRMSE against the measured flight, noise-free [-]")
    path_error_m: dict[Horizon, Number] = Field(description="seconds ahead -> root mean square distance from the measured path [m]")
    seed: int | None = Field(default=None, description="seed of noise and gusts")
    phases: list[FlownPhase] = Field(default=[], description="phases that were flown, of a plan with phases")
    cycles: list[Earned] = Field(default=[], description="whole pumping cycles")
    mean_cycle_W: Number | None = Field(default=None, description="mean mechanical power of whole cycles [W]")
    mean_cycle_interval_W: Interval = Field(
        default=None, description="5 to 95 % of it over kites drawn from what is known of the parameters [W]"
    )
    cycles_flown: int = Field(default=0, description="whole pumping cycles that were flown")
    draws: int = Field(default=0, description="kites drawn from what is known of the parameters")
    draws_flown: int = Field(default=0, description="drawn kites that flew all cycles")
    measured_cycle_W: list[Number] = Field(default=[], description="mean mechanical power of each measured pumping cycle [W]")
    slopes: Slopes | None = Field(default=None, description="how the mean cycle power changes with parameters, winch settings and limits")
    power_curve: dict[Literal["initial", "identified", "with_effects"], list[InWind]] = Field(
        default={}, description="model -> mean cycle power in every wind"
    )

    @model_validator(mode="after")
    def _alike(self) -> Self:
        if self.nrmse.keys() != self.path_error_m.keys():
            raise ValueError("nrmse and path_error_m are of different times")
        return self
