"""Evidence: all that a page is made of. What a stage did not leave behind is None, and its section says so."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from awescli.flightlog.log import FlightLog
from awescli.flightlog.loops import Loops
from awescli.flightlog.quality import DataQuality
from awescli.flightlog.split import Split
from awescli.notation.present import present
from awescli.reporting.words import BASELINE, MODELS, effect_words, listed

Document = Mapping[str, Any]
Arrays = Mapping[str, np.ndarray]

IN_ORDER = ("initial", "identified", "with_effects", "hybrid")
"""Models in the order in which they are made."""


EMPTY = ("nothing_to_learn", "too_short", "no_gain", "diverged")
"""Outcomes of a training that leaves the network at zero."""


@dataclass(frozen=True)
class Action:
    """What one effect does in the model that was fitted with it.

    effect: its key; quantity, unit: what it changes most, SI; received, made: what the two lines are called; time: (K, N) s of the flight;
    without, with_effect: (K, N) the quantity at the same simulated states, with the effect at its null value and as fitted.
    """

    effect: str
    quantity: str
    unit: str
    received: str
    made: str
    time: np.ndarray
    without: np.ndarray
    with_effect: np.ndarray


@dataclass(frozen=True)
class Evidence:
    """log, loops, phases, quality, parts: the flight and how it is divided; phases: (N,) names.

    scores, predictions: evaluate's metrics.json and predictions.npz; controller: fit-controller's metrics.json;
    commanded: surface -> (N,) rad, what the fitted law commands at the measured states; identify, params: metrics.json and params.json;
    effects, traced_params, residuals: effects.json, params.json and residuals.npz of trace-residual; actions: of the added
    effects; hybrid, network, correction:
    train-hybrid's metrics.json, network.json and correction.npz; flown, trajectory: simulate's metrics.json and trajectory.npz;
    provenance: stage -> provenance.json; versions: package -> version.
    """

    log: FlightLog
    loops: Loops
    phases: np.ndarray
    quality: DataQuality
    parts: Split
    scores: Document
    predictions: Arrays
    controller: Document | None = None
    commanded: Arrays = field(default_factory=dict)
    identify: Document | None = None
    params: Document | None = None
    effects: Document | None = None
    traced_params: Document | None = None
    residuals: Arrays | None = None
    actions: tuple[Action, ...] = ()
    hybrid: Document | None = None
    network: Document | None = None
    correction: Arrays | None = None
    flown: Document | None = None
    trajectory: Arrays | None = None
    provenance: Mapping[str, Document] = field(default_factory=dict)
    versions: Mapping[str, str] = field(default_factory=dict)

    @property
    def traced(self) -> Document:
        """The effects.json of trace-residual, for sections that are shown only where it is there."""
        return present(self.effects, "the effects.json of trace-residual")

    @property
    def fitted_controller(self) -> Document:
        """The metrics.json of fit-controller, for sections that are shown only where it is there."""
        return present(self.controller, "the metrics.json of fit-controller")

    @property
    def free_flight(self) -> Document:
        """The metrics.json of simulate, for sections that are shown only where it is there."""
        return present(self.flown, "the metrics.json of simulate")

    @property
    def fitted_params(self) -> Document:
        """The params.json of identify, for sections that are shown only where it is there."""
        return present(self.params, "the params.json of identify")

    @property
    def free_path(self) -> Arrays:
        """The trajectory.npz of simulate, for sections that are shown only where it is there."""
        return present(self.trajectory, "the trajectory.npz of simulate")

    @property
    def residual_series(self) -> Arrays:
        """The residuals.npz of trace-residual, for sections that are shown only where it is there."""
        return present(self.residuals, "the residuals.npz of trace-residual")

    @property
    def models(self) -> tuple[str, ...]:
        """Models that were scored, in order, without those that are the one before again: nothing added, nothing learned."""
        twins = {"with_effects"} if self.effects is not None and not self.tracing_added and "identified" in self.scores else set()
        twins |= {"hybrid"} if (self.hybrid or {}).get("outcome") in EMPTY else set()
        return tuple(m for m in IN_ORDER if m in self.scores and m not in twins)

    @property
    def compared(self) -> tuple[str, ...]:
        """`models`, and the linear baseline beside them where it was scored."""
        return *self.models, *(m for m in BASELINE if m in self.scores)

    def same_as(self, model: str) -> str:
        """The model itself, or the one before it where it adds nothing to that."""
        return model if model in self.models else next(m for m in reversed(self.models) if IN_ORDER.index(m) < IN_ORDER.index(model))

    @property
    def best(self) -> str:
        """The last of the nested models."""
        return self.models[-1]

    @property
    def horizon(self) -> float:
        """Seconds predicted ahead in all scores."""
        return float(self.scores["horizon_s"])

    def nrmse(self, model: str, part: str = "test") -> Mapping[str, float]:
        """Channel -> NRMSE of one model."""
        return self.scores[model]["nrmse"][part]

    def ahead(self, model: str, key: str) -> Document | None:
        """Scores of a model one step (`one_step`) or `key` seconds ahead; None where the flight is too short."""
        block = self.scores[model]
        return block["one_step"] if key == "one_step" else block["by_horizon"].get(key)

    @property
    def tracing_added(self) -> bool:
        """Whether tracing put anything into the model; an effect that it only names changes no cost."""
        chi2 = (self.effects or {}).get("chi2", {})
        return bool(self.effects) and chi2.get("train_before") != chi2.get("train_after")

    @property
    def named(self) -> list[Document]:
        """What tracing names: the effects of its verdict or, where there is none, those with which unseen flight is predicted better."""
        return [*self.traced["effects"], *(self.traced.get("by_prediction") or {}).get("effects", ())]

    @property
    def added(self) -> list[Document]:
        """What tracing put into the model."""
        return self.named if self.tracing_added else []

    def label(self, model: str) -> str:
        """A model in words; what tracing added, if it added anything, by name."""
        if model != "with_effects" or self.effects is None:
            return (MODELS | BASELINE).get(model, model)
        if not self.tracing_added:
            return "after tracing (nothing added)"
        names = [effect_words(e["name"], e.get("acts_on", "")) for e in self.added]
        if self.effects["verdict"] == "unexplained":
            names.append("empirical terms")
        return f"with {listed(names)}"

    @property
    def floor(self) -> Mapping[str, float]:
        """Channel -> NRMSE that sensor noise alone causes (test)."""
        return self.scores["noise_floor"]
