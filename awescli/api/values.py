"""Numbers with their names and units: parameters, effects, errors."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

from awescli.api.shown import frame

if TYPE_CHECKING:
    import polars


@dataclass(frozen=True)
class Estimate:
    """An identified parameter. value, std, interval: of 95 %, prior, prior_std: all in the same unit; unit: the kite
    file's; at_bound: the fit would have gone further; determined: "well", "hardly" (stays near its prior), "poorly" (moved without being
    seen)."""

    value: float
    std: float
    interval: tuple[float, float]
    unit: str
    prior: float
    prior_std: float
    at_bound: bool
    determined: str


@dataclass(frozen=True)
class Effect:
    """An effect that the model lacked. name, acts_on: as `awes effects` lists them; parameters: name -> (value, standard deviation, unit);
    rivals: names of effects that this flight cannot tell from it."""

    name: str
    acts_on: str
    parameters: Mapping[str, tuple[float, float, str]]
    rivals: tuple[str, ...]


@dataclass(frozen=True)
class Errors:
    """Errors of predictions on the test loops, to which nothing was fitted. horizon: [s] how far ahead.

    before, after, noise: channel -> NRMSE [-], share of the channel's range; "mean" is that of the 12 states. before is empty where there
    is no model before; noise: what sensor noise alone causes.
    """

    horizon: float
    before: Mapping[str, float]
    after: Mapping[str, float]
    noise: Mapping[str, float]

    def to_frame(self) -> "polars.DataFrame":
        """One row a channel."""
        return frame(
            {"channel": n, "before": self.before.get(n), "after": e, "noise alone": self.noise.get(n)} for n, e in self.after.items()
        )
