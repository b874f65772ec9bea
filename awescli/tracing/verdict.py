"""The verdict: a pure function of a table of criteria, and the table."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import exp, isfinite, log

from awescli.estimation.fitted import UNFINISHED
from awescli.estimation.processes.drift import Drift
from awescli.tracing.criteria import CRITERIA, Criteria
from awescli.tracing.evidence import PRICE, Evidence

VERDICTS = ("none", "found", "cannot_tell", "unexplained", "not_deterministic", "not_testable")
UNOPPOSED = (
    "rest_is_small", "no_better_empirical_term", "effect_leads", "effect_steady", "effect_constant", "signs_plausible", "bounds_hold",
)  # fmt: skip
"""Without these an effect that explains everything is no answer."""
NULL = ("sensors_agree", "null_flew", "null_converged", "null_follows", "null_near", "null_as_identified")
"""Without these there is no model in whose residual anything could be sought."""

OBJECTIONS = {
    "sensors_plausible": "a sensor would have to drift, or be noisier, beyond what is plausible for it",
    "no_better_empirical_term": "as few empirical terms fit better",
    "effect_predicts": "gusts may gain as much, and unseen loops are not predicted better by enough (error times {row.value:.2f})",
    "gusts_do_not_repeat": "what would have to be gusts beside it repeats from loop to loop, as no gust does",
    "rest_is_small": "what is left repeats from loop to loop, and is worth {row.value:.2f} of what it gains",
    "effect_leads": "another effect, which is no answer itself, fits better",
    "effect_steady": "its size drifts through the flight: look for what changes with time",
    "effect_constant": "its size changes with the way the kite flies ({row.says}: {row.value:.0f})",
    "signs_plausible": "{row.value}, declared with a sign that hardly any aircraft has, is driven to the end of its range next to zero",
    "bounds_hold": "bounds of the kite file that do not hold the truth would do the same ({row.says}: {row.value:.0f})",
}
"""Criterion -> why an effect that takes most of the residual away is no answer; `row`: the criterion's own."""


@dataclass(frozen=True)
class Criterion:
    """One row of the table. passed: None where the flight does not allow the test; source: where the threshold comes from."""

    name: str
    value: float | str
    threshold: float | str
    passed: bool | None
    says: str
    source: str


def verdict(table: Sequence[Criterion]) -> str:
    """The verdict that a table of criteria stands for.

    Sensors that contradict each other, or a model that did not fly, or is not the identified one, make a flight not testable. An effect is
    found where it is significant (which in gusty air takes a better prediction, too, unless it gains much), sufficient, steady, constant
    and alone, on a kite whose declared signs can be; where others do as well nobody can tell. What is left without a name is unexplained
    where it repeats (called gusts or not) or goes on from loop to loop, and so is an effect beside which too much of that is left, whose
    size drifts or goes with the way the kite flies, or which another one outdoes that cannot be; and so is what one of several flights
    shows alone, or a sensor's drift that steps. That nothing is missing is said in calm air, and where all that could be was tried.
    """
    passed = {c.name: c.passed for c in table}
    if not all(passed[name] is not False for name in NULL):
        return "not_testable"
    if passed["gusts_do_not_repeat"] is False:
        return "unexplained"
    effect = passed["effect_likelier"] and passed["effect_on_unseen_loops"] and passed["effect_predicts"] is not False
    sufficient = passed["rest_is_noise"] or (passed["floor"] and passed["floor_by_channel"])
    if not sufficient:
        structured = passed["rest_repeats"] is not False or passed["rest_lasts"]
        random = not structured and passed["no_better_empirical_term"] and not effect and passed["flights_agree"] is not False
        return "not_deterministic" if random else "unexplained"
    if not passed["sensors_plausible"]:
        return "unexplained"
    if effect:
        if any(passed[name] is False for name in UNOPPOSED):
            return "unexplained"
        return "found" if passed["no_rival"] else "cannot_tell"
    if passed["flights_agree"] is False:
        return "unexplained"
    if not passed["no_parameter_hides_it"]:
        return "cannot_tell"
    if not passed["calm_air"]:
        return "not_deterministic"
    if passed["sensors_steady"] is False:
        return "unexplained"
    return "none" if passed["all_candidates_fitted"] else "cannot_tell"


