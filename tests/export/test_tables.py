"""What stands in the tables of an export: names, units, values, intervals; coefficients in the ways of awebox and KiteModels.jl."""

import ctypes
import json
import math
import shutil
from dataclasses import replace

import numpy as np
import pytest
from export.flying import compiled, put
from export.models import CASES, free, on_file, with_controller, with_network, with_states

from awescli.export import EXPORTERS, exported
from awescli.export.awebox import awebox_files
from awescli.export.c_code import _names, c_files
from awescli.export.json_tables import tables
from awescli.export.kitemodels import AIRSPEED, curves, kitemodels_files
from awescli.export.model import ExportedModel
from awescli.export.words import Signal
from awescli.notation.document import open_document
from awescli.notation.errors import BadInput
from awescli.notation.quantities import SURFACES
from awescli.physics.effects.aerodynamics import body_axes


def coefficients(model: ExportedModel, V: float, alpha: float, beta: float, rates=(0.0, 0.0, 0.0), **held: float):
    """The model's own coefficients in still air, by the physics itself."""
    kite = model.kite
    air = (V * math.cos(alpha) * math.cos(beta), V * math.sin(beta), V * math.sin(alpha) * math.cos(beta))
    x = [150.0, 0.0, -100.0, *air, 0.0, 0.0, 0.0, *rates, *(held.get(n, 0.0) for n in SURFACES)]
    u = [{"density": 1.2, "tether_length": 180.0}.get(n, 0.0) for n in kite.input_names]
    return kite.instant(x, u, [float(v) for v in kite.parameters.vector()]).coefficients


@pytest.mark.parametrize("case", CASES)
def test_json_says_unit_source_and_value_of_everything(case):
    model = CASES[case]().model
    told = json.loads(exported(model, "json")[f"{model.identifier}.json"], parse_constant=pytest.fail)
    values = {p.name: p.value for p in model.kite.parameters.rows}
    for p in told["parameters"]:
        assert p["value"] == values[p["name"]] and isinstance(p["unit"], str) and p["source"], p
    assert all(s["unit"] and s["words"] for kind in ("states", "inputs", "outputs", "set_points") for s in told[kind])
    assert (told["controller"] is not None) == (model.controller is not None) and (told["network"] is not None) == ("network" in case)


def test_intervals_of_a_fit_reach_the_tables():
    fitted = {"m": {"std": 0.5, "interval": [24.0, 26.0]}}
    model = replace(with_states().model, fitted=fitted)
    rows = {p["name"]: p for p in tables(model)["parameters"]}
    assert rows["m"]["std"] == 0.5 and rows["m"]["interval_95"] == [24.0, 26.0] and rows["Jx"]["interval_95"] is None
    assert "95 % in [24, 26]" in next(line for line in c_files(model)[f"{model.identifier}.c"].splitlines() if ": m [kg]" in line)


@pytest.mark.skipif(shutil.which("gcc") is None, reason="no gcc on this machine")
@pytest.mark.parametrize("case", [with_states, with_network, free], ids=lambda f: f.__name__)
def test_the_tables_of_c_say_what_the_model_says(case, tmp_path):
    """Read back from the compiled file: a unit of two words (kg m2) is one string, whatever stands before it."""
    model = case().model
    library = compiled(put(tmp_path, c_files(model)))
    signals = {"state": model.states, "set_point": model.set_points, "input": model.inputs, "parameter": model.parameters}
    for kind, rows in (signals | {"output": model.outputs}).items():
        for what, wanted in (("names", [s.name for s in rows]), ("units", [s.unit for s in rows])):
            table = (ctypes.c_char_p * len(rows)).in_dll(library, f"{model.identifier}_{kind}_{what}")
            assert [text.decode() for text in table] == wanted
    values = (ctypes.c_double * len(model.parameters)).in_dll(library, f"{model.identifier}_parameters")
    assert list(values) == [s.value for s in model.parameters]


@pytest.mark.parametrize("before", range(0, 60, 3))
def test_a_unit_of_two_words_is_never_broken(before):
    """C knows no string over two lines."""
    text = _names("kite", "parameter", [Signal("a", "m", "")] * before + [Signal("Jx", "kg m2", "")] * 9)
    assert text.count('"kg m2"') == 9 and all(line.count('"') % 2 == 0 for line in text.splitlines())


