"""awes export: a run's models, written by the command, fly what `awes simulate` flies; what is not there is one clear error."""

import itertools
import json
import re
import shutil
from functools import cache

import numpy as np
import pytest
from export.flying import Ride, in_c, in_casadi, in_fmu, in_jsbsim, unpacked
from small_run import make_small_run
from typer.testing import CliRunner

from awescli.artifacts import read_arrays, read_json
from awescli.cli import build_app
from awescli.export import EXPORTERS
from awescli.flightlog.read import read_flight
from awescli.flightlog.smoothing import local_quadratic
from awescli.notation.quantities import OUTPUTS, SURFACES
from awescli.physics.declaration import read_kite
from awescli.physics.kite import Kite
from awescli.simulation.rollout import WINCH_SMOOTHING, inputs_of, setpoints_of
from awescli.simulation.segments import wrap
from awescli.stages import STAGES

APP = build_app(STAGES)
LEARNS = {"train-hybrid": "{hidden: [8], horizons: [0.25], warmup: 0.5, batch: 8, rounds: 10, patience: 3, budget: 100000.0}"}
LEARNS["simulate"] = "{surfaces: recorded, duration: 10.0}"
"""Settings of the small run with which a network is kept, as long as the kite lacks its actuator lag: 44 s of flight hold enough
segments of a quarter of a second to prove a gain, and too few of a second."""


def awes(*words: str):
    result = CliRunner().invoke(APP, [str(w) for w in words])
    assert result.exception is None or isinstance(result.exception, SystemExit), result.exception
    return result


@pytest.fixture(scope="module")
def run(small_run, tmp_path_factory):
    """Two small runs, in the folder where the tests work: `out` up to the traced effect, `learned` with a network in its place."""
    folder = tmp_path_factory.mktemp("export")
    plan = make_small_run(folder)
    for stage, settings in LEARNS.items():
        plan.write_text(re.sub(rf"(?m)^  {stage}: .*$", f"  {stage}: {settings}", plan.read_text()))
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        for there, stages in (("out", ("fit-controller", "identify", "trace-residual")), ("learned", ("fit-controller", "identify"))):
            for stage in stages:
                shutil.copytree(small_run / "out" / stage, folder / there / stage)
        assert (result := awes("train-hybrid", "--set", "out=learned")).exit_code == 0, result.stderr
        assert read_json(folder / "learned" / "train-hybrid" / "metrics.json")["outcome"] == "trained"
        assert "actuator_lag:rudder" in read_kite(folder / "out" / "trace-residual" / "kite.yaml").effects
        yield folder


def results(model: str) -> str:
    """The run that has a model."""
    return "learned" if model == "hybrid" else "out"


def exported(run, folder, forms: str, model: str, by: str) -> dict:
    """What `awes export` writes into a folder, and the tables of the model."""
    surfaces = "controller" if by == "controller" else "inputs"
    answer = awes("export", results(model), "--model", model, "--surfaces", surfaces, "--to", f"{forms},json", "--out", folder, "--json")
    assert answer.exit_code == 0, answer.stderr
    tables, told = read_json(next((folder / "json").glob("*.json"))), json.loads(answer.stdout)
    assert (told["model"], tables["model"], tables["controller"] is not None) == (model, model, by == "controller")
    assert (tables["network"] is not None) == (model == "hybrid")
    return tables


@cache
def simulate(run, model: str, by: str, *more: str) -> dict:
    """Trajectory of `awes simulate`, with further settings: flown once for all forms."""
    settings = [f"out={results(model)}", f"simulate.model={model}", f"simulate.surfaces={by}", *more]
    result = awes("simulate", *(word for setting in settings for word in ("--set", setting)))
    assert result.exit_code == 0, result.stderr
    return read_arrays(run / results(model) / "simulate" / "trajectory.npz")


def simulated(run, tables: dict, model: str, by: str) -> tuple[dict, Ride]:
    """(trajectory of `awes simulate`, the same 10 s for those who read exported files, from the start that they carry)."""
    trajectory, log = simulate(run, model, by), read_flight(run / "flight")
    first = int(np.argmin(np.abs(log.time - trajectory["time"][0])))
    rows = slice(first, first + len(trajectory["time"]))
    assert tables["start"] == f"{log.time[first]:.2f} s into the flight 'flight'"
    inputs = inputs_of(log, kite := Kite(read_kite(run / "kite.yaml"), log.wind.height))[rows]
    # `awes simulate` smooths the winch's speed over its own ten seconds, and knows nothing of what came before them
    speed = log["reel_out_speed"][first : first + int(round(10.0 / log.dt)) + 1]
    acceleration = local_quadratic(speed, log.dt, WINCH_SMOOTHING, derivative=1)[: len(inputs)]
    inputs[:, kite.input_names.index("reel_out_acceleration")] = acceleration
    # networks look at the rates of commands, and lags begin with them; in `awes simulate` commands have stood still before it flies, and
    # their rates are null on and on; what an actuator asks of them besides is null, too
    inputs[:, [kite.input_names.index(f"{s}_rate") for s in SURFACES]] = 0.0
    known = dict(zip(kite.input_names, inputs.T, strict=True))
    inputs = np.stack([known.get(s["name"], np.zeros(len(inputs))) for s in tables["inputs"]], axis=1)
    return trajectory, Ride(np.array([s["start"] for s in tables["states"][:12]]), inputs, setpoints_of(log)[rows], log.dt)


