"""The first screen: what was wrong with the model, how much better it is now; every claim leads to the plot that shows it."""

from awescli.reporting.evidence import Evidence
from awescli.reporting.linear import beside_linear
from awescli.reporting.marks import Body, Link, OnScreen, Paragraph, Section, Soft, Strong, Tiles, Tip, Words, bullets, in_a_row
from awescli.reporting.phase_power import phase_table
from awescli.reporting.plots import Figure, dots, hover, log_axis
from awescli.reporting.power import power_claim, power_figure
from awescli.reporting.words import COLOURS, channel, effect_words, listed, number, percent, short, times, with_std

ODDS = {
    "none": "Nothing is missing that this flight could show",
    "not_deterministic": "What is left does not repeat: it is the air, or noise",
    "not_testable": "There is no fitted model whose residual could be traced",
}
LEADS = {
    "cannot_tell": ("Several explanations do equally well on this flight; ", Link("next", "what would tell them apart"), "."),
    "none": (
        "Nothing is missing that this flight could show at its noise; ",
        Link("detectable", "what would have been seen"),
        ".",
    ),
}
"""Where effects.json points to another of its keys, the page points to a place on the page."""
UNUSED = {
    "nothing_to_learn": "found nothing to learn: physics explains validation nearly to the noise",
    "too_short": "was not used: physics leaves more than noise, but this flight is too short to prove a correction of it",
    "no_gain": "was not used: no weights lowered the error on the validation loops",
    "diverged": "was not used: with every one that was tried the simulation diverged",
}
"""Why a trained network is no model of its own: outcome (`learning.acceptance.OUTCOMES`) -> what the first screen says."""
SCORED = ("p_n", "p_e", "p_d", "u", "v", "w", "phi", "theta", "psi", "p", "q", "r", "V_a", "alpha", "beta", "tension")


def headline(evidence: Evidence) -> Section:
    """Title, verdict, claims, error of every model, and the same per channel."""
    said = Paragraph((lead(evidence), " ", worth(evidence)), "lead") if evidence.effects else ""
    power = power_figure(evidence), phase_table(evidence)
    bad = poor_data(evidence)
    body = Paragraph(bad) if bad else "", said, tiles(evidence), bullets(claims(evidence)), by_channel(evidence), *power
    return Section("summary", title(evidence), body)


def poor_data(evidence: Evidence) -> Words:
    """What of the log is not good, before anything that was made of it; empty where all is."""
    failed = sorted((c for c in evidence.quality.checks if not c.ok), key=lambda c: not c.stops)
    if not failed:
        return ""
    values = [f"{c.name} {number(c.value)} {c.unit}".rstrip() + f" (limit {number(c.threshold)})" for c in failed]
    ignored = " Nothing that is fitted beyond a stop limit means anything; the plan ignores it." if failed[0].stops else ""
    return "The data first, ", Link("tab-quality", "not good"), f": {listed(values)}.{ignored}"


def lead(evidence: Evidence) -> Words:
    """The verdict in a sentence."""
    effects, of = evidence.traced, evidence.parts.of
    rolls = " What is left ", Link("fig-roll", "rolls the kite"), " as gusts across its span do."
    if effects["verdict"] in LEADS:
        known: Words = LEADS[effects["verdict"]]
    elif effects["verdict"] == "not_deterministic":
        known = f"What is left does not repeat from {of.removesuffix('s')} to {of.removesuffix('s')}, and no effect helps on unseen {of}."
    else:
        return effects["sentence"]
    return known, rolls if effects.get("roll_gusts") else ""


def worth(evidence: Evidence) -> Words:
    """How much better the model is now, in a sentence."""
    before, after = (evidence.nrmse(m)["mean"] for m in (evidence.models[0], evidence.best))
    return f"On unseen {evidence.parts.of} the error is ", Link("fig-models", times(before, after)), " now."


