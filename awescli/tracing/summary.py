"""The summary of a trace: effects.json and the arrays behind its pictures."""

from collections.abc import Mapping
from math import log as ln

import numpy as np

from awescli.estimation.prediction import Prediction
from awescli.flightlog.log import FlightLog
from awescli.flightlog.loops import Loops
from awescli.flightlog.split import Split
from awescli.notation.quantities import UNITS
from awescli.physics.disturbances import DISTURBANCE_UNITS
from awescli.physics.effects.base import Effect
from awescli.physics.kite import make_effect
from awescli.simulation.rollout import Simulator
from awescli.tracing.evidence import AbsorbedEffect
from awescli.tracing.fitted_model import FittedModel
from awescli.tracing.instruments import InstrumentError
from awescli.tracing.investigate import Finding
from awescli.tracing.residuals import residual_study
from awescli.tracing.rest import Rest
from awescli.tracing.separate import separate
from awescli.tracing.tried import Tried
from awescli.tracing.when import InFlight

MOST = 1e15
"""Numbers beyond it are cut to it."""
SLIP = 0.08
"""Relative distance from the size that a mistake of a unit leaves up to which it is asked for."""
SENTENCES = {
    "none": "Nothing is missing that this flight could show at its noise; `detectable` says what would have been seen.",
    "found": "An effect of the library explains what the declared model lacks, on loops it was not fitted to; what it leaves is noise.",
    "cannot_tell": "Several explanations do equally well on this flight; `separate` says what would tell them apart.",
    "unexplained": "Something is left that no effect of the library explains; the terms are empirical, not physics.",
    "not_deterministic": "What is left does not repeat from loop to loop: it is the air, or noise, and no effect takes it away.",
    "not_testable": "There is no fitted model in whose residual anything could be sought.",
}


def summary(finding: Finding, log: FlightLog, horizon: float, before: Prediction, after: Prediction) -> dict:
    """effects.json: verdict and its criteria, effects with sizes, intervals and what they cannot be distinguished from, parameters outside
    their bounds, ranking, what is unexplained, error on test loops, parameter shifts. before, after: of the test loops."""
    model, evidence = finding.model, finding.evidence
    named = evidence.model if finding.verdict in ("found", "cannot_tell") else None
    effects = [_effect(finding, key, named, log) for key in named.keys] if named else []
    if finding.verdict == "cannot_tell":
        effects += [_absorbed(finding, s, log) for s in evidence.absorbed[:1]]
    testable, better = finding.verdict != "not_testable", _by_prediction(finding, log)
    error = {
        "horizon_s": horizon, **({"before": before.nrmse()} if testable or better else {}), "after": after.nrmse(),
        "noise_floor": before.noise_floor(), "diverged_before": before.diverged, "diverged_after": after.diverged, "split": "test",
    }  # fmt: skip
    because = finding.reason if testable or not finding.reason else f"Why: {finding.reason}."
    outside = _outside(finding)
    said = (
        SENTENCES[finding.verdict], because, *(o["sentence"] for o in outside.values()), _slip(finding), _began(finding),
        better["sentence"] if better else "",
    )  # fmt: skip
    return {
        "verdict": finding.verdict,
        "sentence": " ".join(s for s in said if s),
        "reason": finding.reason or None,
        "effects": effects,
        "unnamed": _unnamed(finding) if named else None,
        "by_prediction": better,
        "instruments": [_instrument(finding, e) for e in finding.instruments],
        "outside_bounds": outside,
        "ranking": _ranking(finding),
        "unexplained": _unexplained(finding) if finding.verdict == "unexplained" else None,
        "error": error,
        "criteria": [
            {"name": c.name, "value": bounded(c.value), "threshold": c.threshold, "pass": c.passed, "says": c.says, "source": c.source}
            for c in finding.table
        ],
        "probability": dict(finding.probability),
        "chi2": _chi2(finding),
        "left": left(evidence.rest, evidence.bare.chi2) if testable else None,
        "flights": [_in_flight(finding, f) for f in finding.flights],
        "gust_m_s": max(evidence.gusts.values(), default=0.0),
        "processes": _processes(model), "noise_factors": dict(model.problems[0].factors),
        "outliers": dict(finding.outliers),
        "roll_gusts": _roll_gusts(finding),
        "detectable": {key: size for key, (_, size) in evidence.search.detectable.items()},
        "detectable_units": {key: _unit(finding, key, name) for key, (name, _) in evidence.search.detectable.items()},
        "not_testable": list(evidence.search.rounds[0].untestable) if evidence.search.rounds else [],
        "parameter_shifts": _shifts(finding.by_prediction.base if finding.by_prediction else finding.first, model),
        "separate": separate(effects),
    }  # fmt: skip


