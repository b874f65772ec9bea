"""The FMU is valid, compiles as it is, and flies what the simulator flies, in Co-Simulation and in Model Exchange."""

import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest
from export.models import CASES, Flown, compared, free, with_controller, with_network, with_states

from awescli.export.fmu import fmu, fmu_files, token, variable_name

fmpy = pytest.importorskip("fmpy", reason="fmpy is not installed (extra `test`)")
pytest.importorskip("fmpy.validation")
pytestmark = [
    pytest.mark.skipif(shutil.which("gcc") is None, reason="no C compiler on this machine"),
    pytest.mark.skipif(shutil.which("cmake") is None, reason="no cmake on this machine, with which fmpy compiles"),
]


@pytest.fixture(scope="module")
def unpacked(tmp_path_factory):
    """case -> (folder of the compiled FMU, its description); each compiled once, by fmpy itself."""
    from fmpy.build import build_platform_binary

    kept = {}

    def of(flown: Flown):
        key = token(flown.model)
        if key not in kept:
            folder = tmp_path_factory.mktemp("fmu")
            (folder / "model.fmu").write_bytes(fmu(flown.model))
            unzipped = fmpy.extract(str(folder / "model.fmu"), unzipdir=str(folder / "unpacked"))
            build_platform_binary(unzipped, all_warnings=True)
            kept[key] = unzipped, fmpy.read_model_description(unzipped)
        return kept[key]

    return of


class Importer:
    """An instance of an FMU whose variables are set and read by name."""

    def __init__(self, kind, unzipped, description, identifier):
        self.references = {v.name: v.valueReference for v in description.modelVariables}
        self.fmu = kind(guid=description.guid, unzipDirectory=unzipped, modelIdentifier=identifier, instanceName="one")
        self.fmu.instantiate()

    def set(self, kind: str, names, values, derivative: bool = False) -> None:
        self.fmu.setFloat64([self.references[variable_name(kind, n, derivative)] for n in names], [float(v) for v in values])

    def get(self, kind: str, names) -> list[float]:
        return self.fmu.getFloat64([self.references[variable_name(kind, n)] for n in names])


def of_sample(one: Importer, flown: Flown, k: int) -> None:
    """Inputs of a sample, and how they run to the next one."""
    inputs, points = [s.name for s in flown.model.inputs], [s.name for s in flown.model.set_points]
    one.set("input", inputs, flown.inputs[k])
    ahead = flown.inputs[min(k + 1, len(flown.inputs) - 1)]
    one.set("input", inputs, (ahead - flown.inputs[k]) / flown.segments.dt, derivative=True)
    one.set("set_point", points, flown.set_points[k])


@pytest.mark.parametrize("case", CASES)
def test_the_fmu_is_valid(case, tmp_path):
    (name, content), = fmu_files(CASES[case]().model).items()
    (tmp_path / name).write_bytes(content)
    assert fmpy.validation.validate_fmu(str(tmp_path / name)) == []


def test_the_interface_compiles_without_a_warning(tmp_path):
    """With the flags of the model's own file."""
    (tmp_path / "model.fmu").write_bytes(fmu(with_controller().model))
    sources = Path(fmpy.extract(str(tmp_path / "model.fmu"), unzipdir=str(tmp_path / "unpacked"))) / "sources"
    command = ["gcc", "-std=c99", "-Wall", "-Wextra", "-Werror", "-pedantic", "-O2", "-c", "fmi3.c", "-o", "fmi3.o"]
    done = subprocess.run(command, cwd=sources, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize("case", [n for n in CASES if n != "with_slow_samples"])
def test_co_simulation_flies_the_same_ten_seconds(case, unpacked):
    """Communication points are the samples. (Where samples are slow, an importer holds set-points: it knows no line between samples.)"""
    flown = CASES[case]()
    one = Importer(fmpy.fmi3.FMU3Slave, *unpacked(flown), flown.model.identifier)
    names = [s.name for s in flown.model.outputs]
    of_sample(one, flown, 0)
    one.fmu.enterInitializationMode(startTime=0.0)
    one.fmu.exitInitializationMode()
    found = np.empty_like(flown.outputs)
    for k in range(len(found)):
        of_sample(one, flown, k)
        found[k] = one.get("sensor", names)
        if k + 1 < len(found):
            one.fmu.doStep(k * flown.segments.dt, flown.segments.dt)
    one.fmu.terminate()
    one.fmu.freeInstance()
    assert compared(flown, found) < 1e-9


@pytest.mark.parametrize("flown", [with_states, with_controller, with_network, free], ids=lambda f: f.__name__)
def test_model_exchange_flies_the_same_two_seconds(flown, unpacked):
    """Stepped from outside by RK4 with the simulator's steps, inputs set at every stage, events where a law holds its set-points."""
    flown = flown()
    one = Importer(fmpy.fmi3.FMU3Model, *unpacked(flown), flown.model.identifier)
    n_s, dt, steps = len(flown.model.states), flown.segments.dt, round(flown.segments.dt / flown.model.longest)
    inputs, points = [s.name for s in flown.model.inputs], [s.name for s in flown.model.set_points]
    of_sample(one, flown, 0)
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


def test_the_state_of_an_instance_comes_back(unpacked):
    """What an optimiser needs: put an instance back, and step it again to the same numbers; also from bytes."""
    flown = with_controller()
    one = Importer(fmpy.fmi3.FMU3Slave, *unpacked(flown), flown.model.identifier)
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


def test_fmpy_simulates_it_by_itself(tmp_path, unpacked):
    """The importer's own loop, from the start that the FMU carries, without a file beside it."""
    flown = free()
    unzipped, _ = unpacked(flown)
    found = fmpy.simulate_fmu(unzipped, stop_time=1.0, output_interval=0.02, output=["sensor.V_a", "sensor.p_d"], fmi_type="CoSimulation")
    assert len(found) == 51 and np.isfinite(found["sensor.V_a"]).all()
    assert found["sensor.V_a"][0] == pytest.approx(flown.outputs[0, 15], rel=1e-9)


def test_what_cannot_be_set_is_refused(unpacked):
    flown = free()
    one = Importer(fmpy.fmi3.FMU3Slave, *unpacked(flown), flown.model.identifier)
    with pytest.raises(fmpy.fmi1.FMICallException):
        one.set("sensor", ["V_a"], [1.0])
    wrong = fmpy.fmi3.FMU3Slave(guid="{no}", unzipDirectory=unpacked(flown)[0], modelIdentifier=flown.model.identifier, instanceName="two")
    with pytest.raises(Exception, match="instantiate"):
        wrong.instantiate()
