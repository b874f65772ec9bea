"""The page: whole, self-contained, safe against names from users' files, and there even where stages are not."""

import base64
import hashlib
import itertools
import json
import re
from dataclasses import replace
from functools import cache, reduce
from html.parser import HTMLParser

import numpy as np
import pytest
from plotly.offline import get_plotlyjs
from reporting.small_evidence import evidence

from awescli.artifacts.form_check import wrong_with
from awescli.artifacts.forms import FORMS
from awescli.flightlog.ranges import loop_ranges, part_ranges, ranges_check
from awescli.reporting.html import SECTIONS, page
from awescli.reporting.words import number, percent, times, with_std

EVIL = "\"><script>alert('x')</script><img src=http://evil.example/x onerror=alert(1)></script>&@ink$phase"
LARGEST = 8_200_000


@cache
def usual() -> str:
    return page(evidence())


def own(text: str) -> str:
    """The page without plotly.js, whose comments hold addresses."""
    library = get_plotlyjs().replace("</script", "<\\/script")
    assert library in text
    return text.replace(library, "")


class Reader(HTMLParser):
    """Elements with their attributes, the text that is shown, and the text of every script."""

    def __init__(self, text: str):
        super().__init__()
        self.elements, self.scripts, self.open, self.text = [], [], False, ""
        self.feed(str(text))

    def handle_starttag(self, tag, attrs):
        self.elements.append((tag, dict(attrs)))
        if tag == "script":
            self.scripts.append((dict(attrs), ""))
            self.open = True

    def handle_endtag(self, tag):
        self.open = self.open and tag != "script"

    def handle_data(self, data):
        if self.open:
            self.scripts[-1] = (self.scripts[-1][0], self.scripts[-1][1] + data)
        else:
            self.text += data

    def documents(self):
        return [json.loads(text, parse_constant=pytest.fail) for attrs, text in self.scripts if attrs.get("type") == "application/json"]


def links_lead_somewhere(text: str) -> int:
    """How many links a page has, all to something on it."""
    reader = Reader(text)
    ids = [a["id"] for _, a in reader.elements if "id" in a]
    assert len(set(ids)) == len(ids)
    targets = [a["href"] for tag, a in reader.elements if tag == "a"]
    assert all(t.startswith("#") and t[1:] in ids for t in targets), [t for t in targets if t[1:] not in ids]
    return len(targets)


def test_every_section_is_there_and_every_link_leads_somewhere():
    assert len(SECTIONS) == 10 and links_lead_somewhere(own(usual())) > 15


def test_nothing_is_asked_of_a_network():
    text = own(usual())
    assert not re.search(r"https?:|//[a-z0-9]+\.|\bsrc=|@import|url\(", text)
    assert "default-src 'none'" in text


def test_figures_are_strict_json_with_units_and_splits():
    reader = Reader(own(usual()))
    figures = [d for d in reader.documents() if isinstance(d, dict)]
    plots = [a for tag, a in reader.elements if tag == "div" and a.get("class") == "plot"]
    assert len(figures) == len(plots) > 25
    assert own(usual()).count('class="chip split"') == len(plots)
    for d in figures:
        axes = [v["title"]["text"] for k, v in d["layout"].items() if re.fullmatch(r"[xy]axis", k) and "title" in v]
        assert "scene" in d["layout"] or axes, d["layout"]
    assert "NaN" not in own(usual()).replace("isNaN", "") and "Infinity" not in own(usual())


def test_names_from_files_stay_text():
    text = own(page(evidence(name=f"f{EVIL}", evil=EVIL)))
    reader, plain = Reader(text), Reader(own(usual()))
    assert sorted({t for t, _ in reader.elements}) == sorted({t for t, _ in plain.elements})
    assert len([t for t, _ in reader.elements if t == "script"]) == len([t for t, _ in plain.elements if t == "script"])
    assert not [a for _, a in reader.elements if "onerror" in a or "src" in a]
    # in figures, where plotly.js reads marks in texts
    shown = [t for d in reader.documents() if isinstance(d, dict) for t in texts(d, "meta")]
    assert not [t for t in shown if re.search(r"<(?!br>|extra>|/extra>)", t)]


DOCUMENTS = {
    "controller": ("fit-controller", "metrics.json"), "identify": ("identify", "metrics.json"), "params": ("identify", "params.json"),
    "effects": ("trace-residual", "effects.json"), "hybrid": ("train-hybrid", "metrics.json"), "network": ("train-hybrid", "network.json"),
    "flown": ("simulate", "metrics.json"), "provenance": ("", ""), "versions": ("", ""),
}  # fmt: skip


