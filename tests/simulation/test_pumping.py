"""Pumping cycles: the energy of a cycle balanced by hand, a winch within its limits, guards kept, and a log that is read again."""

from dataclasses import replace

import numpy as np
import pytest
from kites import DEVELOPMENT
from pumped import CIRCLE, DEG, DRUM, DT, HEIGHTS, HIGH, LAW, LENGTH, NAMES, PHASES, TAUT, fly, setpoints, start, wind

from awescli.control.held import Held
from awescli.flightlog.cycles import cycles, pieces
from awescli.flightlog.kitemill_csv import to_kitemill_csv
from awescli.flightlog.phases import phases
from awescli.flightlog.read import read_flight
from awescli.flightlog.split import split
from awescli.notation.errors import BadInput
from awescli.notation.frames import rotate_back
from awescli.notation.quantities import STATES, SURFACES
from awescli.physics.kite import Kite
from awescli.simulation.power_curve import power_curve, starts_on
from awescli.simulation.pumping import Pumping, PumpingPhase, energies, with_winch
from awescli.simulation.switching import Guard
from awescli.simulation.synthetic import as_recorded, with_effects


@pytest.fixture(scope="module")
def flown():
    return fly()


def test_two_cycles_keep_their_guards(flown):
    """Guards phases in their order, each ended by its own guard where the line, or the clock, came to the limit: within a sample's worth of
    line."""
    _, pumped = flown
    assert pumped.done == 2 and not pumped.flown.departed and len(pumped.switches) == 7
    rows, whole = energies(pumped, NAMES)
    assert [r["phase"] for r in rows] == NAMES * 2 and [r["cycle"] for r in rows] == [1] * 4 + [2] * 4
    for row in rows:
        if row["ended_by"] == "tether_length":
            assert row["to_m"] == pytest.approx(400.0 if row["phase"] == "traction" else 280.0, abs=10.0 * DT)
        else:
            assert row["to_s"] - row["from_s"] == pytest.approx(5.0 if row["cycle"] and row["from_m"] > 350 else 3.0, abs=1.5 * DT)
    assert [w["cycle"] for w in whole] == [1, 2]


def test_energies_are_tension_times_line(flown):
    """Guards the account: rows add up to the whole, the speed is the rate of the length, reeling in costs less than paying out yields."""
    _, pumped = flown
    T, v, length = pumped.flown.outputs["tension"], *(pumped.flown.inputs[n] for n in ("reel_out_speed", "tether_length"))
    rows, whole = energies(pumped, NAMES)
    total = np.trapezoid(T * v, dx=DT)
    assert sum(r["energy_J"] for r in rows) == pytest.approx(total) == pytest.approx(sum(w["energy_J"] for w in whole))
    # a change of torque lies between samples
    assert np.gradient(length, DT)[2:-2] == pytest.approx(v[2:-2], abs=5.0 * DT / 2)
    by = {name: sum(r["energy_J"] for r in rows if r["phase"] == name) for name in set(NAMES)}
    assert by["traction"] > -by["retraction"] > 0 and whole[1]["mean_W"] > 0


