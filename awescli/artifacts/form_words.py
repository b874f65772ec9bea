"""What the forms of artifacts are written in: numbers, texts and channels, and the class that each form fills."""

from typing import Annotated

from pydantic import AfterValidator, BaseModel, ConfigDict, Field

Number = Annotated[float, Field(allow_inf_nan=False)]
Spread = Annotated[float, Field(ge=0, allow_inf_nan=False)]
"""A standard deviation."""
Text = str
Numbers = dict[str, Number]


def _with_mean(errors: dict[str, float]) -> dict[str, float]:
    if "mean" not in errors:
        raise ValueError("'mean' is missing")
    return errors


Word = Annotated[str, Field(pattern="^[A-Za-z0-9_]+$")]
"""A name that also becomes part of a file's name."""
Channels = Annotated[Numbers, AfterValidator(_with_mean)]
"""Channel -> NRMSE, and their `mean`."""
Horizon = Annotated[str, Field(pattern=r"^[0-9]+(\.[0-9]+)?$")]
"""Seconds ahead, as a key."""


class Checked(BaseModel):
    """A mapping of a JSON artifact: types as they are written, more keys than these allowed."""

    model_config = ConfigDict(strict=True, extra="allow")
