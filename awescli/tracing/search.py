"""Search the library: screen all effects, fit the best ones, accept the likeliest where it beats "something else", again; then go back
over what was accepted."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TypeVar

import numpy as np

from awescli.estimation.gauss_newton import OutOfReach
from awescli.physics.effects.base import Effect
from awescli.physics.kite import make_effect
from awescli.tracing.answered_gusts import SET_ASIDE, beside_answers, is_feedback, of_answering, set_aside, with_gains_under_null
from awescli.tracing.criteria import CRITERIA, Criteria
from awescli.tracing.fitted_model import FittedModel
from awescli.tracing.frame import Frame
from awescli.tracing.models import Say, begins_nowhere, fit_added, fit_on, fit_on_part, fit_swapped, fit_without
from awescli.tracing.rest import gusty
from awescli.tracing.screen import Score, Screening, begun, holm, screen
from awescli.tracing.shapes import plausible, refined
from awescli.tracing.tried import Tried

STARTS = ((1.0, True), (1.0, False), (0.3, False))
"""Shares of its one-step estimate from which a candidate is fitted, and whether without the help of model error; the next one where the fit
before failed."""
HELPED = 0.5
"""Share of the best gain from which a candidate that model error helps is fitted to the end, for a quick fit may end before its level has
come down (a delay that lacked a third of the gain of a lag then led it in the end); and below which no candidate is fitted any further."""
WORSE = 5.0
"""Deviance by which a fit with one effect more may end above the model without it: more, and the optimiser has failed."""
PROMISED = 3.0
"""Times the best gain of a round that a score promises: what was not fitted is fitted then, too, up to twice as many as compete. Where a
model lacks several effects and has hardly ended, scores may be wrong: a winch clock that was off stood behind a dozen that gained nothing
of what theirs said (tracing campaign, family 52)."""

Candidate = TypeVar("Candidate", Score, Tried)
CROWD = 2
"""So many candidates beside the best may gain half as much as it: rivals do."""


@dataclass(frozen=True)
class Round:
    """base: the model that was there; tried: all candidates, best screened first; accepted: whose turn it was, "" for nobody; untestable:
    effects that the free parameters absorb; unnamed: the likeliest, where it may only be what the form of an earlier one leaves."""

    base: FittedModel
    tried: tuple[Tried, ...]
    accepted: str
    untestable: tuple[str, ...]
    unnamed: str = ""

    @property
    def contenders(self) -> list[Tried]:
        """Those that were fitted, likeliest first."""
        return sorted((t for t in self.tried if t.model is not None), key=lambda t: -t.gain)


@dataclass(frozen=True)
class Search:
    """What a search found. null, final: the models before and after; detectable: key -> (parameter, least size that would have shown)."""

    null: FittedModel
    final: FittedModel
    rounds: tuple[Round, ...]
    detectable: dict[str, tuple[str, float]] = field(default_factory=dict)

    @property
    def gains(self) -> dict[str, float]:
        """Accepted effect -> deviance that it gained in its turn."""
        return {r.accepted: next(t.gain for t in r.contenders if t.key == r.accepted) for r in self.rounds if r.accepted}

    @property
    def passed_over(self) -> float:
        """Deviance that the best further effect would gain, which got no name: what the form of the accepted ones may have left. 0 where
        there is none."""
        return max((t.gain for r in self.rounds[1:] if not r.accepted for t in r.contenders), default=0.0) if self.final.keys else 0.0

    @property
    def unnamed(self) -> Tried | None:
        """The further effect that is decisively likelier, also on loops that it was not fitted to, and gets no name all the same: it may be
        there, or be what the form of an accepted one leaves. None where there is none."""
        last = self.rounds[-1] if self.rounds and self.final.keys else None
        return next((t for t in last.contenders if t.key == last.unnamed), None) if last else None

    @property
    def set_aside(self) -> tuple[str, ...]:
        """Effects of surfaces whose gain may be a controller's answer to gusts."""
        return tuple(dict.fromkeys(t.key for r in self.rounds for t in r.tried if t.outcome == SET_ASIDE))

    @property
    def failed(self) -> tuple[str, ...]:
        """Significant candidates that could not be fitted."""
        return tuple(dict.fromkeys(t.key for r in self.rounds for t in r.tried if t.significant and t.outcome == "failed"))


