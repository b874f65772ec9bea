"""Synthetic flights: gusts, the path-following law, logs of closed loop, what users would declare of them, and the bundled flight."""

import importlib.util
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from awescli.artifacts import read_json, write_text
from awescli.control.path_following import PathFollowing
from awescli.control.pattern import Pattern, arc
from awescli.engine.machine import LANES, compile_program, evaluate
from awescli.flightlog.kitemill_csv import to_kitemill_csv
from awescli.flightlog.loops import find_loops
from awescli.flightlog.read import read_flight
from awescli.notation.errors import BadInput, NumericalFailure
from awescli.notation.quantities import STATES, SURFACES
from awescli.physics.declaration import read_kite
from awescli.physics.effects.past import BEHIND, past_of
from awescli.physics.kite import Kite
from awescli.simulation import synthetic
from awescli.simulation.campaign_flights import dev_like, perturbed
from awescli.simulation.gusts import dryden, roll_corner, roll_gust, yaw_corner
from awescli.simulation.made_wind import wind_record
from awescli.simulation.rollout import Simulator, rates_at
from awescli.simulation.segments import observe
from awescli.simulation.synthetic import ReelOut, fly, with_effects
from awescli.stages import STAGES
from awescli.stages.plan import read_plan
from awescli.stages.runner import run_plan
from awescli.stages.simulate import Simulate

ROOT = Path(__file__).parents[2]
DATA = ROOT / "data"
DEVELOPMENT = read_kite(DATA / "kites" / "development.yaml")


# --- gusts ---


def test_gusts_have_unit_variance_whatever_the_sampling():
    for dt, samples in ((0.02, 40_000), (0.5, 20_000)):
        gusts = np.concatenate([dryden(samples, dt, 40.0, seed) for seed in range(5)])
        # a record holds time / (2 L/V) independent samples; three standard errors of a variance
        independent = len(gusts) * dt * 40.0 / (2 * 150.0)
        assert np.abs(gusts.var(axis=0) - 1).max() < 3 * np.sqrt(2 / independent)
        assert np.abs(gusts.mean(axis=0)).max() < 3 / np.sqrt(independent)


def test_gusts_begin_as_turbulent_as_they_go_on():
    first = np.array([dryden(1, 0.02, 40.0, seed)[0] for seed in range(2000)])
    assert np.abs(first.var(axis=0) - 1).max() < 3 * np.sqrt(2 / 2000)


def test_gusts_decorrelate_as_dryden_says():
    dt, a_long, a_trans = 0.1, 40.0 / 150.0, 40.0 / 60.0
    gusts = np.concatenate([dryden(60_000, dt, 40.0, seed) for seed in range(3)])
    for lag in (1.0, 3.0):
        k = int(lag / dt)
        found = (gusts[k:] * gusts[:-k]).mean(axis=0)
        expected = [np.exp(-a_long * lag)] * 2 + [(1 - a_trans * lag / 2) * np.exp(-a_trans * lag)]
        assert found == pytest.approx(expected, abs=0.06)


def test_gusts_are_seeded():
    assert (dryden(50, 0.02, 40.0, 3) == dryden(50, 0.02, 40.0, 3)).all()
    assert (dryden(50, 0.02, 40.0, 3) != dryden(50, 0.02, 40.0, 4)).all()


# --- the law ---

PATTERN = Pattern(0.5, 0.0, 60.0, 1.0)
STATE = {"p_n": 280.0, "p_e": 40.0, "p_d": -190.0, "u": 38.0, "v": 2.0, "w": 5.0, "phi": 0.4, "theta": 0.2, "psi": 1.3,
         "p": 0.1, "q": 0.2, "r": -0.6}  # fmt: skip


def test_a_mirrored_kite_gets_the_mirrored_rudder():
    law = PathFollowing(PATTERN)
    mirrored = {n: -x if n in ("p_e", "v", "phi", "psi", "p", "r") else x for n, x in STATE.items()}
    other = replace(law, pattern=replace(PATTERN, turn=-1.0))
    assert other.deflections(mirrored)["rudder"] == pytest.approx(-law.deflections(STATE)["rudder"], rel=1e-12)


