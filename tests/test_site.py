"""The documentation site: it builds without a warning, its reference holds all that the code has, what it cites is there."""

import ast
import os
import re
import subprocess
import sys
import typing
from pathlib import Path

import numpy as np
import pytest
from kites import DEVELOPMENT
from pydantic import BaseModel

import awescli
from awescli.artifacts.forms import ARRAYS, FORMS
from awescli.flightlog.check_names import NAMES
from awescli.flightlog.flight_file import FlightFile
from awescli.physics import effects as room
from awescli.physics.declaration import KiteDeclaration
from awescli.physics.effects import EFFECTS
from awescli.physics.effects.base import PLACES, Effect
from awescli.physics.kite import Kite
from awescli.stages import STAGES
from awescli.stages.plan import SharedSettings
from awescli.tracing.verdict import NULL, VERDICTS

ROOT = Path(__file__).parent.parent
DOCS = ROOT / "docs"
NUMBERS = re.findall(r"\\tag\{(\d+)\}", (DOCS / "equations.md").read_text())


@pytest.fixture(scope="module")
def reference():
    """Name -> page of the reference, as the site has it."""
    sys.path.insert(0, str(DOCS / "make"))
    try:
        import reference
    finally:
        sys.path.remove(str(DOCS / "make"))
    return {name: page() for name, page in reference.PAGES.items()}


@pytest.mark.slow
def test_the_site_builds_without_a_warning(tmp_path):
    """What `make docs` runs; links, anchors and pages that are in no menu are warnings, and --strict makes them errors."""
    done = subprocess.run(
        [sys.executable, "-m", "mkdocs", "build", "--strict", "--quiet", "--site-dir", str(tmp_path / "site")],
        cwd=ROOT, capture_output=True, text=True, env={**os.environ, "NO_MKDOCS_2_WARNING": "1", "PYTHONPATH": str(ROOT)},
    )  # fmt: skip
    assert done.returncode == 0 and not done.stderr.strip(), done.stderr
    equations = (tmp_path / "site" / "equations.html").read_text()
    assert "$$" not in equations and equations.count('<div class="equation">') == len(NUMBERS)
    assert all(f'id="eq-{n}"' in equations for n in NUMBERS)
    page = (tmp_path / "site" / "reference" / "effects.html").read_text()
    assert not re.search(r'(?:src|href)="https?://(?!(?:www\.)?(?:mkdocs|squidfunk))', page), "something is loaded from elsewhere"


def rows_of(page: str) -> dict[str, list[str]]:
    """First cell of every row of a page's tables -> all its cells."""
    rows = [re.split(r"(?<!\\) \| ", line.strip("| ")) for line in page.splitlines() if line.startswith("| ")]
    return {row[0].strip("`"): row for row in rows}


def models_in(model, seen=None):
    """A pydantic model and all models that its fields hold."""
    seen = {} if seen is None else seen
    if isinstance(model, type) and issubclass(model, BaseModel):
        if model not in seen:
            seen[model] = True
            for field in model.model_fields.values():
                models_in(field.annotation, seen)
    else:
        for part in typing.get_args(model):
            models_in(part, seen)
    return list(seen)


@pytest.mark.parametrize("page, tops", [
    ("stages", [SharedSettings, *(s.Config for s in STAGES)]), ("kite_file", [KiteDeclaration]), ("flight_yaml", [FlightFile]),
])  # fmt: skip
def test_every_key_is_there_and_has_a_meaning(reference, page, tops):
    rows = rows_of(reference[page])
    for model in (m for top in tops for m in models_in(top)):
        for name, field in model.model_fields.items():
            assert (field.alias or name) in rows, f"{model.__name__}.{name}"
            assert field.description, f"{model.__name__}.{name} has no description"


def test_the_reference_names_all_that_there_is(reference):
    """Guards against a page that silently loses a part of what it is made of."""
    for name, effect in EFFECTS.items():
        assert f"\n## {name}\n" in reference["effects"] and effect.doc in reference["effects"].replace(effect.doc.capitalize(), effect.doc)
        for p in effect.parameters:
            assert p.source.replace("|", "\\|") in reference["effects"]
    assert set(NAMES) <= set(rows_of(reference["data_checks"]))
    assert set(VERDICTS) | set(NULL) <= set(rows_of(reference["verdicts"]))
    assert all(f"\n## {form}\n" in reference["artifacts"] for form in (*FORMS, *ARRAYS))
    assert all(row[-1] for row in rows_of(reference["artifacts"]).values()), "a field without its meaning"
    assert {"0", "1", "2", "3", "130"} <= set(rows_of(reference["exit_codes"]))
    assert all(f"\n## awes {s.name}\n" in reference["commands"] for s in STAGES)
    assert all(f"\n## {name}\n" in reference["python"] for name in awescli.__all__)