def search(
    frame: Frame, null: FittedModel, keys: Sequence[str], *, rounds: int, beside: FittedModel | None = None, criteria: Criteria = CRITERIA,
    progress: Say = lambda text: None,
) -> Search:  # fmt: skip
    """Search the effects `keys` for what the fitted model `null` lacks. beside: an answer that is there already: effects that come to much
    less in the rounds that are left are given up."""
    model, record, detectable = null, [], {}
    remaining = [k for k in keys if k not in null.keys]
    for number in range(rounds):
        progress(f"round {number + 1}: screening {len(remaining)} candidates")
        screening = screen(frame, model, remaining)
        detectable = detectable or _detectable(screening)
        lead = (model.fit.deviance - beside.fit.deviance) / (rounds - number) if beside else 0.0
        tried = _race(frame, model, screening, lead, criteria, progress)
        least = asked(frame, record, model, tried[0].key, criteria) if tried else 0.0
        best, tried = _best(frame, model, tried, criteria, progress, least)
        if best is not None and crowded(tried):
            model, best, tried = _base_revisited(frame, model, best, tried, criteria, progress)
            null = null if record else model
        unnamed = ""
        if best is not None and (mends(frame, best.keys) or finer_than_samples(best) or slight(frame, record, model, best, criteria)):
            unnamed, best = "" if finer_than_samples(best) else best.keys[-1], None
        if record and gusty(model, criteria):
            tried = set_aside(frame, tried, criteria)
        record.append(Round(model.light(), tried, best.keys[-1] if best else "", screening.untestable, unnamed))
        if best is None:
            break
        model, remaining = best, [k for k in remaining if k != best.keys[-1]]
    final, record = _revisited(frame, model, record, criteria, progress)
    return Search(null, final, tuple(record), detectable)


def admissible(before: FittedModel, after: FittedModel, criteria: Criteria = CRITERIA) -> bool:
    """Is a model with further strengths decisively likelier than the one before, also without the segment that speaks loudest for it, and
    does it gain on loops that it was not fitted to?"""
    new, gain = len(after.strengths) - len(before.strengths), before.deviance - after.deviance
    loudest = max(np.concatenate([before.train - after.train, before.validation - after.validation]).max(), 0.0)
    least = criteria.decisive + criteria.per_parameter * new
    return bool(gain >= least and gain - loudest >= criteria.decisive and before.unseen > after.unseen)


def mends(frame: Frame, keys: Sequence[str]) -> bool:
    """Is the last of `keys` a further error of a sensor or an actuator that has one already? It may be there, or mend the form of the
    first. A pitot that is off linearly with sideslip, fitted by its square, left a scale more than half of its gain; play in a linkage left
    a delay (JSBSim). Forces alone do not say which, so it is not named; kinematics may name both errors of a sensor."""
    *earlier, last = ((e.instrument, e.target) for e in (make_effect(key, frame.declared) for key in keys))
    return bool(last[0]) and last in earlier


def finer_than_samples(model: FittedModel) -> bool:
    """Is the last effect of a model but a time, and shorter than half a sample? No recorder tells when in a row its values came: a receiver
    whose values stand in several rows made an attitude 4 ms late."""
    rows = [model.table[n] for n in model.strengths if n.startswith(f"{model.keys[-1]}.")]
    return bool(rows) and all(p.unit == "s" and abs(p.value) < model.problems[0].log.dt / 2 for p in rows)


def slight(frame: Frame, record: Sequence[Round], here: FittedModel, best: FittedModel, criteria: Criteria = CRITERIA) -> bool:
    """Does the last effect of the model `best` gain so little beside what an earlier one gained that it may only say what the form of that
    one has left, or what gusts may gain that blow beside it? A term without a name claims nothing and is never in doubt."""
    return here.deviance - best.deviance < asked(frame, record, best, best.keys[-1], criteria)


def asked(frame: Frame, record: Sequence[Round], model: FittedModel, key: str, criteria: Criteria = CRITERIA) -> float:
    """Deviance that a further name must gain, in the air that a model sees."""
    gains = [(t.key, t.gain) for r in record for t in r.contenders if t.key == r.accepted]
    if not gains or make_effect(key, frame.declared).empirical:
        return 0.0
    blown = gusty(model, criteria)
    left = max(gain * _left_by_form(frame, accepted, blown, criteria) for accepted, gain in gains)
    return max(left, criteria.clear_of_gusts if blown else 0.0)


def _left_by_form(frame: Frame, key: str, blown: bool, criteria: Criteria) -> float:
    """Share of what an effect gains that its form may leave. In gusts more may be left: a surface that answers them seems late."""
    known = make_effect(key, frame.declared).place in ("line", "report") and not blown
    return criteria.known_form if known else criteria.form


