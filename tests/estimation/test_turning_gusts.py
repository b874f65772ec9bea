"""Gusts that turn a kite, where they had found no room beside a model error that stayed."""

from dataclasses import dataclass, replace
from types import SimpleNamespace

import pytest
from kites import DEVELOPMENT, flight

from awescli.estimation import staged_fit
from awescli.estimation.processes.gusts import Gusts
from awescli.estimation.processes.model_error import ModelError
from awescli.estimation.processes.roll_gusts import RollGusts


@pytest.fixture(scope="module")
def log():
    return flight(seed=1, duration=20.0).log


def processes(log, gusts=0.3, rolling=0.0, **errors):
    """Of a flight: levels of gusts, of roll gusts, and of axes of the model error."""
    air, roll, error = (kind.of(DEVELOPMENT, log) for kind in (Gusts, RollGusts, ModelError))
    return air.at(dict.fromkeys(air.levels, gusts)), roll.at({"roll gusts": rolling}), error.at({**error.levels, **errors})


@dataclass(frozen=True)
class Problem:
    """What is asked of an estimation problem."""

    processes: tuple
    spacing: float = 0.02

    def with_processes(self, processes):
        return replace(self, processes=tuple(processes))

    def spaced(self, between):
        return replace(self, spacing=between)

    def misfit(self):
        return SimpleNamespace(carried=lambda own, before: own)


@pytest.mark.parametrize("levels, may", [
    ({"moment_x": 0.2}, True), ({"force_x": 0.2}, False), ({"moment_x": 0.2, "gusts": 0.0}, False),
    ({"moment_x": 0.2, "rolling": 0.01}, False), ({}, False),
])  # fmt: skip
def test_they_are_looked_for_again_in_place_of_a_model_error_of_moments(log, levels, may):
    """Guards calm air, where what rolls a kite against its model is no gust, and forces, which gusts that turn a kite do not make."""
    assert staged_fit._may_turn(Problem(processes(log, **levels))) is may


@pytest.mark.parametrize("gained, ended, taken", [(90.0, True, True), (90.0, False, False), (1.0, True, False)])
def test_they_stay_where_they_are_likelier(log, monkeypatch, gained, ended, taken):
    """Guards a receiver that is late in JSBSim's turbulence: gusts that roll the kite found no room beside what it had left, and with its
    size found to a thousandth it was `unexplained`, for the model error that stood for them."""
    before = SimpleNamespace(deviance=1000.0, flights=(SimpleNamespace(own=None, misfit=None, parameters=None),))
    problems, begun = [Problem(processes(log, moment_x=0.2))], []
    found = [Problem(processes(log, rolling=0.01))]
    priors = [staged_fit.prior_deviance(those[0].processes) for those in (problems, found)]
    after = SimpleNamespace(deviance=1000.0 + priors[0] - priors[1] - gained, ended=ended)

    def fit_levels(turned, *given):
        begun.append((turned[0].spacing, staged_fit.levels_of(turned[0].processes)))
        return after, found

    monkeypatch.setattr(staged_fit, "fit_levels", fit_levels)
    monkeypatch.setattr(staged_fit, "at_near_nodes", lambda turned, rough, there: (turned, [], []))
    assert staged_fit._turned(before, problems, [""], (), True, None) == ((after, found) if taken else (before, problems))
    assert [spacing for spacing, _ in begun] == ([staged_fit.COARSE, 0.02] if ended else [staged_fit.COARSE])
    assert all(levels["roll gusts"] > 0 and 0 < levels["moment_x"] < 0.2 for _, levels in begun)


def test_where_they_find_no_room_at_nodes_that_are_far_apart_nothing_more_is_asked(log, monkeypatch):
    """Guards the time of a trace: on a long flight of JSBSim they were fitted at close nodes, to come to nothing."""
    before = SimpleNamespace(deviance=1000.0, flights=(SimpleNamespace(own=None, misfit=None, parameters=None),))
    problems, asked = [Problem(processes(log, moment_x=0.2))], []

    def fit_levels(turned, *given):
        asked.append(turned[0].spacing)
        return SimpleNamespace(deviance=0.0, ended=True), [Problem(processes(log, moment_x=0.1))]

    monkeypatch.setattr(staged_fit, "fit_levels", fit_levels)
    assert staged_fit._turned(before, problems, [""], (), True, None) == (before, problems) and asked == [staged_fit.COARSE]