def places(obj, way=()):
    """(way, "key" or "value") of every text in a document."""
    for key, value in obj.items() if isinstance(obj, dict) else enumerate(obj) if isinstance(obj, list) else ():
        if isinstance(obj, dict):
            yield (*way, key), "key"
        if isinstance(value, str) or value is None:
            yield (*way, key), "value"
        yield from places(value, (*way, key))


def with_text(obj, way, kind, text):
    """The same document with another text at one place."""
    if not way:
        return text
    if isinstance(obj, list):
        return [with_text(v, way[1:], kind, text) if i == way[0] else v for i, v in enumerate(obj)]
    if len(way) == 1 and kind == "key":
        return {text if k == way[0] else k: v for k, v in obj.items()}
    return {k: with_text(v, way[1:], kind, text) if k == way[0] else v for k, v in obj.items()}


def rounds(document: str, content) -> list:
    """([(way, kind)], the document with a hostile text at all these places): every place where the artifact's form lets one through. Two
    places share a page where neither hides the other: both deep in the document, in different mappings or lists, none inside the other."""
    stage, name = DOCUMENTS[document]
    found: list[list] = []
    for way, kind in places(content):
        if stage and wrong_with(stage, name, {"version": FORMS[name].version, **with_text(content, way, kind, EVIL)}):
            continue
        together = next((r for r in found if all(apart(way, other) for other, _ in r)), None)
        found.append([(way, kind)]) if together is None else together.append((way, kind))
    return [(r, reduce(lambda made, place: with_text(made, *place, EVIL), r, content)) for r in found]


def apart(one: tuple, other: tuple) -> bool:
    """Do two places of a document not hide each other?"""
    n = min(len(one), len(other))
    return min(len(one), len(other)) > 1 and one[:-1] != other[:-1] and one[:n] != other[:n]


def test_no_text_of_any_artifact_becomes_a_part_of_the_page():
    """Every name, unit, sentence and key of a document, all documents side by side; what the artifact's form refuses never reaches the
    page. A kite file's `unit` used to run a script."""
    whole = evidence()
    known = {(tag, *sorted(attrs)) for tag, attrs in Reader(own(usual())).elements}
    every = {document: rounds(document, getattr(whole, document)) for document in DOCUMENTS}
    assert min(len(at) for of in every.values() for at, _ in of) > 0 and min(sum(len(at) for at, _ in of) for of in every.values()) > 1
    for told in itertools.zip_longest(*every.values()):
        bad = {document: e for document, e in zip(every, told, strict=True) if e}
        at = {document: e[0] for document, e in bad.items()}
        reader = Reader(own(page(replace(whole, **{document: e[1] for document, e in bad.items()}))))
        assert {(tag, *sorted(attrs)) for tag, attrs in reader.elements} <= known | KINDS, at
        assert not [a for _, a in reader.elements if "onerror" in a or "src" in a], at
        shown = [t for d in reader.documents() if isinstance(d, dict) for t in texts(d, "meta")]
        assert not [t for t in shown if re.search(r"<(?!br>|extra>|/extra>)", t)], at


KINDS = {("p", "class"), ("a", "href"), ("code",), ("h3",), ("details",), ("summary",), ("td", "class"), ("th", "class", "scope"), ("b",)}
"""Elements that a page may have which says other things than usual."""


def test_names_of_files_and_of_what_the_reader_says_stay_text():
    """What `flightlog` hands on from the user's files: notes, units, clocks, checks."""
    whole = evidence()
    q = whole.quality
    hostile = replace(
        q, notes=(EVIL,), loops=EVIL, missing=(EVIL,), left_out={EVIL: 1.0}, phases={EVIL: 1.0},
        channels=tuple(replace(c, name=EVIL, unit=EVIL, group=EVIL) for c in q.channels),
        checks=tuple(replace(c, name=EVIL, unit=EVIL, sentence=EVIL, ok=False) for c in q.checks),
    )  # fmt: skip
    reader = Reader(own(page(replace(whole, quality=hostile, log=replace(whole.log, name=EVIL)))))
    assert not [a for _, a in reader.elements if "onerror" in a or "src" in a]
    assert {t for t, _ in reader.elements} <= {t for t, _ in Reader(own(usual())).elements}


def test_only_the_two_scripts_of_the_page_may_run():
    """The policy names them by their hashes: a script that came in nevertheless would not be run."""
    text = usual()
    reader = Reader(text)
    policy = next(a["content"] for tag, a in reader.elements if tag == "meta" and a.get("http-equiv") == "Content-Security-Policy")
    scripts = dict(part.strip().split(" ", 1) for part in policy.split(";"))["script-src"].split(" ")
    running = [content for attrs, content in reader.scripts if attrs.get("type") != "application/json"]
    hashes = [f"'sha256-{base64.b64encode(hashlib.sha256(content.encode()).digest()).decode()}'" for content in running]
    assert scripts == hashes and len(hashes) == 2 and "\r" not in text
    assert not [a for _, a in reader.elements for name in a if name.startswith("on")]


