"""The account of a trace: effects.json and the arrays behind its pictures."""

from dataclasses import replace

import numpy as np

from awescli.estimation.prediction import predict
from awescli.estimation.question import ask, without_record
from awescli.estimation.record_error import mid_times, with_record_errors
from awescli.simulation.rollout import Simulator
from awescli.tracing.race import FLOOR_ERROR, Runner
from awescli.tracing.residuals import residual_study
from awescli.tracing.verdict import Finding

SPOKEN = 0.05
"""A rest of the excess that is worth a sentence."""
SENTENCES = {
    "none": "Nothing is missing that this flight could show at its noise; `detectable` says what would have been seen.",
    "found": "An effect of the library explains what the declared model lacks, on loops it was not fitted to.",
    "cannot_tell": "Several explanations do equally well on this flight; `separate` says what would tell them apart.",
    "unexplained": "Something repeats that no effect of the library explains; the terms are empirical, not physics.",
    "not_deterministic": "The residual does not repeat from loop to loop: the air was gusty, and no effect helps on unseen loops.",
}


def account(finding: Finding, log, parts, horizon: float, before: Simulator, after: Simulator) -> dict:
    """effects.json: verdict, effects with sizes and intervals, ranking, what is unexplained, error on test loops, parameter shifts."""
    null, model = finding.library.null, finding.model
    if log.wind is not None:
        times = mid_times(finding.fitted.segments, log)
        model = replace(model, fit=with_record_errors(model.fit, finding.simulator.kite.record, log.wind.time, times))
    error_before, error_after = (predict(s, log, parts.test, horizon) for s in (before, after))
    effects = [_effect(finding, key, model, log) for key in model.keys if not finding.effect(key).empirical]
    roll = _roll_gusts(finding, log, parts)
    effects += [_suspect(key, bound, trial, log) for key, bound, trial in finding.suspects[:1]]
    return {
        "verdict": finding.verdict,
        "sentence": SENTENCES[finding.verdict] + _rest(null, model) + _rolled(roll),
        "effects": effects,
        "ranking": _ranking(finding),
        "unexplained": _unexplained(finding) if finding.verdict == "unexplained" else None,
        "error": {
            "horizon_s": horizon, "before": error_before.nrmse(), "after": error_after.nrmse(), "noise_floor": error_before.noise_floor(),
            "diverged_before": error_before.diverged, "diverged_after": error_after.diverged, "split": "test",
        },
        "chi2": {"train_before": null.fit.chi2, "train_after": model.fit.chi2,
                 "validation_before": null.choice_chi2, "validation_after": model.choice_chi2},
        "left": _left(null, model),
        "gust_m_s": finding.gust,
        "roll_gusts": roll,
        "detectable": finding.library.detectable,
        "detectable_units": {
            key: {"parameter": name.rpartition(".")[2], "unit": finding.simulator.kite.parameters[name].unit}
            for key, name in finding.library.sizes_of.items() if name in finding.simulator.kite.parameters
        },
        "not_testable": list(finding.library.rounds[0].untestable) if finding.library.rounds else [],
        "parameter_shifts": _shifts(finding, null, model),
        "dropped": [r.dropped for r in finding.library.rounds if r.dropped],
        "separate": _separate(effects),
        "null_run": _null_run(finding),
    }  # fmt: skip


def _rest(null: Runner, model: Runner) -> str:
    """The sentence that keeps an answer from promising too much."""
    left = _left(null, model)["share"]
    return f" It is not the whole of it: {left:.0%} of the excess is left on unseen loops." if model.keys and left > SPOKEN else ""