def title(evidence: Evidence) -> str:
    """The verdict in one line."""
    effects = evidence.effects
    if effects is None:
        return "How well the identified model predicts" if evidence.identify else "How well the declared model predicts"
    verdict, better = effects["verdict"], effects.get("by_prediction")
    names = [effect_words(e["name"], e.get("acts_on", "")) for e in effects["effects"]]
    if verdict == "found":
        return f"The model lacked {listed(names)}"
    if verdict == "cannot_tell":
        pairs = [
            [n, *(effect_words(r["name"], r.get("acts_on", "")) for r in e["rivals"])]
            for n, e in zip(names, effects["effects"], strict=True)
        ]
        return f"Something is missing, and this flight cannot tell which: {'; '.join(' or '.join(p) for p in pairs)}"
    if verdict == "unexplained":
        where = (effects.get("unexplained") or {}).get("channel", "")
        return f"Something is left{f' in {channel(where)}' if where else ''} that no effect of the library explains"
    if better:
        names = [effect_words(e["name"], e["acts_on"]) for e in better["effects"]]
        return f"No verdict; but unseen flight is predicted better with {listed(names)}"
    return ODDS.get(verdict) or str(verdict)


def tiles(evidence: Evidence) -> Body:
    """Mean error of every model, and what noise alone would leave."""
    rows = [(percent(evidence.nrmse(m)["mean"]), evidence.label(m), COLOURS[m]) for m in evidence.compared]
    rows.append((percent(evidence.floor["mean"]), "noise alone (no model can do better)", COLOURS["floor"]))
    ahead = f"Prediction error {evidence.horizon:g} s ahead on the test {evidence.parts.of}: mean "
    what = Soft((ahead, Tip("NRMSE"), " of the 12 states, in percent of each state's range."))
    return Tiles("fig-models", tuple(rows)), Paragraph(what)


def claims(evidence: Evidence) -> list[Words]:
    """What the page claims, each sentence with a link to its plot."""
    found = [_error(evidence), _linear(evidence), power_claim(evidence)]
    if evidence.effects:
        found += [_effect(evidence, e) for e in evidence.traced["effects"]]
        found += [f"{unnamed['sentence']}."] if (unnamed := evidence.traced.get("unnamed")) else []
        found += [_predicts(evidence, e) for e in (evidence.traced.get("by_prediction") or {}).get("effects", ())]
        errors = "; ".join(e["sentence"] for e in evidence.traced.get("instruments", ()) if e["found"])
        found += [f"Beside gusts and model error the flight says of its instruments: {errors}."] if errors else []
        seen_alone = evidence.traced.get("kinematics", [])
        found += [f"Kinematics alone, without any model of forces: {seen['sentence']}." for seen in seen_alone]
        found.append(_gain(evidence))
        found += _shifts(evidence)
    elif evidence.params:
        found += _bounds(evidence)
    return [c for c in [*found, _hybrid(evidence), _flown(evidence), _controller(evidence), _flight(evidence)] if c]


def _error(evidence: Evidence) -> Words:
    first, last = evidence.models[0], evidence.best
    before, after = evidence.nrmse(first)["mean"], evidence.nrmse(last)["mean"]
    count = f"{evidence.parts.counts[2]} {evidence.parts.of}"
    ahead = f"{evidence.horizon:g} s ahead"
    if first == last:
        return f"On {count} that nothing was fitted to, the model errs by ", Link("fig-models", percent(before)), f" {ahead}."
    text: list[Words] = [
        f"On {count} that nothing was fitted to, the error {ahead} went from {percent(before)} ({evidence.label(first)}) to ",
        Link("fig-models", percent(after)), f" ({evidence.label(last)}): {times(before, after)}",
    ]  # fmt: skip
    if "identified" in evidence.models and last != "identified":
        text += ["; identification alone reaches ", Link("fig-attitude", percent(evidence.nrmse("identified")["mean"]))]
    floor = evidence.floor["mean"]
    left = f"{'little more is left than' if after < 1.15 * floor else 'there remains more than'} sensor noise ({percent(floor)})"
    return *text, f"; {left}.", OnScreen((" ", Link("fig-3d-prediction", "See the paths"), "."))


def _linear(evidence: Evidence) -> Words:
    """Whether the models beat the linear baseline."""
    said = beside_linear(evidence.scores, evidence.models, evidence.label)
    return (f"{said[0].upper()}{said[1:]}", OnScreen(("; ", Link("fig-horizon", "by how far ahead"))), ".") if said else ""