def reason(table: Sequence[Criterion], nearest: str = "") -> str:
    """Why a flight is not testable, or why what came nearest to an answer (`nearest`: its name) is none; "" where there is nothing to say.
    A pure function of the table, as the verdict is."""
    rows, answer = {c.name: c for c in table}, verdict(table)
    if answer == "not_testable":
        failed = next(rows[name] for name in NULL if rows[name].passed is False)
        limit = "" if isinstance(failed.value, str) else f" (at most {_short(failed.threshold)})"
        return f"{failed.says}: {_short(failed.value)}{limit}"
    significant = rows["effect_likelier"].passed and rows["effect_on_unseen_loops"].passed
    sufficient = rows["rest_is_noise"].passed or (rows["floor"].passed and rows["floor_by_channel"].passed)
    if answer == "unexplained" and not significant and (sufficient or rows["flights_agree"].passed is False):
        return _why_nothing_explains(rows)
    if answer not in ("unexplained", "not_deterministic") or not nearest or not significant:
        steps = rows["sensors_steady"]
        return f"Beside gusts {steps.value}: look at it." if answer == "not_deterministic" and steps.passed is False else ""
    objections = [said.format(row=rows[name]) for name, said in OBJECTIONS.items() if rows[name].passed is False]
    if not sufficient:
        objections.insert(0, f"more than noise is left beside it (chi-square {_short(rows['floor'].value)} on validation loops)")
    return f"{nearest} {'come' if ' and ' in nearest else 'comes'} nearest, but {' and '.join(objections)}."


def _why_nothing_explains(rows: Mapping[str, Criterion]) -> str:
    """Why a flight on which nothing but noise and gusts is left is unexplained all the same."""
    if rows["gusts_do_not_repeat"].passed is False:
        return "What would have to be gusts repeats from loop to loop, as no gust does."
    if rows["flights_agree"].passed is False:
        return f"One flight shows what the others do not: {rows['flights_agree'].value}. Trace that flight by itself."
    if rows["sensors_steady"].passed is False:
        return f"Nothing but noise and drift is left, but {rows['sensors_steady'].value}: look at it."
    sensor, ask = rows["sensors_plausible"], "Is the sensor off, or the noise in the kite file too small?"
    return f"Nothing but noise is left, but too much: {sensor.says} is {_short(sensor.value)}. {ask}"


def _short(value: float | str) -> str:
    return value if isinstance(value, str) else f"{value:.3g}"


def table(evidence: Evidence, criteria: Criteria = CRITERIA) -> tuple[Criterion, ...]:
    """Every criterion of a trace, tested."""
    rows = (_of_null, _of_answer, _of_rest, _of_sensors, _of_others)
    return tuple(row for found in rows for row in found(evidence, criteria))


def _of_null(e: Evidence, c: Criteria) -> tuple[Criterion, ...]:
    null = e.search.null
    lost = 1 - null.flies / null.segments
    ratio = e.null_error / e.identified_error if e.null_error is not None and e.identified_error else None
    return (
        Criterion(
            "sensors_agree",
            "; ".join(e.contradictions) or "nothing",
            "nothing",
            not e.contradictions,
            "what sensors contradict each other in by themselves, without any model of forces, and no effect stands for",
            "kinematics; set on development flights",
        ),
        Criterion(
            "null_flew",
            lost,
            c.lost_share,
            lost <= c.lost_share,
            "share of segments that diverged under the declared model",
            "set on development flights",
        ),
        Criterion(
            "null_converged",
            null.fit.still_to_gain if isfinite(null.fit.still_to_gain) else null.fit.solution.outcome,
            UNFINISHED,
            null.fit.still_to_gain <= UNFINISHED,
            f"share of the cost that another step would promise the declared model, whose fit ended as {null.fit.solution.outcome}",
            "set on development flights",
        ),
        Criterion(
            "null_follows",
            null.chi2,
            c.follows,
            0 <= null.chi2 <= c.follows,
            "chi-square per degree of freedom on validation loops of the declared model with its model error",
            "set on development flights",
        ),
        Criterion(
            "null_near",
            e.bare.chi2,
            c.near,
            e.bare.chi2 <= c.near,
            "chi-square per degree of freedom on validation loops of the declared model without model error",
            "set on development flights",
        ),
        Criterion(
            "null_as_identified",
            "not compared" if ratio is None else ratio,
            c.worse_than_identified,
            None if ratio is None else ratio <= c.worse_than_identified,
            "its error on validation loops over that of the model that identify handed on",
            "another optimum is another question",
        ),
    )


