"""The forms of what identify leaves, and of params.json of any stage."""

from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from awescli.artifacts.forms.words import (
    Before,
    Checked,
    Duration,
    Finite,
    Interval,
    Misfit,
    Number,
    Numbers,
    Parts,
    Predicted,
    Spread,
    Text,
    Word,
)


class Level(Checked):
    """How strong a process is: gusts, drift of a sensor, model error."""

    level: Number = Field(description="its standard deviation [as `unit` says]")
    unit: Text = Field(description="unit of the level")
    memory_s: Number | None = Field(default=None, description="its correlation time [s]; nothing: none")
    process: Text = Field(default="", description="which process of the table it is, where several levels belong to one")


class Starts(Checked):
    """Fits from several starts, side by side."""

    starts: int = Field(description="how many there were; the first from the declared values")
    same_optimum: int = Field(description="how many led to the optimum that was kept")
    cost_above_best: list[Finite] = Field(description="cost of each above the best [-]")
    outcomes: list[Text] = Field(description="how each ended, in a word")
    largest_distance_within_optimum_std: Number = Field(
        description="largest distance of a parameter among those of the same optimum [standard deviations of the fit]"
    )
    largest_distance_std: Numbers = Field(description="parameter -> its largest distance among all [standard deviations of the fit]")


class OfFlight(Before):
    """What one of several flights says."""

    initial: Before | None = Field(default=None, description="errors of the declared model")
    processes: dict[str, Level] = Field(default={}, description="process -> its estimated level")
    noise_factors: Numbers = Field(default={}, description="channel -> factor on its declared noise that the flight asks for [-]")


class Fit(Predicted):
    """metrics.json of identify."""

    outcome: Text = Field(description="how the fit ended, in a word")  # pyright: ignore[reportIncompatibleVariableOverride]
    chi2: Misfit = Field(description="squared errors over noise, per degree of freedom, of the model unaided [-]; 1: noise")
    method: Literal["filter error", "output error"] = Field(
        description="filter error: gusts, drift and model error integrated out; output error: without them"
    )
    surfaces: Literal["recorded", "controller"] = Field(description="recorded: set-points replayed; controller: the loop closed")
    chi2_with_processes: Misfit | None = Field(default=None, description="chi2 of the model with its processes integrated out [-]")
    outliers: dict[str, int] = Field(default={}, description="channel -> values that were left out: no model could follow them")
    weights: Literal["noise", "range"] = Field(default="noise", description="what an error of a channel was counted in")
    initial: Before | None = Field(default=None, description="errors of the declared model")
    cost_history: list[Finite] = Field(default=[], description="cost, iteration by iteration, over all horizons [-]")
    kkt_residual: Finite | None = Field(default=None, description="how far the fit is from the conditions of an optimum [-]; 0: it is one")
    starts: Starts | None = Field(default=None, description="fits from several starts, where the plan asks for them")
    flights: dict[str, OfFlight] = Field(default={}, description="flight -> what it says, where several were fitted together")
    horizon_asked_s: Number | None = Field(default=None, description="horizon of the plan, where the flight allowed only a shorter one [s]")
    horizon_s: Duration = Field(description="length of a segment [s]")
    nrmse: Parts = Field(description="errors of the fitted model")
    outputs: list[Word] = Field(description="measured channels that were fitted")
    processes: dict[str, Level] = Field(description="process -> its estimated level")
    noise_factors: Numbers = Field(description="channel -> factor on its declared noise that the flight asks for [-]")


