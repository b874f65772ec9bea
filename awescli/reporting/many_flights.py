"""The page over many flights of one plan: the verdict of each, sizes with intervals side by side, errors, power; links to their reports."""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from awescli.reporting.html import whole_page
from awescli.reporting.marks import Body, Cell, Chip, Code, File, Group, Paragraph, Section, Soft, Tiles, Tip, Words, table
from awescli.reporting.plots import Figure, axis, dots, hover
from awescli.reporting.words import COLOURS, effect_words, listed, number, percent, unit_of

Row = Mapping[str, Any]
"""One flight, as `flights.json` has it."""

TONES = {"found": "good", "none": "good"}
"""Verdict -> tone of its label; every other one asks for a look."""
VERDICT_COLOURS = {
    "found": "@green", "none": "@blue", "cannot_tell": "@ochre", "unexplained": "@orange", "not_deterministic": "@purple",
    "not_testable": "@grey",
}  # fmt: skip
ENDS = {
    "refused": "bad input", "no answer": "a numerical failure", "fault": "a fault of awes", "interrupted": "interrupted",
}  # fmt: skip
"""How a flight's run ended, where it has no verdict by that."""
LEAST = 90
"""Height of a figure without flights [px]; each flight adds LINE."""
LINE = 22


@dataclass(frozen=True)
class Flights:
    """rows: one a flight, in the order of the plan; reports: flight -> its report, relative to the page; plan, kite: what was run, by name;
    version: of awes."""

    rows: Sequence[Row]
    reports: Mapping[str, str]
    plan: str
    kite: str
    version: str


def flights_page(flights: Flights) -> str:
    """The whole page."""
    sections = [_summary(flights), _verdicts(flights), _sizes(flights), _errors(flights), _power(flights)]
    kept = [s for s in sections if s.body]
    count = f"{len(flights.rows)} flight{'' if len(flights.rows) == 1 else 's'}"
    names = {"summary": "Summary", "verdicts": "Verdicts", "sizes": "Sizes", "errors": "Errors", "power": "Power"}
    kicker = f"{count} of {flights.kite} · plan {flights.plan}"
    return whole_page(kept, names, subject=count, kicker=kicker, version=flights.version)


def title(rows: Sequence[Row]) -> str:
    """What the flights say together, in one line."""
    answered = [row for row in rows if row["verdict"]]
    if not answered:
        return "No flight has a verdict"
    found = Counter(effect_words(e["name"], e["acts_on"]) for row in answered if row["verdict"] == "found" for e in row["effects"])
    if found:
        said = [f"{words} in {count}" for words, count in found.most_common()]
        return f"Found: {listed(said)} of {len(rows)} flights"
    if all(row["verdict"] == "none" for row in answered):
        return f"Nothing is missing that {len(answered)} of {len(rows)} flights could show"
    return f"No effect is found in {len(rows)} flights"


def _summary(flights: Flights) -> Section:
    verdicts = Counter(row["verdict"] for row in flights.rows if row["verdict"])
    tiles = [(str(n), verdict.replace("_", " "), VERDICT_COLOURS.get(verdict, "@grey")) for verdict, n in verdicts.most_common()]
    ended = Counter(row["status"] for row in flights.rows if not row["verdict"])
    tiles += [(str(n), ENDS.get(status, "without a trace"), "@red" if status in ENDS else "@grey") for status, n in ended.most_common()]
    body: Body = (
        Paragraph("Each flight was run by itself: nothing of one is known to another. What counts is the verdict of each.", "lead"),
        Tiles("verdicts", tuple(tiles)),
    )
    return Section("summary", title(flights.rows), body)


def _verdicts(flights: Flights) -> Section:
    rows = []
    for row in flights.rows:
        flight, error, power = row["flight"], row["error"] or {}, row["power"] or {}
        link: Words = File(flights.reports[flight], flight) if flight in flights.reports else flight
        verdict = row["verdict"]
        state = Chip(verdict.replace("_", " "), TONES.get(verdict, "bad")) if verdict else Soft("–")
        rows.append((
            Cell(link, flight), Cell(state, verdict or ""), Cell(_said(row), None, "reason"),
            *(Cell(percent(error.get(key)), error.get(key)) for key in ("before", "after", "noise")),
            Cell(_signed(power.get("error_share")), power.get("error_share")), Cell(row["status"], row["status"]),
        ))  # fmt: skip
    head = ("flight", "verdict", "effects, or why there are none", "error before", "after", "noise alone", "power error", "run")
    missing = any(row["verdict"] and row["flight"] not in flights.reports for row in flights.rows)
    note = (
        Paragraph(("A page of its own for each flight: ", Code("evaluate: {report: true}"), " in the plan."), "absent") if missing else ""
    )
    horizons = sorted({row["error"]["horizon_s"] for row in flights.rows if row["error"]})
    ahead = f"{listed([f'{h:g}' for h in horizons])} s ahead " if horizons else ""
    text = Paragraph(("Errors: mean ", Tip("NRMSE"), f" of the 12 states {ahead}on the test loops of each flight."))
    return Section("verdicts", "Flight by flight", (text, table(head, rows), note))


def _said(row: Row) -> Words:
    """The effects of a flight with their sizes, or the first line of why there are none."""
    said = []
    for e in row["effects"]:
        sizes = [f"{name} {_between(size)}" for name, size in e["parameters"].items()]
        rivals = [f"or {' or '.join(e['rivals'])}"] if e["rivals"] else []
        said.append(", ".join([effect_words(e["name"], e["acts_on"]), *sizes, *rivals]))
    return "; ".join(said) or row["reason"].partition("\n")[0] or "–"