def _chi2(finding: Finding) -> dict[str, float]:
    """Chi-square per degree of freedom of the declared model and of what is handed on, without the help of model error; nothing where
    neither fits."""
    if finding.by_prediction:
        before, after = finding.by_prediction.base, finding.model
    elif finding.verdict == "not_testable":
        return {}
    else:
        before = (finding.within or finding).evidence.bare
        after = finding.evidence.bare if finding.model is finding.null else finding.model
    return {
        "train_before": before.fit.chi2, "train_after": after.fit.chi2, "validation_before": before.chi2, "validation_after": after.chi2,
    }  # fmt: skip


def left(rest: Rest, before: float) -> dict:
    """What the final model still leaves on validation loops: chi-square per degree of freedom (1: noise), the share of what was there, and
    the largest of a channel. before: chi-square of the declared model."""
    # nothing but noise before: there is nothing of which something could be left
    share = float(min(max(rest.chi2 - 1, 0.0) / (before - 1), 1.0)) if before > rest.floor() else 0.0
    again = rest.repetition
    return {
        "chi2": rest.chi2, "share": share, "channels": rest.channels, "worth": rest.worth, "levels": rest.levels,
        "repeats": None if again is None else {"share": again.share, "p": again.p, "loops": again.loops},
    }  # fmt: skip


def _outside(finding: Finding) -> dict[str, dict]:
    """Parameters whose declared bounds had to go for the finding: name -> value, std, unit, bounds, and all this in a sentence."""
    fit, found = finding.model.fit, {}
    std = dict(zip(fit.names, np.sqrt(np.diag(fit.covariance)), strict=True))
    for p in finding.outside:
        value, unit = fit.parameters[p.name].value, "" if p.unit in ("", "-") else f" {p.unit}"
        lower, upper = (None if np.isinf(end) else end for end in (p.lower, p.upper))
        declared = (
            f"at least {p.lower:.4g}" if upper is None else f"at most {p.upper:.4g}" if lower is None else f"{lower:.4g} to {upper:.4g}"
        )
        said = f"{value:.4g}{unit} (std {std[p.name]:.2g})"
        found[p.name] = {
            "value": value, "std": float(std[p.name]), "unit": p.unit, "lower": lower, "upper": upper,
            "sentence": f"The kite file's bounds of {p.name}, {declared}, do not hold what the flight says: {said}.",
        }  # fmt: skip
    return found


def _in_flight(finding: Finding, flight: InFlight) -> dict:
    """What the answer is worth in one flight: deviance on every segment, since when it acts, its size from this flight."""
    rows = {p.name: p for key in flight.keys for p in make_effect(key, finding.frame.declared).rows()}
    return {
        "effects": list(flight.keys), "flight": flight.label or finding.frame.flights[0].log.name, "gain": float(flight.gains.sum()),
        "since_s": None if flight.onset is None else list(flight.onset),
        "segments": {"begins_s": flight.times.tolist(), "gain": flight.gains.tolist()},
        "parameters": {n: {"value": v, "std": std, "unit": rows[n].unit} for n, (v, std) in flight.sizes.items()},
    }  # fmt: skip