@pytest.mark.parametrize("name, flaps", [("km1_initial", 0.0), ("km1_initial", 0.1), ("ap2", 0.0)])
def test_awebox_sums_the_same_coefficients(name, flaps):
    """Its sum over inputs x (c0 + c1 alpha + ...), with what is not carried beside it, at 50 random instants.

    awebox's own axes are aft, right, up: in the frame `wind` its p and r are minus ours (kite_dir/stability_derivatives.py: get_p_q_r).
    """
    model, random = on_file(name, flaps=flaps), np.random.default_rng(0)
    scope: dict = {"__name__": "kite"}
    exec(awebox_files(model)[f"{model.identifier}_awebox.py"], scope)
    derivatives, _ = scope["aero"]()
    geometry, frame, surfaces = scope["geometry"](), derivatives.pop("frame"), model.declaration.surfaces
    ours = {"CD": "CD", "CS": "CY", "CL": "CL"} if frame["force"] == "wind" else {}
    signed = {n: surfaces[n].sign if n in surfaces else 1 for n in SURFACES}
    left = {k: v for k, v in scope["NOT_CARRIED"].items() if ":" in k and k.split(":")[0] in (*"CL CD CY CX CZ Cl Cm Cn".split(),)}
    for _ in range(50):
        V, alpha, beta = random.uniform(20, 50), random.uniform(-0.1, 0.2), random.uniform(-0.2, 0.2)
        rates = random.uniform(-1, 1, 3)
        held = dict(zip(("aileron", "elevator", "rudder"), random.uniform(-0.2, 0.2, 3), strict=True)) | {"flaps": flaps}
        of = coefficients(model, V, alpha, beta, rates, **held)._asdict()
        of |= dict(zip(("CX", "CY", "CZ"), body_axes(of["CD"], of["CY"], of["CL"], alpha, beta), strict=True)) if not ours else {}
        turned = -1.0 if frame["force"] == "wind" else 1.0
        b, c = geometry["b_ref"], geometry["c_ref"]
        p, q, r = (w * length / (2 * V) for w, length in zip(rates, (b, c, b), strict=True))
        d = {n: signed[n] * v for n, v in held.items()}
        given = {
            "0": 1.0, "alpha": alpha, "beta": beta, "p": turned * p, "q": q, "r": turned * r,
            "deltaa": d["aileron"], "deltae": d["elevator"], "deltar": d["rudder"],
        }  # fmt: skip
        scope_of_terms = {"alpha": alpha, "beta": beta, "abs": abs, "p_hat": p, "q_hat": q, "r_hat": r, **d}
        for coefficient, inputs in derivatives.items():
            theirs = sum(given[n] * sum(k * alpha**i for i, k in enumerate(stack)) for n, stack in inputs.items())
            own = ours.get(coefficient, coefficient)
            beside = sum(v * eval(k.split(":")[1].replace("^", "**"), scope_of_terms) for k, v in left.items() if k.split(":")[0] == own)
            assert theirs + beside == pytest.approx(of[own], rel=1e-9, abs=1e-12), coefficient


def test_awebox_gets_every_number_that_it_knows(tmp_path):
    """set_options sets mass, span, attachment and wind, on whatever takes keys."""
    model, options, scope = on_file("km1_initial"), {}, {"__name__": "kite"}
    exec(awebox_files(model)["km1_initial_awebox.py"], scope)
    scope["set_options"](options)
    geometry = options["user_options.kite_standard"]["geometry"]
    values = {p.name: p.value for p in model.kite.parameters.rows}
    assert (geometry["m_k"], geometry["b_ref"], geometry["s_ref"]) == (values["m"], values["b"], values["S"])
    Jxz = values["Jxz"]
    assert geometry["j"] == pytest.approx(np.array([[values["Jx"], 0, -Jxz], [0, values["Jy"], 0], [-Jxz, 0, values["Jz"]]]))
    assert geometry["r_tether"].ravel() == pytest.approx([-values["rtx"], values["rty"], -values["rtz"]])
    assert options["user_options.trajectory.fixed_params"]["diam_t"] == values["d_t"]
    assert {"k_v", "c_v", "dl"} <= set(scope["NOT_CARRIED"])


def test_kitemodels_has_lift_and_drag_of_the_physics(tmp_path):
    model = on_file("km1_initial")
    file = tmp_path / "settings.yaml"
    file.write_text(kitemodels_files(model)["settings_km1_initial.yaml"])
    told = open_document(file).data
    values = {p.name: p.value for p in model.kite.parameters.rows}
    assert (told["kite"]["mass"], told["kite"]["area"], told["tether"]["d_tether"]) == (values["m"], values["S"], 1000 * values["d_t"])
    for alpha, CL, CD in zip(*(told["kite"][k] for k in ("alpha_cl", "cl_list", "cd_list")), strict=True):
        found = coefficients(model, AIRSPEED, math.radians(alpha), 0.0)
        assert (CL, CD) == (pytest.approx(found.CL, rel=1e-4, abs=1e-5), pytest.approx(found.CD, rel=1e-4, abs=1e-5))
    exact = curves(model, [0.05])
    assert exact["CL"][0] == pytest.approx(coefficients(model, AIRSPEED, 0.05, 0.0).CL, rel=1e-12)


@pytest.mark.parametrize("form", ["awebox", "kitemodels"])
def test_a_kite_without_a_line_is_refused_by_name(form):
    with pytest.raises(BadInput, match="this one has no line") as refused:
        exported(free().model, form)
    assert refused.value.where == f"--to {form}"


@pytest.mark.parametrize("form", EXPORTERS)
def test_the_same_model_makes_the_same_bytes(form):
    model = with_controller().model
    assert exported(model, form) == exported(replace(model), form)
