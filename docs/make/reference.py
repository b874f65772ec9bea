"""The reference, read off the code: one function a page, Markdown out. Nothing here is written twice, so nothing can be out of date.

python docs/make/reference.py effects      prints one page
"""

import ast
import inspect
import re
import sys
from collections.abc import Callable, Iterable, Sequence
from math import isfinite
from pathlib import Path
from typing import Any

import typer
from models import sections

import awescli
from awescli.artifacts.forms import ARRAYS, FORMS
from awescli.cli import build_app, shell
from awescli.flightlog.check_names import OF_KITE, OF_LOG
from awescli.flightlog.flight_file import FlightFile
from awescli.notation.quantities import IN_WORDS, UNITS
from awescli.physics.declaration import KiteDeclaration
from awescli.physics.effects import EFFECTS
from awescli.physics.library import library
from awescli.stages import STAGES
from awescli.stages.base import Inputs, Split
from awescli.stages.plan import SharedSettings
from awescli.tracing import criteria, verdict
from awescli.tracing.summary import SENTENCES

ROOT = Path(__file__).parents[2]
MADE = "*This page is read off the code while the site is built.*"


def page(title: str, *pieces: str) -> str:
    """A page from its title and paragraphs."""
    return "\n\n".join((f"# {title}", MADE, *pieces)) + "\n"


def table(head: Sequence[str], rows: Iterable[Sequence[Any]]) -> str:
    """A Markdown table; a bar inside a cell would end it."""
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join("| " + " | ".join(str(cell).replace("\n", " ").replace("|", "\\|") for cell in line) + " |" for line in lines)


def text_of(thing: Any) -> str:
    """A docstring without its indentation; empty where there is none of its own."""
    own = thing.__dict__.get("__doc__") if inspect.isclass(thing) else thing.__doc__
    return inspect.cleandoc(own) if own else ""


def commands() -> str:
    """Every command with its options, as `awes COMMAND --help` says them."""
    app = typer.main.get_command(build_app(STAGES))
    pieces = ["`awes STAGE` reads `stages.yaml` in the current folder. What a command exits with: [exit codes](exit_codes.md)."]
    for name, command in app.commands.items():
        words = [p.metavar or p.name.upper() for p in command.params if p.param_type_name == "argument"]
        rows = [(f"`{', '.join(p.opts)}`", p.metavar or "", p.help or "") for p in command.params if p.param_type_name == "option"]
        pieces += [f"## awes {name}", command.help or "", f"    awes {' '.join([name, *words])}" if words else ""]
        pieces += [table(("option", "value", "meaning"), rows)] if rows else []
    return page("Commands", *(p for p in pieces if p))


def stages() -> str:
    """The plan's own keys, and those of every stage."""
    pieces = [
        "`stages.yaml` is the plan. Its keys are those of the first table; below `stages:` each stage has its own. `--set KEY=VALUE` "
        "replaces any of them: `--set identify.horizon=3.0`. What is not said has its default.",
        "## Top level", *sections(SharedSettings, level=3),
    ]  # fmt: skip
    for stage in STAGES:
        needs = [f"[{n.stage}](#{n.stage}){'' if n.required else ' (where it has run)'}" for n in stage.needs(stage.Config())]
        pieces += [f"## {stage.name}", stage.help, f"Takes from: {', '.join(needs) or 'flight and kite file only'}."]
        pieces += ["Leaves: " + ", ".join(f"`{name}`" for name in stage.makes) + ".", *sections(stage.Config, level=3, about=False)]
    return page("Stages and their keys", *pieces)


def kite_file() -> str:
    """The kite file, key by key."""
    return page("Kite file", *sections(KiteDeclaration, level=2))


def flight_yaml() -> str:
    """flight.yaml, key by key, and the quantities that it may map."""
    rows = [(f"`{name}`", UNITS[name], IN_WORDS[name]) for name in IN_WORDS]
    quantities = ["## Quantities", table(("name", "SI unit", "meaning"), rows)]
    return page("flight.yaml", *sections(FlightFile, level=2), *quantities)


