"""The few lines in which a stage ends: effect with size and interval, error before -> after -> noise, where to read on."""

import textwrap
from collections.abc import Iterable, Mapping, Sequence
from math import floor, isfinite, log10
from typing import Any

ANSWER = "answer"
"""Key of a stage's summary that holds its answer: sentences that fill at most six lines of 80 columns, to which the runner
adds one where data checks are not good."""
MOST, WIDTH = 6, 80


def lines_of(stage: str, sentences: Sequence[str], width: int = WIDTH) -> list[str]:
    """The answer of a stage as it is printed: its name, then sentence after sentence, broken between words."""
    lines = []
    for i, sentence in enumerate(sentences):
        first, further = ("", "  ") if i == 0 else ("  ", "    ")
        text = f"{stage}: {sentence}" if i == 0 else sentence
        lines += textwrap.wrap(text, width, initial_indent=first, subsequent_indent=further, break_on_hyphens=False)
    return lines


def fitting(stage: str, versions: Iterable[Sequence[str]]) -> list[str]:
    """The first of several versions of an answer, from the most to the least that could be said, that is short enough; else the last."""
    chosen: Sequence[str] = ()
    for chosen in versions:
        if len(lines_of(stage, chosen)) <= MOST:
            break
    return list(chosen)


def number(value: float | None, digits: int = 3) -> str:
    """So many significant digits, as people write them: 0.0153, 41.2, 1.2e-05."""
    if value is None or not isfinite(value):
        return "-"
    if value == 0:
        return "0"
    size = floor(log10(abs(value)))
    return f"{value:.{digits - 1}e}" if size < -4 or size > 6 else f"{value:.{max(digits - 1 - size, 0)}f}"


def sized(size: Mapping[str, Any]) -> str:
    """A value with its 95 % interval: `0.201 s [0.195, 0.207]`, to the digit that the interval shows."""
    from awescli.estimation.identifiability import interval

    value, std, unit = size["value"], size["std"], size.get("unit", "-")
    places = max(0, min(8, 1 - floor(log10(2 * std)))) if std > 0 and isfinite(std) else 4
    low, high = (f"{end:.{places}f}" for end in interval(value, std))
    return f"{value:.{places}f}{'' if unit in ('', '-') else f' {unit}'} [{low}, {high}]"


def change(before: float | None, after: float, noise: float | None, horizon: float) -> str:
    """The error on loops that nothing was fitted to, before -> after -> noise."""
    way = f"{number(before)} -> {number(after)}" if before is not None else number(after)
    alone = "" if noise is None else f" (noise alone {number(noise)})"
    return f"error on unseen loops, {horizon:g} s ahead: {way}{alone}"


def named(effect: Mapping[str, Any]) -> str:
    """`actuator_lag on rudder`."""
    return f"{effect['name']} on {effect['acts_on']}" if effect.get("acts_on") else effect["name"]


def plural(count: int, word: str) -> str:
    """`1 parameter`, `3 parameters`."""
    return f"{count} {word}{'' if count == 1 else 's'}"