def _of_answer(e: Evidence, c: Criteria) -> tuple[Criterion, ...]:
    before, after = e.search.null, e.model
    gain, unseen = before.deviance - after.deviance, before.unseen - after.unseen
    least = c.decisive + c.per_parameter * (len(after.strengths) - len(before.strengths))
    there = bool(after.keys)
    better = c.predicts if gain < (c.clear_of_gusts if e.of_answering else c.in_gusts) else c.predicts_little
    asked = there and gain < c.clear_of_gusts and max(e.gusts.values(), default=0.0) >= c.gusty
    most = max(e.along, key=lambda channel: e.along[channel], default="")
    return (
        Criterion(
            "effect_likelier",
            gain if there else 0.0,
            least,
            there and gain >= least,
            "deviance by which the answer leads the declared model with something else as model error",
            "Kass & Raftery 1995; Akaike",
        ),
        Criterion(
            "effect_on_unseen_loops",
            unseen if there else 0.0,
            0.0,
            there and unseen > 0,
            "its deviance gained on loops it was not fitted to",
            "set on development flights",
        ),
        Criterion(
            "effect_predicts",
            e.error_ratio if asked else "not asked",
            1 - better,
            e.error_ratio <= 1 - better if asked else None,
            f"its prediction error on validation loops over that before, where gusts may gain as much (< {c.clear_of_gusts:g})",
            "set on development flights",
        ),
        Criterion(
            "effect_leads",
            e.outdone,
            c.decisive,
            e.outdone < c.decisive,
            "deviance by which another effect, of an implausible size maybe, leads it",
            "Kass & Raftery 1995",
        ),
        Criterion(
            "effect_steady",
            e.steadiness,
            c.steady,
            e.steadiness >= c.steady,
            "probability that chance makes its size drift so much through the flight",
            "score test (Rao 1948)",
        ),
        Criterion(
            "effect_constant",
            e.along.get(most, 0.0),
            c.constant,
            e.along.get(most, 0.0) < c.constant,
            f"deviance that its size would gain by going with {most or 'a channel of the flight'}",
            "score test (Rao 1948); set on development flights",
        ),
    )


def _of_rest(e: Evidence, c: Criteria) -> tuple[Criterion, ...]:
    rest, gain = e.rest, e.search.null.deviance - e.model.deviance
    structured = any(r is not None and r.repeats(c) for r in (rest.repetition, rest.lasting))
    asked = structured and gain > 0 and rest.worth >= c.rest_worth
    worst = rest.channels.get(rest.largest, 1.0)
    again, floor, of_one = rest.repetition, rest.floor(c), rest.floor_of(rest.largest, c)
    return (
        Criterion(
            "rest_is_noise",
            rest.worth,
            c.rest_worth,
            rest.worth < c.rest_worth and rest.chi2 < 1 + c.much * c.floor_error,
            "deviance that model error is worth beside the answer",
            "set on development flights",
        ),
        Criterion(
            "rest_is_small",
            rest.worth / gain if asked else "not asked",
            c.form,
            rest.worth < c.form * gain if asked else None,
            "what model error is worth beside the answer over what the answer gains, where it repeats from loop to loop or goes on",
            "set on development flights",
        ),
        Criterion(
            "floor",
            rest.chi2,
            floor,
            rest.chi2 <= floor and rest.worth < c.rest_slight,
            f"chi-square per degree of freedom left on validation loops, model error worth less than {c.rest_slight:g}",
            "set on development flights",
        ),
        Criterion(
            "floor_by_channel",
            worst,
            of_one,
            worst <= of_one,
            f"of the channel farthest above its own ({rest.largest})",
            "set on development flights",
        ),
        Criterion(
            "rest_repeats",
            1.0 if again is None else again.least,
            c.repeats,
            None if again is None else again.repeats(c),
            "probability that chance makes what is left repeat so much from loop to loop",
            "permutation of the loops' phases",
        ),
        Criterion(
            "rest_lasts",
            1.0 if rest.lasting is None else rest.lasting.least,
            c.repeats,
            None if rest.lasting is None else rest.lasting.repeats(c),
            "probability that chance makes what is left go on so much from one loop to the next",
            "permutation of the loops",
        ),
    )


def _of_sensors(e: Evidence, c: Criteria) -> tuple[Criterion, ...]:
    problem, off = e.model.problems[0], e.drift_offsets
    drifts = [g for p in problem.processes if p.name == Drift.name for g in p.groups if g.level > 0]
    shares = {g.name: g.of_level.above(off.get(g.name, (g.level, ""))[0]) / c.drift_spreads for g in drifts}
    shares |= {name: log(factor) / log(c.noise_factor) for name, factor in problem.factors.items()}
    worst = max(shares, key=lambda name: shares[name], default="")
    value = max(shares.get(worst, 0.0), 0.0)
    which = f" ({'; '.join((worst, *off.get(worst, ())[1:]))})" if value > 0 else ""
    says = f"drift or noise of a sensor over the largest that is plausible for it{which}"
    return (Criterion("sensors_plausible", value, 1.0, value <= 1.0, says, "set on development flights"),)


