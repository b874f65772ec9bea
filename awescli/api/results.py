"""What the functions of this room give back: numbers with names and units, a table, figures, and what a notebook shows of them."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

from awescli.api.figures import Album, Picture
from awescli.api.inputs import Flight, Kite, read_flight, read_kite
from awescli.api.shown import as_html, as_text, frame
from awescli.api.work import Origin
from awescli.stages.answers import ANSWER

if TYPE_CHECKING:
    import numpy as np
    import polars

    from awescli.flightlog.split import Split

Document = Mapping[str, Any]


@dataclass(frozen=True)
class Estimate:
    """An identified parameter. value, std, interval (95 %), prior, prior_std: in `unit`; at_bound: the fit would have gone further;
    determined: "well", "hardly" (stays near its prior), "poorly" (moved without being seen)."""

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
    """Errors of predictions `horizon` seconds ahead on the test loops, to which nothing was fitted.

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


@dataclass(frozen=True)
class Result:
    """What one stage found. origin: what it comes from; folder: where its files are (temporary, unless `out` named one);
    answer: its own words, as the terminal shows them; notes: what it said on the way; documents: its JSON files, by name."""

    origin: Origin
    folder: Path
    answer: tuple[str, ...]
    notes: tuple[str, ...]
    documents: Mapping[str, Document]

    title: ClassVar[str] = ""
    stage: ClassVar[str] = ""
    reads: ClassVar[tuple[str, ...]] = ("metrics.json",)

    @property
    def metrics(self) -> Document:
        """metrics.json: all numbers of the stage."""
        return self.documents["metrics.json"]

    @property
    def flight(self) -> Flight:
        """The flight that it was made from."""
        return self.origin.flight

    @cached_property
    def parts(self) -> "Split":
        """train, validation, test: half-open sample ranges of the flight, whole loops each."""
        return self.origin.context().inputs.parts_of(self.flight.log, self.flight.path)

    def to_frame(self) -> "polars.DataFrame":
        """Its main table."""
        raise NotImplementedError

    def plot(self, name: str | None = None) -> Picture:
        """A figure of its section of the report, by name (`figures`); None: the first. Raises BadInput for other names."""
        return self._album.picture(name)

    @property
    def figures(self) -> tuple[str, ...]:
        """Names for `plot`."""
        return tuple(self._album.figures)

    def _tell(self) -> Callable[[Any], Any]:
        """Its section of the report."""
        raise NotImplementedError

    def _scores(self) -> dict[str, Any]:
        """What its section knows of errors, in the form of evaluate's metrics.json."""
        return {}

    @cached_property
    def _album(self) -> Album:
        def tell() -> list[Any]:
            from awescli.stages.page import gather

            return [self._tell()(gather(self.origin.context(), self.flight.log, self.parts, self._scores(), {}))]

        return Album(tell)

    def __repr__(self) -> str:
        return as_text(self.title, self.answer)

    def _repr_html_(self) -> str:
        return as_html(self.title, self.answer, self.to_frame())


class _Model(Result):
    """A result that hands on a model."""

    label: ClassVar[str] = ""
    """Its name on the ladder of models."""

    @property
    def kite(self) -> Kite:
        """The model as a kite file: the declaration with what was found."""
        path = self.folder / "kite.yaml"
        return Kite(path, read_kite(path).declaration, self.origin.made[self.stage].keep)


class Controller(Result):
    """The flight controller, from measured states to surface set-points (`fit_controller`)."""

    title, stage = "Flight controller", "fit-controller"

    @property
    def errors(self) -> Mapping[str, float]:
        """Surface -> NRMSE [-] of its set-point on the test loops, share of its range."""
        return self.metrics["nrmse"]["test"]

    @cached_property
    def commanded(self) -> "Mapping[str, np.ndarray]":
        """Surface -> (N,) rad: what the law commands at the measured states of the flight."""
        from awescli.control.law import deflections_of_log
        from awescli.stages.controller_artifact import read_controller, wind_direction

        law, log = read_controller(self.origin.made[self.stage].intact().folder), self.flight.log
        found = deflections_of_log(law, log, wind_direction(log))
        return {surface: found[surface] for surface in law.surfaces}

    def to_frame(self) -> "polars.DataFrame":
        """One row a surface and part: NRMSE of the set-point, and what noise in the law's inputs alone causes."""
        return frame(
            {"surface": s, "part": part, "nrmse": e, "noise alone": self.metrics["noise_nrmse"][part].get(s)}
            for part, found in self.metrics["nrmse"].items() for s, e in found.items()
        )  # fmt: skip

    def _tell(self):
        from awescli.reporting.controller import controller

        return controller


class Identification(_Model):
    """Parameters of the kite, identified from a flight (`identify`)."""

    title, stage, label = "Identification", "identify", "identified"
    reads = ("params.json", "metrics.json")

    @cached_property
    def parameters(self) -> Mapping[str, Estimate]:
        """Name -> estimate, of every free parameter."""
        keys = ("value", "std", "unit", "prior", "prior_std", "at_bound", "determined")
        return {
            n: Estimate(interval=tuple(row["interval"]), **{k: row[k] for k in keys})
            for n, row in self.documents["params.json"]["parameters"].items()
        }

    @property
    def outcome(self) -> str:
        """How the fit ended: "converged", or the name of what stopped it."""
        return self.metrics["outcome"]

    @property
    def errors(self) -> Errors:
        """Of the declared kite before, of the identified one after."""
        m = self.metrics
        return Errors(m["horizon_s"], m["initial"]["nrmse"]["test"], m["nrmse"]["test"], m["noise_floor"])

    def to_frame(self) -> "polars.DataFrame":
        """One row a parameter: value, std, 95 % interval, unit, prior, whether it is at a bound and how well the flight determines it."""
        return frame(
            {"parameter": n, "value": e.value, "std": e.std, "low": e.interval[0], "high": e.interval[1], "unit": e.unit, "prior": e.prior,
             "at bound": e.at_bound, "determined": e.determined}
            for n, e in self.parameters.items()
        )  # fmt: skip

    def _scores(self):
        m = self.metrics
        return {"horizon_s": m["horizon_s"], "noise_floor": m["noise_floor"], "initial": m["initial"], "identified": m}

    def _tell(self):
        from awescli.reporting.identification import identification

        return identification