KEPT = ("p_n", "p_e", "p_d", "phi", "theta", "psi", "p", "q", "r", "V_a", "tension")
"""Channels that `awes simulate` keeps."""


def channels(trajectory: dict) -> np.ndarray:
    """(11, N) KEPT."""
    return np.array([trajectory[f"simulated_{n}"] for n in KEPT])


def apart(found: np.ndarray, wanted: np.ndarray, of_range: bool = False) -> np.ndarray:
    """(N,) largest difference over KEPT at each sample (both (11, N)), in shares of what each channel reaches, or of its range."""
    error = found - wanted
    for i in (KEPT.index("phi"), KEPT.index("psi")):
        error[i] = wrap(error[i])
    span = np.ptp(wanted, axis=1) if of_range else np.maximum(np.ptp(wanted, axis=1), np.abs(wanted).max(axis=1))
    return (np.abs(error) / span[:, None]).max(axis=0)


def kept(outputs: np.ndarray) -> np.ndarray:
    """(11, N) KEPT of (N, 24) outputs."""
    return outputs.T[[OUTPUTS.index(n) for n in KEPT]]


def needs(form: str) -> None:
    """Skip where this machine cannot read a form."""
    for package in {"fmu": ("fmpy", "fmpy.validation"), "casadi": ("casadi",), "jsbsim": ("jsbsim",)}.get(form, ()):
        pytest.importorskip(package, reason=f"{package} is not installed (extra `test`)")
    for program in {"c": ("gcc",), "fmu": ("gcc", "cmake")}.get(form, ()):
        if shutil.which(program) is None:
            pytest.skip(f"no {program} on this machine")


MODELS = ("initial", "identified", "with_effects", "hybrid")
FLY = {"c": in_c, "fmu": lambda folder, *ride: in_fmu(unpacked(folder), *ride), "casadi": in_casadi, "jsbsim": in_jsbsim}


@pytest.mark.slow
@pytest.mark.parametrize("by", ["recorded", "controller"])
# an FMU holds the C of its model: the two models that have states of effects, and a network, are enough of it
@pytest.mark.parametrize("form, model", [*itertools.product(("c", "casadi"), MODELS), *itertools.product(("fmu",), MODELS[2:])])
def test_the_exported_files_fly_what_awes_simulate_flies(run, tmp_path, form, model, by):
    """Ten seconds, or as long as the simulated kite stays up, to 1e-9 of what each channel reaches."""
    needs(form)
    tables = exported(run, tmp_path, form, model, by)
    trajectory, ride = simulated(run, tables, model, by)
    assert apart(kept(FLY[form](tmp_path / form, tables, ride)), channels(trajectory)).max() < 1e-9


@pytest.mark.slow
@pytest.mark.parametrize("by", ["recorded", "controller"])
@pytest.mark.parametrize("model", ["identified", "with_effects"])
def test_the_aircraft_of_jsbsim_flies_what_awes_simulate_flies(run, tmp_path, model, by):
    """Ten seconds, or as long as the simulated kite stays up, to 1e-3 of each channel's range, beside `awes simulate` in steps that change
    nothing of what it flies: those it takes by itself err by as much where the controlled kite magnifies errors."""
    needs("jsbsim")
    tables = exported(run, tmp_path, "jsbsim", model, by)
    _, ride = simulated(run, tables, model, by)
    wanted = channels(simulate(run, model, by, "simulate.step=0.001"))
    assert apart(kept(in_jsbsim(tmp_path / "jsbsim", tables, ride)), wanted, of_range=True).max() < 1e-3


