"""What a traced effect is shown to do is what it does: the inferred deflection follows its set-point as the lag says, and so on."""

import numpy as np
import pytest
from kites import DEVELOPMENT

from awescli.flightlog.loops import find_loops
from awescli.flightlog.split import split
from awescli.physics.declaration import kite_text
from awescli.physics.kite import Kite
from awescli.stages.in_action import actions

HORIZON = 3.0


def traced(folder, log, key: str, values: dict[str, float]):
    """(effects.json, folder of a trace that found the effect `key` at some values)."""
    kite = Kite(DEVELOPMENT, log.wind.height, (key,)).with_values({f"{key}.{n}": v for n, v in values.items()})
    (folder / "kite.yaml").write_text(kite_text(kite.declare((key,))))
    (effect,) = (e for e in kite.effects if e.key == key)
    effects = {"verdict": "found", "effects": [{"name": effect.name, "acts_on": effect.acts_on}], "error": {"horizon_s": HORIZON}}
    return effects, folder


def action_of(folder, calm, key, values):
    log = calm.log
    (action,) = actions(*traced(folder, log, key, values), log, split(find_loops(log), log=log))
    assert action.effect == key and action.time.shape == action.without.shape == action.with_effect.shape
    return action


def test_an_inferred_deflection_lags_its_set_point(calm, tmp_path):
    """tau d(delta)/dt + delta = set-point, to the accuracy of central differences; the set-point is the log's."""
    tau = 0.2
    action = action_of(tmp_path, calm, "actuator_lag:rudder", {"tau": tau})
    log = calm.log
    rows = np.rint((action.time - log.time[0]) / log.dt).astype(int)
    assert np.allclose(action.without, log["rudder"][rows], atol=1e-12)
    rate = (action.with_effect[:, 2:] - action.with_effect[:, :-2]) / (2 * log.dt)
    # set-points are held between samples: what acts on the middle is the mean of this sample's and the one before
    driven = 0.5 * (action.without[:, 1:-1] + action.without[:, :-2])
    off = tau * rate + action.with_effect[:, 1:-1] - driven
    assert np.sqrt(np.mean(off**2)) < 0.01 * np.std(action.without)
    assert np.std(action.with_effect - action.without) > 0.03 * np.std(action.without)


@pytest.mark.parametrize("key, values, quantity, truth", [
    ("parasitic_drag", {"dCD": 0.05}, "drag coefficient", lambda without: without + 0.05),
    ("load_cell_scale", {"s": 0.9}, "tether tension", lambda without: 0.9 * without),
    ("air_density", {"c": 1.04}, "air density", lambda without: 1.04 * without),
    ("winch_length", {"b": -0.05}, "tether tension", lambda without: without + 0.05 * DEVELOPMENT.parameters["k_v"].value),
])  # fmt: skip
def test_other_effects_show_what_their_equation_says(calm, tmp_path, key, values, quantity, truth):
    action = action_of(tmp_path, calm, key, values)
    assert action.quantity == quantity and np.allclose(action.with_effect, truth(action.without), rtol=1e-9)


def test_nothing_is_shown_where_nothing_was_found(calm, tmp_path):
    log = calm.log
    parts = split(find_loops(log), log=log)
    effects, folder = traced(tmp_path, log, "parasitic_drag", {"dCD": 0.05})
    assert actions(None, None, log, parts) == () and actions({**effects, "effects": []}, folder, log, parts) == ()
    assert actions({**effects, "verdict": "unexplained"}, folder, log, parts) == ()
    assert actions({**effects, "error": {"horizon_s": 500.0}}, folder, log, parts) == ()
