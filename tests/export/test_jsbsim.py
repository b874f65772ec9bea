"""JSBSim flies the exported aircraft as the simulator flies the model; what it has no counterpart for is refused by name."""

import os

import numpy as np
import pytest
from export.models import Flown, free, with_controller, with_network, with_one, with_states
from kites import every_key

from awescli.export.jsbsim_aircraft import DEFAULT_STEP, FT, SLUG, jsbsim_files, property_name
from awescli.notation.errors import BadInput

ADAMS_BASHFORTH_3 = 4


def fly(flown: Flown, folder) -> np.ndarray:
    """(N+1, 24) sensors of the aircraft in JSBSim, inputs linear between samples, set-points held."""
    jsbsim = pytest.importorskip("jsbsim", reason="jsbsim is not installed (extra `test`)")
    os.environ.setdefault("JSBSIM_DEBUG", "0")
    for name, text in jsbsim_files(flown.model).items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(text)
    machine = jsbsim.FGFDMExec(str(folder))
    machine.set_debug_level(0)
    machine.set_aircraft_path("aircraft")
    machine.set_dt(DEFAULT_STEP)
    assert machine.load_planet(str(folder / "planet.xml"), False) and machine.load_model(flown.model.identifier)
    machine["simulation/gravity-model"] = 0
    for integrator in ("rate/rotational", "rate/translational", "position/rotational", "position/translational"):
        machine[f"simulation/integrator/{integrator}"] = ADAMS_BASHFORTH_3
    assert machine.load_ic("start.xml", True)
    U, SP, frames = flown.inputs, flown.set_points, round(flown.segments.dt / DEFAULT_STEP)
    names = flown.model.programs.inputs
    atmosphere = {"density": ("atmosphere/override/density", 1 / (SLUG * FT**3))}

    def give(k, share):
        u = U[k] + share * (U[min(k + 1, len(U) - 1)] - U[k])
        for name, x in zip(names, u, strict=True):
            place, unit = atmosphere.get(name, (property_name("input", name), 1.0))
            if not name.startswith(("gust", "force", "moment")):
                machine[place] = float(x) * unit
        for s, x in zip(flown.model.set_points, SP[k], strict=True):
            machine[property_name("set_point", s.name)] = float(x)

    give(0, 0.0)
    machine.run_ic()
    found = []
    for k in range(len(U)):
        if k:
            for i in range(1, frames + 1):
                give(*((k - 1, i / frames) if i < frames else (k, 0.0)))
                machine.run()
        found.append([machine[property_name("sensor", s.name)] for s in flown.model.outputs])
    return np.array(found)


@pytest.mark.parametrize("case", [with_states, with_controller, free], ids=lambda f: f.__name__)
def test_jsbsim_flies_the_same_ten_seconds(case, tmp_path):
    """To a thousandth of every channel's range."""
    flown = case()
    error = np.abs(fly(flown, tmp_path) - flown.outputs)
    for i in (6, 8):
        error[:, i] = np.abs((error[:, i] + np.pi) % (2 * np.pi) - np.pi)
    span = np.ptp(flown.outputs, axis=0)
    worst = {s.name: float(e / r) for s, e, r in zip(flown.model.outputs, error.max(axis=0), span, strict=True) if r > 0}
    assert max(worst.values()) < 1e-3, worst


def test_a_network_is_refused_by_name():
    with pytest.raises(BadInput, match="the network has no counterpart in JSBSim") as refused:
        jsbsim_files(with_network().model)
    assert "--model with_effects" in refused.value.do


@pytest.mark.parametrize("key", every_key())
def test_every_effect_is_flown_or_refused_by_name(key, tmp_path):
    """A second with one effect: to a thousandth of what each channel reaches."""
    flown = with_one(key)
    if key == "added_mass":
        with pytest.raises(BadInput, match="effect 'added_mass' has no counterpart in JSBSim"):
            jsbsim_files(flown.model)
        return
    found = fly(flown, tmp_path)
    error = np.abs(found - flown.outputs)
    for i in (6, 8):
        error[:, i] = np.abs((error[:, i] + np.pi) % (2 * np.pi) - np.pi)
    worst = {s.name: float(e / r) for s, e, r in zip(flown.model.outputs, error.max(axis=0), flown.range, strict=True)}
    assert max(worst.values()) < 1e-3, worst
