"""The form of what trace-residual finds: effects.json."""

from typing import Annotated, Literal

from pydantic import Field, model_validator

from awescli.artifacts.forms.words import Channels, Checked, Number, Numbers, OrAbsent, Spread, Text, Word


class Size(Checked):
    """How large an effect is."""

    value: Number = Field(description="size of the parameter [as `unit` says]")
    std: Spread | None = Field(description="its standard deviation [as `unit` says]; nothing where none is known")
    unit: Text = Field(description="unit of value and std")


class Named(Checked):
    """An effect of the library."""

    name: Text = Field(description="its name in the library")
    acts_on: Text = Field(default="", description="what it acts on: a surface, an axis, a sensor, or its place in the model")


class Effect(Named):
    """An effect that was found."""

    rivals: list[Named] = Field(description="effects that this flight cannot tell from it")
    parameters: dict[str, Size] = Field(description="parameter -> its size")
    doc: Text = Field(default="", description="what the effect is, in a line")


class Candidate(Named):
    """One candidate, as the first round judged it."""

    score: Number = Field(description="fall of the deviance by it, to first order [-]")
    p_value: Number = Field(
        description="probability of such a score where the effect is absent (likelihood ratio, all candidates counted) [-]"
    )
    explained_share: Number = Field(description="share of what the answer explains that it explains alone, on train [-]")
    plausible_size: bool = Field(description="whether its fitted size lies inside its plausible range")
    test_gain: Number | None = Field(description="share of the cost of validation loops that it takes away [-]")
    outcome: Text = Field(default="", description="outcome of its fit: converged, failed, not fitted, ...")


class Unexplained(Checked):
    """What repeats and has no name in the library."""

    channel: Text = Field(default="", description="force or moment in which it shows most: f_x to m_z")
    share: Number | None = Field(default=None, description="share of the misfit that the empirical terms explain [-]")
    expression: Text | None = Field(default=None, description="sparse expression for it; nothing where no term helps")


class OwnUnit(Checked):
    """Unit of a detectable size."""

    unit: Text = Field(default="-", description="unit of the size in `detectable`")


class Shift(Checked):
    """How far a parameter lies from its prior, without the answer's effects and with them."""

    before_in_prior_std: Number = Field(description="(value - prior) / prior_std before [-]")
    after_in_prior_std: Number = Field(description="the same after [-]")


class Errors(Checked):
    """Errors on loops that took no part in the choice; the same channels in all three."""

    horizon_s: Number = Field(description="length of a prediction [s]")
    before: Annotated[Channels | None, OrAbsent] = Field(
        default=None,
        description="channel -> NRMSE of the model without the answer's effects, and their `mean` [-]; not there where nothing was fitted",
    )
    after: Channels = Field(description="likewise, with them [-]")
    noise_floor: Channels = Field(description="likewise, what sensor noise alone causes [-]")

    @model_validator(mode="after")
    def _alike(self):
        before = self.after if self.before is None else self.before
        if not before.keys() == self.after.keys() == self.noise_floor.keys():
            raise ValueError("before, after and noise_floor are of different channels")
        return self


class BeforeAfter(Checked):
    """Chi-square of one channel."""

    before: Number = Field(description="without roll gusts [-]; 1: noise")
    after: Number = Field(description="with them [-]")


class RollGusts(Checked):
    """Gusts that roll the kite, where what is left looks like them."""

    std_rad_s: Number = Field(description="standard deviation of the vertical gust's gradient along the span [rad/s]")
    worth: Number = Field(description="fall of the deviance by them [-]")
    lasts_s: Number = Field(description="their correlation time [s]")
    split: Text = Field(description="part of the flight that they were judged on")
    channels: dict[str, BeforeAfter] = Field(description="channel -> chi-square without them and with them")
    parameter_shifts: dict[str, Shift] = Field(description="parameter -> where it lies without them and with them")


class Criterion(Checked):
    """One line of what the verdict stands on."""

    says: Text = Field(description="the criterion in a sentence")
    value: Number | Text = Field(description="what this flight gives [as `says` tells]")
    threshold: Number | Text = Field(description="what is asked [as `says` tells]")
    passed: bool | None = Field(alias="pass", description="whether it is met; nothing where it could not be tested")
    source: Text = Field(description="where the threshold comes from")


class SeenAlone(Checked):
    """An error of a sensor that kinematics alone shows, without any model of forces."""

    name: Word = Field(description="which error")
    acts_on: Text = Field(description="sensor or group of sensors")
    channels: list[Text] = Field(description="channels that have it")
    size: Number = Field(description="how large it is [as `unit` says]")
    std: Number = Field(description="its standard deviation [as `unit` says]")
    unit: Text = Field(description="unit of size and std")
    sentence: Text = Field(description="the same in a sentence")


class Effects(Checked):
    """effects.json of trace-residual."""

    verdict: Literal["none", "found", "cannot_tell", "unexplained", "not_deterministic", "not_testable"] = Field(
        description="what the declared model lacks, in a word (explanation: what a verdict means)"
    )
    sentence: Text = Field(description="the verdict in a sentence")
    effects: list[Effect] = Field(description="effects that were found; of `cannot_tell` each with its rivals")
    ranking: list[Candidate] = Field(description="every candidate, the likeliest first")
    unexplained: Unexplained | None = Field(description="what has no name, of the verdict `unexplained`")
    error: Errors = Field(description="errors on test loops, before and after")
    criteria: list[Criterion] = Field(default=[], description="what the verdict stands on")
    probability: Numbers = Field(
        default={}, description="cause -> its probability, `none` and `something_else` among them; they sum to one [-]"
    )
    chi2: dict[str, Number | None] = Field(
        default={}, description="part and model (train_before, ...) -> squared errors over noise per degree of freedom [-]; 1: noise"
    )
    gust_m_s: Number | None = Field(default=None, description="strongest gusts that the flight shows, one standard deviation [m/s]")
    roll_gusts: RollGusts | None = Field(default=None, description="gusts that roll the kite, of the verdict `not_deterministic`")
    detectable: Numbers = Field(
        default={}, description="effect -> smallest size that this flight would have shown [as `detectable_units` says]"
    )
    detectable_units: dict[str, OwnUnit] = Field(default={}, description="effect -> unit of that size")
    not_testable: list[Text] = Field(default=[], description="effects that the free parameters absorb")
    parameter_shifts: dict[str, Shift] = Field(default={}, description="parameter -> where it lies without the answer and with it")
    separate: list[Text] = Field(default=[], description="what to fly to tell rivals apart, a sentence each")
    kinematics: list[SeenAlone] = Field(default=[], description="errors of sensors that show without any model of forces")

    @model_validator(mode="after")
    def _fitted(self):
        if self.error.before is None and self.verdict != "not_testable":
            raise ValueError("error.before is missing")
        return self