def test_a_kite_outside_the_circle_is_turned_inwards():
    law = PathFollowing(PATTERN)
    wider = PathFollowing(replace(PATTERN, radius=80.0))
    # turning clockwise seen from the winch is a negative yaw rate, so "more turn" is a more negative rudder
    assert law.deflections(STATE)["rudder"] < wider.deflections(STATE)["rudder"]


def test_the_compiled_law_is_the_law():
    law = PathFollowing(PATTERN, trims={"flaps": 0.1})
    program = compile_program(law.setpoints, 16, 1, 1)
    x = np.array([*STATE.values(), 0.0, 0.0, 0.0, 0.0])
    compiled = evaluate(program, np.repeat(x[:, None], LANES, axis=1), np.zeros((1, LANES)), np.zeros((1, LANES)))[:, 0]
    expected = law.deflections(STATE)
    assert compiled == pytest.approx([expected[s] for s in SURFACES], rel=1e-12)
    assert expected["flaps"] == 0.1 and abs(expected["rudder"]) < law.limit


# --- flights ---


@pytest.fixture(scope="module")
def flight():
    return dev_like(DEVELOPMENT, 1, duration=60.0)


@pytest.mark.parametrize("turn", [-1.0, 1.0])
def test_it_loops_both_ways_round(turn):
    f = dev_like(DEVELOPMENT, 2, {"actuator_lag:rudder": {"tau": 0.2}}, duration=40.0, turn=turn, air="power")
    away = arc(f.log, f.law.pattern) / f.law.pattern.radius
    assert 0.6 < away.min() and away.max() < 1.5
    assert (np.sign(f.log["r"]) == -turn).mean() > 0.95
    # one turn about the line per loop: 40 s hold at least three
    assert len(find_loops(f.log)) >= 3


def test_flights_stay_where_the_development_flights_are(flight):
    log = flight.log
    assert 20 < log["V_a"].min() and log["V_a"].max() < 62
    assert np.abs(log["rudder"]).max() < 0.4 and log["tension"].min() > 300
    assert 255 < log["tether_length"].min() and log["tether_length"].max() < 400


def test_the_same_seed_flies_the_same_flight(flight):
    again = dev_like(DEVELOPMENT, 1, duration=60.0)
    assert all((again.log[n] == flight.log[n]).all() for n in flight.log.measured)


def test_the_noise_is_the_kite_files(flight):
    clean = dev_like(DEVELOPMENT, 1, duration=60.0, noise=False).log
    noise = flight.flown.noise
    for name, std in (
        ("p_d", noise.position[2]),
        ("v_n", noise.velocity),
        ("theta", noise.euler),
        ("r", noise.rates),
        ("V_a", noise.airspeed),
    ):
        assert np.std(flight.log[name] - clean[name]) == pytest.approx(std, rel=0.06), name
    assert (flight.log["rudder"] == clean["rudder"]).all()


def test_the_flown_kite_predicts_its_own_flight():
    f = dev_like(DEVELOPMENT, 5, {"wind_veer": {"k": 0.001}}, duration=20.0, noise=False)
    kite = Kite(f.flown, f.log.wind.height)
    measured = observe(f.log, kite, np.array([0]), 250, ("p_n", "p_e", "p_d", "phi"))
    # the recorded wind is off by the station's errors, 5 cm/s and 0.3 deg
    error = measured.residual(Simulator(kite, wrt=(), step=0.005).rollout(measured.segments)) * measured.sigma
    assert np.abs(error[0, -1, :3]).max() < 3.0


def test_a_written_flight_reads_back(flight, tmp_path):
    kite, wind = to_kitemill_csv(flight.log)
    write_text(tmp_path / "kite.csv", kite)
    write_text(tmp_path / "wind.csv", wind)
    read = read_flight(tmp_path)
    assert len(read) == len(flight.log) and read.valid.all()
    assert np.abs(read["p_n"] - flight.log["p_n"]).max() < 1e-3
    assert np.abs(read["rudder"] - flight.log["rudder"]).max() < 1e-5


