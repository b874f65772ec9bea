"""The form of what trace-residual finds: effects.json."""

from typing import Annotated, Any, Literal, Self

from pydantic import Field, model_validator

from awescli.artifacts.forms.parameters import Level
from awescli.artifacts.forms.words import (
    Before,
    Channels,
    Checked,
    Duration,
    Misfit,
    Number,
    Numbers,
    OrAbsent,
    Parts,
    Predicted,
    Spread,
    Text,
    Word,
)


class Size(Checked):
    """How large an effect is."""

    value: Number = Field(description="size of the parameter [as `unit` says]")
    std: Spread | None = Field(description="its standard deviation [as `unit` says]; nothing where none is known")
    unit: Text = Field(description="unit of value and std")


class Named(Checked):
    """An effect of the library."""

    name: Text = Field(description="its name in the library")
    acts_on: Text = Field(default="", description="what it acts on: a surface, an axis, a sensor, or its place in the model")


class Alike(Named):
    """A member of a class of effects that the flight cannot tell from each other."""

    parameters: dict[str, dict[str, Any]] = Field(description="parameter -> value, std and unit")
    lag: Number = Field(description="deviance by which it lies behind the best of them [-]")


class Effect(Named):
    """An effect that was found."""

    alike: list[Alike] = Field(default=[], alias="class", description="the effect and its rivals, with the size that each would have")
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
    outcome: Text = Field(default="", description="outcome of its fit: converged, failed, given up, not fitted, ...")
    significant: bool = Field(default=False, description="whether the score is larger than chance gives among so many candidates")
    deviance_gain: Number | None = Field(default=None, description="fall of the deviance by its fit [-]")


class Unexplained(Checked):
    """What repeats and has no name in the library."""

    channel: Text = Field(default="", description="force or moment in which it shows most: f_x to m_z")
    share: Number | None = Field(default=None, description="share of the misfit that the empirical terms explain [-]")
    expression: Text | None = Field(default=None, description="sparse expression for it; nothing where no term helps")
    terms: list[Any] = Field(default=[], description="terms of that expression")


class OwnUnit(Checked):
    """Unit of a detectable size."""

    unit: Text = Field(default="-", description="unit of the size in `detectable`")
    parameter: Text = Field(default="", description="parameter that the size is of")


class Shift(Checked):
    """How far a parameter lies from its prior, without the answer's effects and with them."""

    prior: Number | None = Field(default=None, description="declared value [unit of the parameter]")
    before: Number | None = Field(default=None, description="value before [unit of the parameter]")
    after: Number | None = Field(default=None, description="value after [unit of the parameter]")
    before_in_prior_std: Number = Field(description="(value - prior) / prior_std before [-]")
    after_in_prior_std: Number = Field(description="the same after [-]")


class Errors(Checked):
    """Errors on loops that took no part in the choice; the same channels in all three."""

    horizon_s: Duration = Field(description="length of a prediction [s]")
    split: Text = Field(default="test", description="part of the flight that they are of")
    diverged_before: int = Field(default=0, description="predictions of it that diverged, before; they count with their last error")
    diverged_after: int = Field(default=0, description="likewise, after")
    before: Annotated[Channels | None, OrAbsent] = Field(
        default=None,
        description="channel -> NRMSE of the model without the answer's effects, and their `mean` [-]; not there where nothing was fitted",
    )
    after: Channels = Field(description="likewise, with them [-]")
    noise_floor: Channels = Field(description="likewise, what sensor noise alone causes [-]")

    @model_validator(mode="after")
    def _alike(self) -> Self:
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

    name: Text = Field(default="", description="its name")
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


class Predicting(Named):
    """An effect with which unseen loops are predicted nearly as well."""

    after: Number = Field(description="error on validation loops with it: NRMSE, mean of the states [-]")


class PredictsBetter(Named):
    """An effect with which a model without a verdict predicts unseen loops better."""

    parameters: dict[str, Size] = Field(description="parameter -> its size")
    before: Number = Field(description="error on validation loops without it: NRMSE, mean of the states [-]")
    after: Number = Field(description="the same with it [-]")
    rivals: list[Predicting] = Field(description="others that take away at least half as much")


class ByPrediction(Checked):
    """What a model without a verdict predicts unseen loops better with: a place to look, no finding."""

    effects: list[PredictsBetter] = Field(description="one after the other, in the order in which they came")
    chi2: dict[str, Misfit] = Field(description="chi-square per degree of freedom on validation loops, `before` and `after` [-]")
    sentence: Text = Field(description="the same in a sentence")


class OfInstrument(Named):
    """What a flight without a verdict says of an error of a sensor or an actuator, all of them asked about at once."""

    parameter: Word = Field(description="parameter of the effect that the error is")
    size: Number = Field(description="its value [as `unit` says]")
    std: Number = Field(description="its standard deviation [as `unit` says]")
    unit: Text = Field(description="unit of size and std")
    found: bool = Field(description="whether it is clearly there, and of a size that changes what a model learns")
    rivals: list[Named] = Field(description="effects that do nearly the same to the instrument")
    sentence: Text = Field(description="the same in a sentence")


class Outside(Size):
    """A parameter whose declared bounds do not hold what the flight says."""

    lower: Number | None = Field(description="lower bound that was declared [as `unit` says]; nothing where there was none")
    upper: Number | None = Field(description="upper bound that was declared [as `unit` says]; nothing where there was none")
    sentence: Text = Field(description="the same in a sentence")


class Unnamed(Checked):
    """A further effect that may be there, or be what the form of the answer leaves."""

    name: Text = Field(description="of the library")
    acts_on: Text = Field(description="surface, axis, channel or place")
    gain: Number = Field(description="fall of the deviance by it, beside the answer [-]")
    sentence: Text = Field(description="the same in a sentence")


