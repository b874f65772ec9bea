"""The CasADi functions fly what the simulator flies, also after they were written and loaded."""

import numpy as np
import pytest
from export.flying import in_casadi, put
from export.models import CASES, compared, free, with_controller, with_states

from awescli.export.casadi_functions import casadi_files

ca = pytest.importorskip("casadi", reason="casadi is not installed (extra `casadi`)")


@pytest.mark.parametrize("case", CASES)
def test_casadi_flies_the_same_ten_seconds(case, tmp_path):
    flown = CASES[case]()
    assert compared(flown, in_casadi(put(tmp_path, casadi_files(flown.model)), flown.tables, flown.ride)) < 1e-9


@pytest.mark.parametrize("flown", [with_states, with_controller, free], ids=lambda f: f.__name__)
def test_what_casadi_differentiates_is_what_the_simulator_differentiates(flown, tmp_path):
    """d(outputs one sample later) / d(states, two parameters), against the engine's exact sensitivities."""
    from awescli.notation.quantities import MEASURED
    from awescli.simulation.rollout import Columns, Segments, Simulator

    flown = flown()
    put(tmp_path, casadi_files(flown.model))
    f = {p.stem: ca.Function.load(str(p)) for p in tmp_path.glob("*.casadi")}
    c = np.array([p["value"] for p in flown.tables["parameters"]])
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
