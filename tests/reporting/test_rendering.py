"""How plain data become a page: by templates that escape every value, and by nothing else."""

import ast
import re
from dataclasses import fields, replace
from pathlib import Path
from urllib.parse import quote

import pytest
from jinja2 import StrictUndefined, UndefinedError
from markupsafe import Markup
from reporting.small_evidence import evidence
from reporting.test_page import EVIL, Reader, texts
from reporting.test_pumping import pumped

import awescli
from awescli.api.figures import Picture
from awescli.api.shown import as_html
from awescli.reporting import marks, plots
from awescli.reporting.free_flight import free_flight
from awescli.reporting.html import page
from awescli.reporting.phase_power import phase_table
from awescli.reporting.rendering import MACROS, environment, rendered, show

PACKAGE = Path(awescli.__file__).parent
SOURCES = sorted([*(PACKAGE / "reporting").glob("*.py"), *(PACKAGE / "api").glob("*.py")])
TEMPLATES = {p.name: p.read_text(encoding="utf-8") for p in (PACKAGE / "reporting" / "templates").glob("*")}

NOT_HTML = {
    "reporting/plots.py": {"<br>", "<extra>", "</extra>"},  # marks of plotly.js, in `hover`
    "reporting/html.py": {"</script", "<\\/script"},  # what is taken out of our own scripts
    "api/figures.py": {"<svg"},  # where matplotlib's drawing begins
}
TRUSTED = {"reporting/html.py": 2, "api/shown.py": 1, "api/figures.py": 1}
"""Where `trusted` is called: our scripts and style, polars' table, matplotlib's drawing."""


def called(path: Path) -> str:
    return path.relative_to(PACKAGE).as_posix()


def docstrings(tree: ast.AST) -> set[int]:
    """ids of the constants that only document."""
    bodies = [node.body for node in ast.walk(tree) if hasattr(node, "body") and isinstance(node.body, list)]
    return {id(line.value) for body in bodies for line in body if isinstance(line, ast.Expr)}


@pytest.mark.parametrize("path", SOURCES, ids=called)
def test_no_markup_stands_in_python(path):
    """A value in an HTML string of Python is escaped only where somebody thought of it; in a template it always is."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    told = docstrings(tree)
    texts = [n.value for n in ast.walk(tree) if isinstance(n, ast.Constant) and isinstance(n.value, str) and id(n) not in told]
    found = {tag for text in texts for tag in re.findall(r"<\\?[/!]?[A-Za-z]\w*>?", text)}
    assert found == NOT_HTML.get(called(path), set())


@pytest.mark.parametrize("path", SOURCES, ids=called)
def test_only_one_file_makes_markup(path):
    calls = [n.func for n in ast.walk(ast.parse(path.read_text(encoding="utf-8"))) if isinstance(n, ast.Call)]
    names = [f.id if isinstance(f, ast.Name) else getattr(f, "attr", "") for f in calls]
    assert "Markup" not in names or called(path) == "reporting/rendering.py"
    assert names.count("trusted") == TRUSTED.get(called(path), 0)


def test_templates_escape_everything_and_know_what_they_are_given():
    assert environment().autoescape is True and environment().undefined is StrictUndefined and len(TEMPLATES) == 5
    for name, text in TEMPLATES.items():
        assert not re.search(r"\|\s*safe\b|autoescape|Markup", text), name
        # an attribute without quotes could be ended by a space
        assert not re.search(r"=\{\{", text), name
    for name in ("page.html", "result.html", "picture.html"):
        with pytest.raises(UndefinedError):
            rendered(name)
    assert environment().from_string("{{ x }}").render(x=EVIL) == str(Markup.escape(EVIL))


def test_every_macro_shows_something_and_everything_has_its_macro():
    """The table is whole: no macro that nothing uses, no piece of a page without one."""
    made = {(name, macro) for name in ("words.html", "blocks.html") for macro in re.findall(r"macro ([a-z]\w*)\(it\)", TEMPLATES[name])}
    assert made == set(MACROS.values()) and len(made) == len(MACROS)
    pieces = {c for room in (marks, plots) for c in vars(room).values() if isinstance(c, type) and c.__module__ == room.__name__}
    assert pieces - {marks.Cell} == set(MACROS)
    with pytest.raises(KeyError):
        show(3.0)


NAME = "harmless-name-of-a-thing"


def filled(kind: type, text: str):
    """A piece of this kind with the text at every place that holds one."""
    known = {
        "rows": ((marks.Cell(text, text, text), marks.Cell(marks.Tip(text))),), "head": (marks.Tip(text), marks.Tip("NRMSE")),
        "items": (text, marks.Code(text)), "share": 0.5, "sortable": True,
        "entries": ((text, text, f"@{text}"),) if kind is marks.Tiles else ((text, f"@{text}", text),),
        "values": [1.0], "data": [plots.line([text], [1.0], text, "@ink", meta=text)], "layout": {"xaxis": plots.axis(text)},
        "height": 200, "part": True,
    }  # fmt: skip
    return kind(**{f.name: known.get(f.name, text) for f in fields(kind)})


def attributes(reader: Reader) -> set[tuple[str, ...]]:
    return {(tag, *sorted(names)) for tag, names in reader.elements}


@pytest.mark.parametrize("kind", MACROS, ids=lambda kind: kind.__name__)
def test_text_stays_text_in_every_piece(kind):
    """The page with a hostile text is the page with a harmless one, but for that text: in words, in attributes, in the JSON of figures."""
    usual, hostile = Reader(show(filled(kind, NAME))), Reader(show(filled(kind, EVIL)))
    # a path becomes an address
    said = quote(EVIL) if kind is marks.File else EVIL
    assert hostile.elements == [(tag, {k: (v or "").replace(NAME, said) for k, v in named.items()}) for tag, named in usual.elements]
    assert hostile.text == usual.text.replace(NAME, EVIL)
    shown = [text for document in hostile.documents() for text in texts(document, "meta")]
    assert not [text for text in shown if "<" in text.replace("<extra>", "").replace("</extra>", "")]
    everything = str([usual.elements, usual.text, usual.documents()])
    assert everything.count(NAME) >= sum(f.type in ("str", "Words", "Body") for f in fields(kind)), "a text that is nowhere to be seen"


def test_words_that_are_made_of_marks_keep_their_order_and_their_texts():
    words = "a < b, ", marks.Strong((marks.Link("x&y", "c > d"), "; ")), marks.Chip("e", 'f" onclick="g'), ""
    assert show(words) == ('a &lt; b, <b><a href="#x&amp;y">c &gt; d</a>; </b><span class="chip f&#34; onclick=&#34;g">e</span>')
    assert marks.plain(words) == "a < b, c > d; e"


def test_a_figure_holds_texts_as_they_are_and_the_page_what_plotly_reads():
    """plotly.js reads marks in texts, so that the page's JSON has them escaped; files for papers take them as they are."""
    told = plots.hover("%{x}", aside="<i>")
    figure = plots.Figure("fig-x", "x", [plots.line([0.0], [1.0], "<b>&", "@ink", meta="<b>&", hovertemplate=told)])
    (trace,) = figure.document["data"]
    assert figure.data[0]["name"] == "<b>&" and trace["name"] == "&lt;b&gt;&amp;"
    assert trace["meta"] == "<b>&" and trace["hovertemplate"] == "%{x}<extra>&lt;i&gt;</extra>"
    text = str(show(figure))
    assert "<b>" not in text and "\\u003cb\\u003e\\u0026" in text
    (document,) = Reader(text).documents()
    assert document["data"][0]["meta"] == "<b>&"


