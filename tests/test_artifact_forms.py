"""JSON artifacts of an older awes, or edited by hand, are named with the command that makes them again; none is a fault of awes."""

import json
import shutil

import numpy as np
import pytest
from fuzz_kinds import run_subject

from awescli.artifacts import read_arrays, read_json, write_arrays, write_json
from awescli.artifacts.form_check import undescribed
from awescli.artifacts.forms import ARRAYS, FORMS
from awescli.notation.errors import BadInput

PARAMS = {
    "parameters": {
        "m": {"value": 1.0, "std": 0.1, "unit": "kg", "prior": 1.0, "prior_std": 0.2, "shift_in_prior_std": 0.0, "excited": True,
              "at_bound": False, "partners": [], "advice": None},
    },
    "more": [1, 2],
}  # fmt: skip


def test_a_form_has_a_version_that_readers_do_not_see(tmp_path):
    write_json(tmp_path / "identify" / "params.json", PARAMS)
    assert json.loads((tmp_path / "identify" / "params.json").read_text())["version"] == FORMS["params.json"].version
    assert read_json(tmp_path / "identify" / "params.json") == PARAMS
    write_json(tmp_path / "other.json", {"a": 1})
    assert json.loads((tmp_path / "other.json").read_text()) == {"a": 1}


@pytest.mark.parametrize(
    "content, says",
    [
        ([], "a list instead of a mapping"),
        (True, "a truth value instead of a mapping"),
        (None, "nothing instead of a mapping"),
        (PARAMS, "written by an older awes"),
        ({"version": 1, **PARAMS}, "written by an older awes"),
        ({"version": 99, **PARAMS}, "written by a newer or another awes"),
        ({"version": 2}, "parameters is missing"),
        ({"version": 2, "parameters": {"m": {**PARAMS["parameters"]["m"], "std": "0.1"}}}, "m.std should be a valid number, is text"),
        ({"version": 2, "parameters": {"m": {**PARAMS["parameters"]["m"], "std": -1.0}}}, "parameters.m.std"),
        ({"version": 2, "parameters": {"m": {**PARAMS["parameters"]["m"], "prior_std": 0.0}}}, "parameters.m.prior_std"),
        ({"version": 2, "parameters": [1]}, "parameters should be a valid dictionary, is a list"),
    ],
)  # fmt: skip
def test_what_is_not_of_todays_form_is_named(tmp_path, content, says):
    """`[]`, `true` and artifacts of 0.1 used to end in a fault of awes."""
    file = tmp_path / "identify" / "params.json"
    file.parent.mkdir()
    file.write_text(json.dumps(content))
    with pytest.raises(BadInput) as caught:
        read_json(file)
    assert says in caught.value.what and str(file) in caught.value.where and "awes identify --force" in caught.value.do
    assert read_json(file, any_form=True) == (
        {k: v for k, v in content.items() if k != "version"} if isinstance(content, dict) else content
    )


@pytest.mark.parametrize(
    "arrays, says",
    [
        ({"time": np.arange(5.0)}, "'correction' is missing"),
        ({"time": np.arange(5.0), "correction": np.ones(5)}, "'correction' has 1 axes"),
        ({"time": np.arange(5.0), "correction": np.ones((4, 6))}, "'correction' has the shape (4, 6)"),
        ({"time": np.arange(5.0), "correction": np.full((5, 6), "x")}, "of type"),
    ],
)
def test_arrays_that_do_not_fit_each_other_are_named(tmp_path, arrays, says):
    write_arrays(tmp_path / "train-hybrid" / "correction.npz", arrays)
    with pytest.raises(BadInput) as caught:
        read_arrays(tmp_path / "train-hybrid" / "correction.npz")
    assert says in caught.value.what and "awes train-hybrid --force" in caught.value.do


@pytest.mark.slow
def test_edited_artifacts_are_refused_or_do_not_matter(small_run, tmp_path):
    """The campaign benchmarks/fuzz_kinds.py, small: through verify, compare, the decision to run, the models and the page."""
    found = run_subject("artifacts", 0.05, 7, shutil.copytree(small_run, tmp_path / "run"), lambda line: None)
    bad = [(kind, j) for kind, judged in found.items() for j in judged if j.outcome == "fault"]
    assert not bad and sum(len(judged) for judged in found.values()) > 10


def test_mistakes_in_kite_files_are_told(tmp_path):
    found = run_subject("declared", 0.1, 7, tmp_path, lambda line: None)
    cases = [j for judged in found.values() for j in judged]
    assert not [j for j in cases if j.outcome == "fault"]
    # the sign of most coefficients is a matter of convention, and a factor of ten of a mass may be true
    unnoticed = {kind for kind, judged in found.items() if any(j.outcome == "unnoticed" for j in judged)}
    assert unnoticed <= {"sign of a coefficient that may have either", "a mass or inertia in other units (x 1e-9 to 1e9)"}


def test_damaged_objects_are_not_run(tmp_path, monkeypatch):
    monkeypatch.setenv("AWES_CACHE", str(tmp_path))  # put back afterwards
    found = run_subject("cache", 0.1, 7, tmp_path, lambda line: None)
    assert {j.outcome for judged in found.values() for j in judged} <= {"repaired", "refused"}


