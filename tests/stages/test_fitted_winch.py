"""The winch's law from a pumping flight: what a phase answers to its load, found again, chosen among terms, and flown by simulate."""

from dataclasses import replace

import numpy as np
import pytest
from flightlog.synthetic import write_folder
from kites import DEVELOPMENT
from pumped import DRUM, DT, HEIGHTS, LENGTH, PHASES, start, wind

from awescli.artifacts import read_json
from awescli.controller_fit.winch import fit_winch, lag
from awescli.flightlog.cycles import pieces
from awescli.flightlog.read import read_flight
from awescli.flightlog.split import split
from awescli.notation.errors import BadInput, BadInputs
from awescli.physics.declaration import kite_text
from awescli.physics.kite import Kite
from awescli.simulation.pumping import Pumping, with_winch
from awescli.simulation.switching import Guard
from awescli.simulation.synthetic import as_recorded
from awescli.stages import STAGES
from awescli.stages.fit_controller import winch_lines
from awescli.stages.plan import read_plan
from awescli.stages.runner import run_plan

LEGS = (replace(PHASES[0], guards=(Guard("tether_length", 340.0, True),)), *PHASES[1:])
PLAN = """
flight: flight
kite: kite.yaml
out: out
split: {of: cycles}
stages:
  fit-controller: {winch: true, kind: linear, folds: 2, closed_loop_time: 2.0}
  simulate:
    cycles: 1
    draws: 0
    start: 0.0
    noise: false
    phases:
      - {name: traction, winch: {fitted: true}, until: {tether_length: {above: 340}}}
      - {name: transition, pattern: {elevation: 60}, winch: {k: 0.002, f_low: 300, f_high: 6000}, until: {time_in_phase: {above: 5}}}
      - {name: retraction, pattern: {elevation: 60}, surfaces: {elevator: 3, flaps: 0}, winch: {fitted: true, tau: 0.3},
         until: {tether_length: {below: 280}}}
      - {name: transition, winch: {k: 0.002, f_low: 300, f_high: 6000}, until: {time_in_phase: {above: 3}}}
"""


@pytest.fixture(scope="module")
def flown():
    """Five cycles of the development kite, and their noisy log."""
    how = {"start": start(), "length": LENGTH, "duration": 500.0, "dt": DT, "cycles": 5, "load": 2000.0}
    pumped = Pumping.of(Kite(with_winch(DEVELOPMENT, DRUM), HEIGHTS), LEGS).fly(wind(10.0), **how)
    return pumped, as_recorded(pumped.flown, DEVELOPMENT, wind(10.0), seed=1)


@pytest.fixture(scope="module")
def folder(flown, tmp_path_factory):
    path = tmp_path_factory.mktemp("winch")
    write_folder(path / "flight", flown[1])
    (path / "kite.yaml").write_text(kite_text(DEVELOPMENT))
    (path / "stages.yaml").write_text(PLAN)
    return path


def run(folder, stage, out="out", **overrides):
    plan = read_plan(folder / "stages.yaml", STAGES, {"out": str(folder / out), **overrides})
    run_plan(plan, STAGES, only=[stage])
    return folder / out / stage


def test_the_laws_of_both_phases_are_found_again(flown):
    """Guards the fit: of traction that speed goes with the root of the load and that its limits were never reached, of retraction the speed
    and the load above which it gives way; values and lags within their intervals, errors on unseen cycles of the load cell's noise."""
    log = flown[1]
    laws = fit_winch(log, split(pieces(log, "cycles"), log=log))
    assert set(laws) == {"traction", "retraction"}
    assert laws["traction"].terms == ("kv",) and laws["retraction"].terms == ("v", "f_high")
    truths = {"traction": {"kv": 0.045, "tau": 0.3, "tau_d": 0.3}, "retraction": {"v": -5.0, "k": 0.004, "f_high": 1500.0}}
    for phase, truth in truths.items():
        law = laws[phase]
        for name, value in truth.items():
            assert abs(law.values[name] - value) < 4 * law.std[name], (phase, name, law.values[name], law.std[name])
            assert law.std[name] < 0.1 * abs(value)
        assert law.nrmse["test"] < 0.005
    lags = laws["retraction"].values
    assert lags["tau"] + lags["tau_d"] == pytest.approx(0.6, abs=0.02)


def test_a_lag_is_exact_between_samples():
    """Guards the filter: the answer to a ramp in closed form, whatever the step."""
    for dt in (0.02, 0.3):
        t = dt * np.arange(40)
        assert lag(2.0 * t + 1.0, dt, 0.4, 5.0) == pytest.approx(2.0 * (t - 0.4) + 1.0 + (5.0 - 1.0 + 0.8) * np.exp(-t / 0.4), abs=1e-12)


def test_simulate_flies_the_winch_that_was_found(folder):
    """Guards the way from a plan to a winch: fit-controller tells the laws, simulate pays out and reels in by them: its speeds are
    what the law that flew the log, lags and all, makes of its loads."""
    made = run(folder, "fit-controller")
    winch = read_json(made / "metrics.json")["winch"]
    assert winch["traction"]["parameters"]["kv"]["value"] == pytest.approx(0.045, rel=0.01)
    assert winch["retraction"]["parameters"]["f_high"]["unit"] == "N" and set(winch["traction"]["nrmse"]) == {"train", "validation", "test"}
    (line,) = winch_lines(winch)
    assert line.startswith("winch: traction 0.0450 sqrt(T) m/s (error 0.0") and "0.00400 per N above 1500" in line and winch_lines({}) == []
    made = run(folder, "simulate")
    metrics = read_json(made / "metrics.json")
    assert metrics["cycles_flown"] == 1 and [r["ended_by"] for r in metrics["phases"]] == ["tether_length", "time_in_phase"] * 2
    log = read_flight(made / "flight")
    law = {"traction": lambda T: 0.045 * np.sqrt(T), "retraction": lambda T: -5.0 + 0.004 * np.maximum(T - 1500.0, 0.0)}
    for row in (r for r in metrics["phases"] if r["phase"] in law):
        here = slice(int((row["from_s"] + 3.0) / DT), int(row["to_s"] / DT))
        asked = lag(law[row["phase"]](lag(log["tension"], DT, 0.3, 0.0)), DT, 0.3, 0.0)[here]
        assert log["reel_out_speed"][here] == pytest.approx(asked, abs=0.05), row["phase"]


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        ({"fit-controller.winch": "false"}, "fit-controller found no winch law for traction"),
        ({"simulate.phases": "[{name: transition, winch: {fitted: true}, until: {time_in_phase: {above: 9}}}]"}, "it has one for traction"),
    ],
)
def test_a_winch_that_was_not_found_is_not_flown(folder, settings, words):
    """Guards the messages: no law at all, none of this phase."""
    out = f"refused_{len(words)}"
    run(folder, "fit-controller", out, **{k: v for k, v in settings.items() if k.startswith("fit")})
    with pytest.raises((BadInput, BadInputs), match=words):
        run(folder, "simulate", out, **settings)
    assert not (folder / out / "simulate").exists()