def test_energy_of_a_cycle_balances(flown):
    """Guards the whole of it, with the uncompiled physics as the oracle: over a cycle, what air, line and weight do on the kite is the
    change of its kinetic and potential energy, to a thousandth of the energy that passes through; and what the line takes from the kite is
    what the winch got, but for the drag that hangs on the line, which is integrated too, and the spring that holds the length, to 2 %."""
    kite, pumped = flown
    rows, whole = energies(pumped, NAMES)
    first, last = (int(round(whole[1][key] / DT)) for key in ("from_s", "to_s"))
    states = pumped.flown.outputs
    own = {n: np.zeros(last - first + 1) for n in kite.state_names[12:]}
    own["winch_tracking.speed"] = pumped.flown.inputs["reel_out_speed"][first : last + 1]
    own["winch_control.ahead"] = pumped.flown.inputs["tether_length"][first : last + 1] - LENGTH
    z = {n: states[n][first : last + 1] for n in STATES}
    x = [*z.values(), *own.values(), *(states[s][first : last + 1] for s in SURFACES)]
    u = dict.fromkeys(kite.input_names, np.zeros(last - first + 1)) | {"density": np.full(last - first + 1, 1.225)}
    u |= {f"wind_speed_{i}": np.full(last - first + 1, 10.0 * (h / 10) ** 0.12) for i, h in enumerate(HEIGHTS)}
    u |= {f"wind_direction_{i}": np.full(last - first + 1, np.pi) for i in range(len(HEIGHTS))}
    u["tether_length"] = np.full(last - first + 1, LENGTH)
    at = kite.instant(x, list(u.values()), [float(v) for v in kite.parameters.vector()])

    def work(force):
        return np.trapezoid(sum(f * v for f, v in zip(force, (z["u"], z["v"], z["w"]), strict=True)), dx=DT)

    done = {name: work(load.force) for name, load in at.loads.items()}
    m, g = kite.parameters["m"].value, kite.parameters["g"].value
    energy = m / 2 * (z["u"] ** 2 + z["v"] ** 2 + z["w"] ** 2) - m * g * z["p_d"]
    through = np.abs(states["tension"] * pumped.flown.inputs["reel_out_speed"])[first:last].sum() * DT
    assert done["gravity"] == pytest.approx(m * g * (z["p_d"][-1] - z["p_d"][0]), abs=1e-3 * through)
    assert done["aerodynamics"] + done["tether"] == pytest.approx(energy[-1] - energy[0], abs=1e-3 * through)
    # the tether's force is the pull along the line and the drag that hangs on it
    pull = rotate_back(at.R, tuple(-states["tension"][first : last + 1] * p for p in at.p_hat))
    dragged = work(tuple(f - p for f, p in zip(at.loads["tether"].force, pull, strict=True)))
    assert dragged < 0 and -(done["tether"] - dragged) == pytest.approx(whole[1]["energy_J"], abs=2e-2 * through)


def test_the_drum_keeps_within_its_limits():
    """Guards torque and speed limits: asked for -12 m/s and more, it turns with 5 m/s2 and 6 m/s at most, late by its lag."""
    fast = replace(PHASES[2], winch={"v": -12.0, "f_high": 1e5})
    kite = Kite(with_winch(DEVELOPMENT, {"tau": 0.3, "v_max": 6.0, "a_max": 5.0}), HEIGHTS)
    begun = {"start": start(), "length": 400.0, "duration": 8.0, "dt": DT, "speed": 1.0, "load": 2000.0}
    pumped = Pumping.of(kite, [fast]).fly(wind(9.0), **begun | {"start": start() * np.array([400 / LENGTH] * 3 + [1.0] * 9)})
    v = pumped.flown.inputs["reel_out_speed"]
    rate = np.gradient(v, DT)
    assert v[0] == pytest.approx(1.0) and np.abs(v).max() <= 6.0 + 1e-6 and np.abs(rate).max() <= 5.0 + 1e-6
    assert rate[5:50] == pytest.approx(-5.0, abs=1e-6) and v[-1] == pytest.approx(-6.0, abs=1e-3)


def test_a_slack_line_is_flown():
    """Guards the tether law in transitions: a wing that is told to give up its lift leaves the line slack, carries nothing, and comes
    taut."""
    dive = setpoints(Held(HIGH, {"elevator": 8 * DEG, "flaps": 0.0}))
    loose = (PumpingPhase("transition", dive, {"v": 2.0}, (Guard("time_in_phase", 2.5, True),)),
             PumpingPhase("traction", setpoints(LAW), {"kv": 0.03, **TAUT}, (Guard("time_in_phase", 15.0, True),)))  # fmt: skip
    _, pumped = fly(phases_=loose, cycles=1)
    T = pumped.flown.outputs["tension"]
    assert pumped.done == 1 and (T == 0).sum() > 10 and T[-50:].min() > 0


def test_a_kite_that_comes_down_has_departed():
    """Guards too little wind: it ends where it is too low, says so, and counts no cycle."""
    _, pumped = fly(speed=2.0, cycles=5)
    assert pumped.flown.departed and pumped.done == 0 and -pumped.flown.outputs["p_d"][-1] > 4.0
    assert energies(pumped, NAMES)[0][-1]["ended_by"] == "departed"


def test_gusts_are_seeded():
    """Guards turbulence: the same seed flies the same, another another, and calm air neither."""
    gusty = with_effects(DEVELOPMENT, {"turbulence": {"sigma": 0.5}})
    a, b, other, calm = (fly(declaration=d, cycles=None, duration=20.0, seed=s)[1].flown.outputs["p_d"]
                         for d, s in ((gusty, 1), (gusty, 1), (gusty, 2), (DEVELOPMENT, 1)))  # fmt: skip
    assert np.array_equal(a, b) and not np.array_equal(a, other) and not np.array_equal(a, calm)


