"""The CasADi functions fly what the simulator flies, also after they were written and loaded."""

import json

import numpy as np
import pytest
from export.models import CASES, Flown, compared, free, with_controller, with_states

from awescli.export.casadi_functions import casadi_files

ca = pytest.importorskip("casadi", reason="casadi is not installed (extra `casadi`)")


def loaded(flown: Flown, folder) -> tuple[dict, np.ndarray]:
    """(name -> function, parameter values), as somebody has them who has the folder only."""
    for name, text in casadi_files(flown.model).items():
        (folder / name).write_text(text)
    tables = json.loads(next(folder.glob("*.json")).read_text())
    return {p.stem: ca.Function.load(str(p)) for p in folder.glob("*.casadi")}, np.array([p["value"] for p in tables["parameters"]])


@pytest.mark.parametrize("case", CASES)
def test_casadi_flies_the_same_ten_seconds(case, tmp_path):
    flown = CASES[case]()
    f, c = loaded(flown, tmp_path)
    U, SP = flown.inputs, flown.set_points
    x = ca.DM([*flown.segments.starts[0], *np.zeros(len(flown.model.states) - 12), *SP[0]])
    x = f["initial"](f["hold"](x, U[0], SP[0], c), U[0], c)
    found = np.empty_like(flown.outputs)
    for k in range(len(U)):
        found[k] = np.array(f["outputs"](f["hold"](x, U[k], SP[k], c), U[k], c)).ravel()
        if k + 1 < len(U):
            x = f["step"](x, U[k], U[k + 1], SP[k], SP[k + 1], c)
    assert compared(flown, found) < 1e-9


@pytest.mark.parametrize("flown", [with_states, with_controller, free], ids=lambda f: f.__name__)
def test_what_casadi_differentiates_is_what_the_simulator_differentiates(flown, tmp_path):
    """d(outputs one sample later) / d(states, two parameters), against the engine's exact sensitivities."""
    from awescli.notation.quantities import MEASURED
    from awescli.simulation.rollout import Columns, Segments, Simulator

    flown = flown()
    f, c = loaded(flown, tmp_path)
    kite, s = flown.model.kite, flown.segments
    asked = ("m", "Jx")
    one = Segments(s.first, s.starts, s.setpoints[:, :2], s.inputs[:, :2], s.dt)
    simulator = Simulator(kite, wrt=asked, law=flown.model.law, step=flown.model.longest)
    _, J = simulator.sensitivities(one, Columns(tuple(kite.state_names[:12]), asked), MEASURED)
    x, c_ = ca.SX.sym("x", 12), ca.SX.sym("c", len(c))
    U, SP = flown.inputs, flown.set_points
    whole = ca.vertcat(x, ca.DM.zeros(len(flown.model.states) - 12), ca.DM(SP[0]))
    begun = f["initial"](f["hold"](whole, U[0], SP[0], c_), U[0], c_)
    after = f["hold"](f["step"](begun, U[0], U[1], SP[0], SP[1], c_), U[1], SP[1], c_)
    y = f["outputs"](after, U[1], c_)[: len(MEASURED)]
    places = [[p.name for p in flown.model.parameters].index(n) for n in asked]
    derivative = ca.Function("d", [x, c_], [ca.horzcat(ca.jacobian(y, x), ca.jacobian(y, c_)[:, places])])
    found = np.array(derivative(s.starts[0], c))
    assert found == pytest.approx(J[0, 1], rel=1e-7, abs=1e-7 * np.abs(J[0, 1]).max())
