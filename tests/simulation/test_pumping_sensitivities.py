"""How a pumping cycle changes with what it is flown with: exact derivatives against differences of whole flights."""

from dataclasses import replace

import numpy as np
import pytest
from kites import DEVELOPMENT
from pumped import DRUM, DT, HEIGHTS, LENGTH, PHASES, start, wind

from awescli.physics.kite import Kite
from awescli.simulation.pumping import Pumping, with_winch
from awescli.simulation.pumping_sensitivities import differentiated, parameters_of
from awescli.simulation.switching import Guard

ASKED = ("p_e", "CLa", "CD0:retraction", "CD0", ("winch_control.kv", 0), ("winch_control.v", 2), ("tether_length", 0), ("time_in_phase", 1))
HOW = {"start": start(), "length": LENGTH, "duration": 120.0, "dt": DT, "cycles": 1, "load": 2000.0}


def pumping(wrt=(), **values) -> Pumping:
    """Short cycles of a kite that drags more in retraction."""
    row = DEVELOPMENT.parameters["CD0"].model_copy(update={"value": 0.11})
    kite = DEVELOPMENT.model_copy(update={"parameters": {**DEVELOPMENT.parameters, "CD0:retraction": row}})
    legs = [replace(p, winch=dict(p.winch)) for p in PHASES]
    limits = {(0, "tether_length"): 325.3, (1, "time_in_phase"): 5.0, (2, "tether_length"): 280.0, (3, "time_in_phase"): 3.0}
    rows = {}
    for key, value in values.pop("moved", {}).items():
        if isinstance(key, str):
            rows[key] = value
        elif key[0].startswith("winch_control"):
            legs[key[1]].winch[key[0].partition(".")[2]] = value
        else:
            limits[key[1], key[0]] = value
    legs = [replace(p, guards=tuple(Guard(g.quantity, limits[i, g.quantity], g.rising) for g in p.guards)) for i, p in enumerate(legs)]
    return Pumping.of(Kite(with_winch(kite, DRUM), HEIGHTS).with_values(rows), legs, wrt=wrt)


def value_of(what) -> float:
    one = pumping()
    if what == "p_e":
        return float(HOW["start"][1])
    if isinstance(what, str):
        return one.kite.parameters[what].value
    if what[0].startswith("winch_control"):
        return one.phases[what[1]].winch[what[0].partition(".")[2]]
    return one.phases[what[1]].guards[0].limit


def flown(what=None, change: float = 0.0):
    """The flight with something moved."""
    how = dict(HOW)
    if what == "p_e":
        how["start"] = HOW["start"] + change * np.eye(12)[1]
        what = None
    moved = {} if what is None else {"moved": {what: value_of(what) + change}}
    return differentiated(pumping(wrt=("CLa",), **moved), wind(10.0), ("CLa",), **how)


@pytest.fixture(scope="module")
def exact():
    return differentiated(pumping(wrt=parameters_of(ASKED)), wind(10.0), ASKED, **HOW)


@pytest.mark.parametrize("what", ASKED, ids=str)
def test_a_cycle_moves_as_differences_say(exact, what):
    """Guards the whole of it: line, load and place of the kite at every sample, times of the switches, and the mean power of a cycle, with
    respect to its start, coefficients of all phases and of one, the winch laws of one phase, and the limits that end phases; against
    central differences of whole flights, to what a flight that magnifies leaves of their rounding and their third order."""
    assert len(exact.flown.switches) == 4 and exact.flown.switches[-1].into == 0
    j, step = ASKED.index(what), 1e-7 * max(abs(value_of(what)), 10.0 if what == "p_e" else 0.1)
    ahead, behind = flown(what, step), flown(what, -step)
    slope = lambda of: (of(ahead) - of(behind)) / (2 * step)  # noqa: E731
    times = slope(lambda f: np.array([s.time for s in f.flown.switches]))
    assert exact.of.times[:, j] == pytest.approx(times, rel=2e-4, abs=1e-5 * np.abs(times).max() + 1e-9)
    # beside a switch a sample may change sides of it
    calm = np.all([np.abs(np.arange(len(exact.power)) - s.sample) > 1 for s in exact.flown.switches], axis=0)
    N = min(len(f.power) for f in (exact, ahead, behind))
    calm = calm[:N]
    for name, of, own in (
        ("speed of the line", lambda f: f.flown.states[:N, 14], exact.of.states[:N, 14, j]),
        ("height", lambda f: f.flown.states[:N, 2], exact.of.states[:N, 2, j]),
        ("power", lambda f: f.power[:N], exact.power_moved[:N, j]),
    ):
        differences = slope(of)
        assert own[calm] == pytest.approx(differences[calm], rel=1e-3, abs=1e-3 * np.abs(differences[calm]).max() + 1e-12), name
    power, moved, seconds = exact.mean_power()
    assert moved[j] == pytest.approx(slope(lambda f: f.mean_power()[0]), rel=2e-3, abs=1e-4)
    assert 35.0 < seconds < 45.0


def test_flights_at_guards_are_those_at_samples_but_for_a_sample(exact):
    """Guards that both ways of switching fly the same cycles: each switch within a sample, energy to a per cent."""
    one = pumping()
    sampled = one.fly(wind(10.0), **HOW)
    assert [s.time for s in sampled.switches] == pytest.approx([s.time for s in exact.flown.switches[:3]], abs=2 * DT)
    power = sampled.flown.outputs["tension"] * sampled.flown.inputs["reel_out_speed"]
    assert exact.cycles == 1 and exact.mean_power()[0] == pytest.approx(np.trapezoid(power, dx=DT) / ((len(power) - 1) * DT), rel=0.01)
