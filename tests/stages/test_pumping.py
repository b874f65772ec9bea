"""simulate with phases: from a plan to cycles, energies, a log that is read again, and what a plan may not say."""

import csv
from pathlib import Path
from typing import get_args

import numpy as np
import pytest

from awescli.artifacts import read_json
from awescli.flightlog.cycles import cycles
from awescli.flightlog.phases import phases
from awescli.flightlog.read import read_flight
from awescli.notation.errors import BadInput, BadInputs
from awescli.simulation.pumping import GUARDED
from awescli.stages import STAGES
from awescli.stages.plan import read_plan
from awescli.stages.power_curve import told_of_curve
from awescli.stages.pumping import Ending, Limit, guards_of, told_of_cycles
from awescli.stages.runner import run_plan

ROOT = Path(__file__).parents[2]
EXAMPLE = ROOT / "examples" / "pumping" / "stages.yaml"


def flown(tmp_path, **settings):
    """(summary, metrics, flight) of the example with other settings."""
    asked = {f"simulate.{k}": v for k, v in ({"draws": "4"} | settings).items()} | {"out": str(tmp_path / "out")}
    result = run_plan(read_plan(EXAMPLE, STAGES, asked), STAGES, only=("simulate",))
    folder = tmp_path / "out" / "simulate"
    return result, read_json(folder / "metrics.json"), folder / "flight"


def test_the_example_earns_power_and_is_read_again(tmp_path):
    """Guards the whole way: two cycles, each phase ended by its own guard, energies that add up, a log with retractions in it."""
    _, metrics, folder = flown(tmp_path, cycles="2")
    assert metrics["outcome"] == "flew_on" and metrics["cycles_flown"] == 2
    assert [r["ended_by"] for r in metrics["phases"]] == ["tether_length", "time_in_phase"] * 4
    assert sum(r["energy_J"] for r in metrics["phases"]) == pytest.approx(sum(c["energy_J"] for c in metrics["cycles"]))
    seconds = metrics["cycles"][-1]["to_s"]
    assert (
        metrics["mean_cycle_W"] == pytest.approx(sum(c["energy_J"] for c in metrics["cycles"]) / seconds) and metrics["mean_cycle_W"] > 1e3
    )
    low, high = metrics["mean_cycle_interval_W"]
    assert low < high and metrics["draws"] == 4 >= metrics["draws_flown"] > 1
    assert "2 pumping cycles" in told_of_cycles(metrics)[0] and "(90 %: " in told_of_cycles(metrics)[0]
    slopes = metrics["slopes"]
    assert slopes["mean_W"] == pytest.approx(metrics["mean_cycle_W"], rel=0.02)
    named = [(r["name"], r["phase"]) for r in slopes["rows"] if "phase" in r]
    assert named[:5] == [(n, 1) for n in ("kv", "k", "f_low", "f_high", "tether_length")] and ("v", 3) in named and len(named) == 18
    assert {"CD_0", "Cm_elev"} <= {r["name"] for r in slopes["rows"]} and all(np.isfinite(r["W_per_unit"]) for r in slopes["rows"])
    log = read_flight(folder)
    labels = phases(log)
    assert len(cycles(labels)) == 2 and (np.asarray(log["tether_length"]) > 470).all()
    # the log says of every sample in which phase it was, as metrics.json does
    said = [r["flight_phase"] for r in csv.DictReader((folder / "kite.csv").open())]
    for row in metrics["phases"]:
        inside = [phase for phase, t in zip(said, log.time, strict=True) if row["from_s"] < t < row["to_s"]]
        assert set(inside) == {row["phase"]}
    assert not any("without a quantity" in note for note in log.notes)
    # a pumping flight has two levels of the held surfaces, as the plan says
    assert np.degrees(log["elevator"]).min() == pytest.approx(-5, abs=0.01) and np.degrees(log["flaps"]).min() == pytest.approx(0, abs=0.01)


def test_a_time_ends_a_flight_within_a_cycle(tmp_path):
    """Guards flights to a stop time: what was not ended is no cycle and has no mean power."""
    _, metrics, _ = flown(tmp_path, cycles="null", duration="20.0")
    assert metrics["cycles_flown"] == 0 and metrics["mean_cycle_W"] is None and metrics["survived_s"] == pytest.approx(20.0)
    assert told_of_cycles(metrics) == ["no pumping cycle came to its end"] and told_of_cycles({}) == []


@pytest.mark.parametrize(
    ("phases_", "said"),
    [
        ("[{name: traction, until: {tether_length: {above: 600, below: 400}}}]", "give above or below"),
        ("[{name: traction, until: {time_in_phase: {below: 5}}}]", "only grows"),
        ("[{name: traction, until: {}}]", "until"),
        ("[{name: traction, surfaces: {rudderr: 3}, until: {height: {below: 50}}}]", "rudderr"),
        ("[{name: traction, winch: {f_low: 900, f_high: 300}, until: {height: {below: 50}}}]", "f_low 900 lies above f_high 300"),
        ("[{name: loitering, until: {height: {below: 50}}}]", "loitering"),
    ],
)
def test_what_cannot_be_flown_is_said_before(tmp_path, phases_, said):
    """Guards the settings: each mistake is one message that names it, before anything is flown."""
    with pytest.raises((BadInput, BadInputs), match=said):
        flown(tmp_path, phases=phases_)
    assert not (tmp_path / "out" / "simulate").exists()


def test_a_power_curve_is_written_for_every_model(tmp_path):
    """Guards the CSV and what metrics.json holds of it; a curve without phases is refused."""
    result, metrics, folder = flown(tmp_path, cycles="2", power_curve="{speeds: [9, 10.5], draws: 1, cycles: 2}")
    rows = list(csv.DictReader((folder.parent / "power_curve.csv").open()))
    assert [(r["model"], float(r["wind_m_s"])) for r in rows] == [("initial", 9.0), ("initial", 10.5)]
    assert [float(r["mean_W"]) for r in rows] == [p["mean_W"] for p in metrics["power_curve"]["initial"]]
    assert rows[0]["draws"] == "1" and "initial flies 2 of 2 winds" in told_of_curve(metrics["power_curve"])[0] and told_of_curve({}) == []
    with pytest.raises((BadInput, BadInputs), match="give their phases"):
        flown(tmp_path, phases="[]", power_curve="{}")


def test_a_network_flies_no_phases(tmp_path):
    """Guards extrapolation: a network that was trained in traction is refused by name."""
    with pytest.raises((BadInput, BadInputs), match="physical models"):
        flown(tmp_path, model="hybrid")


def test_a_plan_may_name_every_quantity_that_ends_a_phase():
    """Guards the two lists, and degrees: what a plan says of elevation is in rad where it is compared."""
    assert set(get_args(Ending)) == {"time_in_phase", *GUARDED}
    (guard,) = guards_of({"elevation": Limit(below=30.0)})
    assert (guard.limit, guard.rising) == (pytest.approx(np.pi / 6), False)
