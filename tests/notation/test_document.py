"""read_document: a model, or an error with its place and its cure; never anything else."""

from pathlib import Path
from typing import Literal

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import BaseModel, ConfigDict, Field, model_validator

from awescli.notation.document import read_document
from awescli.notation.errors import BadInput, BadInputs
from awescli.notation.yaml_text import parse_yaml


class Strict(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid")


class Identify(Strict):
    horizon: float = Field(5.0, gt=0, description="seconds between re-initialisations")
    law: Literal["thesis", "exact"] = "thesis"
    weight: float | Literal["auto"] = "auto"
    start: dict[str, float] = {}
    hidden: tuple[int, ...] = (32, 32)
    lower: float = 0.0
    upper: float = 1.0

    @model_validator(mode="after")
    def _ordered(self):
        if self.lower > self.upper:
            raise ValueError(BadInput("lower is above upper", do="Swap them."))
        return self


class Stages(Strict):
    identify: Identify = Identify()
    fit_controller: Identify | None = Field(None, alias="fit-controller")


class Plan(Strict):
    flight: str
    kite: str = Field("kite.yaml", description="kite file")
    stages: Stages = Stages()


def read(text, **overrides):
    return read_document(Path("stages.yaml"), Plan, text, {k.replace("__", "."): v for k, v in overrides.items()}, ("stages",))


def errors(text, **overrides) -> list[BadInput]:
    with pytest.raises(BadInput) as caught:
        read(text, **overrides)
    return caught.value.errors if isinstance(caught.value, BadInputs) else [caught.value]


def test_good_document():
    plan = read("flight: km1 # comment\nstages:\n  identify: {horizon: 1e-1, start: {tether.stiffness: 200}, hidden: [8]}\n")
    assert (plan.flight, plan.stages.identify.horizon, plan.stages.identify.hidden) == ("km1", 0.1, (8,))
    assert plan.stages.identify.start == {"tether.stiffness": 200.0}


def test_all_mistakes_at_once_each_with_line_key_and_cure():
    found = errors("stages:\n  identify:\n    horizonn: 3\n    horizon: -1\n    law: exat\n    weight: much\n  fit-controler: {}\n")
    assert [(e.where, e.do) for e in found] == [
        ("stages.yaml:1: flight", "Add it: flight"),
        ("stages.yaml:4: identify.horizon", "Expected: horizon: seconds between re-initialisations (default 5.0)"),
        ("stages.yaml:5: identify.law", "Did you mean 'exact'?"),
        ("stages.yaml:6: identify.weight", "Expected: weight (default 'auto')"),
        ("stages.yaml:3: identify.horizonn", "Did you mean 'horizon'?"),
        ("stages.yaml:7: fit-controler", "Did you mean 'fit-controller'?"),
    ]
    assert found[1].what == "must be greater than 0, got -1"
    assert found[3].what == "must be a valid number, got 'much' or must be 'auto', got 'much'"


def test_a_validator_gives_its_own_cure():
    (error,) = errors("flight: a\nstages:\n  identify:\n    {lower: 2, upper: 1}\n")
    assert (error.where, error.what, error.do) == ("stages.yaml:3: identify", "lower is above upper", "Swap them.")


def test_overrides_replace_and_are_named_in_errors():
    text = "flight: a\nstages: {identify: {horizon: 5, hidden: [1, 2]}}"
    plan = read(text, identify__horizon="4.0", stages__identify__law="exact", kite="b.yaml", identify__hidden__1="7")
    assert (plan.kite, plan.stages.identify.horizon, plan.stages.identify.law) == ("b.yaml", 4.0, "exact")
    assert plan.stages.identify.hidden == (1, 7)
    assert read(text, identify__start__tether__stiffness="3").stages.identify.start == {"tether.stiffness": 3.0}
    assert read(text, identify__hidden="[4]").stages.identify.hidden == (4,)
    assert [e.where for e in errors(text, identify__horizon="x")] == ["--set identify.horizon"]
    (error,) = errors(text, identify__horizonn="5")
    assert (error.where, error.do) == ("--set identify.horizonn", "Did you mean 'horizon'?")
    (error,) = errors(text, identfy__horizon="5")
    assert error.do == "Did you mean 'identify'?"
    assert errors(text, flight__name="5")[0].where == "--set flight.name"
    assert errors(text, identify__hidden__9="5")[0].where == "--set identify.hidden.9"
    assert errors(text, kite="[")[0].where == "--set kite"


@pytest.mark.parametrize(
    "text, line, what",
    [
        ("flight: a\nflight: b", 2, "appears twice"),
        ("a:\n\t- b", 2, "'\\t'"),
        ("flight: !!python/object/apply:os.system [ls]", 1, "tag"),
        ("flight: &a [*a]", 1, "unknown alias"),
        ("flight: 'a\nb: c", 2, "not readable as YAML"),
        ("a: 1\n---\nb: 2", 2, "second document"),
        ("a: \x00", 1, "not allowed"),
        ('a: "\\ud800"', 1, "unprintable"),
        ("a: 1e999", 1, "too large"),
        ("a: .nan", 1, "not a number"),
        (f"a: {'9' * 5000}", 1, "too many digits"),
        ("\n<<: {a: b}", 2, "merge"),
        ("[" * 100_000, 1, "nested deeper"),
        ("a:\n" + "\n".join(f"{' ' * i}a:" for i in range(1, 60)), 26, "nested deeper"),
        ("- 1", 1, "expected a mapping"),
        ("? [a]\n: b", 1, "key must be plain text"),
    ],
)
def test_bad_yaml(text, line, what):
    (error,) = errors(text)
    assert error.where.startswith(f"stages.yaml:{line}") and what in str(error)


def test_billion_laughs():
    levels = "".join(f"l{i + 1}: &l{i + 1} [{', '.join([f'*l{i}'] * 10)}]\n" for i in range(30))
    (error,) = errors("l0: &l0 [x]\n" + levels)
    assert "aliases" in error.what


def test_aliases_are_copies():
    assert parse_yaml("a: &x {b: 1}\nc: *x", "f").data == {"a": {"b": 1}, "c": {"b": 1}}


def test_scalars_are_of_yaml_1_2():
    text = "[1e-3, 0x10, .5, 1_000, no, 12:30, ~, null, true, '1', -.inf, +3, 007]"
    assert parse_yaml(text, "f").data == [0.001, 16, 0.5, "1_000", "no", "12:30", None, None, True, "1", -float("inf"), 3, 7.0]


def test_files_that_are_no_documents(tmp_path):
    def where(path):
        with pytest.raises(BadInput) as caught:
            read_document(path, Plan)
        return caught.value.where, caught.value.what

    assert where(tmp_path / "none.yaml") == (str(tmp_path / "none.yaml"), "there is no such file")
    assert "folder" in where(tmp_path)[1]
    (tmp_path / "latin.yaml").write_bytes("flight: a\nkite: für".encode("latin-1"))
    assert where(tmp_path / "latin.yaml") == (f"{tmp_path / 'latin.yaml'}:2", "not UTF-8 text")
    (tmp_path / "large.yaml").write_text("a: b\n" * 200_000)
    assert "too many" in where(tmp_path / "large.yaml")[1]
    (tmp_path / "empty.yaml").write_text("")
    assert "found nothing" in where(tmp_path / "empty.yaml")[1]
    assert "cannot be read" in where(Path("a\0b"))[1]
    (tmp_path / "bom.yaml").write_bytes(b"\xef\xbb\xbfflight: a\n")
    assert read_document(tmp_path / "bom.yaml", Plan).flight == "a"


yaml_like = st.lists(
    st.sampled_from(
        ["flight", "kite", "stages", "identify", "horizon", "hidden", ": ", "\n", "  ", "\t", "- ", "[", "]", "{", "}", "&a ", "*a"]
        + ["!!str ", "!", "|", ">", "'", '"', "\\U", "#", "%YAML", "---", "...", "? ", "1e9", "-1", ".nan", "0x", "~", ",", "\ufeff"]
        + ["<<", "@", "`"]
    ),
    max_size=30,
).map("".join)


def a_model_or_bad_input(text, overrides):
    try:
        plan = read_document(Path("stages.yaml"), Plan, text, overrides, ("stages",))
    except BadInput as e:
        assert "stages.yaml" in str(e) or "--set" in str(e)
        str(e).encode()
    else:
        assert isinstance(plan, Plan)


@given(st.one_of(st.text(), yaml_like), st.dictionaries(st.one_of(st.just("identify.horizon"), st.text()), st.text(), max_size=2))
def test_any_text_gives_a_model_or_bad_input(text, overrides):
    a_model_or_bad_input(text, overrides)


plain = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5),
    lambda inner: st.lists(inner, max_size=3)
    | st.dictionaries(st.sampled_from(["flight", "stages", "identify", "start", "horizon", "hidden", "x"]), inner, max_size=4),
    max_leaves=12,
)


@given(plain)
def test_any_data_gives_a_model_or_bad_input(data):
    import yaml

    a_model_or_bad_input(yaml.safe_dump(data), {})
