"""What models do: fly by themselves, predict, and all that on one page."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from awescli.api.figures import Album, Picture
from awescli.api.inputs import Flight, read_flight
from awescli.api.results import Document, Result
from awescli.api.shown import as_html, as_text, frame
from awescli.api.work import Origin

if TYPE_CHECKING:
    import numpy as np
    import polars


class Simulation(Result):
    """A flight that a model flew by itself (`simulate`)."""

    title, stage = "Simulated flight", "simulate"

    @cached_property
    def flown(self) -> Flight:
        """The flight as a log, with sensor noise: what every function here takes as a flight."""
        path = self.folder / "flight"
        return Flight(path, read_flight(path).log, self.origin.made[self.stage].keep)

    @property
    def departed(self) -> bool:
        """Did it leave what can be flown before its time was over?"""
        return self.metrics["outcome"] == "departed"

    @cached_property
    def arrays(self) -> "Mapping[str, np.ndarray]":
        """time [s]; simulated_NAME, and measured_NAME as long as there is a log: SI units, radians."""
        from awescli.artifacts import read_arrays

        return read_arrays(self.origin.made[self.stage].intact().folder / "trajectory.npz")

    def to_frame(self) -> "polars.DataFrame":
        """One row a sample of the flight: time, simulated and measured channels; what was not measured is null."""
        import numpy as np

        count = len(self.arrays["time"])
        padded = {n: np.concatenate([v, np.full(count - len(v), np.nan)]) for n, v in self.arrays.items() if v.ndim == 1}
        return frame(padded).fill_nan(None)

    def _repr_html_(self) -> str:
        return as_html(self.title, self.answer)

    def _scores(self) -> dict[str, Any]:
        from awescli.stages.nested_models import MADE_BY

        # a network that stayed at zero is called by the model before it
        known = [label for label, stage in MADE_BY.items() if stage in self.origin.made]
        return {"horizon_s": 0.0, "noise_floor": {}, "initial": {}, **{label: {} for label in known}}

    def _tell(self) -> Callable[[Any], Any]:
        from awescli.reporting.free_flight import free_flight

        return free_flight


@dataclass(frozen=True, eq=False)
class Prediction:
    """Models predicted alike on the test loops (`predict`). origin: what they come from; flight: what they are
    compared with; models: their names; horizon: seconds ahead; metrics: evaluate's numbers; arrays: (K, N+1) each,
    K predictions: measured_NAME and MODEL_NAME in SI units and radians, time (N+1,) s, first (K,) sample where each begins."""

    origin: Origin
    flight: Flight
    horizon: float
    models: tuple[str, ...]
    metrics: Document
    arrays: "Mapping[str, np.ndarray]"

    @property
    def errors(self) -> Mapping[str, Mapping[str, float]]:
        """Model -> channel -> NRMSE [-] on the test loops; "mean" is that of the 12 states."""
        return {m: self.metrics[m]["nrmse"]["test"] for m in self.models}

    @property
    def noise(self) -> Mapping[str, float]:
        """Channel -> NRMSE that sensor noise alone causes."""
        return self.metrics["noise_floor"]

    def to_frame(self) -> "polars.DataFrame":
        """One row a channel, one column a model."""
        channels = dict.fromkeys(n for found in self.errors.values() for n in found)
        return frame({"channel": n, **{m: e.get(n) for m, e in self.errors.items()}, "noise alone": self.noise.get(n)} for n in channels)

    def plot(self, name: str | None = None) -> Picture:
        """A figure, by name (`figures`): measured and predicted paths first. Raises BadInput for other names."""
        return self._album.picture(name)

    @property
    def figures(self) -> tuple[str, ...]:
        """Names for `plot`: paths, errors over the horizon and over loops, every channel."""
        return tuple(self._album.figures)

    @cached_property
    def _album(self) -> Album:
        def tell() -> list[Any]:
            from dataclasses import replace

            from awescli.reporting.prediction import prediction
            from awescli.stages.page import gather

            context = replace(self.origin, flight=self.flight).context()
            log = self.flight.log
            return [prediction(gather(context, log, context.inputs.parts_of(log, self.flight.path), dict(self.metrics), dict(self.arrays)))]

        return Album(tell)

    def _sentences(self) -> list[str]:
        means = ", ".join(f"{m} {e['mean']:.3g}" for m, e in self.errors.items())
        return [f"mean error {self.horizon:g} s ahead on unseen loops: {means} (noise alone {self.noise['mean']:.3g})"]

    def __repr__(self) -> str:
        return as_text("Prediction", self._sentences())

    def _repr_html_(self) -> str:
        return as_html("Prediction", self._sentences(), self.to_frame())


class Report(Result):
    """What every step was worth, on unseen loops, and the page that shows it (`report`)."""

    title, stage = "Report", "evaluate"

    @property
    def path(self) -> Path:
        """The page: one self-contained HTML file."""
        return self.folder / "report.html"

    @property
    def html(self) -> str:
        """The text of the page."""
        return self.path.read_text(encoding="utf-8")

    @property
    def errors(self) -> Mapping[str, Mapping[str, float]]:
        """Model -> channel -> NRMSE [-] on the test loops."""
        return {m: block["nrmse"]["test"] for m, block in self.metrics.items() if isinstance(block, Mapping) and "nrmse" in block}

    def to_frame(self) -> "polars.DataFrame":
        """One row a channel, one column a model."""
        noise = self.metrics["noise_floor"]
        channels = dict.fromkeys(n for found in self.errors.values() for n in found)
        return frame({"channel": n, **{m: e.get(n) for m, e in self.errors.items()}, "noise alone": noise.get(n)} for n in channels)

    @cached_property
    def _album(self) -> Album:
        def tell() -> list[Any]:
            from awescli.artifacts import read_arrays
            from awescli.reporting.html import story
            from awescli.stages.page import gather

            arrays = read_arrays(self.folder / "predictions.npz")
            return story(gather(self.origin.context(), self.flight.log, self.parts, dict(self.metrics), arrays))

        return Album(tell)