def _roll_gusts(finding: Finding, log, parts) -> dict | None:
    """What roll gusts are worth on test segments, and what the parameters are with them: without, feedback against them hides in these."""
    roll, segments = finding.roll_gusts, finding.fitted.segments
    if roll is None:
        return None
    simulator, horizon = finding.simulator, segments.steps * segments.dt
    test = ask(simulator, log, parts, horizon, finding.fitted.outputs, ("test",)).fitted
    models = {"before": roll.before, "after": roll.after}
    clean = {which: simulator.holding(without_record(simulator.kite, r.table)) for which, r in models.items()}
    return {
        "std_rad_s": roll.level, "of_specification": roll.gusts.roll, "lasts_s": roll.memory, "split": "test",
        **roll.on(simulator, test), "nrmse": {which: predict(s, log, parts.test, horizon).nrmse()["mean"] for which, s in clean.items()},
        "parameter_shifts": _shifts(finding, roll.before, roll.after),
    }  # fmt: skip


def _rolled(roll: dict | None) -> str:
    """The sentence on roll gusts, where there are any."""
    if roll is None:
        return ""
    before, after = roll["chi2"]["before"], roll["chi2"]["after"]
    return (
        f" Roll gusts of {roll['std_rad_s']:.2g} rad/s, {roll['of_specification']:.1f} times MIL-F-8785C's, take chi-square per degree of "
        f"freedom on unseen segments from {before:.3g} to {after:.3g}; `roll_gusts` says what the derivatives are with them."
    )


def _left(null: Runner, model: Runner) -> dict:
    """What the final model still leaves on unseen loops: chi-square per degree of freedom (1: noise), and the share of what was there."""
    before, after = (max(r.choice_chi2 - 1, 0.0) for r in (null, model))
    return {"chi2": model.choice_chi2, "share": float(min(after / before, 1.0)) if before > FLOOR_ERROR else 0.0}


def _null_run(finding: Finding) -> dict | None:
    """The same search on the model with what was accepted: it must find nothing more. None where nothing was accepted."""
    rounds = (finding.bank if finding.verdict == "unexplained" else finding.library).rounds
    if not any(r.accepted for r in rounds):
        return None
    last = rounds[-1]
    return {"verdict": "found" if last.accepted or last.dropped else "none", "screened": len(last.entries), "chi2": last.chi2_after}


def _sizes(key: str, model: Runner, log) -> dict:
    """parameter -> value, std, unit. A time is known to no better than where in a sample things happen, dt / (2 sqrt 3)."""
    std = dict(zip(model.names, np.sqrt(np.diag(model.fit.covariance)) * np.sqrt(max(model.fit.chi2, 1.0)), strict=True))
    sizes = {}
    for name in model.names:
        if name.startswith(f"{key}."):
            p = model.table[name]
            timing = log.dt / (2 * np.sqrt(3)) if p.unit == "s" else 0.0
            sizes[name.removeprefix(f"{key}.")] = {"value": p.value, "std": float(np.hypot(std[name], timing)), "unit": p.unit}
    return sizes


def _effect(finding: Finding, key: str, model: Runner, log) -> dict:
    effect = finding.effect(key)
    rivals = [finding.effect(k) for k in finding.rivals.get(key, ())]
    return {
        "name": effect.name, "acts_on": effect.acts_on, "doc": effect.doc,
        "rivals": [{"name": r.name, "acts_on": r.acts_on} for r in rivals], "parameters": _sizes(key, model, log),
    }  # fmt: skip


def _suspect(key: str, bound: str, trial: Runner, log) -> dict:
    name, _, target = key.partition(":")
    return {
        "name": name, "acts_on": target, "rivals": [{"name": bound, "acts_on": "parameter"}], "parameters": _sizes(key, trial, log),
        "doc": f"'{bound}' was driven to its bound; with this effect it returns",
    }  # fmt: skip


def _ranking(finding: Finding) -> list[dict]:
    """The first round's record of every candidate, those that raced first by their gain on unseen loops."""
    entries = finding.library.rounds[0].entries if finding.library.rounds else ()
    ordered = sorted(entries, key=lambda e: (e.outcome == "not raced", -e.gain, -e.score))
    return [
        {
            "name": e.key.partition(":")[0], "acts_on": e.key.partition(":")[2], "score": e.score, "p_value": e.p_value,
            "explained_share": e.explained_share, "plausible_size": e.plausible, "test_gain": e.gain, "outcome": e.outcome,
        }
        for e in ordered
    ]  # fmt: skip


