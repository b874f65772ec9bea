"""Long logs with known faults: every fault is found and told, nothing untrue is called valid, nothing is bridged beyond the stated gap.

The generator and the judge are those of benchmarks/long_logs.py, which runs the same at hours and many seeds.
"""

import long_logs
import numpy as np
import polars as pl
import pytest
from long_logs import clean_of_faults, try_one
from long_logs_faults import FAULTS, gaps, hard_to_use, spoil, stuck, zeros
from long_logs_flight import flight

from awescli.flightlog.loops import find_loops
from awescli.flightlog.quality import data_quality
from awescli.flightlog.read import read_flight
from awescli.notation.errors import AwesError

TWENTY_MINUTES = 1 / 3


@pytest.fixture(scope="module")
def clean():
    """(log, phases) of twenty minutes at 20 Hz."""
    return flight(1200.0, 20.0)


def written(folder, frame, wind):
    frame.write_csv(folder / "kite.csv")
    (folder / "wind.csv").write_text(wind)
    return folder


def test_the_clean_flight_is_read_as_it_is(tmp_path, clean):
    """No fault is seen where there is none, so none of the tests below passes by crying wolf."""
    frame, wind, _ = spoil(clean[0], (), 0)
    log = read_flight(written(tmp_path, frame, wind))
    assert log.valid.all() and log.notes == () and not log.causes
    # the generator lets the nose point along the way over ground, and its wind does not grow with height
    poor = {check.name for check in data_quality(log).checks if not check.ok}
    assert poor <= {"nose against airflow", "wind against airspeed"}


@pytest.mark.parametrize("fault", FAULTS, ids=lambda f: f.__name__)
def test_each_fault_alone(fault):
    found = try_one(TWENTY_MINUTES, 20.0, 3, [fault])
    assert clean_of_faults(found), found


@pytest.mark.parametrize("rate", [10.0, 25.0])
def test_all_faults_at_once(rate):
    found = try_one(TWENTY_MINUTES, rate, 4)
    assert clean_of_faults(found), found


def test_the_judge_sees_what_a_careless_reader_would_do(tmp_path, clean):
    """Bridging every gap and believing every sensor is not good: the judge would say so."""
    log, label = clean
    frame, wind, faulty = spoil(log, [gaps, stuck, zeros], 5)
    read = read_flight(written(tmp_path, frame, wind))
    careless = type(read)(read.name, read.start, read.dt, read.time, read.measured, read.inputs, np.ones(len(read), bool), read.wind)
    found = long_logs.judge(log, label, faulty, careless)
    assert found["wrong"] > 100 and found["bridged"] > 100 and set(found["unnamed"]) == {"gaps", "dropout", "stuck"}


def test_what_is_left_out_is_told_with_its_reason(tmp_path, clean):
    frame, wind, _ = spoil(hard_to_use(*clean), [gaps, stuck], 1)
    log = read_flight(written(tmp_path, frame, wind))
    quality = data_quality(log)
    assert quality.left_out["invalid: gap"] == pytest.approx(0.45 + 1.95 + 11.95, abs=0.2)
    assert quality.left_out["loops left out: slack line"] > 5 and quality.left_out["loops left out: no excitation"] > 5
    told = {stretch.why for stretch in quality.stretches}
    assert {"gap", "q stuck", "psi stuck", "tether_length stuck"} <= told
    assert any(why.startswith("loops: no control surface moves") for why in told)
    assert "left out: 1 slack line, 1 no excitation" in quality.loops
    # and indeed no loop that is used holds one of them
    for out in find_loops(log).left_out:
        assert not any(first < out.last and out.first < last for first, last in find_loops(log).bounds)


def test_figures_of_eight_are_loops(clean):
    """Each of the two phases of 144 s with figures of 16 s gives 8 or 9 of them; those with loops of 8 s give 17 or 18 each."""
    log, label = clean
    loops = find_loops(log)
    seconds = np.diff(loops.bounds, axis=1).ravel() * log.dt
    assert loops.kind == "loops" and 34 <= (abs(seconds - 8.0) < 0.5).sum() <= 36 and 15 <= (abs(seconds - 16.0) < 0.5).sum() <= 18
    # a figure starts and ends in the middle, towards growing azimuth
    eights = loops.bounds[abs(seconds - 16.0) < 0.5]
    azimuth = np.arctan2(log["p_e"], log["p_n"])
    assert np.abs(azimuth[eights[:, 0]]).max() < 0.05 and (azimuth[eights[:, 0] + 20] > azimuth[eights[:, 0]]).all()
    # the first loop begins while the kite speeds up
    assert all((label[first:last] == "traction").mean() > 0.9 for first, last in loops.bounds[1:])


def test_set_points_in_other_units(tmp_path, clean):
    """Surfaces in rad and a load in N are refused by name; declared in flight.yaml they give the same flight."""
    frame, wind, _ = spoil(clean[0], (), 0)
    surfaces = ["aileron_sp", "elevator_sp", "rudder_sp", "flaps_sp"]
    as_format = read_flight(written(tmp_path, frame, wind))
    other = frame.with_columns([pl.col(c) * np.pi / 180 for c in surfaces] + [pl.col("LoadFiltered") * 9.80665])
    written(tmp_path, other, wind)
    with pytest.raises(AwesError) as error:
        read_flight(tmp_path)
    assert all(c in str(error.value) for c in ("rudder_sp", "LoadFiltered"))
    units = ", ".join(f"{c}: rad" for c in surfaces) + ", LoadFiltered: N"
    (tmp_path / "flight.yaml").write_text(f"format: kitemill\nunits: {{{units}}}\n")
    declared = read_flight(tmp_path)
    assert all(np.allclose(declared[n], as_format[n], rtol=0, atol=1e-9) for n in ("rudder", "flaps", "elevator", "tension"))


def test_a_spike_is_no_unit_and_a_step_is_no_spike(tmp_path, clean):
    """One absurd cell does not make a log "in other units"; a set-point that jumps and stays is flown."""
    frame, wind, _ = spoil(clean[0], (), 0)
    rudder = frame["rudder_sp"].to_numpy().copy()
    rudder[9000] = 4000.0
    rudder[12000:12040] += 20.0
    log = read_flight(written(tmp_path, frame.with_columns(pl.Series("rudder_sp", rudder)), wind))
    assert log.counters["spikes"] == 1 and log.valid.all()
    assert np.degrees(log["rudder"][12020] - clean[0]["rudder"][12020]) == pytest.approx(20.0, abs=1e-3)
    # what took the place of the spike is on the line between its neighbours
    assert log["rudder"][9000] == pytest.approx(log["rudder"][[8999, 9001]].mean())