class Row(Checked):
    """One parameter of params.json."""

    value: Number = Field(description="fitted value [as `unit` says]")
    std: Spread = Field(description="its standard deviation, prior and flight together [as `unit` says]")
    interval: Interval = Field(default=None, description="95 % interval of the value [as `unit` says]")
    unit: Text = Field(description="unit of value, std, prior and prior_std; `-`: none")
    prior: Number = Field(description="declared value [as `unit` says]")
    prior_std: Annotated[float, Field(gt=0, allow_inf_nan=False)] = Field(description="its standard deviation as declared [as `unit` says]")
    shift_in_prior_std: Number = Field(description="(value - prior) / prior_std [-]")
    excited: bool = Field(default=True, description="whether the flight at least halves the prior's standard deviation")
    determined: Literal["well", "hardly", "poorly"] = Field(
        default="well", description="well: excited; hardly: near its prior, unseen; poorly: it moved or is at a bound without being seen"
    )
    at_bound: bool = Field(default=False, description="whether it ended at an end of its range")
    partners: list[Text] = Field(default=[], description="parameters correlated with it by more than 0.95")
    advice: Text | None = Field(default=None, description="what that means, in a sentence; nothing where all is well")
    flight: Text = Field(default="", description="flight that it belongs to, where each has a value of its own")
    phase: Text = Field(default="", description="phase of a pumping cycle that it belongs to, where each has a value of its own")


class Factor(Checked):
    """Parameters of which only the ratios are known."""

    says: Annotated[str, Field(min_length=1)] = Field(description="which they are, in a sentence")
    parameters: list[Text] = Field(default=[], description="which they are")


class Kept(Checked):
    """One linear constraint of the kite file, after the fit."""

    constraint: Text = Field(description="as it stands in the kite file")
    value: Number | None = Field(default=None, description="value of its sum after the fit [unit of the constraint]")
    active: bool = Field(description="whether it holds the fit back")
    cost_per_unit: Number = Field(description="fall of chi-square if its limit were moved outwards by one [1 per unit of the constraint]")


class RecordError(Checked):
    """Error of the wind record at one height or time: a nuisance parameter, fitted with the others."""

    value: Number = Field(description="estimated error [as `unit` says]")
    std: Spread = Field(description="its standard deviation [as `unit` says]")
    unit: Text = Field(description="unit of value and std")
    flight: Text = Field(default="", description="flight that it belongs to, of several")
    phase: Text = Field(default="", description="phase that it belongs to, where each has a value of its own")


class Correlation(Checked):
    """Correlation of the estimates, prior and flight together."""

    names: list[Text] = Field(description="parameters and errors of the wind record, in the order of rows and columns")
    matrix: list[list[Number]] = Field(description="rows of correlation coefficients [-]")


class Direction(Checked):
    """A combination of parameters, from the singular values of the Jacobian scaled by prior standard deviations and noise."""

    singular_value: Number = Field(default=0.0, description="what the flight says of it, against the prior [-]; below 1: less")
    parameters: Numbers = Field(default={}, description="parameter -> its share of the unit vector [-]; the largest five")
    condition: Number | None = Field(default=None, description="largest singular value over this one [-]; nothing where this is 0")


class Params(Checked):
    """params.json of identify and of trace-residual."""

    parameters: dict[str, Row] = Field(description="parameter -> what is known of it")
    common_factors: list[Factor] = Field(default=[], description="groups of parameters that may share a factor without being seen")
    constraints: list[Kept] = Field(default=[], description="constraints of the kite file that concern a fitted parameter")
    wind_record_error: dict[str, RecordError] = Field(
        default={}, description="errors of the wind record that were fitted with the parameters"
    )
    correlation: Correlation | None = Field(default=None, description="how the estimates are correlated")
    weakest_direction: Direction = Field(default=Direction(), description="the combination that the flight says least of")
    unseen_directions: list[Direction] = Field(default=[], description="combinations that the prior knows better than the flight")

    @model_validator(mode="after")
    def _correlated(self) -> Self:
        fitted = {*self.parameters, *self.wind_record_error}
        if self.correlation is not None and (other := sorted(fitted.symmetric_difference(self.correlation.names))):
            raise ValueError(f"'{other[0]}' is only in one of parameters and correlation.names")
        return self
