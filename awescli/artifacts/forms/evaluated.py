"""The form of what evaluate says of every model."""

from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from awescli.artifacts.forms.words import Channels, Checked, Duration, Horizon, Interval, Loops, Number, OrAbsent, Parts, Spread, Text, Word


class Ahead(Checked):
    """Errors so far ahead, on test loops."""

    horizon_s: Duration = Field(default=0.0, description="how far ahead [s]")
    predictions: int = Field(description="predictions of this length")
    diverged_predictions: int = Field(description="those that diverged; they count with their last error")
    nrmse: Channels = Field(description="channel -> NRMSE, and their `mean` [-]")
    rmse: dict[str, Number | None] = Field(default={}, description="channel -> root mean square error [SI unit of the channel]")


class OfLoop(Checked):
    """Errors in one loop."""

    loop: int = Field(description="number of the loop, from 1")
    part: Literal["train", "validation", "test"] = Field(description="part of the flight that it belongs to")
    from_s: Number = Field(description="begin, on the flight's clock [s]")
    to_s: Number = Field(description="where it ends, on the same clock [s]")
    nrmse: Channels = Field(description="channel -> NRMSE, and their `mean` [-]")


class Energy(Checked):
    """Mechanical energy of one loop, measured and predicted."""

    loop: int = Field(description="number of the loop, from 1")
    seconds: Number = Field(description="how much of it predictions cover [s]")
    of_seconds: Number = Field(description="how long it lasts [s]")
    measured_J: Number = Field(description="measured energy of the covered seconds [J]")
    predicted_J: Number = Field(description="predicted energy of them [J]")
    reeled_m: Number | None = Field(default=None, description="line paid out in the covered seconds [m]")


class EnergyError(Checked):
    """Error of the energy of a loop, over loops."""

    nrmse: Number | None = Field(description="root mean square error over the range of the measured energies [-]")
    relative_rmse: Number | None = Field(description="root mean square error over their mean [-]")
    loops: int = Field(description="loops that predictions cover far enough")


class Predicted(Checked):
    """Mechanical power and energy of a part of the flight, measured and predicted."""

    seconds: Number = Field(description="how much of it predictions cover [s]")
    of_seconds: Number = Field(description="how long it lasts [s]")
    measured_J: Number = Field(description="measured energy of the covered seconds [J]")
    predicted_J: Number = Field(description="predicted energy of them [J]")
    measured_mean_W: Number = Field(description="measured mean power of them [W]")
    mean_W: Number = Field(description="predicted mean power of them [W]")
    interval_W: Interval = Field(
        default=None, description="interval of the prediction at `interval_level` [W]; nothing where the model was not fitted"
    )
    interval_level: Number = Field(default=0.9, description="probability of that interval [-]")
    std_W: dict[str, Number] = Field(default={}, description="part of it (parameters, wind, loops) -> standard deviation [W]")


class OfPhase(Predicted):
    """Of one phase, over all that no stage was fitted to or chosen on."""

    phase: Word = Field(description="traction, transition or retraction")


class OfCycle(Predicted):
    """Of one pumping cycle."""

    cycle: int = Field(description="number of the cycle, from 1")
    from_s: Number = Field(description="begin, on the flight's clock [s]")
    to_s: Number = Field(description="where it ends, on the same clock [s]")
    unseen_share: Number = Field(description="share of it that no stage was fitted to or chosen on [-]")