class Segments(Checked):
    """Where in the flight an answer gains."""

    begins_s: list[Number] = Field(description="begin of each segment, on the flight's clock [s]")
    gain: list[Number] = Field(description="fall of the deviance in it [-]")


class OfFlight(Checked):
    """What one of the flights says of the answer."""

    flight: Text = Field(description="which flight")
    effects: list[Text] = Field(default=[], description="effects that it was asked about")
    gain: Number | None = Field(default=None, description="fall of the deviance by them in this flight [-]")
    since_s: list[Number] | None = Field(
        default=None, description="[earliest, latest] time at which they began, on its clock [s]; nothing: with the flight"
    )
    segments: Segments | None = Field(default=None, description="where in the flight they gain")
    parameters: dict[str, Size] = Field(default={}, description="effect and parameter -> its size by this flight alone")


class Repeats(Checked):
    """What of the rest repeats from loop to loop, by permutation of the loops' phases."""

    share: Numbers = Field(default={}, description="force or moment -> share of the variance of its model error that repeats [-]")
    p: Numbers = Field(default={}, description="force or moment -> probability of such a share by chance [-]")
    loops: int = Field(default=0, description="loops that show it")


class Left(Checked):
    """What the answer leaves unexplained."""

    chi2: Misfit | None = Field(default=None, description="squared errors over noise per degree of freedom [-]; 1: noise")
    share: Number | None = Field(default=None, description="share of the declared model's misfit that is left beyond noise [-]")
    channels: dict[str, Misfit | None] = Field(default={}, description="channel -> the same as chi2 [-]")
    worth: Number | None = Field(default=None, description="fall of the deviance by model error, were it let in [-]")
    levels: dict[str, Any] = Field(default={}, description="force or moment -> level of that model error")
    repeats: Repeats | None = Field(default=None, description="what of it repeats from loop to loop; nothing where too few loops show it")


class Clock(Checked):
    """How far the winch's clock is from the kite's."""

    winch_late_s: Number = Field(description="how late the winch's signals come [s]")
    correlation: Number = Field(description="correlation of winch and range at that lag [-]")
    clear: bool = Field(description="whether that is to be believed")


class LeftOver(Checked):
    """The residual of one model, measured in several ways; the arrays stand in residuals.npz."""

    equation_error: dict[str, Number | None] = Field(
        default={}, description="force [N], moment [N m] or tension [N] -> root mean square of what the log shows and the model does not"
    )
    innovation: dict[str, Number | None] = Field(default={}, description="seconds ahead -> mean NRMSE on test [-]")
    loop_averaged_share: dict[str, Number | None] = Field(
        default={}, description="channel -> share of the variance half a second ahead that repeats from loop to loop [-]"
    )
    clock: Clock | None = Field(default=None, description="clocks of winch and kite; nothing where the log does not show it")


class Effects(Checked):
    """effects.json of trace-residual."""

    verdict: Literal["none", "found", "cannot_tell", "unexplained", "not_deterministic", "not_testable"] = Field(
        description="what the declared model lacks, in a word (explanation: what a verdict means)"
    )
    sentence: Text = Field(description="the verdict in a sentence")
    effects: list[Effect] = Field(description="effects that were found; of `cannot_tell` each with its rivals")
    unnamed: Unnamed | None = Field(default=None, description="a further effect that gains beside the answer, and gets no name")
    ranking: list[Candidate] = Field(description="every candidate, the likeliest first")
    unexplained: Unexplained | None = Field(description="what has no name, of the verdict `unexplained`")
    error: Errors = Field(description="errors on test loops, before and after")
    reason: Text | None = Field(default=None, description="why the answer could not be had, of the verdict `not_testable`")
    flights: list[OfFlight] = Field(default=[], description="flight by flight, what each says of the answer")
    left: Left | None = Field(default=None, description="what the answer leaves")
    processes: dict[str, Level] = Field(default={}, description="process -> its estimated level, with the answer")
    noise_factors: Numbers = Field(default={}, description="channel -> factor on its declared noise that the flight asks for [-]")
    outliers: dict[str, int] = Field(default={}, description="channel -> values that were left out: far off, for a moment")
    residual: dict[Literal["before", "after"], LeftOver] = Field(
        default={}, description="the residual without the answer's effects, and with them"
    )
    criteria: list[Criterion] = Field(default=[], description="what the verdict stands on")
    probability: Numbers = Field(description="cause -> its probability, `none` and `something_else` among them; they sum to one [-]")
    chi2: dict[str, Misfit | None] = Field(
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
    by_prediction: ByPrediction | None = Field(
        default=None, description="where there is no verdict: with which effects unseen loops are predicted better"
    )
    instruments: list[OfInstrument] = Field(
        default=[], description="where there is no verdict, or much is left: errors of instruments that the flight tells, clearest first"
    )
    outside_bounds: dict[str, Outside] = Field(
        default={}, description="parameter -> its value, where the answer holds only outside the bounds that the kite file declares"
    )
    kinematics: list[SeenAlone] = Field(default=[], description="errors of sensors that show without any model of forces")

    @model_validator(mode="after")
    def _fitted(self) -> Self:
        if self.error.before is None and self.verdict != "not_testable":
            raise ValueError("error.before is missing")
        return self


class Traced(Predicted):
    """metrics.json of trace-residual."""

    horizon_s: Duration = Field(default=0.0, description="length of a prediction [s]")
    nrmse: Parts | None = Field(default=None, description="errors of the model with the answer's effects")
    before: Before | None = Field(default=None, description="errors without them")
