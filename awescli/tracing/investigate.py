"""From a fitted declared model to a finding: search the library, see what is left, what else would do, and let the criteria decide."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from awescli.estimation.processes.base import Group
from awescli.estimation.processes.roll_gusts import RollGusts as RollGustProcess
from awescli.flightlog.log import FlightLog
from awescli.flightlog.reconstruction.result import SensorError
from awescli.flightlog.thinning import SLOWER
from awescli.notation.parameters import Parameter
from awescli.notation.quantities import SURFACES
from awescli.physics.declaration import KiteDeclaration
from awescli.physics.doubts import unusual_signs
from awescli.physics.effects.custom_term import CHANNELS, FEATURES, CustomTerm
from awescli.physics.kite import can_act, candidates, make_effect
from awescli.simulation.rollout import Simulator
from awescli.tracing.by_prediction import ByPrediction, error_of
from awescli.tracing.candidates import variants
from awescli.tracing.classes import rivals
from awescli.tracing.constancy import gains_along, steadiness
from awescli.tracing.criteria import CRITERIA, Criteria
from awescli.tracing.evidence import AbsorbedEffect, BoundsLeft, Evidence
from awescli.tracing.fitted_model import FittedModel
from awescli.tracing.frame import Frame
from awescli.tracing.instruments import InstrumentError
from awescli.tracing.models import Say, fit_added, fit_beyond, fit_on, fit_without, fit_without_process, promised_beyond
from awescli.tracing.rest import Rest, channels_of, gusts_of, gusty, offsets_of_drifts, repetition_of_gusts, rest_of, steps_of_drifts
from awescli.tracing.screen import CandidateColumns, informed, screen
from awescli.tracing.search import Search, search
from awescli.tracing.tried import Tried
from awescli.tracing.verdict import NULL, Criterion, probabilities, reason, table, verdict
from awescli.tracing.when import InFlight, in_flights, shown_alone

ROLL_GUSTS = RollGustProcess.name
STILL = 1e-3
"""[rad] a surface that moves less than this over a flight does not move."""
EMPIRICAL_ROUNDS, EMPIRICAL_FINALISTS = 3, 3
"""Empirical terms at most, and how many are fitted in a round: what they are called matters less than that there is one."""
FAR_BEHIND = 0.05
"""Share of what an answer leads by that parameters at their bounds must promise to gain beyond these, to first order, for a model with them
free to be fitted: on development flights it gained up to seven times that."""
DIVERGED = 100.0
"""Ratio of prediction errors that stands for a prediction that diverges."""


@dataclass(frozen=True)
class RollGusts:
    """Gusts that roll the kite. model, without: the declared one, fitted with and without them; worth: deviance;
    channels_before, channels_after: chi-square of each channel on validation loops, without and with them."""

    model: FittedModel
    without: FittedModel
    worth: float
    channels_before: Mapping[str, float]
    channels_after: Mapping[str, float]

    @property
    def _group(self) -> Group:
        return next(g for p in self.model.problems[0].processes if p.name == ROLL_GUSTS for g in p.groups)

    @property
    def level(self) -> float:
        """[rad/s] standard deviation."""
        return self._group.level

    @property
    def memory(self) -> float:
        """[s] over which they last."""
        return self._group.memory


@dataclass(frozen=True)
class Finding:
    """verdict: see `verdict`; table: of the criteria; probability: cause -> probability; evidence: behind them; model: what is handed on:
    the declared model where nothing was found, one with empirical terms where what is left has no name; implausible: a candidate that leads
    with a size that nothing has, and its model without bounds; roll_gusts: None where there are none; flights: since when and with which
    size the answer, or the candidate that came nearest to one, holds in each; by_prediction: with what a model without a verdict predicts
    better; instruments: what such a flight says of its sensors and actuators; within: the finding within the declared bounds,
    `unexplained`, where this one is that without them; outliers: channel -> values that were left out (`tracing.outliers`);
    kinematics: errors of the plan's flight that its sensors show by themselves."""

    frame: Frame
    verdict: str
    table: tuple[Criterion, ...]
    probability: Mapping[str, float]
    evidence: Evidence
    model: FittedModel
    implausible: tuple[tuple[Tried, FittedModel], ...] = ()
    roll_gusts: RollGusts | None = None
    flights: tuple[InFlight, ...] = ()
    by_prediction: ByPrediction | None = None
    instruments: tuple[InstrumentError, ...] = ()
    within: "Finding | None" = None
    outliers: Mapping[str, int] = field(default_factory=dict)
    kinematics: tuple[SensorError, ...] = ()

    @property
    def null(self) -> FittedModel:
        return self.evidence.search.null

    @property
    def first(self) -> FittedModel:
        """The declared model within its bounds."""
        return self.within.null if self.within else self.null

    @property
    def outside(self) -> tuple[Parameter, ...]:
        """Parameters, as they were declared, whose bounds leave out the whole 95 % interval of this finding."""
        if self.within is None:
            return ()
        fit = self.model.fit
        away = dict(zip(fit.names, 1.96 * np.sqrt(np.diag(fit.covariance)), strict=True))
        rows = [(p, fit.parameters[p.name].value) for p in self.within.frame.declared.table().rows if p.name in away]
        return tuple(p for p, value in rows if value + away[p.name] < p.lower or value - away[p.name] > p.upper)

    @property
    def reason(self) -> str:
        """Why a flight is not testable, or why what came nearest is no answer."""
        return reason(self.table, " and ".join(self.evidence.model.keys))

    def before(self) -> Simulator:
        """The declared model at its fit, ready to predict."""
        return self.by_prediction.base.simulator if self.by_prediction else self.first.simulator

    def after(self) -> Simulator:
        """The final model, ready to predict."""
        return self.model.simulator

    def declaration(self) -> KiteDeclaration:
        """The kite file of the final model."""
        return self.model.declaration()


