"""All that a verdict is made of: what was searched, what is left, what else would do."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from awescli.notation.quantities import SURFACES
from awescli.tracing.classes import Rival
from awescli.tracing.criteria import CRITERIA
from awescli.tracing.fitted_model import FittedModel
from awescli.tracing.rest import Repetition, Rest
from awescli.tracing.search import Search
from awescli.tracing.when import Alone

PRICE = 2 * CRITERIA.rest_worth
"""Deviance of something else where nothing of it is seen: twice what it would have to be worth to be seen."""


@dataclass(frozen=True)
class AbsorbedEffect:
    """An effect that brings a parameter back from its bound. gain: deviance; model: the declared model with it."""

    key: str
    parameter: str
    gain: float
    model: FittedModel


@dataclass(frozen=True)
class BoundsLeft:
    """The answer without one of its effects, its parameters at their bounds free to leave them. gone: the effect; parameters: what was at
    a bound; deviance: of that model, to first order where that leaves it far behind the answer."""

    gone: str
    parameters: tuple[str, ...]
    deviance: float


@dataclass(frozen=True)
class Evidence:
    """search: of the library; bare: the declared model without model error; model: the answer, the declared model where there is none;
    rest: what it leaves; rivals: accepted effect -> what the flight cannot tell from it; absorbed: effects that a parameter at its bound
    stands for; empirical: the search of empirical terms, None where nothing asked for it; gusts: group -> level [m/s] beside the answer;
    gusts_repeat: how much of them repeats from loop to loop, None where there are none or too few loops; steadiness: of the answer
    (`constancy.steadiness`); along: channel -> what its size would gain by going with it (`constancy.gains_along`); doubted: coefficients
    declared with a sign that hardly any aircraft has, which the declared model drives to the end of their range next to zero;
    bounds_left: the likeliest of the answer with one effect less and free of its bounds, None where no parameter is at one; alone: what
    single flights show, None where that was not asked; drift_steps: channel -> how large the largest step of its sensor's drift is
    (`rest.steps_of_drifts`), None where none is seen; drift_offsets: group of drifts -> (size of the largest mean of one over a flight, in
    words), where there is no answer (`rest.offsets_of_drifts`).

    contradictions: sentences of what kinematics find of the sensors that no effect stands for (rates that are late);
    answering: surfaces that answer the kite, or may do so; error_ratio: prediction error of the answer on validation loops over that of the
    declared model; null_error, identified_error: mean NRMSE of the declared model and of the one that identify handed on there; None
    without one.
    """

    search: Search
    bare: FittedModel
    model: FittedModel
    rest: Rest
    rivals: Mapping[str, Sequence[Rival]] = field(default_factory=dict)
    absorbed: tuple[AbsorbedEffect, ...] = ()
    empirical: Search | None = None
    gusts: Mapping[str, float] = field(default_factory=dict)
    gusts_repeat: Repetition | None = None
    steadiness: float = 1.0
    along: Mapping[str, float] = field(default_factory=dict)
    doubted: tuple[str, ...] = ()
    bounds_left: BoundsLeft | None = None
    alone: tuple[Alone, ...] | None = None
    drift_steps: Mapping[str, float] | None = None
    drift_offsets: Mapping[str, tuple[float, str]] = field(default_factory=dict)
    contradictions: tuple[str, ...] = ()
    answering: tuple[str, ...] = SURFACES
    error_ratio: float = 1.0
    null_error: float | None = None
    identified_error: float | None = None

    @property
    def of_answering(self) -> bool:
        """Does an effect of the answer act between the record of a surface that answers the kite and the kite?"""
        return any(key.partition(":")[2] in self.answering for key in self.model.keys)

    @property
    def empirical_lead(self) -> float:
        """Deviance by which as few or fewer empirical terms (one at least) lead the answer, each name more than they have terms counted as
        `decisive`; 0 where none do."""
        if self.empirical is None or not self.empirical.final.keys:
            return 0.0
        more = max(len(self.model.keys), 1) - len(self.empirical.final.keys)
        return max(self.model.deviance - self.empirical.final.deviance + CRITERIA.decisive * more, 0.0) if more >= 0 else 0.0

    @property
    def outdone(self) -> float:
        """Deviance by which another effect that was fitted beside the answer's last one leads it, be its size as implausible as it may, or
        its gain on some loops only; 0 where none does."""
        last = next((r for r in reversed(self.search.rounds) if r.accepted), None)
        gains = {t.key: t.gain for t in last.contenders} if last and self.model.keys else {}
        if last is None or len(gains) < 2 or last.accepted not in gains:
            return 0.0
        return max(max(gains.values()) - gains[last.accepted], 0.0)

    @property
    def deviances(self) -> dict[str, float]:
        """Cause -> deviance of the model that stands for it: "none", "something_else" (model error alone; where none is seen, at the price
        that it would have to be worth), every effect that was fitted in the round of the answer's last one, the answer and its rivals."""
        null, bare = self.search.null, self.bare.deviance
        found = {"none": bare, "something_else": null.deviance if null.rest and null.deviance < bare else bare + PRICE}
        accepted = [r for r in self.search.rounds if r.accepted]
        for r in accepted[-1:] if self.model.keys else self.search.rounds[:1]:
            for t in r.contenders:
                found["+".join((*r.base.keys, t.key))] = r.base.deviance - t.gain
        for key, rivals in self.rivals.items():
            for r in rivals:
                found["+".join(r.key if k == key else k for k in self.model.keys)] = r.model.deviance
        if self.model.keys:
            found["+".join(self.model.keys)] = self.model.deviance
        return found
