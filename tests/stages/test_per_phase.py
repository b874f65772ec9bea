"""identify with values of their own in the phases of a cycle: found again from a flight through all phases, handed on, and flown."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from flightlog.synthetic import write_folder
from kites import DEVELOPMENT, flight
from pumped import DRUM, DT, HEIGHTS, LENGTH, PHASES, start, wind

from awescli.artifacts import read_json
from awescli.export.words import input_signal
from awescli.learning.correction import HybridKite
from awescli.notation.errors import BadInput, BadInputs
from awescli.physics.declaration import KiteDeclaration, kite_text, read_kite
from awescli.physics.kite import Kite
from awescli.simulation.pumping import Pumping, in_phase, with_winch
from awescli.simulation.rollout import inputs_of
from awescli.simulation.switching import Guard
from awescli.simulation.synthetic import as_recorded
from awescli.stages import STAGES
from awescli.stages.plan import read_plan
from awescli.stages.runner import run_plan

OWN = {"CD0": (0.0884, 0.115), "sideslip_drag.k": (1.0, 2.0)}
"""Parameter -> its value in traction, and in retraction."""
PLAN = """
flight: flight
kite: kite.yaml
out: out
split: {of: cycles}
stages:
  identify: {horizon: 2.5, curriculum: [], per_phase: [CD0, "sideslip_drag.*"]}
  trace-residual: {}
  evaluate: {report: false, wind_profile: false, horizons: [1.0]}
"""


def declared(values: dict[str, float], free=()) -> KiteDeclaration:
    """The development kite with `sideslip_drag`, these values (rows are added where they are new), and only `free` ones free."""
    kite = DEVELOPMENT.model_copy(update={"effects": (*DEVELOPMENT.effects[:-1], "sideslip_drag", DEVELOPMENT.effects[-1])})
    rows = {n: r.model_copy(update={"free": n in free}) for n, r in kite.parameters.items()}
    for name, value in values.items():
        row = rows.get(name, rows.get(name.partition(":")[0], rows["CD0"])).model_dump() | {"value": value, "lower": None, "upper": None}
        rows[name] = rows["CD0"].__class__(**row | {"free": name in free, "std": 0.5 * abs(value) or 1.0})
    return kite.model_copy(update={"parameters": rows})


TRUTH = declared({f"{n}{phase}": v for n, both in OWN.items() for phase, v in zip(("", ":retraction"), both, strict=True)})


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A plan, and a noisy flight of four cycles of a kite that drags otherwise in retraction."""
    path = tmp_path_factory.mktemp("per_phase")
    legs = (replace(PHASES[0], guards=(Guard("tether_length", 340.0, True),)), *PHASES[1:])
    how = {"start": start(), "length": LENGTH, "duration": 400.0, "dt": DT, "cycles": 4, "load": 2000.0}
    pumped = Pumping.of(Kite(with_winch(TRUTH, DRUM), HEIGHTS), legs).fly(wind(10.0), **how)
    assert pumped.done == 4
    # the last transition is too short to show, without a traction behind it
    flown = as_recorded(pumped.flown, TRUTH, wind(10.0), seed=1).between(0, pumped.switches[-1].sample)
    write_folder(path / "flight", flown)
    guess = {"CD0": 0.1, "sideslip_drag.k": 1.3}
    (path / "kite.yaml").write_text(kite_text(declared(guess, (*guess, "CLa", "dl", "CtD"))))
    (path / "stages.yaml").write_text(PLAN)
    return path


def run(folder, out, stage, **overrides):
    plan = read_plan(folder / "stages.yaml", STAGES, {"out": str(folder / out), **overrides})
    run_plan(plan, STAGES, only=[stage])
    return folder / out / stage


