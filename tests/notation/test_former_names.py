"""What was called otherwise before is refused with its new name, at its place, and nothing else is."""

import pytest
from small_run import ROOT, make_small_run

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