def test_a_run_of_the_first_version_can_be_compared_and_is_run_again(tmp_path, monkeypatch):
    """Its provenance has no version and is read nevertheless: code and versions have changed, so all is run again."""
    from stages.dummy_stages import DUMMIES, make_folder

    from awescli.stages.comparison import compare
    from awescli.stages.plan import read_plan
    from awescli.stages.runner import run_plan

    plan = read_plan(make_folder(tmp_path), DUMMIES)
    run_plan(plan, DUMMIES)
    for file in plan.out.glob("*/*.json"):
        content = json.loads(file.read_text())
        content.pop("version", None)
        if file.name == "provenance.json":
            content["stamp"]["code"] = "of the first version"
        file.write_text(json.dumps(content))
    assert compare(plan.out, plan.out, DUMMIES).same > 0
    assert {r.reason for r in run_plan(plan, DUMMIES, dry_run=True)} == {
        "code changed", "upstream identify ran", "upstream identify, trace-residual ran",
    }  # fmt: skip


def fields_of(schema: dict):
    """(place, schema) of every field of a form and of the models inside it."""
    for name, inner in {"": schema, **schema.get("$defs", {})}.items():
        yield from ((f"{name}.{key}", field) for key, field in inner.get("properties", {}).items())


def holds_numbers(field: dict) -> bool:
    """Whether a value of a field is, or directly holds, a number with a unit (counts have none)."""
    inner = [field.get("items"), field.get("additionalProperties"), *field.get("anyOf", ())]
    return field.get("type") == "number" or any(holds_numbers(part) for part in inner if isinstance(part, dict))


@pytest.mark.parametrize("file", FORMS)
def test_every_field_says_what_it_means_and_every_number_its_unit(file):
    """Fields were listed in the reference by name and type alone."""
    schema = FORMS[file].model.model_json_schema(by_alias=True)
    fields = dict(fields_of(schema))
    assert fields
    assert [place for place, field in fields.items() if len(field.get("description", "")) < 8] == []
    assert [place for place, field in fields.items() if holds_numbers(field) and "[" not in field["description"]] == []
    assert [name for name, inner in schema.get("$defs", {}).items() if not inner.get("description")] == []


@pytest.mark.slow
def test_a_run_leaves_no_key_that_no_form_describes(small_run):
    """125 keys stood in no form, so that the reference did not know them."""
    out = small_run / "out"
    described, unknown = set(), []
    for file in sorted(out.glob("*/*.json")):
        form = FORMS.get(f"{file.parent.name}/{file.name}") or FORMS[file.name]
        unknown += [f"{file.parent.name}/{file.name}: {key}" for key in undescribed(form.model.model_validate(read_json(file)))]
        described.add(file.parent.name)
    for file in sorted(out.glob("*/*.npz")):
        known = ARRAYS[file.name]
        unknown += [
            f"{file.name}: {name}" for name in read_arrays(file)
            if name not in known and not any(key.endswith("*") and name.startswith(key[:-1]) for key in known)
        ]  # fmt: skip
    assert unknown == [] and len(described) == 6


def test_a_key_of_no_form_is_seen():
    """Guards the test above: a key in a list of mappings of a mapping counts."""
    row = {"constraint": "a <= b", "active": True, "cost_per_unit": 0.0, "colour": 1}
    form = FORMS["params.json"].model.model_validate({"parameters": {}, "constraints": [row], "mood": 2})
    assert [*undescribed(form)] == ["mood", "constraints.0.colour"]


FIT = {
    "outcome": "converged", "chi2": 1.0, "method": "filter error", "surfaces": "recorded", "horizon_s": 5.0, "outputs": ["p_n"],
    "nrmse": {part: {"p_n": 0.1, "mean": 0.1} for part in ("train", "validation", "test")}, "processes": {}, "noise_factors": {},
    "kkt_residual": 0.1,
}  # fmt: skip


@pytest.mark.parametrize("name, content, key, says", [
    ("metrics.json", FIT, "outcome", "outcome is missing"),
    ("metrics.json", FIT, "chi2", "chi2 is missing"),
    ("metrics.json", FIT, "kkt_residual", "kkt_residual_ is no key of it (did you mean 'kkt_residual'?)"),
    ("params.json", PARAMS["parameters"]["m"], "advice", "parameters.m.advice_ is no key of it (did you mean 'advice'?)"),
    ("params.json", {"m": PARAMS["parameters"]["m"]}, "m", "'m' is only in one of parameters and correlation.names"),
])  # fmt: skip
def test_a_misspelt_key_is_refused_by_name(tmp_path, name, content, key, says):
    """Defaults took the place of what stood under the misspelt key, and the report went on without it."""
    file = tmp_path / "identify" / name
    correlation = {"correlation": {"names": ["m"], "matrix": [[1.0]]}}

    def whole(inside):
        if content is FIT:
            return inside
        return {"parameters": inside if "m" in content else {"m": inside}, **correlation}

    def renamed(inside):
        return {f"{k}_" if k == key else k: v for k, v in inside.items()}

    write_json(file, whole(content))
    assert read_json(file) == whole(content)
    write_json(file, whole(renamed(content)))
    with pytest.raises(BadInput, match="awes identify --force") as caught:
        read_json(file)
    if key == "m":
        says = "is only in one of parameters and correlation.names"
    assert says in caught.value.what


def test_every_array_says_what_it_is():
    assert all("[" in array.means for arrays in ARRAYS.values() for array in arrays.values())
    assert {file: [n for n, a in arrays.items() if not a.axes] for file, arrays in ARRAYS.items()} == {file: [] for file in ARRAYS}
