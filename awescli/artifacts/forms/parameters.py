"""The forms of what identify leaves, and of params.json of any stage."""

from typing import Annotated, Literal

from pydantic import Field

from awescli.artifacts.forms.words import Checked, Metrics, Number, Numbers, Parts, Spread, Text, Word


class Level(Checked):
    """How strong a process is: gusts, drift of a sensor, model error."""

    level: Number = Field(description="its standard deviation [as `unit` says]")
    unit: Text = Field(description="unit of the level")


class Fit(Metrics):
    """metrics.json of identify."""

    chi2: Number | None = Field(
        default=None, description="squared errors over noise, per degree of freedom, of the model unaided [-]; 1: noise"
    )
    method: Literal["filter error", "output error"] = Field(
        description="filter error: gusts, drift and model error integrated out; output error: without them"
    )
    surfaces: Literal["recorded", "controller"] = Field(description="recorded: set-points replayed; controller: the loop closed")
    horizon_s: Number = Field(description="length of a segment [s]")
    nrmse: Parts = Field(description="errors of the fitted model")
    outputs: list[Word] = Field(description="measured channels that were fitted")
    processes: dict[str, Level] = Field(description="process -> its estimated level")
    noise_factors: Numbers = Field(description="channel -> factor on its declared noise that the flight asks for [-]")


class Row(Checked):
    """One parameter of params.json."""

    value: Number = Field(description="fitted value [as `unit` says]")
    std: Spread = Field(description="its standard deviation, prior and flight together [as `unit` says]")
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


class Factor(Checked):
    """Parameters of which only the ratios are known."""

    says: Annotated[str, Field(min_length=1)] = Field(description="which they are, in a sentence")


class Kept(Checked):
    """One linear constraint of the kite file, after the fit."""

    constraint: Text = Field(description="as it stands in the kite file")
    active: bool = Field(description="whether it holds the fit back")
    cost_per_unit: Number = Field(description="fall of chi-square if its limit were moved outwards by one [1 per unit of the constraint]")


class Params(Checked):
    """params.json of identify and of trace-residual."""

    parameters: dict[str, Row] = Field(description="parameter -> what is known of it")
    common_factors: list[Factor] = Field(default=[], description="groups of parameters that may share a factor without being seen")
    constraints: list[Kept] = Field(default=[], description="constraints of the kite file that concern a fitted parameter")