def effects() -> str:
    """The library: equation, place, parameters with ranges and sources."""
    pieces = [
        "The equations are those of the code's own docstrings, in the letters of [the equations](../equations.md). A candidate is what "
        "`trace-residual` looks for; at its null value an effect changes nothing, to the last bit. What is plausible of a size is listed "
        "for kites of some 54 kg on 3 m2 (KM1, AP2); of a larger one more is, as forces grow with the weight and lengths with the root "
        "of the wing area.",
        table(("effect", "acts on", "role", "what it is"), [
            (f"[{e['name']}](#{e['name']})", _acts(e), e["role"], e["doc"]) for e in library()
        ]),
    ]  # fmt: skip
    for e in library():
        said = f"{e['doc'][0].upper()}{e['doc'][1:]}. Acts on: {_acts(e)}; {e['role']}; in a kite file `{e['key']}`."
        pieces += [f"## {e['name']}", said]
        pieces += ["```text\n" + text_of(EFFECTS[e["name"]]) + "\n```"]
        if e["parameters"]:
            rows = [(f"`{p['name']}`", p["unit"], f"{p['null']:g}", _range(p), p["source"]) for p in e["parameters"]]
            pieces.append(table(("parameter", "unit", "null", "plausible", "source"), rows))
    return page("Effects", *pieces)


def _acts(row: dict[str, Any]) -> str:
    return ", ".join(row["targets"]) or row["place"]


def _range(row: dict[str, Any]) -> str:
    return " .. ".join("" if row[end] is None or not isfinite(row[end]) else f"{row[end]:g}" for end in ("lower", "upper"))


def artifacts() -> str:
    """What each stage leaves, and what its JSON holds."""
    pieces = [
        "Every stage has a folder in `out`, which appears whole or not at all. JSON is strict (no NaN), with the version of its form under "
        "`version`. More keys than these may stand in a file. Units are in brackets, `[-]` for a number without one; NRMSE is the root "
        "mean square error over the range of the measured channel.",
        table(("stage", "leaves"), [(s.name, ", ".join(f"`{name}`" for name in s.makes)) for s in STAGES]),
    ]
    for name, form in FORMS.items():
        pieces += [f"## {name}", f"Version {form.version} of its form.", *sections(form.model, level=3)]
    for file, arrays in ARRAYS.items():
        pieces += [f"## {file}", table(("array (`*`: a channel)", "what it is"), [(f"`{name}`", a.means) for name, a in arrays.items()])]
    return page("Artifacts", *pieces)


def data_checks() -> str:
    """Every data check, with its limits as they are for the bundled flight."""
    from awescli.stages.data_checks import quality_of

    bundled = Inputs(ROOT / "data" / "km1_demo", ROOT / "data" / "kites" / "km1_initial.yaml", Split())
    seen = {check.name: check for check in quality_of(bundled, bundled.log, bundled.flight).checks}
    pieces = [
        "`awes check` prints them; beyond the limit that stops, no stage fits anything unless the plan says `ignore: [name]`. Some limits "
        "grow with what the flight flies: the numbers are those of the bundled flight, which gives no occasion for some checks.",
    ]
    for title, names in (("Of the log", OF_LOG), ("Of the log against the declared kite", OF_KITE)):
        rows = []
        for name in names:
            if (c := seen.get(name)) is None:
                rows.append((name, "", "", "not on this flight", "The same for this surface as for the rudder."))
            else:
                unit = f" {c.unit}" if c.unit else ""
                stop = "-" if c.stop is None else f"{c.stop:.3g}"
                rows.append((name, f"{c.value:.3g}{unit}", f"{c.threshold:.3g}", stop, f"{c.sentence} {c.do}"))
        pieces += [f"## {title}", table(("check", "bundled flight", "warns", "stops", "what it means, and what to do"), rows)]
    return page("Data checks", *pieces)


def verdicts() -> str:
    """The six verdicts, the criteria they stand on, and the thresholds with their reasons."""
    rows = [(f"`{name}`", SENTENCES[name], "3, or 0 with `by_prediction`" if name == "not_testable" else 0) for name in verdict.VERDICTS]
    pieces = [
        "What they mean for you: [what a verdict means](../explanation/verdict.md).", table(("verdict", "says", "exit code"), rows),
        "## Which criteria make which verdict", text_of(verdict.verdict), "```python\n" + _body(verdict.verdict) + "\n```",
        "## Criteria", "One row of `criteria` in `effects.json` each, with value, threshold and whether it passed.",
        table(("criterion", "its value is", "where the threshold comes from"), criterion_rows()),
        "## Thresholds", text_of(criteria.Criteria), table(("name", "value", "reason"), thresholds()),
    ]  # fmt: skip
    return page("Verdicts and criteria", *pieces)


def _body(function: Callable) -> str:
    """A function's statements without its docstring."""
    tree = ast.parse(inspect.getsource(function)).body[0]
    return "\n".join(ast.unparse(node) for node in tree.body[1:])


