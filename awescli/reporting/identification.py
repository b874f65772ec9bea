"""Identification: parameters with intervals, prior, shift and flags; errors before and after (Rositani (2025), figure 2)."""

from collections.abc import Mapping

from awescli.reporting.correlation import correlation
from awescli.reporting.evidence import Evidence
from awescli.reporting.marks import Cell, Chip, Code, Group, Paragraph, Section, Tip, Words, absent, spaced, table
from awescli.reporting.plots import Figure, axis, bars, dots, hover
from awescli.reporting.words import COLOURS, channel, listed, number, percent, unit_of, with_std

DETERMINED = {"hardly": "hardly seen", "poorly": "poorly determined"}
"""How params.json says that a flight does not determine a parameter -> how the table does."""


def identification(evidence: Evidence) -> Section:
    title = "Identification"
    if evidence.params is None:
        return Section("identification", title, absent("awes identify", "no parameters were identified"))
    tables = [parameters(evidence.fitted_params["parameters"], "tab-parameters", "Parameters")]
    if evidence.tracing_added and evidence.traced_params is not None:
        title_of = f"Parameters {evidence.label('with_effects')}"
        tables.append(parameters(evidence.traced_params["parameters"], "tab-traced-parameters", title_of))
    body = Paragraph(sentence(evidence)), attitude(evidence), shifts(evidence), *tables, correlation(evidence)
    return Section("identification", title, body)


def sentence(evidence: Evidence) -> Words:
    """How the fit went."""
    m, rows = evidence.identify or {}, evidence.fitted_params["parameters"]
    chi2 = m.get("chi2")
    head: Words = f"{len(rows)} free parameters, fitted to the train {evidence.parts.of}; outcome: {m.get('outcome', '?')}."
    if chi2 is not None:
        head = head, " ", Tip("χ²"), f" per degree of freedom {number(chi2)} (1: nothing but noise is left on train)."
    return head, _details(evidence, m, rows)


def _details(evidence: Evidence, m: Mapping, rows: Mapping[str, Mapping]) -> str:
    """What was estimated along, what the flight hardly shows, what bounds and constraints did."""
    text = ""
    if along := [f"{name} ({number(p['level'])} {p['unit']})" for name, p in (m.get("processes") or {}).items()]:
        text += f" Estimated along, besides starts: {listed(along)}."
    if off := [f"{name} {number(factor)}" for name, factor in (m.get("noise_factors") or {}).items() if abs(factor - 1) > 0.1]:
        text += f" Noise over the declared one: {listed(off)}."
    counts = {how: sum(p.get("determined") == how for p in rows.values()) for how in ("hardly", "poorly")}
    if count := counts["hardly"]:
        stay = "stay near their priors" if count > 1 else "stays near its prior"
        text += f" {_parameters(count)} hardly seen by this flight and {stay}."
    if count := counts["poorly"]:
        whose = "their priors" if count > 1 else "its prior"
        text += f" {_parameters(count)} hardly seen by it and yet more than one prior std from {whose}, or at a bound: "
        text += "what others or a missing effect should explain, and of little meaning by itself."
    for factor in evidence.fitted_params.get("common_factors", []):
        text += f" {factor['says'][:1].upper()}{factor['says'][1:]}; the prior sets the factor."
    for row in evidence.fitted_params.get("constraints", []):
        if row["active"]:
            gain = number(row["cost_per_unit"])
            text += f" The constraint {row['constraint']} is active: relaxed by one unit, the fit would gain {gain} of χ²."
    return text


def _parameters(count: int) -> str:
    return f"{count} parameters were" if count > 1 else "One parameter was"


def attitude(evidence: Evidence) -> Figure:
    """Rositani (2025), figure 2: Euler angles before and after, and the mean of all states beside them."""
    names = [n for n in ("phi", "theta", "psi", "mean") if n in evidence.nrmse("initial")]
    data = [
        bars(
            [channel(n) for n in names], [100 * evidence.nrmse(m)[n] for n in names], evidence.label(m), COLOURS[m],
            text=[percent(evidence.nrmse(m)[n]) for n in names], textposition="outside", cliponaxis=False,
        )
        for m in ("initial", "identified") if m in evidence.models
    ]  # fmt: skip
    return Figure(
        "fig-attitude", f"Attitude {evidence.horizon:g} s ahead, before and after identification", data,
        {"yaxis": axis("NRMSE [% of range]", rangemode="tozero"), "margin": {"t": 24}}, split=f"test {evidence.parts.of}", height=290,
    )  # fmt: skip


def shifts(evidence: Evidence) -> Figure:
    """Every parameter's way from its prior, with its interval."""
    rows = evidence.fitted_params["parameters"]
    data = []
    for name, colour, keep in (
        ("seen by the flight", "@blue", lambda p: p.get("excited", True) and not p.get("at_bound")),
        ("hardly seen, near its prior", "@grey", lambda p: p.get("determined") == "hardly"),
        ("hardly seen, and moved", "@ochre", lambda p: p.get("determined") == "poorly" and not p.get("at_bound")),
        ("at its bound", "@red", lambda p: p.get("at_bound")),
    ):
        here = {n: p for n, p in rows.items() if keep(p)}
        if not here:
            continue
        data.append(
            dots(
                [p["shift_in_prior_std"] for p in here.values()], list(here), name, colour, size=8,
                error_x=dict(array=[2 * p["std"] / p["prior_std"] for p in here.values()], thickness=1.4, width=0, color=colour),
                text=[with_std(p["value"], p["std"], p["unit"]) for p in here.values()],
                hovertemplate=hover("%{y} = %{text}", "%{x:.2f} prior std from its prior"),
            )
        )  # fmt: skip
    layout = {
        "xaxis": axis("shift from the prior, in prior standard deviations", zeroline=True),
        "yaxis": {
            "autorange": "reversed",
            "type": "category",
            "categoryorder": "array",
            "categoryarray": list(rows),
            "dtick": 1,
        },
        "shapes": [{"type": "rect", "yref": "paper", "y0": 0, "y1": 1, "x0": -1, "x1": 1, "fillcolor": "@grey/0.12", "line": {"width": 0}}],
    }
    return Figure(
        "fig-parameters", "What identification changed", data, layout, split="fitted to train",
        note="Dots: identified value; lines: ± 2 standard deviations; shaded: one prior standard deviation around the declared value.",
        height=90 + 17 * len(rows),
    )  # fmt: skip


def parameters(rows: Mapping[str, Mapping], place: str, title: str) -> Group:
    """The table of a params.json."""
    lines = []
    for name, p in rows.items():
        unit, factor = unit_of(p["unit"])
        flags = [Chip("at bound", "bad")] if p.get("at_bound") else []
        flags += [Chip(DETERMINED[p["determined"]])] if p.get("determined") in DETERMINED else []
        flags += [Chip(f"flight {p['flight']}")] if "flight" in p else []
        flags += [Chip(f"with {', '.join(p['partners'])}")] if p.get("partners") else []
        lines.append((
            Cell(Code(name), name), Cell(with_std(p["value"] * factor, p["std"] * factor), p["value"]), unit,
            Cell(f"{number(p['prior'] * factor, 4)} ± {number(2 * p['prior_std'] * factor, 2)}", p["prior"]),
            Cell(f"{p['shift_in_prior_std']:+.2f}".replace("-", "−"), p["shift_in_prior_std"]), Cell(spaced(flags), -len(flags)),
        ))  # fmt: skip
    head = ("parameter", "value ± 2 std", "unit", "prior ± 2 std", "shift [prior std]", "flags")
    return Group(place, title, table(head, lines))