def texts(obj, *left_out):
    if isinstance(obj, str):
        yield obj
    elif isinstance(obj, dict):
        for k, v in obj.items():
            yield from texts(v, *left_out) if k not in left_out else ()
    elif isinstance(obj, list):
        for v in obj:
            yield from texts(v, *left_out)


MISSING = {
    "only the declared model": dict(controller=None, commanded={}, identify=None, params=None, effects=None, residuals=None, hybrid=None),
    "no controller": dict(controller=None, commanded={}),
    "not flown": dict(flown=None, trajectory=None),
    "no tracing": dict(effects=None, residuals=None),
    "empty controller": dict(controller={}, commanded={}),
    "empty hybrid": dict(hybrid={}, network={}),
    "nothing learned": dict(hybrid={"outcome": "nothing_to_learn"}),
    "no provenance": dict(provenance={}),
    "no parameters": dict(params={"parameters": {}}),
}


@pytest.mark.parametrize("left_out", MISSING.values(), ids=MISSING.keys())
def test_what_did_not_run_is_said(left_out):
    whole = evidence(hybrid="hybrid" not in left_out)
    keep = {"initial", "horizon_s", "noise_floor"} if "identify" in left_out else set(whole.scores)
    some = replace(whole, **left_out, scores={k: v for k, v in whole.scores.items() if k in keep})
    text = own(page(some))
    ids = {a["id"] for _, a in Reader(text).elements if "id" in a}
    assert {"summary", "flight", "controller", "identification", "residual", "hybrid", "flown", "prediction", "next", "provenance"} <= ids
    links_lead_somewhere(text)
    if None in left_out.values():
        assert 'class="absent"' in text


@pytest.mark.parametrize("verdict", ["none", "found", "cannot_tell", "unexplained", "not_deterministic"])
@pytest.mark.parametrize("added", [True, False])
def test_every_verdict_has_its_headline(verdict, added):
    whole = evidence()
    effects = {**whole.effects, "verdict": verdict, "chi2": {"train_before": 2.0, "train_after": 1.0 if added else 2.0}}
    if verdict == "unexplained":
        effects |= {"effects": [], "unexplained": {"channel": "Cm", "share": 0.4, "expression": "Cm += qbar*S*(+0.1*q)", "terms": []}}
    text = own(page(replace(whole, effects=effects)))
    links_lead_somewhere(text)
    assert ("nothing added" in text) is False  # a model that is the one before it again is not shown twice
    title = re.search(r"<h1>(.*?)</h1>", text)[1]
    assert {"none": "Nothing", "found": "lacked", "cannot_tell": "cannot tell", "unexplained": "left", "not_deterministic": "repeat"}[
        verdict
    ] in title


def test_a_further_effect_without_a_name_is_told():
    """Guards a page on which an answer with one of two effects looks complete."""
    assert "Beside it heading_bias would gain." in usual()


def test_flights_that_do_not_loop_and_have_no_wind():
    whole = evidence()
    text = own(page(replace(whole, loops=replace(whole.loops, kind="blocks"), log=replace(whole.log, wind=None))))
    links_lead_somewhere(text)
    assert "does not loop" in text and "no wind record" in text


def test_a_network_that_stayed_at_zero_flies_as_the_physics():
    whole = evidence()
    text = own(page(replace(whole, hybrid={"outcome": "nothing_to_learn"})))
    flown = text[text.index('<section id="flown">') :]
    assert whole.flown["model"] == "hybrid" and "With actuator lag" in flown[:600] and "kept: best on validation" not in text


def test_the_page_stays_small_for_long_flights():
    long = evidence(samples=80 * 700)  # an hour and a half
    assert len(page(long).encode()) < LARGEST


def test_numbers_on_the_page_are_those_of_the_artifacts():
    text = own(usual())
    assert "10.0 %" in text and "0.37 %" in text and "0.210 ± 0.020 s" in text


@pytest.mark.parametrize(
    ("value", "text"),
    [(0, "0"), (1234.5, "1234"), (0.00123, "0.00123"), (-2.5, "−2.50"), (1.2e-7, "1.20·10⁻⁷"), (None, "–"), (np.nan, "–")],
)
def test_numbers_in_words(value, text):
    assert number(value) == text