def _of_others(e: Evidence, c: Criteria) -> tuple[Criterion, ...]:
    rivals = sorted({r.key for found in e.rivals.values() for r in found})
    failed, gusts, again = e.search.failed, max(e.gusts.values(), default=0.0), e.gusts_repeat
    gain = e.search.null.deviance - e.model.deviance if e.model.keys else 0.0
    left, lead = e.bounds_left, e.bounds_left.deviance - e.model.deviance if e.bounds_left else None
    steps = e.drift_steps
    changed = " and ".join(channel for channel, size in (steps or {}).items() if size > c.drift_step)
    stepped = f"the drift of {changed} steps, as of a sensor that changes" if changed else "nothing"
    gone, at_bound = (left.gone, ", ".join(left.parameters)) if left else ("one effect", "parameters")
    return (
        Criterion(
            "no_rival",
            ", ".join(rivals) or 0,
            c.decisive,
            not rivals,
            f"effects that the answer leads by less than this, or than {100 * c.approximate:g} % of what it gains",
            "Kass & Raftery 1995",
        ),
        Criterion(
            "all_candidates_fitted", ", ".join(failed) or 0, 0, not failed, "significant candidates whose fit failed from every start",
            "a fit that failed proves nothing",
        ),  # fmt: skip
        Criterion(
            "flights_agree",
            "not asked" if e.alone is None else "; ".join(f"{a.key} in {a.label}" for a in e.alone) or "nothing", "nothing",
            None if e.alone is None else not e.alone, f"what one of several flights shows alone, of a promised {c.in_one_flight:g} or more",
            "score test (Rao 1948); set on development flights",
        ),  # fmt: skip
        Criterion(
            "sensors_steady", "not asked" if steps is None else stepped, "nothing", None if steps is None else not changed,
            f"drifts that change from one loop to the next by more than {c.drift_step:g} times what they usually do",
            "set on development flights",
        ),  # fmt: skip
        Criterion(
            "no_parameter_hides_it", ", ".join(s.key for s in e.absorbed) or 0, c.at_bound, not e.absorbed,
            "effects that bring a parameter back from its bound", "set on development flights",
        ),  # fmt: skip
        Criterion(
            "no_better_empirical_term", e.empirical_lead, c.empirical, e.empirical_lead < c.empirical,
            "deviance by which as few empirical terms lead the answer, each name more counted", "set on development flights",
        ),  # fmt: skip
        Criterion(
            "signs_plausible", ", ".join(e.doubted) or 0, 0, not e.doubted,
            "coefficients of an unlikely sign that the declared model drives to the end of their range next to zero",
            "Etkin & Reid 1996, ch. 5",
        ),  # fmt: skip
        Criterion(
            "bounds_hold", "no parameter at a bound" if lead is None else lead, c.decisive, lead is None or lead >= c.decisive,
            f"deviance by which the answer leads one without {gone}, {at_bound} free to leave their bounds", "Kass & Raftery 1995",
        ),  # fmt: skip
        Criterion(
            "calm_air", gusts, c.gusty, gusts < c.gusty, "level of the gusts that the flight shows [m/s]", "set on development flights"
        ),
        Criterion(
            "gusts_do_not_repeat",
            1.0 if again is None else again.least,
            c.repeats,
            None if again is None or gusts < c.gusty else not again.repeats(c) or again.worth < c.form * gain,
            f"probability that chance makes the gusts repeat so much from loop to loop, where that is worth {100 * c.form:g} % of what the "
            "answer gains",
            "permutation of the loops' phases",
        ),
    )


def probabilities(e: Evidence, answer: str, criteria: Criteria = CRITERIA) -> dict[str, float]:
    """Cause -> probability: every model that was fitted beside "none" and "something else"; prior odds even, evidence tempered; sum 1."""
    deviances = dict(e.deviances)
    if answer == "none":  # what is left beside noise is too little to be called missing
        deviances["something_else"] = max(deviances["something_else"], deviances["none"] + PRICE)
    best = min(deviances.values())
    gained = min(deviances["none"], deviances["something_else"]) - best
    lead = criteria.lead(gained) if answer != "not_deterministic" else max(criteria.lead(gained), criteria.clear_of_gusts)
    temperature = criteria.temperature * lead / criteria.decisive
    odds = {name: exp(-max(d - best, 0.0) / 2 / temperature) for name, d in deviances.items()}
    if answer in ("unexplained", "not_testable"):
        odds = {**{name: odd * criteria.unknown for name, odd in odds.items()}, "something_else": 1.0}
    total = sum(odds.values())
    found = {name: (1 - criteria.unknown) * odd / total for name, odd in odds.items()}
    return _rounded({**found, "something_else": found["something_else"] + criteria.unknown})


def _rounded(found: Mapping[str, float]) -> dict[str, float]:
    """Without what is less than a thousandth, likeliest first; "none" and "something else" stay."""
    kept = {n: p for n, p in found.items() if p >= 1e-3 or n in ("none", "something_else")}
    total = sum(kept.values())
    return {n: p / total for n, p in sorted(kept.items(), key=lambda item: -item[1])}