def _detectable(screening: Screening) -> dict[str, tuple[str, float]]:
    found = {}
    for s in screening.scores:
        unit = s.variant.at[s.moving[0]] if s.variant.secant else 1.0
        found[s.key] = (s.moving[0], float(screening.detectable * s.std[0] * unit))
    return found


def _race(
    frame: Frame, here: FittedModel, screening: Screening, lead: float, criteria: Criteria, progress: Say
) -> tuple[Tried, ...]:  # fmt: skip
    """Fit those that the screening puts first, to a part of long flights. lead: deviance on train that is gained elsewhere."""
    scores = screening.scores
    if not scores:
        return ()
    significant = holm([s.p_value for s in scores], criteria.family_error)
    leaders = [s for s, sure in zip(scores, significant, strict=True) if sure]
    drops = criteria.close * leaders[0].drop if leaders else 0.0
    chosen = leaders[: criteria.competitors]
    chosen += [s for s in _apart(frame, here, leaders, criteria)[0][: criteria.competitors] if s not in chosen]
    chosen += [s for s in leaders[criteria.competitors : 2 * criteria.competitors] if s.drop > drops]
    # what points in a leader's direction competes with it, whatever its rank
    chosen += [s for s in scores if s not in chosen and any(screening.cosine(s, c) > criteria.alike for c in chosen[:2])][:3]
    # and so does what acts on the same surface, axis or clock: what an actuator does is seldom nearly linear
    targets = {t for s in chosen[:2] if (t := make_effect(s.key, frame.declared).target)}
    chosen += [s for s in scores if s not in chosen and make_effect(s.key, frame.declared).target in targets]
    if here.rest or leaders:
        # an abrupt effect changes a flight at its start already: only a fit from its probe can judge it
        chosen += [s for s in scores if s not in chosen and make_effect(s.key, frame.declared).abrupt]
    part, few = fit_on_part(frame, here) if chosen else (frame, here)
    times, entered = here.segments / few.segments, {}
    groups = _apart(frame, here, scores, criteria)
    best = [few.fit.deviance - lead / times] * len(groups)

    def enter(s: Score) -> None:
        progress(f"fitting with {s.key}")
        group = next(i for i, those in enumerate(groups) if s in those)
        tried = _entered(part, few, screening, s, s in leaders, _reach(few, best[group], criteria))
        entered[s.key] = replace(tried, gain=times * tried.gain, unseen=times * tried.unseen, partly=few is not here)
        best[group] = min(best[group], tried.fitted.fit.deviance if tried.model and tried.plausible else best[group])

    for s in (s for s in scores if s in chosen):
        enter(s)
    for s in [s for s in leaders if s.key not in entered][: 2 * criteria.competitors]:
        if s.drop > PROMISED * max(t.gain for t in entered.values()):
            enter(s)
    return tuple(entered.get(s.key, Tried(s, s in leaders)) for s in scores)


def _apart(frame: Frame, here: FittedModel, those: Sequence[Candidate], criteria: Criteria) -> tuple[list[Candidate], ...]:
    """Groups of candidates that compete with each other: one in calm air; in gusts those that are no effects of surfaces that answer the
    kite, and those."""
    if not gusty(here, criteria):
        return (list(those),)
    return [t for t in those if not of_answering(frame, t.key)], [t for t in those if of_answering(frame, t.key)]


def _reach(here: FittedModel, best: float, criteria: Criteria) -> float:
    """Deviance on train above which a candidate is of no use in a race in which one has come to `best`: it gains less than half as much,
    and so much less that it is no finalist."""
    lead = here.fit.deviance - best
    return best + max((1 - HELPED) * lead, criteria.in_reach(criteria.finalists, lead)) if lead > 0 else np.inf


