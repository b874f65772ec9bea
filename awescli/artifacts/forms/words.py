"""What the forms of artifacts are written in: numbers, texts and channels, and the class that each form fills."""

from typing import Annotated, Any, Literal

from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, Field

Number = Annotated[float, Field(allow_inf_nan=False, ge=-1e15, le=1e15)]
"""Nothing that awes measures or estimates is larger."""
Spread = Annotated[float, Field(allow_inf_nan=False, ge=0, le=1e15)]
"""What is never negative: a standard deviation, a length."""
Finite = Annotated[float, Field(allow_inf_nan=False)]
"""What knows no bounds where a model diverges: a cost, its slope."""
Misfit = Annotated[float, Field(allow_inf_nan=False, ge=0)]
"""What is never negative, and knows no upper bound where a model diverges: an error, a chi-square."""
Duration = Annotated[float, Field(allow_inf_nan=False, ge=0, le=1e5)]
"""A prediction's length [s]."""
Text = str
Numbers = dict[str, Number]
Interval = Annotated[list[Number], Field(min_length=2, max_length=2)] | None
"""[low, high]."""


def _with_mean(errors: dict[str, float]) -> dict[str, float]:
    if "mean" not in errors:
        raise ValueError("'mean' is missing")
    return errors


def _not_null(value: Any) -> Any:
    if value is None:
        raise ValueError("null stands in place of what may be left out")
    return value


OrAbsent = BeforeValidator(_not_null)
"""Of `Annotated[X | None, OrAbsent]`: a key that may be left out, and is never null where it is there."""
Word = Annotated[str, Field(pattern="^[A-Za-z0-9_]+$")]
"""A name that also becomes part of a file's name."""
Channels = Annotated[dict[str, Misfit], AfterValidator(_with_mean)]
"""Channel -> NRMSE, and their `mean`."""
Horizon = Annotated[str, Field(pattern=r"^[0-9]+(\.[0-9]+)?$")]
"""Seconds ahead, as a key."""


class Checked(BaseModel):
    """A mapping of a JSON artifact: types as they are written, more keys than these allowed. Every field says what it means, and every
    number its unit in brackets, `[-]` where it has none (tests/test_artifact_forms.py)."""

    model_config = ConfigDict(strict=True, extra="allow")


class Metrics(Checked):
    """What metrics.json of every stage has where it has it."""

    outcome: Text | None = Field(default=None, description="how the stage ended, in a word; the verdict, where it gives one")


class Loops(Checked):
    """Where the parts of a flight lie."""

    train: list[list[int]] = Field(description="[first, end) samples of each stretch that stages are fitted to")
    validation: list[list[int]] = Field(description="likewise, of the stretches that choices are made on")
    test: list[list[int]] = Field(description="likewise, of those that nothing was fitted to or chosen on")


class Parts(Checked):
    """NRMSE of the parts of a flight."""

    train: Channels = Field(description="channel -> NRMSE on the loops that stages are fitted to, and their `mean` [-]")
    validation: Channels = Field(description="likewise, on the loops that choices are made on [-]")
    test: Channels = Field(description="likewise, on the loops that nothing was fitted to or chosen on [-]")


class Before(Checked):
    """Errors of the model that a stage began with, on the same predictions."""

    horizon_s: Duration = Field(description="length of a prediction [s]")
    nrmse: Parts = Field(description="errors, part by part")
    diverged_predictions: dict[str, int] = Field(
        default={}, description="part -> predictions that diverged; they count with their last error"
    )
    noise_floor: Channels = Field(description="channel -> NRMSE that sensor noise alone causes on test, and their `mean` [-]")


class Predicted(Metrics):
    """What metrics.json of every stage that fits a model says of its predictions."""

    surfaces: Literal["recorded", "controller"] = Field(
        default="recorded", description="recorded: set-points replayed; controller: the loop closed"
    )
    initial_states: Literal["free", "measured"] = Field(
        default="free", description="where predictions begin; free: in a state fitted to the measurements around it; measured: as measured"
    )
    diverged_predictions: dict[str, int] = Field(
        default={}, description="part -> predictions that diverged; they count with their last error"
    )
    noise_floor: Channels | None = Field(
        default=None, description="channel -> NRMSE that sensor noise alone causes on test, and their `mean` [-]"
    )
