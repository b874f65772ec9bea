"""Numbers that cannot be: physical ranges, the weather's cover, the sign and size of the load; by values that are set."""

from dataclasses import replace

import numpy as np
import pytest
from flightlog.synthetic import circle

from awescli.flightlog.enough import enough_checks
from awescli.flightlog.loops import Loops
from awescli.flightlog.physical import physical_checks
from awescli.flightlog.quality import data_quality
from awescli.flightlog.repeats import LONGEST_ALIKE, repeated_rows

LOG = circle(noise=0.01)
FLOWN = np.ones(len(LOG), bool)


def found(log, name):
    return next(c for c in physical_checks(log, FLOWN) if c.name == name)


def test_a_good_log_passes_all():
    assert all(c.ok and not c.stops for c in physical_checks(LOG, FLOWN))


NO_AIR = (0.0, -1.0, 0.5, 1225.0, 1e9)


@pytest.mark.parametrize("density, stops", [*((d, True) for d in NO_AIR), (0.75, False), (1.45, False)])
def test_density_that_is_no_air(density, stops):
    """Guards the four values that were called good, and the limits at which a mountain or a winter's day only warn."""
    check = found(replace(LOG, wind=replace(LOG.wind, density=np.full(2, density))), "air density")
    assert not check.ok and check.stops == stops and check.value == density


@pytest.mark.parametrize("away, ok, stops", [(60.0, True, False), (1800.0, False, False), (6840.0, False, True)])
def test_weather_that_does_not_cover_the_flight(away, ok, stops):
    """Guards 1.9 h: what is told is the farthest end of the flight from the nearest sample, here the end, `away` after the last."""
    log = replace(LOG, wind=replace(LOG.wind, time=LOG.time[-1] - away - np.array([600.0, 0.0])))
    check = found(log, "weather coverage")
    assert check.value == pytest.approx(away, abs=0.1) and (check.ok, check.stops) == (ok, stops)


def test_heights_of_the_wind_in_km():
    check = found(replace(LOG, wind=replace(LOG.wind, height=np.array([0.01]))), "wind heights")
    assert check.stops and check.value == 0.01
    assert found(replace(LOG, wind=replace(LOG.wind, height=np.array([32808.0]))), "wind heights").stops


def test_a_line_that_pushes_and_one_that_hardly_pulls():
    negative = replace(LOG, measured={**LOG.measured, "tension": -LOG["tension"]})
    assert found(negative, "line that pushes").stops and found(negative, "line that pushes").value == 100.0
    tiny = replace(LOG, measured={**LOG.measured, "tension": 1e-3 * LOG["tension"]})
    assert found(tiny, "load against airspeed").stops


def test_the_channel_that_goes_farthest_is_named():
    far = replace(LOG, inputs={**LOG.inputs, "rudder": np.deg2rad(80.0) * np.sin(LOG.time)})
    check = found(far, "physical ranges")
    assert check.stops and "rudder" in check.sentence and check.value == pytest.approx(2.0, rel=0.01)


def test_blocks_that_stand_there_twice_are_found_row_by_row():
    """Guards pasted logs: exactly the second copy counts; a sensor that stands still, and rows that repeat their neighbour, do not."""
    noise = np.random.default_rng(0).standard_normal((3, 400))
    assert not repeated_rows(noise).any()
    twice = np.concatenate([noise, noise[:, 100:250]], axis=1)
    assert np.flatnonzero(repeated_rows(twice)).tolist() == list(range(400, 550))
    with_gaps = twice.copy()
    with_gaps[1, 120], with_gaps[1, 420] = np.nan, np.nan
    assert repeated_rows(with_gaps).sum() == 150
    assert not repeated_rows([np.repeat(noise[0], 3), np.repeat(noise[1], 3)]).any()
    assert not repeated_rows([np.zeros(400), np.ones(400)]).any()
    short = np.concatenate([noise, noise[:, : LONGEST_ALIKE - 1]], axis=1)
    assert not repeated_rows(short).any()


def test_enough_counts_rows_copies_loops_and_motion():
    loops = Loops("loops", np.array([[0, 100]] * 4), "four loops")
    log = replace(LOG, counters={"rows": 1000, "repeated": 100, "pasted_rows": 200})
    checks = {c.name: c for c in enough_checks(log, FLOWN, loops)}
    assert checks["missing rows"].value == pytest.approx(100 * (1 - 900 / 3000)) and not checks["missing rows"].ok
    assert checks["repeated blocks"].value == 20.0 and checks["repeated blocks"].stops
    assert checks["usable loops"].value == 4 and not checks["usable loops"].ok and not checks["usable loops"].stops
    still = replace(LOG, inputs={**LOG.inputs, "rudder": 0.2 + 0.0 * LOG.time})
    assert next(c for c in enough_checks(still, FLOWN, loops) if c.name == "moving surfaces").stops


def test_every_check_has_a_name_that_a_plan_may_ignore():
    from awescli.flightlog.check_names import OF_LOG

    made = {c.name for c in data_quality(LOG).checks}
    assert made <= set(OF_LOG) and len(made) > 20