def investigate(
    frame: Frame, null: FittedModel, keys: Sequence[str], *, rounds: int = CRITERIA.effects, null_error: float | None = None,
    identified_error: float | None = None, contradictions: tuple[str, ...] = (), criteria: Criteria = CRITERIA,
    progress: Say = lambda text: None,
) -> Finding:  # fmt: skip
    """Trace what the fitted declared model lacks. Where nothing explains it and parameters stand at their bounds, it may be the bounds that
    do not hold the truth: what is found without them is the answer then, and they are named, if it leads all that was found within them.
    An effect that does what the bounds forbid is as good an explanation, else."""
    how = {
        "rounds": rounds, "null_error": null_error, "identified_error": identified_error, "contradictions": contradictions,
        "criteria": criteria, "progress": progress,
    }  # fmt: skip
    found = _investigated(frame, null, keys, **how)
    at_bound = [n for n in found.null.at_bound if n in frame.declared.parameters]
    if found.verdict != "unexplained" or not at_bound:
        return found
    progress("looking again, without the bounds that parameters stand at")
    wider = frame.beyond(at_bound)
    free = fit_on(wider, found.null)
    if found.null.deviance - free.deviance < criteria.decisive:
        return found
    again = _investigated(wider, free, keys, **how)
    lead = min(found.null.deviance, found.evidence.model.deviance) - again.model.deviance
    return replace(again, within=found) if again.verdict in ("found", "none") and lead >= criteria.decisive else found


