"""The form of what evaluate says of every model."""

from typing import Annotated, Literal

from pydantic import Field, model_validator

from awescli.artifacts.form_words import Channels, Checked, Horizon, Number, Word


class Ahead(Checked):
    """Errors so far ahead."""

    predictions: int
    diverged_predictions: int
    nrmse: Channels
    rmse: dict[str, Number | None] = {}


class OfLoop(Checked):
    loop: int
    part: Literal["train", "validation", "test"]
    from_s: Number
    to_s: Number
    nrmse: Channels


class Energy(Checked):
    """Of one loop, measured and predicted."""

    loop: int
    seconds: Number
    of_seconds: Number
    measured_J: Number
    predicted_J: Number


Interval = Annotated[list[Number], Field(min_length=2, max_length=2)] | None


class Told(Checked):
    """Mean power and energy of a part of the flight, measured and predicted."""

    seconds: Number
    of_seconds: Number
    measured_J: Number
    predicted_J: Number
    measured_mean_W: Number
    mean_W: Number
    interval_W: Interval = None


class OfPhase(Told):
    phase: Word


class OfCycle(Told):
    cycle: int
    from_s: Number
    to_s: Number
    unseen_share: Number


class Power(Checked):
    mean_W: Number
    measured_mean_W: Number
    error_share: Number | None
    interval_share: Interval
    interval_W: Interval = None
    std_W: dict[str, Number] = {}
    by_phase: list[OfPhase] = []
    by_cycle: list[OfCycle] = []
    seconds: Number
    loop_seconds: Number
    loops: int
    by_loop: Annotated[list[Energy], Field(min_length=1)]


class Bands(Checked):
    """Bands around the predictions of the test loops. level: share of samples that they should hold; outcome: "computed", how many
    predictions diverged, or why there are none; inside: channel -> share of samples that they hold, `all` of them together; half_width:
    its mean, and std: parameters, processes, start, noise -> what each makes of it, SI."""

    outcome: str
    level: Number = 0.9
    predictions: int = 0
    inside: dict[str, Number] = {}
    half_width: dict[str, Number] = {}
    std: dict[str, dict[str, Number]] = {}


class Parts(Checked):
    train: Channels
    validation: Channels
    test: Channels


class Scored(Checked):
    """All scores of one model."""

    nrmse: Parts
    predictions: dict[str, int] = {}
    diverged_predictions: dict[str, int] = {}
    rmse: dict[str, Number | None] = {}
    r2: dict[str, Number | None] = {}
    theil: dict[str, Number | None] = {}
    by_horizon: dict[Horizon, Ahead]
    one_step: Ahead | None
    by_loop: list[OfLoop]
    bands: Bands = None
    power: Power = None  # one that is not there may not be null


class Baseline(Checked):
    """The linear model beside the others: how it came about, and at which horizons [s] each of these does not beat it."""

    outcome: Literal["fitted", "unstable", "too_short"]
    order: int = 0
    step_s: Number = 0.0
    not_beaten: dict[str, list[Horizon]] = {}


class AtHeight(Checked):
    """The wind at one height, from the kite, the pitot and the station."""

    height_m: Number
    seconds: Number
    speed_m_s: Number
    speed_std: Number
    direction_deg: Number
    direction_std: Number
    station_speed_m_s: Number
    station_direction_deg: Number


class WindProfile(Checked):
    model: Literal["identified", "with_effects"]
    rows: Annotated[list[AtHeight], Field(min_length=1)]


class Scores(Checked):
    """metrics.json of evaluate."""

    horizon_s: Number
    wind_profile: WindProfile = None
    noise_floor: Channels
    initial: Scored
    identified: Scored = None
    with_effects: Scored = None
    hybrid: Scored = None
    linear: Scored = None
    baseline: Baseline = None

    @model_validator(mode="after")
    def _alike(self):
        every = (self.initial, self.identified, self.with_effects, self.hybrid, self.linear)
        models = [model for model in every if model is not None]
        for of in (lambda m: m.nrmse.test.keys(), lambda m: m.by_horizon.keys()):
            if any(of(model) != of(self.initial) for model in models):
                raise ValueError("models are scored on different channels or horizons")
        return self