def test_values_of_both_phases_are_found_again(folder):
    """Guards `per_phase` from the plan to params.json, kite.yaml and what flies: a coefficient and an effect's parameter come back in each
    phase, each within its interval and well apart; one value for both cannot fit; evaluate reads them from the kite file."""
    made = run(folder, "own", "identify")
    rows = read_json(made / "params.json")["parameters"]
    assert {n: r["phase"] for n, r in rows.items() if "phase" in r} == {
        f"{n}{own}": phase for n in OWN for own, phase in (("", "traction"), (":retraction", "retraction"))
    }
    for name, (pull, back) in OWN.items():
        first, second = rows[name], rows[f"{name}:retraction"]
        for row, truth in ((first, pull), (second, back)):
            assert abs(row["value"] - truth) < 4 * row["std"] and row["excited"], (name, row["value"], row["std"])
        assert second["value"] - first["value"] > 6 * np.hypot(first["std"], second["std"]), name
    kite = read_kite(made / "kite.yaml")
    assert kite.parameters["CD0:retraction"].value == rows["CD0:retraction"]["value"] and kite.parameters["CD0:retraction"].free
    pulling, reeling = (in_phase(Kite(kite), phase).parameters["CD0"].value for phase in ("traction", "retraction"))
    assert (pulling, reeling) == (rows["CD0"]["value"], rows["CD0:retraction"]["value"])
    shared = run(folder, "shared", "identify", **{"identify.per_phase": "[]"})
    own, one = (read_json(f / "metrics.json") for f in (made, shared))
    # what is left beside the noise: the log tells changes of phase to some seconds only
    assert one["chi2"] > 2 * own["chi2"] and own["chi2"] == pytest.approx(1.0, abs=0.03)
    assert own["nrmse"]["test"]["mean"] < min(1.5 * own["noise_floor"]["mean"], 0.8 * one["nrmse"]["test"]["mean"])
    scored = read_json(run(folder, "own", "evaluate") / "metrics.json")
    found = read_json(run(folder, "own", "trace-residual", **{"trace-residual.candidates": "[air_density]"}) / "params.json")
    assert found["parameters"]["CD0:retraction"]["phase"] == "retraction"
    phases = {row["phase"]: abs(row["predicted_J"] / row["measured_J"] - 1) for row in scored["identified"]["power"]["by_phase"]}
    assert max(phases.values()) < 0.02, phases


def test_an_instant_counts_what_its_phase_says():
    """Guards the formula: with the input at 0, 1 and 1/2 an instant has the value of traction, of the phase, and the mean; a phase in which
    nothing is declared is as traction; a kite without such values has no such input."""
    kite = Kite(TRUTH, HEIGHTS)
    x = [210.0, 40.0, -160.0, 38.0, 1.5, 4.0, -0.5, 0.15, 1.4, 0.1, 0.25, -0.5, *np.zeros(5)]
    inputs = dict.fromkeys(kite.input_names, 0.0) | {"density": 1.2, "tether_length": 266.0}
    c = [float(v) for v in kite.parameters.vector()]
    seen = [kite.instant(x, list((inputs | {"phase_retraction": w}).values()), c).values["CD0"] for w in (0.0, 1.0, 0.5)]
    assert seen == pytest.approx([0.0884, 0.115, (0.0884 + 0.115) / 2])
    assert "phase_transition" not in kite.input_names and not [n for n in Kite(DEVELOPMENT).input_names if n.startswith("phase_")]
    assert input_signal("phase_retraction", HEIGHTS, 0.0).words.startswith("1 in retraction")
    assert in_phase(kite, "transition").parameters["CD0"].value == 0.0884


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        ({"split.of": "loops"}, "what is fitted of the flight 'flight' is traction alone"),
        ({"identify.per_phase": "[CDO]"}, "no free parameter is called 'CDO'"),
        ({"split.of": "turns"}, "cycles"),
    ],
)
def test_what_has_no_phases_is_refused(folder, settings, words):
    """Guards the messages: one phase alone, no such parameter, no such pieces."""
    with pytest.raises((BadInput, BadInputs), match=words):
        run(folder, "refused", "identify", **settings)
    assert not (folder / "refused" / "identify").exists()


@pytest.mark.parametrize(("name", "words"), [("CD0:reel_in", "'reel_in'"), ("CX0:retraction", "'CX0', which this kite does not have")])
def test_a_kite_file_says_no_other_phase(tmp_path, name, words):
    """Guards kite files: a phase that no cycle has, and the value of a parameter that is not there."""
    row = DEVELOPMENT.parameters["CD0"]
    kite = DEVELOPMENT.model_copy(update={"parameters": {**DEVELOPMENT.parameters, name: row}})
    (tmp_path / "kite.yaml").write_text(kite_text(kite))
    with pytest.raises(BadInput, match=words):
        read_kite(tmp_path / "kite.yaml")


def test_a_network_beside_it_leaves_its_phases():
    """Guards hybrids of such a kite: inputs of phases come to it as to the kite alone."""
    log = flight(seed=1).log
    kite = Kite(TRUTH, log.wind.height)
    hybrid = HybridKite(kite, SimpleNamespace(weights=np.zeros(1), inputs=("alpha",)))
    assert hybrid.own_in_phase == kite.own_in_phase and np.array_equal(inputs_of(log, hybrid), inputs_of(log, kite))