def test_the_written_log_holds_the_cycles(flown, tmp_path):
    """Guards the way to a log and back: what is read again has the phases that were flown, found by its motion alone, the line as it was
    paid out, and the same energy to a few percent of sensor noise."""
    kite, pumped = flown
    log = as_recorded(pumped.flown, kite.declaration, wind(10.0), seed=1)
    for name, text in zip(("kite.csv", "wind.csv"), to_kitemill_csv(log), strict=True):
        (tmp_path / name).write_text(text)
    again = read_flight(tmp_path)
    labels = phases(again)
    rows, whole = energies(pumped, NAMES)
    for row in (r for r in rows if r["phase"] == "retraction"):
        inside = (again.time > row["from_s"] + 4) & (again.time < row["to_s"] - 4)
        assert (labels[inside] == "retraction").mean() > 0.9
    assert len(cycles(labels)) == 2
    power = again["tension"] * again["reel_out_speed"]
    assert np.trapezoid(power, again.time) == pytest.approx(sum(w["energy_J"] for w in whole), rel=0.05)


def test_whole_cycles_are_dealt(flown):
    """Guards `split.of: cycles`: each piece is a cycle with its retraction, from the beginning of its traction to that of the next (found
    by motion alone, so to some seconds); loops stay in the traction; two cycles are too few."""
    kite, pumped = flown
    log = as_recorded(pumped.flown, kite.declaration, wind(10.0), seed=1)
    labels, found = phases(log), pieces(log, "cycles")
    begun = [0, *(s.sample for s in pumped.switches if s.into == 0), len(log)]
    assert found.kind == "cycles" and found.bounds.shape == (2, 2) and "2 pumping cycles of 9" in found.sentence
    assert np.abs(found.bounds - np.column_stack([begun[:-1], begun[1:]])).max() < 5.0 / DT
    assert all(set(labels[a:b]) >= {"traction", "retraction"} for a, b in found.bounds)
    assert all(set(labels[a:b]) == {"traction"} for a, b in pieces(log, "loops").bounds)
    with pytest.raises(BadInput, match="2 cycles cannot be split"):
        split(found)


def test_a_power_curve_is_that_of_its_flights():
    """Guards the curve: the mean of all cycles but the first, integrated here once more; kites that are all the same have a band without
    width; a wind in which nothing flies has no power."""
    kite = Kite(with_winch(DEVELOPMENT, DRUM), HEIGHTS)
    pumping = Pumping.of(kite, PHASES)
    how = {"length": LENGTH, "dt": DT, "cycles": 2}
    winds = {2.0: wind(2.0), 10.0: wind(10.0)}
    low, high = power_curve(pumping, winds, CIRCLE, [{}, {"CLa": kite.parameters["CLa"].value}], longest=300.0, **how)
    assert (low["mean_W"], low["low_W"], low["flown"], low["draws"]) == (None, None, 0, 2)
    flights = (
        pumping.fly(winds[10.0], start=s, duration=300.0, load=2000.0, **how) for s in starts_on(pumping, winds[10.0], CIRCLE, LENGTH)
    )
    flight = next(f for f in flights if f.ended)
    begins = next(s.sample for s in flight.switches if s.into == 0)
    power = flight.flown.outputs["tension"] * flight.flown.inputs["reel_out_speed"]
    mean = np.trapezoid(power[begins:], dx=DT) / ((len(power) - 1 - begins) * DT)
    assert high["mean_W"] == pytest.approx(mean) == pytest.approx(high["low_W"]) == pytest.approx(high["high_W"]) and high["flown"] == 2


def test_more_wind_more_power():
    """Guards the sense of it: power grows with the wind, less than with its cube."""
    pumping = Pumping.of(Kite(with_winch(DEVELOPMENT, DRUM), HEIGHTS), PHASES)
    how = {"length": LENGTH, "dt": DT, "cycles": 2, "longest": 300.0}
    nine, eleven = power_curve(pumping, {9.0: wind(9.0), 11.0: wind(11.0)}, CIRCLE, [], **how)
    assert 0 < nine["mean_W"] < eleven["mean_W"] and nine["high_W"] is None