def _between(size: Mapping[str, Any]) -> str:
    """0.202 s (0.19 to 0.214)."""
    unit, factor = unit_of(size["unit"])
    interval = "" if size["low"] is None else f" ({number(size['low'] * factor)} to {number(size['high'] * factor)})"
    return f"{number(size['value'] * factor)}{f' {unit}' if unit else ''}{interval}"


def _signed(share: float | None) -> str:
    return "–" if share is None else f"{'+' if share >= 0 else ''}{percent(share)}"


def _sizes(flights: Flights) -> Section:
    """A figure for every parameter of every effect that some flight named."""
    named: dict[tuple[str, str, str, str], list[tuple[Row, Mapping[str, Any]]]] = {}
    for row in flights.rows:
        for e in row["effects"]:
            for parameter, size in e["parameters"].items():
                named.setdefault((e["name"], e["acts_on"], parameter, size["unit"]), []).append((row, size))
    figures = tuple(_size(i, *key, found, len(flights.rows)) for i, (key, found) in enumerate(named.items()))
    text = Paragraph(
        "Each effect that a flight named, with its 95 % interval: flights of one kite should agree on what belongs to the kite."
    )
    return Section("sizes", "Sizes of the effects", (text, Group("fig-sizes", "", figures)) if figures else ())


def _size(i: int, effect: str, acts_on: str, parameter: str, unit: str, found: list[tuple[Row, Mapping[str, Any]]], count: int) -> Figure:
    shown, factor = unit_of(unit)
    data = []
    for verdict, colour in VERDICT_COLOURS.items():
        here = [(row["flight"], size) for row, size in found if row["verdict"] == verdict]
        if here:
            value = [size["value"] * factor for _, size in here]
            high, low = ([_arm(size, end) * factor for _, size in here] for end in ("high", "low"))
            data.append(
                dots(
                    value, [flight for flight, _ in here], verdict.replace("_", " "), colour, size=9,
                    error_x=dict(array=high, arrayminus=low, symmetric=False, thickness=1.6, width=4, color=colour),
                    hovertemplate=hover("%{y}", f"%{{x:.4g}} {shown}", aside=verdict.replace("_", " ")),
                )
            )  # fmt: skip
    label = f"{parameter} [{shown}]" if shown else parameter
    names = [row["flight"] for row, _ in found]
    return Figure(
        f"fig-size-{i}", f"{effect_words(effect, acts_on)}: {parameter}", data,
        {"xaxis": axis(label), "yaxis": _flight_axis(names), "showlegend": True}, split=f"{len(names)} of {count} flights",
        note="Dots: size; lines: 95 % interval.", height=LEAST + 30 + LINE * len(names),
    )  # fmt: skip


def _arm(size: Mapping[str, Any], end: str) -> float:
    """How far the interval reaches beyond the size; 0 where there is none."""
    return abs(size[end] - size["value"]) if size[end] is not None else 0.0


def _flight_axis(names: Sequence[str]) -> dict[str, Any]:
    """Flights from top to bottom, each with its name whatever it looks like."""
    return {"autorange": "reversed", "type": "category", "categoryorder": "array", "categoryarray": list(names), "dtick": 1}


def _errors(flights: Flights) -> Section:
    rows = [row for row in flights.rows if row["error"]]
    if not rows:
        return Section("errors", "", ())
    names, data = [row["flight"] for row in rows], []
    for key, said, colour in (
        ("before", "before", COLOURS["initial"]), ("after", "after", COLOURS["with_effects"]), ("noise", "noise alone", COLOURS["floor"]),
    ):  # fmt: skip
        values = [None if row["error"][key] is None else 100 * row["error"][key] for row in rows]
        template = hover("%{y}", "%{x:.3g} %", aside=said)
        data.append(
            dots(values, names, said, colour, size=9, symbol="line-ns-open" if key == "noise" else "circle", hovertemplate=template)
        )
    figure = Figure(
        "fig-errors", "Error on unseen loops", data,
        {"xaxis": axis("mean NRMSE of the 12 states [%]", rangemode="tozero"), "yaxis": _flight_axis(names)}, split="test",
        note="Before: the declared model, fitted; after: with what the trace added, else the last model of the plan.",
        height=LEAST + 30 + LINE * len(names),
    )  # fmt: skip
    return Section("errors", "Errors", figure)


def _power(flights: Flights) -> Section:
    rows = [row for row in flights.rows if (row["power"] or {}).get("error_share") is not None]
    if not rows:
        return Section("power", "", ())
    shares = [row["power"]["error_share"] for row in rows]
    between = [row["power"]["interval_share"] or (share, share) for row, share in zip(rows, shares, strict=True)]
    high, low = ([100 * abs(ends[k] - share) for ends, share in zip(between, shares, strict=True)] for k in (1, 0))
    arms = dict(array=high, arrayminus=low, symmetric=False, thickness=1.6, width=4)
    names = [row["flight"] for row in rows]
    data = [
        dots([100 * s for s in shares], names, "power", "@blue", error_x=arms, hovertemplate=hover("%{y}", "%{x:+.3g} %"), showlegend=False)
    ]
    figure = Figure(
        "fig-power", "Error of the mean mechanical power", data,
        {"xaxis": axis("predicted over measured, less one [%]", zeroline=True), "yaxis": _flight_axis(names)}, split="test",
        note="Dots: the last model of each flight; lines: 95 % interval over loops.", height=LEAST + LINE * len(names),
    )  # fmt: skip
    return Section("power", "Power", figure)