def _unit(finding: Finding, key: str, name: str) -> dict:
    row = next(p for p in make_effect(key, finding.frame.declared).rows() if p.name == name)
    return {"parameter": name.rpartition(".")[2], "unit": row.unit}


def _processes(model: FittedModel) -> dict:
    return {
        g.name: {"level": g.level, "unit": UNITS.get(g.axes[0]) or DISTURBANCE_UNITS[g.axes[0]], "memory_s": g.memory, "process": p.name}
        for p in model.problems[0].processes
        for g in p.groups
        if g.level > 0
    }


def _roll_gusts(finding: Finding) -> dict | None:
    """What gusts that roll the kite are worth on validation loops, and what the parameters are with them: without, feedback hides in
    these."""
    roll = finding.roll_gusts
    if roll is None:
        return None
    before, after = roll.without, roll.model
    channels = {n: {"before": roll.channels_before[n], "after": roll.channels_after[n]} for n in roll.channels_before}
    return {
        "std_rad_s": roll.level, "lasts_s": roll.memory, "split": "validation", "chi2": {"before": before.chi2, "after": after.chi2},
        "worth": roll.worth, "channels": channels, "parameter_shifts": _shifts(before, after),
    }  # fmt: skip


def sizes(key: str, model: FittedModel, log: FlightLog) -> dict:
    """parameter -> value, std, unit. A time is known to no better than where in a sample things happen, dt / (2 sqrt 3)."""
    std = dict(zip(model.fit.names, np.sqrt(np.diag(model.fit.covariance)), strict=True))
    found = {}
    for name in (n for n in model.strengths if n.startswith(f"{key}.")):
        p = model.table[name]
        timing = log.dt / (2 * np.sqrt(3)) if p.unit == "s" else 0.0
        found[name.removeprefix(f"{key}.")] = {"value": p.value, "std": float(np.hypot(std[name], timing)), "unit": p.unit}
    return found


def _named(effect: Effect) -> dict:
    return {"name": effect.name, "acts_on": effect.acts_on}


def _effect(finding: Finding, key: str, model: FittedModel, log: FlightLog) -> dict:
    effect = make_effect(key, finding.frame.declared)
    rivals = finding.evidence.rivals.get(key, ())
    others = [(make_effect(r.key, finding.frame.declared), r) for r in rivals]
    mine = sizes(key, model, log)
    return {
        **_named(effect), "doc": effect.doc, "rivals": [_named(o) for o, _ in others], "parameters": mine,
        "class": [{**_named(effect), "parameters": mine, "lag": 0.0}]
        + [{**_named(o), "parameters": sizes(r.key, r.model, log), "lag": r.lag} for o, r in others],
    }  # fmt: skip


def _absorbed(finding: Finding, absorbed: AbsorbedEffect, log: FlightLog) -> dict:
    effect = make_effect(absorbed.key, finding.frame.declared)
    mine = sizes(absorbed.key, absorbed.model, log)
    bound = finding.null.table[absorbed.parameter]
    return {
        **_named(effect), "rivals": [{"name": bound.name, "acts_on": "parameter"}], "parameters": mine,
        "doc": f"'{bound.name}' was driven to its bound; with this effect it returns",
        "class": [
            {**_named(effect), "parameters": mine, "lag": 0.0},
            {"name": bound.name, "acts_on": "parameter", "parameters": {"value": {"value": bound.value, "unit": bound.unit}}, "lag":
            absorbed.gain},
        ],
    }  # fmt: skip


def _by_prediction(finding: Finding, log: FlightLog) -> dict | None:
    """With what a model without a verdict predicts unseen loops better."""
    found = finding.by_prediction
    if found is None:
        return None

    def named(key: str) -> dict:
        return _named(make_effect(key, finding.frame.declared))

    better = [
        {
            **named(b.key), "parameters": sizes(b.key, found.model, log), "before": b.before, "after": b.after,
            "rivals": [{**named(key), "after": after} for key, after in sorted(b.rivals.items(), key=lambda r: r[1])],
        }
        for b in found.better
    ]  # fmt: skip
    sentence = "No verdict, but a place to look first: unseen flight is predicted better with " + " and ".join(
        " or ".join((b.key, *sorted(b.rivals, key=lambda key: b.rivals[key]))) for b in found.better
    )
    return {"effects": better, "chi2": {"before": found.base.chi2, "after": found.model.chi2}, "sentence": f"{sentence}."}