def _entered(frame: Frame, here: FittedModel, screening: Screening, score: Score, significant: bool, reach: float = np.inf) -> Tried:
    """The model with a candidate added, from the first start from which the fit succeeds; one that is not significant is begun once, for
    its failure would say nothing. A fit that comes nowhere near a deviance of `reach` is given up: not one that may do so because a shape
    is held where it was probed; an abrupt effect is begun elsewhere then, too. One that was seen with a shape that it may do without is
    begun without, and then with it: a lag that was seen with a limit of its rate gained a quarter less with that limit than without."""
    effect = make_effect(score.key, frame.declared)
    starts, ended = STARTS if here.rest else STARTS[1:], "given up"
    first = np.inf if effect.onset or any(len(effect.probes.get(shape, ())) > 1 for shape in effect.shapes) else reach
    onset = begun(frame, here, score.key) if effect.onset else {}
    for share, alone in starts if significant else starts[:1]:
        strengths, seen = ({n: onset.get(n, value) for n, value in those.items()} for those in score.start(screening.rows, share))
        shapes = {**seen, **_without(effect)}
        try:
            model = fit_added(frame, here, score.key, strengths, shapes, alone, first)
            if _failed(here, model) and model.flies >= here.flies:
                # a quick fit keeps the slope of the log determinant as it was before: in gusts that may lead it astray
                model = fit_on(frame, model, reach=reach)
        except OutOfReach:
            if effect.abrupt:
                continue
            break
        if not _failed(here, model):
            if shapes != seen or not plausible(model, score.key) or model.unseen > here.unseen:
                model = _reshaped(frame, here, model, strengths, shapes, alone, reach)
            return _of(Tried(score, significant), here, model)
        ended = "failed"
    return Tried(score, significant, ended)


def _without(effect: Effect) -> dict[str, float]:
    """Full name -> null of the shapes that an effect may do without, as their probes say that have it among them."""
    null = {p.name: p.value for p in effect.parameters}
    return {f"{effect.key}.{n}": null[n] for n in effect.shapes if null[n] in effect.probes.get(n, ())}


def _of(tried: Tried, here: FittedModel, model: FittedModel) -> Tried:
    """A candidate of which `model` came where `here` stood."""
    gain, unseen = here.deviance - model.deviance, here.unseen - model.unseen
    outcome, sound = model.fit.solution.outcome, plausible(model, tried.key)
    return replace(tried, outcome=outcome, model=model.light(), gain=gain, unseen=unseen, plausible=sound, partly=False)


def _reshaped(
    frame: Frame, here: FittedModel, model: FittedModel, strengths: Mapping[str, float], shapes: Mapping[str, float], alone: bool,
    reach: float,
) -> FittedModel:  # fmt: skip
    """The likeliest of a model whose last effect has come to the end of a range, or does worse on unseen loops, and those with the other
    shapes that it is probed with: a rate limit was taken for the longest lag there is, because the one that was tried first was no limit.
    """
    effect, best = make_effect(model.keys[-1], frame.declared), model
    for shape in (s for s in effect.shapes if s in effect.probes):
        name = f"{effect.key}.{shape}"
        for value in (v for v in effect.probes[shape] if v != shapes.get(name) and not begins_nowhere(model, name, v)):
            try:
                other = fit_added(frame, here, effect.key, strengths, {**shapes, name: value}, alone, reach)
            except OutOfReach:
                continue
            if not _failed(here, other) and other.deviance < best.deviance:
                best = other
    return best


def _failed(before: FittedModel, after: FittedModel) -> bool:
    """Does a model with one effect more lose segments, or follow those it was fitted to worse? Not where its cost has fallen with the same
    noise and levels: then what is not known of the effect's own states makes it less likely, and no optimiser has failed."""
    alike = all(p.factors == q.factors and p.processes == q.processes for p, q in zip(before.problems, after.problems, strict=True))
    nearer = alike and after.fit.solution.cost < before.fit.solution.cost
    return after.flies < before.flies or (after.train.sum() >= before.train.sum() + WORSE and not nearer)


