"""Settings that no stage could work with are refused with the plan, not minutes later, and never as a fault of awes."""

import pytest

from awescli.notation.errors import BadInput
from awescli.stages import STAGES
from awescli.stages.plan import read_plan


@pytest.fixture
def file(tmp_path):
    (tmp_path / "flight").mkdir()
    (tmp_path / "kite.yaml").write_text("name: x\n")
    (tmp_path / "stages.yaml").write_text("flight: flight\nkite: kite.yaml\nstages: {identify: {}}\n")
    return tmp_path / "stages.yaml"


@pytest.mark.parametrize(
    "key, value, says",
    [
        ("identify.outputs", "[]", "must have at least 1 of them"),
        ("identify.outputs", "[p_n, p_n]", "'p_n' is there twice"),
        ("identify.curriculum", "[-1]", "must be greater than or equal to 0.05"),
        ("trace-residual.outputs", "[]", "must have at least 1 of them"),
        ("trace-residual.candidates", "[]", "must have at least 1 of them"),
        ("trace-residual.candidates", "['actuator_lag:rudder', 'actuator_lag:rudder']", "is there twice"),
        ("train-hybrid.hidden", "[-4]", "must be greater than or equal to 1, got -4"),
        ("train-hybrid.hidden", "[16, 1000000]", "must be less than or equal to 512"),
        ("train-hybrid.hidden", "[]", "must have at least 1 of them"),
        ("train-hybrid.hidden", "[1, 1, 1, 1, 1]", "must have at most 4 of them"),
        ("train-hybrid.horizons", "[]", "must have at least 1 of them"),
        ("train-hybrid.horizons", "[0]", "must be greater than or equal to 0.05"),
        ("train-hybrid.inputs", "[]", "must have at least 1 of them"),
        ("fit-controller.features", "[p, p]", "'p' is there twice"),
        ("simulate.duration", "1e-9", "must be greater than or equal to 0.5"),
        ("evaluate.horizons", "[1e300]", "must be less than or equal to 600"),
    ],
)
def test_settings_that_mean_nothing_are_refused(file, key, value, says):
    with pytest.raises(BadInput) as caught:
        read_plan(file, STAGES, {key: value})
    assert says in str(caught.value) and f"--set {key}" in str(caught.value)
    assert str(caught.value).count("--set") == 1  # one mistake, one message