def test_a_kite_without_wind_departs_with_a_name():
    law = PathFollowing(Pattern(0.6, 0.0, 53.0, 1.0))
    calm = wind_record(np.array([10.0]), np.array([0.5]), np.pi, 20.0)
    with pytest.raises(NumericalFailure) as failure:
        fly(DEVELOPMENT, law.setpoints, calm, ReelOut(260.0), pattern=law.pattern, duration=20.0)
    assert failure.value.outcome == "departed"


def test_roll_gusts_have_the_spectrum_of_the_specification():
    """Guards variance and corner: one, and the correlation of a first-order process with MIL-F-8785C's corner of p_g."""
    V, b = 40.0, 5.0
    series = np.concatenate([roll_gust(60_000, 0.02, V, b, seed) for seed in range(3)])
    later = int(round(1 / roll_corner(V, b) / 0.02))
    assert series.std() == pytest.approx(1.0, abs=0.03)
    assert np.mean(series[later:] * series[:-later]) == pytest.approx(np.exp(-later * 0.02 * roll_corner(V, b)), abs=0.03)


def test_corners_of_gusts_that_turn_the_kite():
    """Guards MIL-F-8785C's corners: pi V / 4 b of p_g and q_g, pi V / 3 b of r_g."""
    assert roll_corner(40.0, 5.0) == pytest.approx(2 * np.pi)
    assert yaw_corner(40.0, 5.0) == pytest.approx(8 / 3 * np.pi)


def test_turbulence_shows_and_is_seeded():
    smooth, rough = (dev_like(DEVELOPMENT, 4, e, duration=20.0, noise=False).log for e in ({}, {"turbulence": {"sigma": 1.0}}))
    assert np.std(np.diff(rough["V_a"])) > 1.2 * np.std(np.diff(smooth["V_a"]))


@pytest.mark.parametrize("speed", [9.0, 13.0])
def test_gusts_are_crossed_at_the_airspeed_of_the_kite_that_flies(speed, monkeypatch):
    """Guards the time scale of gusts against one kite's airspeed in generic code: it is that of this flight in still air."""
    crossed = []

    def gusts(samples, dt, airspeed, *rest):
        crossed.append(airspeed)
        return dryden(samples, dt, airspeed, *rest)

    monkeypatch.setattr(synthetic, "dryden", gusts)
    law = PathFollowing(Pattern(0.6, 0.0, 53.0, 1.0), trims={"elevator": -0.025, "flaps": 0.065})
    how = {"pattern": law.pattern, "duration": 15.0, "noise": False}
    wind = wind_record(np.array([10.0]), np.array([speed]), np.pi, 20.0)
    still = fly(DEVELOPMENT, law.setpoints, wind, ReelOut(260.0), **how)
    fly(with_effects(DEVELOPMENT, {"turbulence": {"sigma": 0.5}}), law.setpoints, wind, ReelOut(260.0), **how)
    assert crossed == [pytest.approx(still["V_a"].mean(), rel=1e-6)]
    assert abs(crossed[0] - 40.0) > 1.0