def _investigated(
    frame: Frame, null: FittedModel, keys: Sequence[str], *, rounds: int, null_error: float | None, identified_error: float | None,
    contradictions: tuple[str, ...], criteria: Criteria, progress: Say,
) -> Finding:  # fmt: skip
    """Trace what the fitted declared model lacks within its bounds."""
    bare, rest = rest_of(frame, null)
    errors = {"null_error": null_error, "identified_error": identified_error}
    known = {**errors, "contradictions": contradictions, "answering": frame.answering}
    evidence = Evidence(Search(null, null, ()), bare, bare, rest, **known)
    if any(c.passed is False for c in table(evidence, criteria) if c.name in NULL):
        return _finding(frame, evidence, criteria)
    library = search(frame, null, keys, rounds=rounds, criteria=criteria, progress=progress)
    progress("looking at what is left")
    if library.null is not null:
        null = library.null
        bare, rest = rest_of(frame, null)
        evidence = replace(evidence, bare=bare, model=bare, rest=rest)
    evidence = replace(evidence, search=library, **_settled(frame, library, bare, rest, criteria))
    evidence = replace(evidence, doubted=tuple(n for n in unusual_signs(frame.declared) if n in null.towards_zero))
    if not evidence.model.keys:
        alone, steps = shown_alone(frame, null, keys, criteria), steps_of_drifts(frame, evidence.model)
        evidence = replace(evidence, alone=alone, drift_steps=steps, drift_offsets=offsets_of_drifts(evidence.model))
    gusts = {g.name: g.level for g in gusts_of(evidence.model)}
    evidence = replace(evidence, gusts=gusts, gusts_repeat=repetition_of_gusts(frame, evidence.model))
    windy = gusty(evidence.model, criteria)
    if evidence.model.keys:
        if windy:
            evidence = replace(evidence, error_ratio=_error_ratio(frame, null, evidence.model))
        evidence = replace(evidence, steadiness=steadiness(evidence.model), along=gains_along(evidence.model))
        if verdict(table(evidence, criteria)) == "found":  # what is no answer by itself has no rivals
            near = rivals(frame, evidence.model, keys, library.gains, *_ranked(library), library.passed_over, progress=progress)
            evidence = replace(evidence, rivals=near)
    elif evidence.rest.chi2 < 1 + criteria.much * criteria.floor_error:
        evidence = replace(evidence, absorbed=absorbed_effects(frame, null, keys, criteria))
    sufficient = verdict(table(evidence, criteria)) in ("found", "cannot_tell", "none")
    if sufficient and evidence.model.keys:
        progress("letting parameters leave their bounds")
        evidence = replace(evidence, bounds_left=bounds_left(frame, null, evidence.model))
    terms = term_keys(frame.declared, moving(frame.flights[0].log))
    if lacks_terms(frame, evidence.model, terms, criteria) if sufficient else evidence.model.keys or not windy:
        progress("weighing empirical terms")
        most = len(evidence.model.keys) if sufficient else EMPIRICAL_ROUNDS
        few = replace(criteria, competitors=EMPIRICAL_FINALISTS)
        found = evidence.model if sufficient else None
        evidence = replace(evidence, empirical=search(frame, null, terms, rounds=most, beside=found, criteria=few, progress=progress))
    return _finding(frame, evidence, criteria)


def _error_ratio(frame: Frame, before: FittedModel, after: FittedModel) -> float:
    """Prediction error on validation loops after over before; DIVERGED where only the one after diverges, 1 where that cannot be said."""
    first = error_of(frame, before)
    return min(error_of(frame, after) / first, DIVERGED) if np.isfinite(first) else 1.0


def _finding(frame: Frame, evidence: Evidence, criteria: Criteria) -> Finding:
    rows = table(evidence, criteria)
    answer = verdict(rows)
    handed_on = evidence.search.null
    if answer in ("found", "cannot_tell") and evidence.model.keys:
        handed_on = evidence.model
    elif answer == "unexplained" and evidence.empirical is not None and evidence.empirical.final.keys:
        handed_on = evidence.empirical.final
    roll = _roll_gusts(frame, evidence.search.null) if answer == "not_deterministic" and evidence.gusts else None
    odds = probabilities(evidence, answer, criteria)
    implausible = _implausible(frame, evidence, criteria)
    return Finding(frame, answer, rows, odds, evidence, handed_on, implausible, roll, _since(frame, evidence, answer, criteria))


