"""What a flight teaches: a controller, parameters, missing effects, a network."""

from collections.abc import Callable, Mapping
from functools import cached_property
from typing import TYPE_CHECKING, Any

from awescli.api.results import Document, HandsOn, Result
from awescli.api.shown import frame
from awescli.api.values import Effect, Errors, Estimate

if TYPE_CHECKING:
    import numpy as np
    import polars


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

    def _tell(self) -> Callable[[Any], Any]:
        from awescli.reporting.controller import controller

        return controller


class Identification(HandsOn):
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

    def _scores(self) -> dict[str, Any]:
        m = self.metrics
        return {"horizon_s": m["horizon_s"], "noise_floor": m["noise_floor"], "initial": m["initial"], "identified": m}

    def _tell(self) -> Callable[[Any], Any]:
        from awescli.reporting.identification import identification

        return identification


class Tracing(HandsOn):
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

    def _scores(self) -> dict[str, Any]:
        m = self.metrics
        before = {"identified": m["before"]} if m.get("before") else {}
        return {"horizon_s": m["horizon_s"], "noise_floor": m["noise_floor"], **before, "with_effects": m}

    def _tell(self) -> Callable[[Any], Any]:
        from awescli.reporting.residual import residual

        return residual


class Hybrid(HandsOn):
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

    def _scores(self) -> dict[str, Any]:
        m = self.metrics
        before = "with_effects" if "trace-residual" in self.origin.made else "identified"
        return {"horizon_s": m["horizons"][-1], "noise_floor": m["noise_floor"], before: m["before"], "hybrid": m}

    def _tell(self) -> Callable[[Any], Any]:
        from awescli.reporting.hybrid import hybrid

        return hybrid


def _cell(value: Any) -> str:
    return "" if value is None else f"{value:.4g}" if isinstance(value, float) else str(value)