def criterion_rows() -> list[tuple[str, str, str]]:
    """(name, what its value says, source) of every criterion that the verdict's table may hold, from the calls that make them."""
    found, said = [], {}
    for node in ast.walk(ast.parse(inspect.getsource(verdict))):
        if isinstance(node, ast.Assign) and isinstance(node.targets[0], ast.Name):
            said[node.targets[0].id] = node.value
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id == "Criterion":
            name, says, source = (node.args[i] for i in (0, 4, 5))
            says = said.get(says.id, says) if isinstance(says, ast.Name) else says
            found.append((f"`{_plain(name)}`", _plain(says), _plain(source)))
    return found


def _plain(node: ast.expr) -> str:
    """The text of a string in code; what is filled in while it runs is left out."""
    if isinstance(node, ast.JoinedStr):
        return "".join(str(v.value) if isinstance(v, ast.Constant) else "..." for v in node.values).replace("(...)", "").strip()
    return str(ast.literal_eval(node))


def thresholds() -> list[tuple[str, str, str]]:
    """(name, value, reason) of every threshold: the field and the text below it."""
    (cls,) = (n for n in ast.parse(inspect.getsource(criteria)).body if isinstance(n, ast.ClassDef))
    pairs = zip(cls.body, cls.body[1:], strict=False)
    return [
        (f"`{field.target.id}`", f"{getattr(criteria.CRITERIA, field.target.id):g}", inspect.cleandoc(_plain(reason.value)))
        for field, reason in pairs
        if isinstance(field, ast.AnnAssign) and isinstance(reason, ast.Expr)
    ]


def exit_codes() -> str:
    """What commands exit with."""
    codes = text_of(shell).partition("Exit codes: ")[2].rstrip(".").split("; ")
    rows = [(f"`{code}`", meaning) for code, _, meaning in (entry.strip().partition(" ") for entry in codes)]
    return page(
        "Exit codes", table(("code", "meaning"), rows),
        "An error says what is wrong, where (`stages.yaml:12: identify.horizon`) and what to do. Nothing is left half-written: after 2, 3 "
        "and 130 the artifacts of the run before stand as they were, or the new ones stand and say what failed.",
    )  # fmt: skip


def python() -> str:
    """What `awescli.__all__` names."""
    pieces = [text_of(awescli), "Settings of a stage are keyword arguments of its function: [stages](stages.md)."]
    functions = [n for n in awescli.__all__ if inspect.isfunction(getattr(awescli, n))]
    for name in [*functions, *(n for n in awescli.__all__ if n not in functions)]:
        thing = getattr(awescli, name)
        if name in functions:
            pieces += [f"## {name}", f"```python\n{signature(name, thing)}\n```", text_of(thing)]
        else:
            rows = [(f"`{n}{_call(member)}`", text_of(_function(member))) for n, member in public_members(thing)]
            pieces += [f"## {name}", text_of(thing), table(("member", "meaning"), rows)]
    return page("Python", *pieces)


def signature(name: str, function: Callable) -> str:
    """A call with one argument a line; types without the modules that they come from."""
    words = (re.sub(r"\b(?:[a-z_]+\.)+(?=[A-Z])", "", str(p)).replace("'", "") for p in inspect.signature(function).parameters.values())
    kinds = [p.kind for p in inspect.signature(function).parameters.values()]
    lines = [*words]
    if inspect.Parameter.VAR_POSITIONAL not in kinds and inspect.Parameter.KEYWORD_ONLY in kinds:
        lines.insert(kinds.index(inspect.Parameter.KEYWORD_ONLY), "*")
    back = inspect.signature(function).return_annotation
    return f"{name}(\n" + "".join(f"    {line},\n" for line in lines) + f") -> {getattr(back, '__name__', back)}"


def public_members(cls: type) -> list[tuple[str, Any]]:
    """(name, function or property) of what a public class offers, its own first, then what it inherits."""
    found: dict[str, Any] = {}
    for base in cls.__mro__:
        for name, member in vars(base).items():
            if not name.startswith("_") and base is not object and callable(_function(member)) and base.__module__.startswith("awescli"):
                found.setdefault(name, member)
    return list(found.items())


def _function(member: Any) -> Any:
    """The function behind a property, a cached one, a class method."""
    return getattr(member, "fget", None) or getattr(member, "func", None) or getattr(member, "__func__", member)


def _call(member: Any) -> str:
    """Its arguments, empty for a property."""
    if not inspect.isfunction(member):
        return ""
    parameters = list(inspect.signature(member).parameters)[1:]
    return f"({', '.join(parameters)})"


PAGES: dict[str, Callable[[], str]] = {
    p.__name__: p for p in (commands, stages, kite_file, flight_yaml, effects, artifacts, data_checks, verdicts, exit_codes, python)
}

if __name__ == "__main__":
    print(PAGES[sys.argv[1]]())