def _unexplained(finding: Finding) -> dict:
    """Channel, share and a sparse expression for what repeats and has no name in the library."""
    model = finding.model
    terms = [k for k in model.keys if finding.effect(k).empirical]
    null = finding.library.null
    share = 1 - (model.choice_chi2 - 1) / max(null.choice_chi2 - 1, 1e-9)
    if not terms:
        best = max(finding.bank.rounds[0].entries, key=lambda e: e.score) if finding.bank and finding.bank.rounds else None
        channel = best.key.partition(":")[2].partition("*")[0] if best else ""
        return {"channel": channel, "share": 0.0, "expression": None, "terms": []}
    values = {k: model.table[f"{k}.k"].value for k in terms}
    pieces = [f"{v:+.4g}*{k.partition(':')[2].partition('*')[2]}" for k, v in values.items()]
    channels = [k.partition(":")[2].partition("*")[0] for k in terms]
    expression = "; ".join(f"{c} += qbar*S*({p})" for c, p in zip(channels, pieces, strict=True))
    return {"channel": channels[0], "share": float(np.clip(share, 0, 1)), "expression": expression,
            "terms": [{"term": k.partition(":")[2], "k": v} for k, v in values.items()]}  # fmt: skip


def _shifts(finding: Finding, null: Runner, model: Runner) -> dict:
    """What the parameters had swallowed: value and distance from the prior, in prior standard deviations, before and after."""
    shifts = {}
    for name in (n for n in null.names if n not in finding.simulator.kite.record):
        p, prior = null.table[name], null.prior[name]
        after = model.table[name].value if name in model.table else p.value
        shifts[name] = {
            "prior": prior.value, "before": p.value, "after": after,
            "before_in_prior_std": (p.value - prior.value) / prior.prior_std, "after_in_prior_std": (after - prior.value) / prior.prior_std,
        }  # fmt: skip
    return shifts


def _separate(effects: list[dict]) -> list[str]:
    """For every pair of rivals: what would tell them apart."""
    return [
        f"{e['name']} and {r['name']}: fly so that what they act on differs: {_what(e)} against {_what(r)}."
        for e in effects
        for r in e["rivals"]
    ]


def _what(entry: dict) -> str:
    advice = {
        "parameter": "move the surface whose derivative this is",
        "airflow": "other heights and directions of flight, or a wind profile measured at height",
        "coefficients": "other airspeeds and angles of attack or sideslip at the same tension",
        "line": "another tether length and low tension",
        "load": "another tether length",
        "body": "another loading of the kite",
        "report": "a second sensor of the same quantity",
    }
    return advice.get(entry["acts_on"], "steps of that surface, sharp enough to see phase and amplitude")


def residual_arrays(log, parts, loops, before: Simulator, after: Simulator, horizon: float) -> tuple[dict, dict[str, np.ndarray]]:
    """(summaries before and after, arrays of residuals.npz).

    Arrays: <part>_<which>_<channel> (K, N+1) prediction errors, <part>_first (K,); study_<which>_<series> of `residuals.residual_study`.
    """
    arrays: dict[str, np.ndarray] = {}
    summary = {}
    for which, simulator in (("before", before), ("after", after)):
        for part in ("validation", "test"):
            prediction = predict(simulator, log, getattr(parts, part), horizon)
            arrays[f"{part}_first"], arrays["time"] = prediction.first, prediction.time
            for name in prediction.simulated:
                arrays[f"{part}_{which}_{name}"] = prediction.errors(name)
        summary[which], series = residual_study(simulator, log, parts, loops, horizon)
        arrays |= {f"study_{which}_{name}": a for name, a in series.items()}
    return summary, arrays