def test_names_of_models_effects_and_actions_stay_text():
    """What is not a document of a stage: names that the page makes of effects, and the parameters of the traced model."""
    whole = evidence(evil="x")
    first = whole.actions[0]
    hostile = replace(
        whole, actions=(replace(first, effect=f"{EVIL}:{EVIL}", quantity=EVIL, unit=EVIL, received=EVIL, made=EVIL),),
        traced_params={"parameters": {EVIL: {**whole.traced_params["parameters"]["Cb"], "unit": EVIL, "partners": [EVIL], "advice": EVIL}}},
    )  # fmt: skip
    reader, usual = Reader(page(hostile)), Reader(page(whole))
    assert attributes(reader) <= attributes(usual) and EVIL in reader.text


def test_the_names_that_a_plan_gives_to_phases_stay_text():
    """Of cycles that were flown, and of measured power per phase."""
    whole = pumped()
    flown, blocks = whole.flown, {m: whole.scores[m] for m in whole.models}
    phases = [part | {"phase": EVIL, "ended_by": EVIL} for part in flown["phases"]]
    parts = {
        m: b | {"power": b["power"] | {"by_phase": [part | {"phase": EVIL} for part in b["power"]["by_phase"]]}} for m, b in blocks.items()
    }
    hostile = replace(whole, flown={**flown, "phases": phases}, scores={**whole.scores, **parts})
    for tell in (free_flight, phase_table):
        reader = Reader(show(tell(hostile)))
        assert EVIL in reader.text and attributes(reader) <= attributes(Reader(show(tell(whole))))


def test_what_a_notebook_shows_stays_text():
    html = as_html(EVIL, [EVIL])
    assert [t for t, _ in Reader(html).elements] == ["div", "b", "div"] and Reader(html).text == EVIL * 2
    picture = Picture("x", EVIL, '<?xml version="1.0"?><svg><g></g></svg>', b"")
    reader = Reader(picture._repr_html_())
    assert [t for t, _ in reader.elements] == ["figure", "svg", "g", "figcaption"] and reader.text == EVIL
