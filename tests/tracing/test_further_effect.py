"""A further effect that gains too little for a name is told; one that is not there is not."""

import pytest
from tracing.traced import traced

from awescli.artifacts.forms.effects import Effects

DRAG = {"sideslip_drag": {"k": 2.5}}


@pytest.mark.parametrize("heading", [0.0, 0.001])
def test_a_further_effect_that_gets_no_name_is_told(heading):
    """Guards an answer that lacks one of two effects and looked as complete as any: a heading that is a twentieth of a degree off
    gains a fifteenth of what a drag does, and the form of the drag may leave as much."""
    told, finding = traced(DRAG | ({"heading_bias": {"b": heading}} if heading else {}), 33)
    assert told["verdict"] == "found" and [e["name"] for e in told["effects"]] == ["sideslip_drag"]
    further = told["unnamed"]
    assert (further is not None) == bool(heading), further
    if further:
        assert further["name"] == "heading_bias" and further["gain"] == finding.evidence.search.passed_over
        assert 10 < further["gain"] < 0.1 * finding.evidence.search.gains["sideslip_drag"]
        assert "heading_bias (" in further["sentence"] and "sideslip_drag gains" in further["sentence"]
    assert set(told) <= set(Effects.model_fields) | {"residual", "kinematics"}