def test_the_criteria_are_those_of_a_real_verdict(reference):
    """The rows that are read off the code are those that a table of criteria has."""
    from tracing.test_verdict import GOOD, evidence

    from awescli.tracing.verdict import table

    rows = rows_of(reference["verdicts"])
    for c in table(evidence(GOOD)):
        assert c.name in rows, c.name
        known = [piece for piece in rows[c.name][1].split("...") if piece.strip()]
        assert all(piece.strip() in c.says for piece in known), (c.says, known)


def docstrings_and_comments():
    """(file, its text) of all code and files of parameters."""
    for folder in ("awescli", "examples", "benchmarks", "data"):
        for file in (f for kind in ("*.py", "*.yaml") for f in (ROOT / folder).rglob(kind)):
            yield file, file.read_text()


def test_equations_are_numbered_and_what_is_cited_is_there():
    assert [int(n) for n in NUMBERS] == list(range(1, len(NUMBERS) + 1))
    cited = 0
    for file, text in docstrings_and_comments():
        for citation in re.findall(r"docs/equations\.md ((?:\(\d+\)(?:, | to | and )?)+)", text):
            for number in re.findall(r"\d+", citation):
                cited += 1
                assert number in NUMBERS, f"{file}: ({number})"
    assert cited > 20
    for page in DOCS.rglob("*.md"):
        for number in re.findall(r"equations\.md#eq-(\d+)", page.read_text()):
            assert number in NUMBERS, f"{page}: ({number})"


def test_nothing_cites_a_document_that_a_reader_does_not_have():
    """"The seed" was this project's own word for the thesis."""
    for file, text in docstrings_and_comments():
        found = re.search(r"\bseed'?s? (?:section|eqs?\b|figure)|\bthe seed's |(?:\(|of the )seed,? (?:section|eq|figure)", text, re.I)
        assert not found, f"{file}: {found[0]}"


def python_blocks():
    for page in sorted([*DOCS.rglob("*.md"), ROOT / "README.md"]):
        for i, block in enumerate(re.findall(r"^```python\n(.*?)^```$", page.read_text(), re.M | re.S)):
            yield pytest.param(block, id=f"{page.relative_to(ROOT)}-{i}")


@pytest.mark.parametrize("block", list(python_blocks()))
def test_python_in_the_pages_imports_what_there_is(block):
    """It compiles, and every name it takes from awes exists."""
    for node in ast.walk(ast.parse(block)):
        if isinstance(node, ast.ImportFrom) and node.module.startswith("awescli"):
            module = __import__(node.module, fromlist=["_"])
            assert all(hasattr(module, a.name) for a in node.names), ast.unparse(node)


def test_the_effect_of_the_page_keeps_the_contract(calm, monkeypatch):
    """What a reader copies is an effect: one place, null is absent to the last bit, and it does what its equation says."""
    text = (DOCS / "how_to" / "own_effect.md").read_text()
    names: dict = {}
    exec(re.search(r"^```python\n(.*?)^```$", text, re.M | re.S)[1], names)  # noqa: S102 - the page's own code
    cls = names["GroundEffect"]
    assert [p for p in PLACES if getattr(cls, p) is not getattr(Effect, p)] == ["coefficients"]
    monkeypatch.setitem(room.EFFECTS, cls.name, cls)
    heights = calm.log.wind.height
    without, with_it = Kite(DEVELOPMENT, heights), Kite(DEVELOPMENT, heights, (cls.name,))
    log = calm.log
    states = [float(log[n][100]) for n in ("p_n", "p_e", "p_d")] + [20.0, 0.5, 1.0, 0.1, 0.05, 0.3, 0.0, 0.0, 0.1]
    x = [*states, *(0.0 for _ in range(len(without.x_names) - 12))]
    u = [1.0 for _ in without.input_names]
    at = [kite.instant(x, u, [kite.parameters[n].value for n in kite.parameter_names]) for kite in (without, with_it)]
    assert at[0].coefficients == at[1].coefficients
    strong = with_it.with_values({f"{cls.name}.k": 0.03})
    near = strong.instant([x[0], x[1], -2.0, *x[3:]], u, [strong.parameters[n].value for n in strong.parameter_names])
    bare = without.instant([x[0], x[1], -2.0, *x[3:]], u, [without.parameters[n].value for n in without.parameter_names])
    ratio = 16 * 2.0 / without.parameters["b"].value
    assert np.isclose(near.coefficients.CD - bare.coefficients.CD, -0.03 * bare.coefficients.CL**2 / (1 + ratio**2), rtol=1e-9)
