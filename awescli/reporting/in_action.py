"""The effect in action: what it received beside what it made of it, and the channel that gains most, without the effect and with it."""

import numpy as np

from awescli.notation.angles import wrap
from awescli.notation.quantities import ANGLES
from awescli.reporting.evidence import Action, Evidence
from awescli.reporting.marks import Body, Group, Paragraph
from awescli.reporting.plots import Figure, axis, grid, line, stride, with_gaps
from awescli.reporting.words import COLOURS, channel, effect_words, scale_of, unit_of

SHOWN = 3
"""Predictions shown, one after the other: enough to see a loop, few enough to see a lag."""


CLEAR = 2.0
"""Times the noise that the error of a channel must be without the effect, for the difference to be seen in a picture."""


def in_action(evidence: Evidence) -> Body:
    """One row of pictures for every effect that was added; empty where none was, or where there is nothing to draw."""
    if not evidence.tracing_added or not evidence.actions:
        return ""
    pictures = [made_of_it(action, i) for i, action in enumerate(evidence.actions, 1)]
    gained = gaining(evidence)
    note = (
        "Three predictions of unseen flight, one after the other. First: what the effect receives, and what it makes of it in the model "
        "that was fitted with it. Last: the channel that gains most, measured, predicted without the effect and with it."
    )
    return Group("in-action", "The effect in action", (Paragraph(note, "soft"), grid([*pictures, *gained])))


def made_of_it(action: Action, number: int = 1) -> Figure:
    """A quantity without the effect and with it, at the same simulated states."""
    if action.unit == "N":
        unit, factor = scale_of("tension", np.stack([action.without, action.with_effect]))
    else:
        unit, factor = unit_of(action.unit)
    step = stride(action.without[:SHOWN].size)
    time = with_gaps(action.time[:SHOWN], step)
    data = [
        line(time, with_gaps(action.without[:SHOWN] * factor, step), action.received, COLOURS["measured"], width=1.6),
        line(time, with_gaps(action.with_effect[:SHOWN] * factor, step), action.made, COLOURS["with_effects"], width=2.2),
    ]
    layout = {"xaxis": axis("time [s]"), "yaxis": axis(f"{action.quantity} [{unit or '-'}]"), "margin": {"t": 40}}
    title = effect_words(*action.effect.partition(":")[::2])
    return Figure(f"fig-action-{number}", title[:1].upper() + title[1:], data, layout, split="test, simulated", height=300, part=True)


def gaining(evidence: Evidence) -> list[Figure]:
    """The channel whose error falls most, of those where it can be seen: measured, and as both models predict it."""
    r, error, p = evidence.residuals or {}, evidence.traced["error"], evidence.predictions
    names = [n for n in error["after"] if f"test_after_{n}" in r and f"test_before_{n}" in r and f"measured_{n}" in p]
    if "before" not in error or not names or not np.array_equal(r["test_first"], p["first"]):
        return []
    clear = [n for n in names if error["before"][n] > CLEAR * error["noise_floor"][n]]
    name = max(clear or names, key=lambda n: error["before"][n] - error["after"][n])
    measured = p[f"measured_{name}"][:SHOWN]
    if r[f"test_after_{name}"][:SHOWN].shape != measured.shape:
        return []
    unit, factor = scale_of(name, measured)
    measured = np.unwrap(measured, axis=1) if name in ANGLES else measured
    step = stride(measured.size)
    time = with_gaps(evidence.log.time[0] + r["test_first"][:SHOWN, None] * evidence.log.dt + r["time"][None], step)
    data = [line(time, with_gaps(measured * factor, step), "measured", COLOURS["measured"], width=1.6)]
    for which, label, model in (("before", "without the effect", "identified"), ("after", "with it", "with_effects")):
        off = r[f"test_{which}_{name}"][:SHOWN]
        predicted = measured - (wrap(off) if name in ANGLES else off)
        dash = "dot" if which == "before" else "solid"
        data.append(line(time, with_gaps(predicted * factor, step), label, COLOURS[model], width=1.8, dash=dash))
    layout = {"xaxis": axis("time [s]"), "yaxis": axis(f"{channel(name)} [{unit or '-'}]"), "margin": {"t": 40}}
    title = f"{channel(name)[:1].upper()}{channel(name)[1:]}, without it and with it"
    return [Figure("fig-action-channel", title, data, layout, split=f"test {evidence.parts.of}", height=300, part=True)]