class Power(Checked):
    """What a tethered flight earned on the test loops: mean mechanical power, tension times reel-out speed."""

    mean_W: Number = Field(description="predicted, over all predicted seconds inside loops [W]")
    measured_mean_W: Number = Field(description="measured, over the same seconds [W]")
    error_share: Number | None = Field(description="mean_W / measured_mean_W - 1 [-]; nothing where nothing was earned")
    interval_share: Interval = Field(description="95 % interval of error_share over loops [-]; nothing of fewer than two loops")
    interval_W: Interval = Field(
        default=None,
        description="interval at `interval_level`, with what other loops take off [W]; nothing where the model was not fitted",
    )
    interval_level: Number = Field(default=0.9, description="probability of that interval [-]")
    energy_per_loop_J: EnergyError | None = Field(default=None, description="how well the energy of a loop is predicted")
    std_W: dict[str, Number] = Field(default={}, description="part of that interval (parameters, wind, loops) -> standard deviation [W]")
    by_phase: list[OfPhase] = Field(default=[], description="phase by phase")
    by_cycle: list[OfCycle] = Field(default=[], description="cycle by cycle, over the whole flight")
    seconds: Number = Field(description="predicted seconds inside loops [s]")
    loop_seconds: Number = Field(description="how long these loops last [s]")
    loops: int = Field(description="how many they are")
    by_loop: Annotated[list[Energy], Field(min_length=1)] = Field(description="loop by loop")


class Bands(Checked):
    """Bands around a model's predictions of the test loops."""

    outcome: Text = Field(description='"computed", how many predictions diverged, or why there are none')
    level: Number = Field(default=0.9, description="share of the samples that they should hold [-]")
    predictions: int = Field(default=0, description="predictions that they lie around")
    inside: dict[str, Number] = Field(default={}, description="channel -> share of the samples that they hold, `all` of them together [-]")
    half_width: dict[str, Number] = Field(default={}, description="channel -> mean half width [SI unit of the channel]")
    std: dict[str, dict[str, Number]] = Field(
        default={},
        description="source (parameters, processes, start, noise) -> channel -> its part, root mean square [SI unit of the channel]",
    )


class Scored(Checked):
    """All scores of one model."""

    outcome: Text = Field(default="scored", description="scored, or why there are no scores")
    horizon_s: Duration = Field(default=0.0, description="seconds predicted ahead in `nrmse` [s]")
    nrmse: Parts = Field(description="errors `horizon_s` ahead, part by part")
    divergence_rate: dict[str, Number | None] = Field(default={}, description="part -> share of predictions that diverged [-]")
    predictions: dict[str, int] = Field(default={}, description="part -> predictions that were made")
    diverged_predictions: dict[str, int] = Field(default={}, description="part -> those that diverged; they count with their last error")
    rmse: dict[str, Number | None] = Field(default={}, description="channel -> root mean square error on test [SI unit of the channel]")
    r2: dict[str, Number | None] = Field(default={}, description="channel -> coefficient of determination on test [-]")
    theil: dict[str, Annotated[Spread, Field(le=1)] | None] = Field(
        default={}, description="channel -> Theil's inequality coefficient on test (Jategaonkar, ch. 11) [-]"
    )
    by_horizon: dict[Horizon, Ahead] = Field(description="seconds ahead -> errors on test; as many as fit into a stretch of it")
    one_step: Ahead | None = Field(description="errors one sample ahead; nothing where test is too short")
    by_loop: list[OfLoop] = Field(description="errors loop by loop, over the whole flight")
    bands: Annotated[Bands | None, OrAbsent] = Field(default=None, description="how far the predictions may be off, and how often they are")
    power: Annotated[Power | None, OrAbsent] = Field(
        default=None, description="what the flight earned, and what the model predicts of it; tethered flights only"
    )


class Baseline(Checked):
    """The linear model (ARX) beside the others: how it came about, and which of these do not beat it."""

    outcome: Literal["fitted", "unstable", "too_short"] = Field(
        description="unstable: even the best choice runs away on validation; too_short: fewer samples than coefficients"
    )
    inputs: list[Text] = Field(default=[], description="quantities that it is given over the prediction")
    outputs: list[Text] = Field(default=[], description="channels that it predicts")
    place: bool = Field(default=False, description="whether it sees where the kite is, not only how it moves")
    ridge: Number = Field(default=0.0, description="weight of its ridge regression [-]")
    validation: Number | None = Field(default=None, description="mean NRMSE on validation, by which order and ridge were chosen [-]")
    order: int = Field(default=0, description="past samples that it sees")
    step_s: Number = Field(default=0.0, description="time between them [s]")
    not_beaten: dict[str, list[Horizon]] = Field(
        default={}, description="model -> seconds ahead at which its mean error on test is not below the linear one's"
    )