def _since(frame: Frame, evidence: Evidence, answer: str, criteria: Criteria) -> tuple[InFlight, ...]:
    """Since when and in which flights the answer holds; where there is none but something is left, the candidate that came nearest, if it
    began in flight."""
    null, model = evidence.search.null, evidence.model
    if answer in ("found", "cannot_tell") and model.keys:
        return in_flights(frame, null, model, criteria)
    nearest = evidence.search.rounds[0].contenders[:1] if answer == "unexplained" and evidence.search.rounds else []
    models = [fit_on(frame, t.fitted) if t.partly else t.fitted for t in nearest if t.gain > criteria.decisive]
    found = [in_flights(frame, null, model, criteria) for model in models]
    return next((flights for flights in found if any(f.onset for f in flights)), ())


def lacks_terms(frame: Frame, model: FittedModel, terms: Sequence[str], criteria: Criteria = CRITERIA) -> bool:
    """May empirical terms lead a model with effects? Not where none adds anything to it, to first order: a term that says the truth better
    than the model adds to it what it lacks. Of a model that needs model error to fly that cannot be said."""
    return bool(model.keys) and (bool(model.rest) or any(s.drop >= criteria.empirical for s in screen(frame, model, terms).scores))


def _implausible(frame: Frame, evidence: Evidence, criteria: Criteria) -> tuple[tuple[Tried, FittedModel], ...]:
    """The candidate that led the first round with an implausible size, fitted with that size free, where it is not explained by what was
    found."""
    lead = evidence.search.null.deviance - evidence.model.deviance if evidence.model.keys else 0.0
    first = evidence.search.rounds[0].contenders if evidence.search.rounds else []
    found = [t for t in first if not t.plausible and t.gain > max(lead, criteria.decisive)]
    return tuple((t, fit_beyond(frame, t.fitted, t.score.moving).light()) for t in found[:1])


def _roll_gusts(frame: Frame, null: FittedModel, criteria: Criteria = CRITERIA) -> RollGusts | None:
    """Feedback hides roll gusts: a controller answers the roll that a gust makes, and a model without them sees surfaces that move and a
    kite that does not follow. None where there are none, or they are worth nothing."""
    if not any(g.level > 0 for p in null.problems[0].processes if p.name == ROLL_GUSTS for g in p.groups):
        return None
    without = fit_without_process(frame, null, ROLL_GUSTS)
    worth = without.deviance - null.deviance
    if worth < criteria.decisive:
        return None
    return RollGusts(null.light(), without.light(), worth, channels_of(without)[0], channels_of(null)[0])


def _settled(frame: Frame, library: Search, bare: FittedModel, rest: Rest, criteria: Criteria) -> dict:
    """The answer, without model error where that is worth nothing to it, and what it leaves."""
    if not library.final.keys:
        return {"model": bare, "rest": rest}
    alone, left = rest_of(frame, library.final)
    return {"model": (alone if left.worth < criteria.rest_worth else library.final).widened(), "rest": left}


def _ranked(library: Search) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """(effects that a single accepted one has left behind by their own fit to the end, and that need not be tried in its place again; those
    that it has not left behind). A quick fit proves nothing: in gusts it left an exact twin behind, and the whole fit did not. What was set
    aside may be the controller's answer to gusts, and is nobody's rival."""
    accepted = [r for r in library.rounds if r.accepted]
    if len(accepted) != 1:
        return library.set_aside, ()
    lead = library.null.deviance - library.final.deviance
    reach = max(CRITERIA.in_reach(CRITERIA.finalists, lead), library.passed_over)
    others = [t for t in accepted[0].contenders if t.key != accepted[0].accepted]
    close = [t.key for t in others if lead - t.gain <= reach or t.undecided]
    beaten = (t.key for t in others if t.finalist and t.key not in close)
    return (*beaten, *library.set_aside), tuple(close)