def _instrument(finding: Finding, error: InstrumentError) -> dict:
    """An error of a sensor or an actuator, beside gusts and model error."""
    effect = make_effect(error.key, finding.frame.declared)
    rivals = [make_effect(key, finding.frame.declared) for key in error.rivals]
    size = f"{error.parameter} = {error.size:.3g} +- {1.96 * error.std:.2g}{f' {error.unit}' if error.unit != '-' else ''} (95 %)"
    return {
        **_named(effect), "parameter": error.parameter, "size": error.size, "std": error.std, "unit": error.unit, "found": error.found,
        "rivals": [_named(r) for r in rivals], "sentence": f"{' or '.join((error.key, *error.rivals))}, {size}",
    }  # fmt: skip


def bounded(value: float | str) -> float | str:
    """A value as a file may hold it: of a model that is nowhere near the flight some have no bounds."""
    return value if isinstance(value, str) else min(max(value, -MOST), MOST)


def _ranking(finding: Finding) -> list[dict]:
    """The first round's record of every candidate, those that were fitted first by their gain."""
    rounds, null = finding.evidence.search.rounds, finding.null
    if not rounds:
        return []
    excess = finding.evidence.bare.deviance - finding.evidence.model.deviance
    ordered = sorted(rounds[0].tried, key=lambda t: (t.model is None, -t.gain, -t.score.drop))
    return [
        {
            **_named(make_effect(t.key, finding.frame.declared)), "score": t.score.drop, "p_value": t.score.p_value,
            "explained_share": _share(finding, t, excess), "plausible_size": t.plausible, "test_gain": _gain(null, t),
            "outcome": t.outcome, "significant": t.significant, "deviance_gain": t.gain,
        }
        for t in ordered
    ]  # fmt: skip


def _share(finding: Finding, t: Tried, excess: float) -> float:
    """Of what the answer explains of the declared model's deviance, without model error on either side; 0 where that is nothing."""
    if t.model is None or excess < 1.0:
        return 0.0
    return float(np.clip((finding.evidence.bare.deviance - (finding.null.deviance - t.gain)) / excess, -1.0, 1.0))


def _gain(null: FittedModel, t: Tried) -> float:
    """Share of the cost of the validation loops that a candidate takes away."""
    cost = sum(float(f.information.cost.sum()) for f in null.judged)
    return float(t.unseen / max(cost, 1.0))


def _unexplained(finding: Finding) -> dict:
    """Channel, share and a sparse expression for what has no name in the library."""
    empirical = finding.evidence.empirical
    if empirical is None or not empirical.final.keys:
        levels = finding.evidence.rest.levels
        channel = max(levels, key=lambda axis: levels[axis], default=finding.evidence.rest.largest)
        return {"channel": _short(channel), "share": 0.0, "expression": None, "terms": []}
    terms, excess = empirical.final.keys, max(finding.evidence.bare.chi2 - 1, 1e-9)
    values = {k: empirical.final.table[f"{k}.k"].value for k in terms}
    pieces = [f"{v:+.4g}*{k.partition(':')[2].partition('*')[2]}" for k, v in values.items()]
    channels = [k.partition(":")[2].partition("*")[0] for k in terms]
    expression = "; ".join(f"{c} += qbar*S*({p})" for c, p in zip(channels, pieces, strict=True))
    share = float(np.clip(1 - (empirical.final.chi2 - 1) / excess, 0, 1))
    return {
        "channel": channels[0],
        "share": share,
        "expression": expression,
        "terms": [{"term": k.partition(":")[2], "k": v} for k, v in values.items()],
    }


def _short(axis: str) -> str:
    """force_x -> f_x"""
    return axis.replace("force_", "f_").replace("moment_", "m_")