@pytest.mark.slow
def test_every_form_of_the_newest_model_or_the_reason(run, tmp_path):
    """A network has no counterpart in JSBSim: with all forms it is named, asked for alone it is an error and nothing is written."""
    answer = awes("export", "learned", "--out", tmp_path / "all", "--json")
    assert answer.exit_code == 0, answer.stderr
    told = json.loads(answer.stdout)
    assert told["model"] == "hybrid" and [*told["files"], *told["refused"]] == [*(f for f in EXPORTERS if f != "jsbsim"), "jsbsim"]
    assert {p.name for p in (tmp_path / "all").iterdir()} == set(told["files"])
    shown = awes("export", "learned", "--out", tmp_path / "all").stdout
    assert "jsbsim: not written: the network has no counterpart in JSBSim" in shown
    alone = awes("export", "learned", "--to", "json,jsbsim", "--out", tmp_path / "alone")
    assert alone.exit_code == 2 and "--model with_effects" in alone.stderr and not (tmp_path / "alone").exists()
    assert awes("export", "out", "--to", "jsbsim", "--model", "with_effects", "--out", tmp_path / "alone").exit_code == 0


@pytest.mark.slow
def test_numbers_come_with_interval_source_and_provenance(run, tmp_path):
    """Those of params.json, unit and hash of the flight included."""
    assert awes("export", "out", "--model", "identified", "--to", "json", "--out", tmp_path).exit_code == 0
    tables = read_json(next((tmp_path / "json").glob("*.json")))
    params = read_json(run / "out" / "identify" / "params.json")["parameters"]
    rows = {p["name"]: p for p in tables["parameters"]}
    shared = [n for n in params if n in rows]
    assert len(shared) > 10
    for name in shared:
        row, fit = rows[name], params[name]
        assert (row["value"], row["std"], row["interval_95"]) == (pytest.approx(fit["value"], rel=1e-9), fit["std"], fit["interval"])
        assert "identified by awes" in row["source"]
    made = read_json(run / "out" / "identify" / "provenance.json")
    assert made["stamp"]["inputs"]["flight"] in tables["provenance"]["flight"]
    assert made["artifacts"]["kite.yaml"] in tables["provenance"]["kite file"]


def test_a_kite_file_alone_is_a_model(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    make_small_run(tmp_path)
    answer = awes("export", "kite.yaml", "--to", "c,json")
    assert answer.exit_code == 0 and "no flight was named" in answer.stdout
    assert {p.name for p in (tmp_path / "export" / "c").iterdir()} == {"km1_initial.c", "km1_initial.h", "README.md"}
    assert awes("export", "kite.yaml", "--flight", "flight", "--to", "json").exit_code == 0
    tables = read_json(tmp_path / "export" / "json" / "km1_initial.json")
    assert "into the flight" in tables["start"] and tables["flown_range"]["V_a"][0] > 10.0


@pytest.mark.parametrize(
    "words, told",
    [
        (["none"], "none: there is no such folder or file"),
        (["kite.yaml", "--to", "fnu"], "--to: there is no form 'fnu'\n  Did you mean 'fmu'?"),
        (["kite.yaml", "--to", ""], "--to: there is no form ''"),
        (["kite.yaml", "--model", "hybird"], "--model: there is no 'hybird'\n  Did you mean 'hybrid'?"),
        (["kite.yaml", "--model", "hybrid"], "a kite file holds no model 'hybrid'"),
        (["kite.yaml", "--surfaces", "controller"], "a kite file holds no controller"),
        (["kite.yaml", "--surfaces", "pilot"], "--surfaces: there is no 'pilot'"),
        (["kite.yaml", "--out", "kite.yaml"], "--out kite.yaml: is a file, a folder is needed"),
        (["kite.yaml", "--flight", "gone"], "gone"),
        (["stages.yaml"], "stages.yaml"),
        (["flight/kite.csv"], "kite.csv"),
        (["flight"], "flight: no results of awes are here"),
        ([".", "--to", "c"], "no results of awes are here"),
    ],
)
def test_bad_input_is_one_clear_error_and_writes_nothing(tmp_path, monkeypatch, words, told):
    monkeypatch.chdir(tmp_path)
    make_small_run(tmp_path)
    before = sorted(tmp_path.rglob("*"))
    result = awes("export", *words)
    assert result.exit_code == 2 and told in result.stderr and result.stdout == "", result.stderr
    assert sorted(tmp_path.rglob("*")) == before


@pytest.mark.slow
def test_what_a_run_has_not_made_names_the_command_that_makes_it(run, tmp_path, monkeypatch):
    shutil.copytree(run / "out" / "identify", tmp_path / "out" / "identify")
    monkeypatch.chdir(tmp_path)
    for words, told in (
        (["--model", "hybrid"], "Make it: awes train-hybrid; it has initial, identified."),
        (["--surfaces", "controller"], "Make it: awes fit-controller"),
        (["--flight", "gone"], "gone"),
    ):
        result = awes("export", "out", *words)
        assert result.exit_code == 2 and told in result.stderr, result.stderr
    result = awes("export", ".")
    assert result.exit_code == 2 and "Did you mean out?" in result.stderr, result.stderr
    assert awes("export", "out", "--to", "json").exit_code == 0  # the newest is what identify made