def absorbed_effects(frame: Frame, null: FittedModel, keys: Sequence[str], criteria: Criteria = CRITERIA) -> tuple[AbsorbedEffect, ...]:
    """Effects with one strength that do what a parameter at its bound does, and bring it back: a constant moment hides in the derivative
    of a surface that never moves; the fit is good, but the derivative is at the end of what its user thinks possible."""
    at_bound = [n for n in null.at_bound if n in frame.declared.parameters]
    effects = [e for e in (make_effect(k, frame.declared) for k in keys) if not e.probes and not e.shapes and len(e.parameters) == 1]
    if not at_bound or not effects:
        return ()
    columns = CandidateColumns([v for e in effects for v in variants(e)])
    H = informed(frame, null, [e.key for e in effects], columns, frame.horizon)[0]
    nothing = {p.name: p.value for e in effects for p in e.rows()}
    found, n = [], len(null.fit.names)
    for bound in at_bound:
        i = null.fit.names.index(bound)
        for j, name in enumerate(columns.names, start=n):
            key = name.rpartition(".")[0]
            if abs(H[i, j]) < criteria.collinear * np.sqrt(max(H[i, i] * H[j, j], 1e-300)):
                continue
            trial = fit_added(frame, null, key, {name: nothing[name]}, {}, alone=False)
            gain = null.fit.solution.cost - trial.fit.solution.cost
            if bound not in trial.at_bound and gain > criteria.at_bound:
                found.append(AbsorbedEffect(key, bound, gain, trial.widened().light()))
    return tuple(sorted(found, key=lambda s: -s.gain)[:2])


def bounds_left(frame: Frame, null: FittedModel, model: FittedModel) -> BoundsLeft | None:
    """The likeliest of the models with one effect less than an answer whose parameters at their bounds may leave them; None where none is
    at one. Bounds that do not hold the truth look like an effect: the air's density stood for nine parameters that could go no further."""
    found = []
    for key in model.keys:
        fewer = null if model.keys == (key,) else fit_without(frame, model, (key,))
        if at_bound := tuple(n for n in fewer.at_bound if n in frame.declared.parameters):
            promised = promised_beyond(fewer, at_bound)
            far = promised < FAR_BEHIND * (fewer.deviance - model.deviance)
            left = fewer.deviance - promised if far else fit_beyond(frame, fewer, at_bound).deviance
            found.append(BoundsLeft(key, at_bound, left))
    return min(found, key=lambda b: b.deviance, default=None)


def moving(log: FlightLog) -> list[str]:
    """Surfaces that move on a log."""
    return [s for s in SURFACES if s in log.inputs and np.ptp(log.inputs[s]) > STILL]


def library_keys(declared: KiteDeclaration, log: FlightLog, wanted: Sequence[str] | None = None) -> list[str]:
    """Keys of the effects to try on a log: those asked for, else all that it could show (of a receiver that is slower than the log it is
    not known when in a row its values came). Raises BadInput for an unknown one."""
    if wanted is None:
        keys = candidates(declared, list(log.measured), moving(log))
        slow = any(log.is_new(n)[log.valid].mean() < SLOWER for n in ("p_n", "v_n") if n in log)
        return [k for k in keys if not (slow and make_effect(k, declared).needs_times)]
    for key in wanted:
        make_effect(key, declared)
    return [k for k in wanted if k not in declared.effects]


def term_keys(declared: KiteDeclaration, surfaces: Sequence[str]) -> list[str]:
    """The empirical terms that a flight could show and a kite could fly with: every channel times every feature, surfaces only where they
    move, nothing that has to be read from a log."""
    still = set(SURFACES) - set(surfaces)
    keys = [f"{CustomTerm.name}:{c}*{f}" for c in CHANNELS for f in FEATURES if f not in still]
    return [k for k in keys if not make_effect(k, declared).reads and can_act(k, declared)]
