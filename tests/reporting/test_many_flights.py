"""The page over many flights: every flight with its verdict, sizes with their intervals, links to the reports and nowhere else."""

import re
from urllib.parse import unquote, urlsplit

import pytest
from reporting.test_page import EVIL, Reader, own, texts

from awescli.reporting.many_flights import Flights, flights_page, title

HIDDEN = "javascript:alert(1)//?q#f"
"""A folder may be called so; a link to it must stay a path."""


def lag(tau, low, high, rivals=()):
    size = {"tau": {"value": tau, "low": low, "high": high, "unit": "s"}}
    return {"name": "actuator_lag", "acts_on": "rudder", "parameters": size, "rivals": list(rivals)}


def bias(value, std):
    size = {"bias": {"value": value, "low": None if std is None else value - 2 * std, "high": None if std is None else value + 2 * std,
                     "unit": "rad"}}  # fmt: skip
    return {"name": "heading_bias", "acts_on": "", "parameters": size, "rivals": []}


def row(flight, verdict=None, effects=(), error=(None, None, None), power=None, status="done", reason=""):
    before, after, noise = error
    known = {"horizon_s": 5.0, "before": before, "after": after, "noise": noise} if noise is not None else None
    share = None if power is None else {"model": "with_effects", "error_share": power[0], "interval_share": power[1:] or None}
    return {
        "flight": flight, "status": status, "reason": reason, "seconds": 1.0, "stages": {}, "verdict": verdict, "effects": list(effects),
        "error": known, "power": share, "report": None, "log": flight, "out": flight,
    }  # fmt: skip


ROWS = [
    row("first", "found", [lag(0.2, 0.19, 0.21)], (0.03, 0.01, 0.009), (0.02, -0.01, 0.05)),
    row("second", "found", [lag(0.22, 0.2, 0.24), bias(0.05, 0.01)], (0.05, 0.011, 0.01), (-0.03,)),
    row("third", "cannot_tell", [lag(0.15, 0.1, 0.2, ["actuator_delay on rudder"])], (0.02, 0.012, 0.01)),
    row("fourth", "none", [], (0.011, 0.011, 0.01), (0.0, -0.1, 0.1)),
    row("fifth", status="refused", reason="logs/fifth/kite.csv: no time stamp can be read\n  Expected numbers."),
    row("sixth", "not_testable", status="no answer", reason="the fit stalled"),
]


def made(rows=ROWS, reports=None):
    return own(flights_page(Flights(rows, reports or {}, "stages.yaml", "km1.yaml", "0.2")))


def cells(text):
    """First cell of every row of the table -> the texts of its cells."""
    body = text[text.index("<tbody>") : text.index("</tbody>")]
    rows = [re.findall(r"<t[hd][^>]*>(.*?)</t[hd]>", line, re.S) for line in re.findall(r"<tr>(.*?)</tr>", body, re.S)]
    return {Reader(first).text: [Reader(cell).text.strip() for cell in rest] for first, *rest in rows}


def test_every_flight_is_a_row_with_its_verdict_and_its_sizes():
    rows = cells(made())
    assert list(rows) == [r["flight"] for r in ROWS]
    assert [cell[0] for cell in rows.values()] == ["found", "found", "cannot tell", "none", "–", "not testable"]
    assert rows["first"][1] == "actuator lag (rudder), tau 0.200 s (0.190 to 0.210)"
    assert "heading bias, bias 2.86 ° (1.72 to 4.01)" in rows["second"][1] and "or actuator_delay on rudder" in rows["third"][1]
    assert rows["fifth"][1] == "logs/fifth/kite.csv: no time stamp can be read" and rows["sixth"][1] == "the fit stalled"
    assert rows["first"][2:6] == ["3.00 %", "1.00 %", "0.90 %", "+2.00 %"] and rows["fifth"][2:6] == ["–"] * 4


def test_sizes_stand_with_their_intervals_over_the_flights():
    figures = {d["layout"]["xaxis"]["title"]["text"]: d for d in Reader(made()).documents()}
    shown = {}
    for trace in figures["tau [s]"]["data"]:
        arms = trace["error_x"]
        for x, y, up, down in zip(trace["x"], trace["y"], arms["array"], arms["arrayminus"], strict=True):
            shown[y] = (trace["name"], x, pytest.approx(x - down), pytest.approx(x + up))
    assert shown == {"first": ("found", 0.2, 0.19, 0.21), "second": ("found", 0.22, 0.2, 0.24), "third": ("cannot tell", 0.15, 0.1, 0.2)}
    (angle,) = figures["bias [°]"]["data"]
    assert angle["x"] == [pytest.approx(2.865, abs=1e-3)] and angle["error_x"]["array"] == [pytest.approx(1.146, abs=1e-3)]
    before, after, noise = figures["mean NRMSE of the 12 states [%]"]["data"]
    assert before["x"] == [3.0, 5.0, 2.0, 1.1] and after["x"][0] == 1.0 and noise["y"] == ["first", "second", "third", "fourth"]
    (power,) = figures["predicted over measured, less one [%]"]["data"]
    assert power["x"] == [2.0, -3.0, 0.0] and power["error_x"]["array"] == [pytest.approx(3.0), 0.0, pytest.approx(10.0)]


def test_what_no_flight_has_is_not_there():
    text = made([row("only", status="refused", reason="no")])
    assert not Reader(text).documents() and "<h1>No flight has a verdict</h1>" in text
    assert {a.get("href") for tag, a in Reader(text).elements if tag == "a"} == {"#summary", "#verdicts"}
    assert not [d for d in Reader(made([row("a", "found", [bias(0.1, None)])])).documents() if d["data"][0]["error_x"]["array"] != [0.0]]


@pytest.mark.parametrize(
    "rows, says",
    [
        (ROWS, "Found: actuator lag (rudder) in 2 and heading bias in 1 of 6 flights"),
        ([ROWS[3], ROWS[4]], "Nothing is missing that 1 of 2 flights could show"),
        ([ROWS[2], ROWS[3]], "No effect is found in 2 flights"),
    ],
)
def test_the_title_says_what_they_say_together(rows, says):
    assert title(rows) == says


def test_links_lead_to_the_reports_and_names_stay_names():
    names = ["plain", "two words", HIDDEN, EVIL.replace("/", "")]
    text = made([row(n, "found", [lag(0.2, 0.1, 0.3)]) for n in names], {n: f"{n}/evaluate/report.html" for n in names})
    outward = [a["href"] for tag, a in Reader(text).elements if tag == "a" and not a["href"].startswith("#")]
    parts = [urlsplit(address) for address in outward]
    assert [(p.scheme, p.netloc, p.query, p.fragment) for p in parts] == [("", "", "", "")] * len(names)
    assert [unquote(p.path) for p in parts] == [f"./{n}/evaluate/report.html" for n in names]
    assert list(cells(text)) == names and "absent" not in text[text.index("<main>") :]
    assert {t for t, _ in Reader(text).elements} <= {t for t, _ in Reader(made()).elements}
    assert not [t for d in Reader(text).documents() for t in texts(d) if "<script" in t or "<img" in t]
    assert "evaluate: {report: true}" in Reader(made()).text