def test_intervals_and_shares_in_words():
    assert with_std(0.19040, 0.000418) == "0.19040 ± 0.00084"
    assert with_std(np.pi / 180, np.pi / 1800, "rad") == "1.00 ± 0.20 °"
    assert with_std(5.0, 0.0, "m") == "5.000 m"
    assert percent(0.1487) == "14.9 %" and percent(0.004385) == "0.44 %"
    assert times(0.148, 0.0044) == "34 times smaller" and times(1, 1) == "unchanged" and times(1, 2) == "2.0 times larger"


def test_the_power_of_the_test_loops_stands_on_the_first_screen():
    """Guards what an operator asks for: measured power, every model's error, the last one's interval, a figure, over how many seconds."""
    text = own(usual())
    first = re.sub(r"<[^>]+>", "", text[text.index("<body") : text.index('<section id="flight">')])
    assert "0.280 kW measured" in first and "22 of 24 s of 3 test loops" in first
    for said in ("as declared −10.0 %", "identified −3.3 %", "hybrid −0.37 % (−1.4 % to +0.63 % over loops, 95 %)"):
        assert said in first, said
    assert 'id="fig-power"' in text


def test_a_flight_without_a_line_has_no_power():
    whole = evidence()
    scores = {
        k: {n: v for n, v in block.items() if n != "power"} if isinstance(block, dict) else block for k, block in whole.scores.items()
    }
    text = own(page(replace(whole, scores=scores)))
    assert "fig-power" not in text and "mechanical power" not in text
    links_lead_somewhere(text)


def test_the_page_says_how_long_a_free_flight_is_compared_with_unseen_loops():
    """Guards test stretches that end before the simulated flight does: what follows them was fitted."""
    whole = evidence()
    text = re.sub(r"<[^>]+>", "", own(usual()))
    assert "The first 8.00 s of the comparison are test loops" in text
    unseen = own(page(replace(whole, flown={**whole.flown, "unseen_s": 30.0})))
    assert "of the comparison are test loops" not in unseen


def test_the_page_compares_the_ranges_of_the_parts():
    """Guards the table and the named check: who reads a test error sees what train flew."""
    whole = evidence()
    ranges = part_ranges(loop_ranges(whole.log, whole.loops.bounds), whole.loops.bounds, whole.parts.stretches)
    quality = replace(whole.quality, ranges=ranges, checks=(*whole.quality.checks, ranges_check(ranges)))
    text = own(page(replace(whole, quality=quality)))
    links_lead_somewhere(text)
    table = text[text.index('id="tab-ranges"') :]
    assert "rudder rate" in table[: table.index("</table>")]
    checks = text[text.index('id="tab-quality"') : text.index('id="tab-ranges"')]
    assert "Validation and test stay within what train flew." in checks


@pytest.mark.parametrize(
    ("outcome", "said"),
    [
        ("nothing_to_learn", "found nothing to learn"),
        ("too_short", "too short to prove a correction"),
        ("diverged", "the simulation diverged"),
    ],
)
def test_why_a_network_is_not_used(outcome, said):
    """Guards the difference between "there is nothing" and "this flight cannot prove it", on the first screen."""
    text = own(page(replace(evidence(), hybrid={"outcome": outcome})))
    first = re.sub(r"<[^>]+>", "", text[text.index("<body") : text.index('<section id="flight">')])
    assert f"network on top of physics {'was not used: ' if said[0] == 't' else ''}" in first and said in first
    assert "that helps" not in first and ("found nothing" in first) == (outcome == "nothing_to_learn")


def test_weak_parameters_are_not_all_near_their_priors():
    """Guards the sentence over the table: who stayed near its prior and who moved without being seen are told apart."""
    whole = evidence()
    row = {**whole.params["parameters"]["Ca"], "excited": False, "at_bound": False, "determined": "hardly"}
    moved = {**row, "determined": "poorly", "shift_in_prior_std": 2.36}
    params = {"parameters": {"Jx": moved, "Jy": {**moved, "at_bound": True}, "CL0": row}}
    text = re.sub(r"<[^>]+>", "", own(page(replace(whole, params=params))))
    assert "One parameter was hardly seen by this flight and stay near their priors" not in text
    assert "One parameter was hardly seen by this flight and stays near its prior." in text
    assert "2 parameters were hardly seen by it and yet more than one prior std from their priors, or at a bound" in text


def test_the_parameters_of_the_traced_model_have_their_table_with_intervals():
    """Beside those of identification, named by what was added; nothing where tracing added nothing."""
    text = usual()
    assert '<div id="tab-traced-parameters">' in text and "<code>lag.tau</code>" in text
    table = text[text.index('<div id="tab-traced-parameters">') :]
    assert "with actuator lag (rudder)" in table[:200] and "1.10 ± 0.10" in table[:3000]
    nothing = replace(evidence(), effects={**evidence().effects, "verdict": "none", "effects": [], "chi2": {}})
    assert "tab-traced-parameters" not in own(page(nothing))