def _effect(evidence: Evidence, effect: dict) -> Words:
    name = effect_words(effect["name"], effect.get("acts_on", ""))
    sizes = ", ".join(f"{k} = {with_std(p['value'], p['std'], p['unit'])}" for k, p in effect["parameters"].items())
    rivals = [effect_words(r["name"], r.get("acts_on", "")) for r in effect["rivals"]]
    against = (f" This flight cannot separate it from {listed(rivals)}; ", Link("next", "what would"), ".") if rivals else ""
    doc = f" ({effect['doc']})" if effect.get("doc") else ""
    if not evidence.tracing_added:
        hint = Link("fig-shifts", "the parameters")
        return Strong(name), f"{doc} may be missing, {sizes} (± 2 std); ", hint, " hint at it.", against
    shown = "fig-phase" if shows_phase(evidence) else "fig-residual"
    sized = Link("tab-effects", sizes)
    return Strong(Link(shown, name)), f"{doc}: ", sized, " (± 2 std)", _share(evidence, effect), ".", against


def _predicts(evidence: Evidence, effect: dict) -> Words:
    """An effect that is no finding, but with which unseen flight is predicted better."""
    name = Strong(Link("fig-residual", effect_words(effect["name"], effect["acts_on"])))
    sizes = ", ".join(f"{k} = {with_std(p['value'], p['std'], p['unit'])}" for k, p in effect["parameters"].items())
    rivals = [f"{effect_words(r['name'], r['acts_on'])} {percent(r['after'])}" for r in effect["rivals"]]
    nearly = f" (nearly as well: {listed(rivals)})" if rivals else ""
    errs = f"{percent(effect['before'])} to {percent(effect['after'])} on the validation {evidence.parts.of}{nearly}"
    return "No finding, but a place to look first: ", name, f", {sizes} (± 2 std), takes the error from {errs}."


def _share(evidence: Evidence, effect: dict) -> Words:
    """How much of the gap the effect explains by itself, and the next best."""
    ranking = evidence.traced["ranking"]
    own = [c for c in ranking if c["name"] == effect["name"] and c.get("acts_on", "") == effect.get("acts_on", "")]
    if not own or own[0]["explained_share"] <= 0:
        return ""
    text = "; alone it explains ", Link("tab-ranking", percent(own[0]["explained_share"])), " of the gap on train"
    named = {e["name"] for e in evidence.traced["effects"]}
    others = [c for c in ranking if c["name"] not in named and c["explained_share"] > 0]
    if not others:
        return text
    best = max(others, key=lambda c: c["explained_share"])
    return text, f" (next: {effect_words(best['name'], best.get('acts_on', ''))}, {percent(best['explained_share'])})"


def _gain(evidence: Evidence) -> Words:
    """What tracing was worth, all effects together."""
    if not evidence.tracing_added:
        return ""
    error = evidence.traced["error"]
    before, after = error["before"]["mean"], error["after"]["mean"]
    them = "them" if len(evidence.added) > 1 else "it"
    repeats = OnScreen(("; ", Link("fig-phase", "what repeats in every loop, before and after"))) if shows_phase(evidence) else ""
    error_after = Link("fig-residual", percent(after))
    return f"Fitted with {them}, the declared model errs by ", error_after, f" instead of {percent(before)}", repeats, "."


def shows_phase(evidence: Evidence) -> bool:
    """Whether there are loops to average the residual over."""
    return evidence.loops.kind == "loops" and "test_first" in (evidence.residuals or {})


def _shifts(evidence: Evidence) -> list[Words]:
    shifts = evidence.traced.get("parameter_shifts", {})
    bounded = [n for n, p in ((evidence.params or {}).get("parameters") or {}).items() if p.get("at_bound")]
    if not shifts or not evidence.tracing_added:
        return _bounds(evidence)
    far = {which: sum(abs(s[f"{which}_in_prior_std"]) > 1 for s in shifts.values()) for which in ("before", "after")}
    moved = Link("fig-shifts", "moved by more than one prior standard deviation")
    added = listed([effect_words(e["name"], e.get("acts_on", "")) for e in evidence.added])
    ended = f", {len(bounded)} to a bound" if bounded else ""
    return [(f"Before adding {added}, {far['before']} of {len(shifts)} parameters ", moved, f"{ended}; after it, {far['after']}.")]


def _bounds(evidence: Evidence) -> list[Words]:
    bounded = [n for n, p in ((evidence.params or {}).get("parameters") or {}).items() if p.get("at_bound")]
    if not bounded:
        return []
    ended = f"{len(bounded)} parameters ended" if len(bounded) > 1 else "One parameter ended"
    there = Link("tab-parameters", "at a bound")
    return [(f"{ended} ", there, f" ({listed(bounded)}): a bound is wrong, or an effect is missing.")]


