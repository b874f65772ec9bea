"""What was called otherwise before is refused with its new name, at its place, and nothing else is."""

import pytest
from small_run import ROOT, make_small_run

from awescli.flightlog.flight_check import read_flight_file
from awescli.notation.errors import BadInput
from awescli.physics.declaration import read_kite
from awescli.stages import STAGES
from awescli.stages.plan import read_plan


def test_weights_by_range_were_called_seed(tmp_path):
    plan = make_small_run(tmp_path)
    with pytest.raises(BadInput, match=r"identify\.weights: 'seed' is called 'range' now\n  Write range\."):
        read_plan(plan, STAGES, {"identify.weights": "seed"})
    assert read_plan(plan, STAGES, {"identify.weights": "range"}).settings["identify"].weights == "range"
    with pytest.raises(BadInput, match="weights") as other:
        read_plan(plan, STAGES, {"identify.weights": "sand"})
    assert "called" not in str(other.value)


def test_the_law_of_the_thesis_was_called_seed(tmp_path):
    kite = tmp_path / "kite.yaml"
    text = (ROOT / "data" / "kites" / "development.yaml").read_text()
    assert "law: thesis" in text
    kite.write_text(text.replace("law: thesis", "law: seed"))
    with pytest.raises(BadInput, match=r"kite\.yaml:\d+: tether\.law: 'seed' is called 'thesis' now\n  Write thesis\."):
        read_kite(kite)


def test_a_key_that_has_another_name_now_is_refused_with_it(tmp_path):
    """In a plan, by --set, and in a flight.yaml."""
    (tmp_path / "stages.yaml").write_text("flight: f\nkite: k.yaml\nstages:\n  fit-controller:\n    prove: 30.0\n")
    with pytest.raises(
        BadInput, match=r"stages\.yaml:5: fit-controller\.prove: 'prove' is called 'closed_loop_time' now\n  Write closed_loop_time\."
    ):
        read_plan(tmp_path / "stages.yaml", STAGES)
    (tmp_path / "stages.yaml").write_text("flight: f\nkite: k.yaml\nstages: {fit-controller: {}}\n")
    with pytest.raises(BadInput, match="'prove' is called 'closed_loop_time' now"):
        read_plan(tmp_path / "stages.yaml", STAGES, {"fit-controller.prove": "30.0"})
    with pytest.raises(BadInput, match=r"believe: 'believe' is called 'unchecked' now"):
        read_flight_file(tmp_path / "flight.yaml", "time: {column: t, unit: s}\nsignals: {}\nbelieve: [load]\n")