def _shifts(null: FittedModel, model: FittedModel) -> dict:
    """What the parameters had swallowed: value and distance from the prior, in prior standard deviations, before and after."""
    shifts, prior, record = {}, null.problems[0].prior, null.problems[0].kite.record
    for name in (n for n in null.problems[0].names if n not in record):
        p, weighed = null.table[name], prior[name]
        after = model.table[name].value if name in model.table else p.value
        away, then = ((v - weighed.value) / weighed.prior_std for v in (p.value, after))
        shifts[name] = {"prior": weighed.value, "before": p.value, "after": after, "before_in_prior_std": away, "after_in_prior_std": then}
    return shifts


def _slip(finding: Finding) -> str:
    """What an effect that leads by a size which nothing has looks like: mostly a mistake of a unit."""
    for t, model in finding.implausible:
        effect = make_effect(t.key, finding.frame.declared)
        for name in t.score.moving:
            size, row = model.table[name].value, model.table[name]
            short = name.rpartition(".")[2]
            said = f"{effect.doc.capitalize()} ({effect.key}, {short} = {size:.3g} {row.unit}) would explain most of it: no plausible size"
            known = effect.slips.get(short, {})
            near = min(known, key=lambda s: abs(ln(abs(size) / s)), default=None) if size > 0 else None
            if near is not None and abs(ln(size / near)) < SLIP:
                return f"{said}; {known[near]}"
            return f"{said}."
    return ""


def _unnamed(finding: Finding) -> dict | None:
    """A further effect that would gain, too, and may be no more than what the form of the answer leaves: told, and not named."""
    found = finding.evidence.search.unnamed
    if found is None or found.key in finding.evidence.model.keys:
        return None
    effect, (first, most) = make_effect(found.key, finding.frame.declared), max(finding.evidence.search.gains.items(), key=lambda x: x[1])
    share = f"{100 * found.gain / most:.2g} % of what {first} gains"
    maybe = f"it may be there, or make up for the form of {first}, and is not named"
    return {**_named(effect), "gain": found.gain, "sentence": f"Beside it {found.key} ({effect.doc}) would gain {share}; {maybe}"}


def _began(finding: Finding) -> str:
    """That an effect set in during a flight; where nothing was found, when what came nearest would have."""
    name = finding.frame.flights[0].log.name
    begun = [(" and ".join(f.keys), f.label or name, *f.onset) for f in finding.flights if f.onset is not None]
    if finding.verdict in ("found", "cannot_tell"):
        sentence = "{} began between {:.0f} s and {:.0f} s of {}."
    else:
        sentence = "What came nearest, {}, gains only from between {:.0f} s and {:.0f} s of {} on: trace what was flown later by itself."
    return " ".join(sentence.format(what, a, b, where) for what, where, a, b in begun)


def residual_arrays(
    log: FlightLog, parts: Split, loops: Loops, models: Mapping[str, Simulator], predictions: Mapping[str, Mapping[str, Prediction]],
    horizon: float,
) -> tuple[dict, dict[str, np.ndarray]]:  # fmt: skip
    """(summaries before and after, arrays of residuals.npz). models, predictions: "before" and "after" -> simulator, part -> prediction.

    Arrays: <part>_<which>_<channel> (K, N+1) prediction errors, <part>_first (K,); study_<which>_<series> of `residuals.residual_study`.
    """
    arrays: dict[str, np.ndarray] = {}
    summary = {}
    for which, simulator in models.items():
        for part in ("validation", "test"):
            prediction = predictions[which][part]
            arrays[f"{part}_first"], arrays["time"] = prediction.first, prediction.time
            for name in prediction.simulated:
                arrays[f"{part}_{which}_{name}"] = prediction.errors(name)
        summary[which], series = residual_study(simulator, log, parts, loops, predictions[which]["test"], horizon)
        arrays |= {f"study_{which}_{name}": a for name, a in series.items()}
    return summary, arrays