def _hybrid(evidence: Evidence) -> Words:
    if evidence.hybrid is not None and "hybrid" not in evidence.models:
        said = UNUSED.get(evidence.hybrid.get("outcome", ""), "was not scored")
        return "A ", Link("hybrid", "network on top of physics"), f" {said}; it stays at zero."
    if "hybrid" not in evidence.models:
        return ""
    base = evidence.models[-2] if len(evidence.models) > 1 else "hybrid"
    before, after = evidence.nrmse(base)["mean"], evidence.nrmse("hybrid")["mean"]
    reached = Link("fig-hybrid-velocities", percent(after))
    return f"The network on top of physics: {percent(before)} to ", reached, f", {times(before, after)}."


def _flown(evidence: Evidence) -> Words:
    """How long the model flies by itself, and how near to the flight."""
    f = evidence.flown
    if f is None:
        return ""
    who = {"controller": "with the fitted controller", "recorded": "on the recorded set-points"}.get(f["surfaces"], "by a built-in law")
    far = list((f.get("path_error_m") or {}).items())
    near = f", {number(far[-1][1])} m (RMS) from the measured path over {far[-1][0]} s" if far else ""
    held = Link("fig-3d-flown", f"{number(f['survived_s'])} s")
    model = evidence.label(evidence.same_as(f["model"]))
    return f"Simulated from one start {who}, the model ({model}) flies ", held, f" of {number(f['asked_s'])} s{near}."


def _controller(evidence: Evidence) -> Words:
    test = ((evidence.controller or {}).get("nrmse") or {}).get("test") or {}
    if not test:
        return ""
    noise = ((evidence.fitted_controller.get("noise_nrmse") or {}).get("test")) or {}
    pieces = [
        (f"{s} to ", Link(f"fig-law-{s}", percent(v)), f" (noise {percent(noise[s])})" if s in noise else "") for s, v in test.items()
    ]
    loop = str((evidence.fitted_controller.get("closed_loop") or {}).get("outcome", ""))
    flown = {"flies": "and flies the declared model in closed loop", "departs": "but does not hold the declared model in closed loop",
             "does_not_fly": "but does not fly the declared model in closed loop"}.get(loop, "")  # fmt: skip
    tail = f" of its range on the test {evidence.parts.of}{f', {flown}' if flown else ''}."
    return "The fitted controller repeats ", in_a_row(pieces), tail


def _flight(evidence: Evidence) -> Words:
    failed = [c.name for c in evidence.quality.checks if not c.ok]
    head = Link("fig-3d-flight", "The flight"), f": {evidence.quality.duration:.0f} s, {evidence.quality.loops}; "
    if not failed:
        return head, Link("tab-quality", "all data checks passed"), "."
    return head, Link("tab-quality", "data checks that failed"), f": {listed(failed)}."


def by_channel(evidence: Evidence) -> Figure:
    """Error per channel of every model, on a logarithmic axis, with the noise floor."""
    names = [n for n in SCORED if n in evidence.nrmse(evidence.best)]
    labels = [short(n) for n in names]
    full = [channel(n) for n in names]
    data = [
        dots(
            [100 * evidence.nrmse(m)[n] for n in names], labels, evidence.label(m), COLOURS[m], size=10,
            text=full, hovertemplate=hover("%{text}: %{x:.3g} %", aside=evidence.label(m)),
        )
        for m in evidence.compared
    ]  # fmt: skip
    data.append(
        dots(
            [100 * evidence.floor[n] for n in names], labels, "noise alone", COLOURS["floor"], size=14, symbol="line-ns",
            marker={"line": {"width": 2.5, "color": COLOURS["floor"]}},
            text=full, hovertemplate=hover("%{text}: %{x:.3g} %", aside="noise alone"),
        )
    )  # fmt: skip
    layout = {
        "xaxis": log_axis("NRMSE [% of range]", *(t["x"] for t in data)),
        "yaxis": {"autorange": "reversed", "type": "category", "dtick": 1},
        "margin": {"l": 64},
    }
    return Figure(
        "fig-models", f"Prediction error {evidence.horizon:g} s ahead, per channel", data, layout, split=f"test {evidence.parts.of}",
        note="Further left is better; the axis is logarithmic. The grey mark is sensor noise: further left is chance.",
        height=max(60 + 24 * len(names), 260),
    )  # fmt: skip