@pytest.mark.parametrize("effect", [{"actuator_lag:rudder": {"tau": 0.3}}, {"actuator_delay:rudder": {"tau": 0.2}}])
def test_a_flight_that_sets_out_in_the_middle_goes_on_as_it_was(flight, effect):
    """A surface that lags a moving set-point stands behind it where a flight sets out too; it used to begin at the set-point, as if that
    had been at rest. The set-point moves steadily, before it sets out, too."""
    log, steps, middle = flight.log, 150, 110
    kite = Kite(with_effects(DEVELOPMENT, effect), log.wind.height)
    rudder = 0.02 * np.arange(steps + 1) * log.dt
    setpoints = np.zeros((steps + 1, len(SURFACES))) + [log[n][0] if n in log.inputs else 0.0 for n in SURFACES]
    setpoints[:, SURFACES.index("rudder")] += rudder
    still = wind_record(log.wind.height, 9.0 + 0.0 * log.wind.height, 0.5, 100.0)
    length, speed = float(log["tether_length"][0]), 0.5

    def flown(begin: int, start: np.ndarray, rates=None) -> synthetic.Flown:
        return synthetic.simulate_flight(
            kite, None, still, ReelOut(length + speed * begin * log.dt, speed), pattern=None, duration=(steps - begin) * log.dt,
            dt=log.dt, start=start, setpoints=setpoints[begin:], rates=rates,
        )  # fmt: skip

    start = np.array([log[n][0] for n in STATES])
    steadily = {name: -0.02 * ago for name, ago in zip(past_of("rudder"), BEHIND, strict=True)}
    whole = flown(0, start, steadily)
    state = np.array([whole.outputs[n][middle] for n in STATES])
    rest, at_rest = flown(middle, state, steadily), flown(middle, state)
    off, without = (np.abs(f.outputs["r"] - whole.outputs["r"][middle:]).max() for f in (rest, at_rest))
    # set-points are held for a sample, so that they run half a sample behind the line
    (tau,) = next(iter(effect.values())).values()
    assert off < log.dt / tau * without and without > 1e-3


def test_simulate_begins_with_the_rates_of_the_measured_flight(tmp_path):
    """The stage hands them on: of a flight that sets out while the rudder moves, not of one at rest."""
    seen = []
    true = synthetic.simulate_flight

    def watched(*args, rates=None, **how):
        seen.append(rates)
        return true(*args, rates=rates, **how)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(synthetic, "simulate_flight", watched)
        simulate(tmp_path, surfaces="recorded", start="20.0", duration="1.0")
    log = read_flight(DATA / "km1_demo")
    kite = Kite(read_kite(DATA / "kites" / "km1_identified.yaml"), log.wind.height)
    told = rates_at(log, kite, int(round(20.0 / log.dt)))
    assert seen == [told] and told["rudder_rate"] != 0.0 and told["tension_rate"] != 0.0


def test_a_term_that_reads_the_log_is_not_flown_without_one():
    """Guards against a term that is silently zero: a flight that is being made has no measured tension."""
    with pytest.raises(BadInput, match="measured tension"):
        dev_like(DEVELOPMENT, 4, {"custom_term:m_z*tension": {"k": 0.002}}, duration=20.0)


def test_unknown_effects_are_refused():
    with pytest.raises(BadInput, match="actuator_lag"):
        with_effects(DEVELOPMENT, {"actuator_lagg:rudder": {"tau": 0.1}})
    with pytest.raises(BadInput, match="tauu"):
        with_effects(DEVELOPMENT, {"actuator_lag:rudder": {"tauu": 0.1}})


def test_a_guess_is_off_by_its_spread_and_its_bounds_hold_the_truth():
    guess = perturbed(DEVELOPMENT, 7, (0.05, 0.3))
    for name in DEVELOPMENT.table().free:
        row, truth = guess.parameters[name], DEVELOPMENT.parameters[name].value
        assert row.lower < truth < row.upper, name
        if name != "dl":
            assert 0.05 <= abs(row.value / truth - 1) <= 0.3, name
    assert guess.parameters["m"] == DEVELOPMENT.parameters["m"]


# --- the bundled flight ---


@pytest.fixture(scope="module")
def demo():
    return read_flight(DATA / "km1_demo")