def _best(
    frame: Frame, here: FittedModel, tried: tuple[Tried, ...], criteria: Criteria, progress: Say, least: float = 0.0
) -> tuple[FittedModel | None, tuple[Tried, ...]]:
    """(the likeliest model of those that are admissible, fitted to the end, shapes included; what was tried, with those that were). least:
    deviance that a name must gain: shapes of one that gains less than half of it are not asked."""
    leaders = sorted((t for t in tried if t.model is not None and t.gain > criteria.decisive), key=lambda t: -t.gain)
    finalists = [t for those in _apart(frame, here, leaders, criteria) for t in _finalists(frame, those, criteria)]
    finished: dict[str, FittedModel] = {}

    def finish(t: Tried) -> None:
        progress(f"fitting with {t.key} to the end")
        # the part of a flight that it was fitted to does not hold every onset
        anew = t.partly and make_effect(t.key, frame.declared).onset
        whole = fit_on(frame, t.fitted, begun(frame, here, t.key)) if anew else fit_on(frame, t.fitted)
        finished[t.key] = refined(frame, whole, criteria, t.fitted if t.partly else None) if t.gain >= HELPED * least else whole

    def standing() -> list[FittedModel]:
        return [m for m in finished.values() if admissible(here, m, criteria) and plausible(m, m.keys[-1])]

    for t in finalists:
        finish(t)
    astray = any(not t.partly and here.deviance - finished[t.key].deviance < t.gain - WORSE for t in finalists)
    for t in (t for t in leaders if t.key not in finished):
        most = max((here.deviance - m.deviance for m in standing()), default=np.inf)
        # that a part of the flight puts it before the best of all of it is no gain yet; nor is a fit to the end that went astray, where
        # nothing else stands, a reason to pass over the next
        if (t.partly and t.gain > most) or (astray and t.plausible and most == np.inf):
            finish(t)
    tried = tuple(replace(_of(t, here, m), finalist=True) if (m := finished.get(t.key)) else t for t in tried)
    if not gusty(here, criteria):
        return min(standing(), key=lambda m: m.deviance, default=None), tried
    tried = with_gains_under_null(frame, here, tried, criteria, progress)
    if best := beside_answers(frame, here, standing(), tried, criteria):
        return best, set_aside(frame, tried, criteria)
    made_by_gusts = {t.key for t in tried if is_feedback(t, criteria)}
    return min((m for m in standing() if m.keys[-1] not in made_by_gusts), key=lambda m: m.deviance, default=None), tried


def _finalists(frame: Frame, leaders: Sequence[Tried], criteria: Criteria) -> list[Tried]:
    """Those of some that compete, likeliest first, that are fitted to the end."""
    sound = [t for t in leaders if t.plausible]
    lead = sound[0].gain if sound else 0.0
    # what stands at the end of a range may only do so because a shape of it is held
    found = [t for t in leaders if not t.plausible and t.gain > lead and make_effect(t.key, frame.declared).shapes]
    reach = lead - criteria.in_reach(criteria.finalists, lead)
    found += [t for t in sound if t.gain > reach or (t.gain > HELPED * lead and t.fitted.rest)]
    return found[: criteria.competitors]


def crowded(tried: Sequence[Tried]) -> bool:
    """Do many candidates gain about as much as the best? What they have in common is then not what they are."""
    gains = sorted((t.gain for t in tried if t.model is not None), reverse=True)
    return len(gains) > CROWD and gains[CROWD] > gains[0] / 2


def _base_revisited(
    frame: Frame, base: FittedModel, best: FittedModel, tried: tuple[Tried, ...], criteria: Criteria, progress: Say
) -> tuple[FittedModel, FittedModel | None, tuple[Tried, ...]]:
    """(base, best, tried), the base fitted anew from where the best candidate led, without it: a fit that had stopped short of its optimum
    would make every candidate look good that happens to carry it on."""
    progress("fitting without it from there")
    again = fit_without(frame, best, best.keys[-1:])
    nearer = base.deviance - again.deviance
    if nearer <= 0:
        return base, best, tried
    seen = base.unseen - again.unseen
    tried = tuple(t if t.model is None else replace(t, gain=t.gain - nearer, unseen=t.unseen - seen) for t in tried)
    return again, best if admissible(again, best, criteria) else None, tried


def _revisited(frame: Frame, final: FittedModel, record: list[Round], criteria: Criteria, progress: Say) -> tuple[FittedModel, list[Round]]:
    """One backward pass: in each earlier round the close ones may take the winner's place in the final model, which holds what later rounds
    found; and an effect that is worth nothing any more goes."""
    record = list(record)
    accepted = [i for i, r in enumerate(record) if r.accepted]
    for i in accepted[:-1]:
        progress("going back over what was accepted")
        r = record[i]
        lead = r.contenders[0].gain if r.contenders else 0.0
        others = [t for t in r.contenders if t.key not in final.keys and t.gain > lead / 2][:3]
        tried = [fit_swapped(frame, final, r.accepted, t.fitted) for t in others]
        best = min([final, *tried], key=lambda m: m.deviance)
        if best is not final:
            record[i] = replace(r, accepted=best.keys[final.keys.index(r.accepted)])
            final = best
    for i in accepted[:-1]:
        without = fit_without(frame, final, (record[i].accepted,))
        if not admissible(without, final, criteria):
            final, record[i] = without, replace(record[i], accepted="")
    return final, record