class Tracing(_Model):
    """What the residual was traced to (`trace`). Where the flight is not testable, `verdict` says so, and there is no effect."""

    title, stage, label = "Tracing", "trace-residual", "with_effects"
    reads = ("effects.json", "params.json", "metrics.json")

    @property
    def verdict(self) -> str:
        """`none`, `found`, `cannot_tell`, `unexplained`, `not_deterministic` or `not_testable`."""
        return self._effects["verdict"]

    @property
    def sentence(self) -> str:
        """The verdict in words."""
        return self._effects["sentence"]

    @cached_property
    def effects(self) -> tuple[Effect, ...]:
        """The effects that were found; with `cannot_tell` each with its rivals."""
        return tuple(
            Effect(
                e["name"], e["acts_on"], {n: (p["value"], p["std"], p["unit"]) for n, p in e["parameters"].items()},
                tuple(r["name"] for r in e["rivals"]),
            )
            for e in self._effects["effects"]
        )  # fmt: skip

    @property
    def probability(self) -> Mapping[str, float]:
        """Cause ("actuator_lag:rudder", "none", "something_else") -> its probability; they sum to 1."""
        return self._effects["probability"]

    @property
    def errors(self) -> Errors:
        """Of the identified model before, of the model with the effects after."""
        e = self._effects["error"]
        return Errors(e["horizon_s"], e.get("before", {}), e["after"], e["noise_floor"])

    @property
    def _effects(self) -> Document:
        return self.documents["effects.json"]

    def criteria(self) -> "polars.DataFrame":
        """What the verdict stands on: one row a criterion, with value, threshold and where that comes from."""
        shown = {"name", "value", "threshold", "pass", "source"}
        return frame({k: v if k == "pass" else _cell(v) for k, v in c.items() if k in shown} for c in self._effects["criteria"])

    def to_frame(self) -> "polars.DataFrame":
        """One row a candidate: what it explains of the residual, what it gains on unseen loops, whether its size is plausible."""
        keys = ("name", "acts_on", "score", "p_value", "explained_share", "test_gain", "plausible_size", "outcome")
        return frame({k: c.get(k) for k in keys} for c in self._effects["ranking"])

    def _scores(self):
        m = self.metrics
        before = {"identified": m["before"]} if m.get("before") else {}
        return {"horizon_s": m["horizon_s"], "noise_floor": m["noise_floor"], **before, "with_effects": m}

    def _tell(self):
        from awescli.reporting.residual import residual

        return residual


class Hybrid(_Model):
    """Physics with a network that learned what physics leaves (`train`)."""

    title, stage, label = "Hybrid", "train-hybrid", "hybrid"

    @property
    def outcome(self) -> str:
        """How training ended; with `nothing_to_learn`, `too_short` and `diverged` the network stays at zero."""
        return self.metrics["outcome"]

    @property
    def errors(self) -> Errors:
        """Of physics alone before, with the network after."""
        m = self.metrics
        return Errors(m["horizons"][-1], m["before"]["nrmse"]["test"], m["nrmse"]["test"], m["noise_floor"])

    def to_frame(self) -> "polars.DataFrame":
        """One row a channel: errors without and with the network, and of noise alone."""
        return self.errors.to_frame()

    def _scores(self):
        m = self.metrics
        before = "with_effects" if "trace-residual" in self.origin.made else "identified"
        return {"horizon_s": m["horizons"][-1], "noise_floor": m["noise_floor"], before: m["before"], "hybrid": m}

    def _tell(self):
        from awescli.reporting.hybrid import hybrid

        return hybrid


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

    def _scores(self):
        from awescli.stages.ladder import MADE_BY

        # a network that stayed at zero is called by the model before it
        known = [label for label, stage in MADE_BY.items() if stage in self.origin.made]
        return {"horizon_s": 0.0, "noise_floor": {}, "initial": {}, **{label: {} for label in known}}

    def _tell(self):
        from awescli.reporting.free_flight import free_flight

        return free_flight


@dataclass(frozen=True)
class Prediction:
    """Models predicted alike on the test loops (`predict`). horizon: seconds ahead; metrics: evaluate's numbers; arrays: (K, N+1) each,
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


def _cell(value: Any) -> str:
    return "" if value is None else f"{value:.4g}" if isinstance(value, float) else str(value)


def result(kind: type[Result], done: Any) -> Any:
    """A result of what a stage left."""
    from awescli.artifacts import read_json

    documents = {name: read_json(done.folder / name) for name in kind.reads}
    answer = done.summary.get(ANSWER, ())
    return kind(done.origin, done.folder, tuple([answer] if isinstance(answer, str) else answer), done.notes, documents)
