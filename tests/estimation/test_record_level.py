"""The level of the wind's record, from flights whose wind differs from their record by as much as is known."""

from dataclasses import replace

import numpy as np
import pytest
from kites import declared, flight

from awescli.estimation.fit import fit
from awescli.estimation.known import Known
from awescli.estimation.problem import build, simulator_of
from awescli.estimation.record_level import with_record_level
from awescli.estimation.wind_seen import processes_at
from awescli.flightlog.split import Split
from awescli.notation.quantities import MEASURED

PARTS = Split(((100, 2100),), ((2100, 2500),), ((2500, 2900),), (1, 1, 1), "loops")


def level_of(log, kite, levels=None) -> float:
    """What is found of the record's level where nothing but the air is unknown."""
    simulator = simulator_of(kite, log)
    known = Known((), np.zeros((0, 0)), np.zeros(0, bool), np.zeros(0), processes_at(kite, log, levels or {}))
    found = with_record_level(simulator, log, PARTS, 5.0, known)
    for before, after in zip(known.processes, found.processes, strict=True):
        assert before.certain or before.levels == after.levels
    return next(p for p in found.processes if p.certain).levels["wind record"]


def kite_with(std: float):
    """The development kite whose wind record is declared so accurate [m/s]."""
    kite = declared()
    return kite.model_copy(update={"wind": kite.wind.model_copy(update={"std": std, "direction_std": std / 10})})


def test_a_level_returns():
    """Guards the likelihood: air that differs from its record by 0.3 m/s on every axis, with the memory that is assumed, is found with its
    level to a quarter, though the record is declared good to 0.1 m/s."""
    flown = flight(seed=3, duration=60.0, noise=True, effects=(("turbulence", (("sigma", 0.3), ("L", 80.0))),))
    assert level_of(flown.log, kite_with(0.1)) == pytest.approx(0.3, rel=0.25)


def test_what_is_declared_matters_little_where_the_log_says_more():
    """Guards the prior: a record declared four times as bad is found within half as much again, below both declarations' levels where
    the record is better than either."""
    log = flight(seed=3, duration=60.0, noise=True).log
    good, bad = (level_of(log, kite_with(std)) for std in (0.1, 0.4))
    assert good < 0.07 and bad < 1.5 * good < 0.28


def test_gusts_of_a_known_level_are_not_taken_for_the_record():
    """Guards what else there is: with the gusts' own process at its level, the record stays below a third of them."""
    log = flight(seed=3, duration=60.0, noise=True, effects=(("turbulence", (("sigma", 0.6),)),)).log
    gusts = {"horizontal gusts": {"level": 0.6, "memory_s": 3.7}, "vertical gusts": {"level": 0.55, "memory_s": 0.75}}
    assert level_of(log, kite_with(0.1), gusts) < 0.2


def test_where_nothing_flies_the_level_stays():
    """Guards a model that diverges everywhere: what was declared is kept."""
    log = flight(seed=3, duration=60.0, noise=True).log
    assert level_of(log, declared(Cmq=4e4)) == pytest.approx(0.07)


def test_parameters_are_known_as_a_record_of_that_level_lets_them_be():
    """Guards covariance and found values: after a fit with a record that is declared four times as bad, what is told of parameters and of
    the record's lasting errors is what a fit with the record's own level says."""
    flown = flight(seed=3, duration=60.0, noise=True)

    def fitted(std: float):
        kite = kite_with(std)
        simulator = simulator_of(kite, flown.log)
        names = tuple(n for n in simulator.wrt if n in ("CL0", "CLa", "CD0", "CYb") or n in simulator.kite.record)
        problem = replace(build(simulator, flown.log, PARTS, 5.0, tuple(MEASURED)), names=names)
        found = fit(problem.misfit(simulator), simulator.kite.parameters)
        values = np.array([found.parameters[n].value for n in names])
        record = np.isin(names, simulator.kite.record)
        model = simulator.holding(found.parameters.with_values(dict.fromkeys(simulator.kite.record, 0.0)))
        processes = processes_at(kite, flown.log, {})
        return model, Known(names, found.covariance, record, np.where(record, values, 0.0), processes), values

    model, known, values = fitted(0.4)
    levelled = with_record_level(model, flown.log, PARTS, 5.0, known)
    share = levelled.processes[0].levels["wind record"] / known.processes[0].levels["wind record"]
    assert levelled.processes[0].certain and share < 0.3
    _, direct, there = fitted(0.4 * share)
    std, asked = (np.sqrt(np.diag(k.covariance)) for k in (levelled, direct))
    assert std == pytest.approx(asked, rel=0.01) and (std < 0.6 * np.sqrt(np.diag(known.covariance))).sum() > 4
    moved = np.where(known.record, 0.0, values) + levelled.found - there
    assert (np.abs(moved) < 0.05 * asked).all()
