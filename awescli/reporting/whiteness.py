"""What is left: is it white, and does it repeat? Spectra of the innovation before and after, and a table channel by channel.

The innovation is the error of predictions half a second ahead, one after the other; of noise alone its spectrum is flat.
"""

from collections.abc import Callable

import numpy as np

from awescli.reporting.evidence import Evidence
from awescli.reporting.marks import Body, Cell, Group, Paragraph, table
from awescli.reporting.plots import Figure, axis, grid, line, log_axis
from awescli.reporting.words import COLOURS, channel, number, percent, scale_of

PANELS = 6
"""Channels whose spectra are shown: those that differed most before."""


def whiteness(evidence: Evidence) -> Body:
    """Table and spectra; empty where the trace left neither."""
    parts = what_is_left(evidence), *spectra(evidence)
    return Group("left", "What is left", parts) if any(parts) else ""


def what_is_left(evidence: Evidence) -> Body:
    """Channel by channel: over noise on validation loops, and the share that repeats from loop to loop."""
    over = (evidence.traced.get("left") or {}).get("channels") or {}
    study = evidence.traced.get("residual") or {}
    repeats = {which: (study.get(which) or {}).get("loop_averaged_share") or {} for which in ("before", "after")}
    names = list(dict.fromkeys([*over, *repeats["after"]]))
    rows = [(channel(n), _share(over.get(n), number), *(_share(repeats[w].get(n), percent) for w in ("before", "after"))) for n in names]
    return table(("channel", "χ² over noise", "repeats before", "repeats after"), rows) if rows else ""


def _share(value: float | None, words: Callable[[float | None], str]) -> Cell:
    return Cell(words(value), value)


def spectra(evidence: Evidence) -> tuple[Body, ...]:
    """Power of the innovation against frequency, before and after."""
    r = evidence.residuals or {}
    begin = "study_after_spectrum_"
    names = [k.removeprefix(begin) for k in r if k.startswith(begin) and k.replace("after", "before") in r and np.all(r[k] > 0)]
    if not names or "study_after_frequency" not in r or len(r["study_after_frequency"]) < 4:
        return ()
    names = sorted(names, key=lambda n: -float(np.mean(r[f"study_before_spectrum_{n}"]) / np.mean(r[f"{begin}{n}"])))[:PANELS]
    note = (
        "Power of the error half a second ahead, over the whole flight. White noise is level; a slope or a peak is something that the "
        "model does not say. Shown: the channels that changed most."
    )
    return Paragraph(note, "soft"), grid([_panel(evidence, n) for n in names])


def _panel(evidence: Evidence, name: str) -> Figure:
    r = evidence.residual_series
    shown = (("before", "identified"), ("after", "with_effects")) if evidence.tracing_added else (("after", "identified"),)
    measured = evidence.predictions.get(f"measured_{name}", np.zeros(1))
    unit, factor = scale_of(name, measured)
    data = []
    for which, model in shown:
        # the mean of a segment is taken out before its spectrum: nothing is known of zero frequency
        f, power = r[f"study_{which}_frequency"][1:], r[f"study_{which}_spectrum_{name}"][1:] * factor**2
        data.append(line(f, power, which if len(shown) > 1 else "residual", COLOURS[model], width=2))
    layout = {
        "xaxis": axis("frequency [Hz]"), "yaxis": log_axis(f"[({unit or '-'})²/Hz]", *(t["y"] for t in data)), "margin": {"t": 24},
        "showlegend": len(shown) > 1,
    }  # fmt: skip
    return Figure(f"fig-spectrum-{name}", channel(name), data, layout, split="whole flight", height=230, part=True)