class AtHeight(Checked):
    """The wind at one height, from the kite and from the station."""

    height_m: Number = Field(description="above the winch [m]")
    seconds: Number = Field(description="flown there [s]")
    speed_m_s: Number = Field(description="wind speed that the model needs [m/s]")
    speed_std: Number = Field(description="its standard deviation [m/s]")
    direction_deg: Number = Field(description="where it comes from, clockwise from north [deg]")
    direction_std: Number = Field(description="its standard deviation [deg]")
    pitot_speed_m_s: Number | None = Field(
        default=None, description="wind speed that airspeed and velocity show, without a model of forces [m/s]"
    )
    pitot_speed_std: Number | None = Field(default=None, description="its standard deviation [m/s]")
    pitot_direction_deg: Number | None = Field(default=None, description="and its direction [deg]")
    pitot_direction_std: Number | None = Field(default=None, description="its standard deviation [deg]")
    station_speed_m_s: Number = Field(description="wind speed of the record, carried to that height by the kite file's law [m/s]")
    station_direction_deg: Number = Field(description="and its direction [deg]")

    @model_validator(mode="after")
    def _whole(self) -> Self:
        names = ("pitot_speed_m_s", "pitot_speed_std", "pitot_direction_deg", "pitot_direction_std")
        if len({getattr(self, name) is None for name in names}) > 1:
            raise ValueError(f"{', '.join(names)} stand together, or none of them does")
        return self


class WindProfile(Checked):
    """The kite as a wind sensor."""

    model: Literal["identified", "with_effects"] = Field(description="model that it was found with")
    rows: Annotated[list[AtHeight], Field(min_length=1)] = Field(description="height by height")


class Scores(Checked):
    """metrics.json of evaluate: a block for every model that there is."""

    horizon_s: Duration = Field(description="seconds predicted ahead in `nrmse` [s]")
    surfaces: Literal["recorded", "controller"] = Field(
        default="recorded", description="recorded: set-points replayed; controller: the loop closed"
    )
    initial_states: Literal["free", "measured", "filtered"] = Field(
        default="free", description="where predictions begin; free: in a state fitted to the second before; measured: as measured; "
        "filtered: in the state, gusts, line and model error that a filter over that second sees",
    )
    split: Loops | None = Field(default=None, description="where train, validation and test lie")
    outcomes: dict[str, Text] = Field(default={}, description="stage -> how it ended, in a word")
    wind_profile: Annotated[WindProfile | None, OrAbsent] = Field(
        default=None, description="wind against height that the last fitted model needs"
    )
    noise_floor: Channels = Field(description="channel -> NRMSE that sensor noise alone causes on test, and their `mean` [-]")
    initial: Scored = Field(description="the declared model")
    identified: Annotated[Scored | None, OrAbsent] = Field(default=None, description="with the parameters of identify")
    with_effects: Annotated[Scored | None, OrAbsent] = Field(default=None, description="with the effects that were found")
    hybrid: Annotated[Scored | None, OrAbsent] = Field(default=None, description="with the network on top")
    linear: Annotated[Scored | None, OrAbsent] = Field(default=None, description="the linear model, fitted to the same flight")
    baseline: Annotated[Baseline | None, OrAbsent] = Field(default=None, description="how the linear model came about")

    @model_validator(mode="after")
    def _alike(self) -> Self:
        every = (self.initial, self.identified, self.with_effects, self.hybrid, self.linear)
        models = [model for model in every if model is not None]
        for of in (lambda m: m.nrmse.test.keys(), lambda m: m.by_horizon.keys()):
            if any(of(model) != of(self.initial) for model in models):
                raise ValueError("models are scored on different channels or horizons")
        return self
