"""The FMU is valid, compiles as it is, and flies what the simulator flies, in Co-Simulation and in Model Exchange."""

import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest
from export.flying import Importer, in_fmu, put, unpacked
from export.models import CASES, Flown, compared, free, on_file, with_controller, with_network, with_states
from kites import ROOT

from awescli.export.fmu import fmu, fmu_files, token

fmpy = pytest.importorskip("fmpy", reason="fmpy is not installed (extra `test`)")
pytest.importorskip("fmpy.validation")
pytestmark = [
    pytest.mark.skipif(shutil.which("gcc") is None, reason="no C compiler on this machine"),
    pytest.mark.skipif(shutil.which("cmake") is None, reason="no cmake on this machine, with which fmpy compiles"),
]


@pytest.fixture(scope="module")
def importable(tmp_path_factory):
    """model -> its FMU, unpacked; each compiled once."""
    kept = {}

    def of(flown: Flown) -> str:
        key = token(flown.model)
        if key not in kept:
            kept[key] = unpacked(put(tmp_path_factory.mktemp("fmu"), fmu_files(flown.model)))
        return kept[key]

    return of


@pytest.mark.parametrize("case", CASES)
def test_the_fmu_is_valid(case, tmp_path):
    (name, content), = fmu_files(CASES[case]().model).items()
    (tmp_path / name).write_bytes(content)
    assert fmpy.validation.validate_fmu(str(tmp_path / name)) == []


@pytest.mark.parametrize("kite", [p.stem for p in (ROOT / "data" / "kites").glob("*.yaml")])
def test_the_fmu_of_every_kite_file_is_valid(kite, tmp_path):
    """Also where no parameter is a time: the unit of `time` is defined in any case."""
    put(tmp_path, fmu_files(on_file(kite)))
    (file,) = tmp_path.glob("*.fmu")
    assert fmpy.validation.validate_fmu(str(file)) == []


def test_the_interface_compiles_without_a_warning(tmp_path):
    """With the flags of the model's own file."""
    (tmp_path / "model.fmu").write_bytes(fmu(with_controller().model))
    sources = Path(fmpy.extract(str(tmp_path / "model.fmu"), unzipdir=str(tmp_path / "unpacked"))) / "sources"
    command = ["gcc", "-std=c99", "-Wall", "-Wextra", "-Werror", "-pedantic", "-O2", "-c", "fmi3.c", "fmi3_absent.c"]
    done = subprocess.run(command, cwd=sources, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize("case", [n for n in CASES if n != "with_slow_samples"])
def test_co_simulation_flies_the_same_ten_seconds(case, importable):
    """Communication points are the samples. (Where samples are slow, an importer holds set-points: it knows no line between samples.)"""
    flown = CASES[case]()
    assert compared(flown, in_fmu(importable(flown), flown.tables, flown.ride)) < 1e-9


@pytest.mark.parametrize("flown", [with_states, with_controller, with_network, free], ids=lambda f: f.__name__)
def test_model_exchange_flies_the_same_two_seconds(flown, importable):
    """Stepped from outside by RK4 with the simulator's steps, inputs set at every stage, events where a law holds its set-points."""
    flown = flown()
    one = Importer(fmpy.fmi3.FMU3Model, importable(flown), flown.model.identifier)
    n_s, dt, steps = len(flown.model.states), flown.segments.dt, round(flown.segments.dt / flown.model.longest)
    inputs, points = [s.name for s in flown.model.inputs], [s.name for s in flown.model.set_points]
    one.at_sample(flown.tables, flown.ride, 0)
    one.fmu.enterInitializationMode(startTime=0.0)
    one.fmu.exitInitializationMode()
    x = np.array([one.get("state", [s.name])[0] for s in flown.model.states])

    def rates(x, k, share):
        one.fmu.setTime((k + share) * dt)
        one.fmu.setContinuousStates((fmpy.fmi3.fmi3Float64 * n_s)(*x), n_s)
        one.set("input", inputs, flown.inputs[k] + share * (flown.inputs[k + 1] - flown.inputs[k]))
        out = (fmpy.fmi3.fmi3Float64 * n_s)()
        one.fmu.getContinuousStateDerivatives(out, n_s)
        return np.array(out)

    found, h = [], dt / steps
    for k in range(101):
        one.fmu.setTime(k * dt)
        one.fmu.setContinuousStates((fmpy.fmi3.fmi3Float64 * n_s)(*x), n_s)
        one.set("input", inputs, flown.inputs[k])
        one.set("set_point", points, flown.set_points[k])
        one.fmu.enterEventMode()
        *_, defined, event = one.fmu.updateDiscreteStates()
        assert defined == bool(flown.model.law) and (not defined or event == pytest.approx((k + 1) * dt))
        one.fmu.enterContinuousTimeMode()
        found.append(one.get("sensor", [s.name for s in flown.model.outputs]))
        for i in range(steps):
            k1 = rates(x, k, i / steps)
            k2 = rates(x + h / 2 * k1, k, (i + 0.5) / steps)
            k3 = rates(x + h / 2 * k2, k, (i + 0.5) / steps)
            x = x + h / 6 * (k1 + 2 * k2 + 2 * k3 + rates(x + h * k3, k, (i + 1) / steps))
    error = np.abs(np.array(found) - flown.outputs[: len(found)]) / flown.range
    assert error.max() < 1e-9


def test_the_state_of_an_instance_comes_back(importable):
    """What an optimiser needs: put an instance back, and step it again to the same numbers; also from bytes."""
    flown = with_controller()
    one = Importer(fmpy.fmi3.FMU3Slave, importable(flown), flown.model.identifier)
    one.fmu.enterInitializationMode(startTime=0.0)
    one.fmu.exitInitializationMode()
    names, dt = [s.name for s in flown.model.states], flown.segments.dt
    one.fmu.doStep(0.0, dt)
    kept = one.fmu.getFMUState()
    for back in (kept, one.fmu.deserializeFMUState(one.fmu.serializeFMUState(kept))):
        one.fmu.setFMUState(back)
        one.fmu.doStep(dt, dt)
        after = one.get("state", names)
        one.fmu.setFMUState(kept)
        assert one.get("state", names) != after
        one.fmu.doStep(dt, dt)
        assert one.get("state", names) == after


def test_fmpy_simulates_it_by_itself(importable):
    """The importer's own loop, from the start that the FMU carries, without a file beside it."""
    flown = free()
    unzipped = importable(flown)
    found = fmpy.simulate_fmu(unzipped, stop_time=1.0, output_interval=0.02, output=["sensor.V_a", "sensor.p_d"], fmi_type="CoSimulation")
    assert len(found) == 51 and np.isfinite(found["sensor.V_a"]).all()
    assert found["sensor.V_a"][0] == pytest.approx(flown.outputs[0, 15], rel=1e-9)


def test_what_cannot_be_set_is_refused(importable):
    flown = free()
    one = Importer(fmpy.fmi3.FMU3Slave, importable(flown), flown.model.identifier)
    with pytest.raises(fmpy.fmi1.FMICallException):
        one.set("sensor", ["V_a"], [1.0])
    wrong = fmpy.fmi3.FMU3Slave(guid="{no}", unzipDirectory=importable(flown), modelIdentifier=flown.model.identifier, instanceName="two")
    with pytest.raises(Exception, match="instantiate"):
        wrong.instantiate()
