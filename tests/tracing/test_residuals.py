"""Forces and moments that a flight shows and a model does not: exactly what was left out, nothing of what was not."""

import numpy as np
import pytest
from kites import DEVELOPMENT

from awescli.estimation.prediction import predict
from awescli.flightlog.loops import find_loops
from awescli.flightlog.split import split
from awescli.notation.parameters import ParameterTable
from awescli.physics.kite import Kite
from awescli.simulation.rollout import Simulator
from awescli.simulation.synthetic import with_effects
from awescli.tracing import residuals
from awescli.tracing.residuals import SHORT, equation_error, residual_study


def left(log, effects) -> dict:
    """Series of `equation_error` of the development kite with further effects."""
    return equation_error(Simulator(Kite(with_effects(DEVELOPMENT, effects), log.wind.height)), log)[1]


def test_a_missing_moment_is_left_about_its_own_axis(calm):
    """Guards J omega_dot + omega x J omega - M with the whole J (Jxz is 1.97 kg m2): a yawing moment that a model has too much of is left
    with its size about z, and nothing of it about x. With the diagonal of J alone, a third of it stood about x."""
    log, k = calm.log, 0.01
    without, with_it = left(log, {}), left(log, {"custom_term:m_z*1": {"k": k}})
    change = {axis: with_it[f"equation_moment_{axis}"] - without[f"equation_moment_{axis}"] for axis in "xyz"}
    table: ParameterTable = DEVELOPMENT.table()
    size = k * 0.5 * 1.2 * 35.0**2 * table["S"].value * table["b"].value  # about: qbar S b in this flight
    assert np.abs(change["x"]).max() < 1e-9 * size and np.abs(change["y"]).max() < 1e-9 * size
    assert 0.3 * size < -change["z"].mean() < 3 * size


def test_what_moves_with_the_kite_is_no_missing_force(calm):
    """Guards M a - f: air that moves with the wing and the line's mass are part of M. A model with them lacks, in a flight without them,
    what they would take (m_a a_z along body z), and not what they weigh in f alone."""
    log = calm.log
    without, with_it = left(log, {}), left(log, {"added_mass": {"m_a": 5.0}})
    change = {axis: with_it[f"equation_force_{axis}"] - without[f"equation_force_{axis}"] for axis in "xyz"}
    assert np.abs(change["x"]).max() == 0 and np.abs(change["y"]).max() == 0
    assert change["z"] == pytest.approx(5.0 * log["a_z"], rel=1e-6, abs=1e-6)


def test_the_test_loops_are_predicted_once(calm, monkeypatch):
    """Guards one prediction per model and split (A13): the study tells the error of the prediction that it is given, and makes none but
    those of half a second."""
    log, horizon, made = calm.log, 2.0, []
    loops = find_loops(log)
    parts = split(loops, log=log)
    simulator = Simulator(Kite(DEVELOPMENT, log.wind.height))
    ahead = predict(simulator, log, parts.test, horizon)
    monkeypatch.setattr(residuals, "predict", lambda *given: made.append(given[-1]) or predict(*given))
    summary, _ = residual_study(simulator, log, parts, loops, ahead, horizon)
    assert made == [SHORT, SHORT] and summary["innovation"]["2"] == ahead.nrmse()["mean"]