def test_the_bundled_flight_is_what_its_command_makes(tmp_path):
    spec = importlib.util.spec_from_file_location("make_km1_demo", DATA / "make_km1_demo.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    module.main(tmp_path)
    for file in ("kite.csv", "wind.csv"):
        made, kept = (np.genfromtxt(folder / file, delimiter=",", skip_header=1) for folder in (tmp_path, DATA / "km1_demo"))
        # another processor rounds in another order; the loop is stable, so that stays in the last written digit
        assert made.shape == kept.shape and np.nanmax(np.abs(made - kept)) < 2e-3
    assert sum(f.stat().st_size for f in (DATA / "km1_demo").iterdir()) < 2e6


def test_the_bundled_flight_loops_near_the_published_box(demo):
    assert demo.time[-1] >= 150 and len(find_loops(demo)) >= 12
    # published operating box (parameters of KM1), and how far outside it the flight may go
    for name, lower, upper, outside in (
        ("V_a", 34, 55, 9), ("u", 24.6, 53.4, 9), ("w", -13.4, -6.6, 3), ("r", -1.203, -0.172, 0.15), ("q", -0.052, 0.462, 0.1),
        ("p_n", -364.7, -230.8, 50), ("p_e", 332.5, 467.2, 60), ("tension", 2901, 5158, 6000),
    ):  # fmt: skip
        assert lower - outside < np.percentile(demo[name], 1) and np.percentile(demo[name], 99) < upper + outside, name


# --- the stage ---


def simulate(tmp_path, **overrides):
    plan = tmp_path / "stages.yaml"
    plan.write_text(f"flight: {DATA / 'km1_demo'}\nkite: {DATA / 'kites' / 'km1_identified.yaml'}\nstages: {{simulate: {{}}}}\n")
    stages = (Simulate(),)
    settings = {"simulate.model": "initial", "simulate.duration": "12.0"} | {f"simulate.{k}": v for k, v in overrides.items()}
    (result,) = run_plan(read_plan(plan, stages, settings), stages)
    return result, read_json(tmp_path / "out" / "simulate" / "metrics.json"), tmp_path / "out" / "simulate" / "flight"


def test_simulate_replays_the_truth_to_the_noise(tmp_path):
    _, metrics, folder = simulate(tmp_path, surfaces="recorded", effects="{actuator_lag:rudder: {tau: 0.2}}")
    assert metrics["outcome"] == "flew_on" and metrics["survived_s"] == pytest.approx(12.0)
    assert metrics["nrmse"]["5"]["mean"] < 0.02
    assert list(metrics["path_error_m"])[-1] == "12"  # all that both reach, not only what looks well
    again = read_flight(folder)
    assert len(again) == 601 and set(STATES[:3]) < set(again.measured)


def test_simulate_follows_the_flown_circle_beyond_the_log(tmp_path):
    _, metrics, folder = simulate(tmp_path, surfaces="path_following", start="140.0", duration="30.0", noise="false")
    assert metrics["outcome"] == "flew_on" and metrics["survived_s"] == pytest.approx(30.0)
    assert read_flight(folder)["tether_length"][-1] > read_flight(DATA / "km1_demo")["tether_length"][-1]


def test_simulate_flies_in_the_wind_it_is_told(tmp_path):
    """The written record is the wind of the power law; the seed decides the noise and nothing else."""
    wanted = {"wind.speed": "9.0", "wind.direction": "300", "wind.height": "100", "wind.shear": "0.2"}
    _, metrics, folder = simulate(tmp_path, surfaces="path_following", seed="3", **wanted)
    wind = read_flight(folder).wind
    assert metrics["outcome"] == "flew_on" and metrics["seed"] == 3 and metrics["wind"]["speed"] == 9.0
    for height in (100.0, 300.0):
        at = np.argmin(np.abs(wind.height - height))
        assert wind.speed[:, at] == pytest.approx(9.0 * (wind.height[at] / 100) ** 0.2, rel=1e-4)
    assert np.degrees(wind.direction) % 360 == pytest.approx(300.0, abs=1e-3)


def test_simulate_names_what_it_cannot_fly(tmp_path):
    with pytest.raises(BadInput, match=r"actuator_lag"):
        simulate(tmp_path, surfaces="recorded", effects="{actuator_lagg:rudder: {tau: 0.2}}")
    settings = {"simulate.model": "hybrid", "simulate.surfaces": "recorded"}
    with pytest.raises(BadInput, match="Make it first: awes train-hybrid"):
        run_plan(read_plan(tmp_path / "stages.yaml", STAGES, settings), STAGES, only=("simulate",))


def test_simulate_says_where_the_flight_ends(tmp_path):
    with pytest.raises(BadInput, match=r"simulate\.start"):
        simulate(tmp_path, surfaces="recorded", start="500.0")
