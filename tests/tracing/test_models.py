"""What a fitted model says of loops that it was not fitted to, parameters integrated out: exact where everything is linear."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from kites import DEVELOPMENT, flight
from tracing.traced import null_model, short_flight, thinned

from awescli.estimation import staged_fit
from awescli.estimation.fit import fit_together
from awescli.estimation.fitted import Share
from awescli.estimation.gauss_newton import OutOfReach
from awescli.estimation.prediction import predict
from awescli.estimation.problem import build, simulator_of
from awescli.estimation.processes.gusts import Gusts
from awescli.estimation.staged_fit import Flight, fit_flights
from awescli.flightlog.loops import find_loops
from awescli.flightlog.split import Split, split
from awescli.notation.parameters import Parameter, ParameterTable
from awescli.simulation.campaign_flights import dev_like
from awescli.tracing import fitted_model, models
from awescli.tracing.fitted_model import FittedModel, _asked_of, bounded, judge
from awescli.tracing.frame import Frame, TracedFlight
from awescli.tracing.models import _fit_null, begins_nowhere, fit_added, fit_bare, fit_null, fit_on, promised_beyond

N, FIT, SEEN = 4, 30, 20


def linear(seed: int, bounded: tuple[int, ...] = ()):
    """(fit of y = A p + e to `FIT` samples with priors, judged on `SEEN` others, their residual r at the fit, B, H of the fit); parameters
    `bounded` sit at an end of their range."""
    random = np.random.default_rng(seed)
    A, B, truth = random.standard_normal((FIT, N)), random.standard_normal((SEEN, N)), 0.5 * random.standard_normal(N)
    y, seen = A @ truth + random.standard_normal(FIT), B @ truth + random.standard_normal(SEEN)
    H = A.T @ A + np.eye(N)
    x = np.linalg.solve(H, A.T @ y)
    r = seen - B @ x
    names = tuple(f"p{i}" for i in range(N))
    lower = [v if i in bounded else v - 5 for i, v in enumerate(x)]
    rows = [Parameter(n, v, "-", low, v + 5, free=True) for n, v, low in zip(names, x, lower, strict=True)]
    fitted = SimpleNamespace(
        names=names, parameters=ParameterTable(rows), solution=SimpleNamespace(H=H, x=x), places=(np.arange(N),),
        flights=(SimpleNamespace(counted=range(6), slope=np.zeros(N)),),
    )  # fmt: skip
    judged = SimpleNamespace(information=SimpleNamespace(H=B.T @ B, b=B.T @ r), counted=range(3))
    return fitted, judged, r, B, H


def test_a_coefficient_that_wants_the_other_sign_sits_at_the_end_next_to_zero():
    """Guards `towards_zero`: at the far end, inside, and in a range that holds zero it says nothing."""
    ranges = {
        "wants": (0.4, 0.4, 1.2),
        "negative": (-0.4, -1.2, -0.4),
        "far": (1.2, 0.4, 1.2),
        "inside": (0.8, 0.4, 1.2),
        "free": (-1.0, -1.0, 1.0),
    }
    rows = [Parameter(n, v, "-", low, high, free=True) for n, (v, low, high) in ranges.items()]
    fitted = SimpleNamespace(names=tuple(ranges), parameters=ParameterTable(rows))
    model = SimpleNamespace(fit=fitted, at_bound=bounded(fitted))
    assert FittedModel.towards_zero.fget(model) == ["wants", "negative"]


@pytest.mark.parametrize("bounded", [(), (1,), (0, 3)])
def test_unseen_loops_are_predicted_with_what_is_not_known_of_the_parameters(bounded):
    """Guards `unseen` and `shift`: for a linear model they are the marginal likelihood of the unseen samples, and the parameters that all
    samples together ask for, those at a bound held."""
    fitted, judged, r, B, H = linear(3, bounded)
    shift, gained, wider = _asked_of(fitted, (judged,), np.zeros(N))
    free = [i for i in range(N) if i not in bounded]
    S = np.eye(SEEN) + B[:, free] @ np.linalg.inv(H[np.ix_(free, free)]) @ B[:, free].T
    assert r @ r - gained + wider == pytest.approx(r @ np.linalg.solve(S, r) + np.linalg.slogdet(S)[1])
    together = np.zeros(N)
    together[free] = np.linalg.solve((H + B.T @ B)[np.ix_(free, free)], (B.T @ r)[free])
    assert shift == pytest.approx(together) and np.abs(shift[free]).max() > 0.01


@pytest.mark.parametrize("free", [(1,), (1, 3)])
def test_what_parameters_would_gain_beyond_their_bounds(free):
    """Guards `promised_beyond`: for a linear model it is what the least squares without these bounds gain, the others held."""
    random, held = np.random.default_rng(5), [1, 3]
    A, y, x = random.standard_normal((FIT, N)), random.standard_normal(FIT), np.full(N, 0.3)

    def best(moving):
        x[moving] += np.linalg.lstsq(A[:, moving], y - A @ x, rcond=None)[0]
        return float(((y - A @ x) ** 2).sum())

    before = best([0, 2])
    at = SimpleNamespace(b=A.T @ (y - A @ x))
    rows = [Parameter(f"p{i}", v, "-", v if i in held else v - 5, v + 5, free=True) for i, v in enumerate(x)]
    names = tuple(row.name for row in rows)
    fitted = SimpleNamespace(names=names, parameters=ParameterTable(rows), solution=SimpleNamespace(H=A.T @ A, at=at))
    promised = promised_beyond(SimpleNamespace(fit=fitted), [names[i] for i in free])
    assert promised == pytest.approx(before - best([0, 2, *free])) and promised > 0.1


@pytest.mark.parametrize("key, strength, ends", [("actuator_lag:rudder", "tau", True), ("sideslip_drag", "k", False)])
def test_a_fit_that_stays_above_its_reach_is_given_up(key, strength, ends):
    """Guards `reach`: a rudder's lag that is there comes to the same end with its own deviance as reach as with none, though it begins far
    above, and drag with sideslip is given up where half of what the lag gains is asked."""
    frame, null = null_model((("actuator_lag:rudder", (("tau", 0.1),)),))
    lag = fit_added(frame, null, "actuator_lag:rudder", {"actuator_lag:rudder.tau": 0.08}, {})
    reach = lag.fit.deviance if ends else (lag.fit.deviance + null.fit.deviance) / 2
    assert null.fit.deviance - lag.fit.deviance > 100
    if not ends:
        assert fit_added(frame, null, key, {f"{key}.{strength}": 0.5}, {}).fit.deviance > reach
        with pytest.raises(OutOfReach):
            fit_added(frame, null, key, {f"{key}.{strength}": 0.5}, {}, reach=reach)
        return
    again = fit_added(frame, null, key, {f"{key}.{strength}": 0.08}, {}, reach=reach)
    assert again.deviance == lag.deviance and again.fit.deviance == sum(f.deviance for f in again.fit.flights)
    with pytest.raises(OutOfReach):
        fit_on(frame, lag, reach=lag.fit.deviance - 100)


def test_where_a_fit_should_not_begin():
    """Guards the time of a trace: a lag without a limit of its rate was fitted from one of 0.008 rad/s, 1800 times its cost away."""
    frame, null = null_model((("actuator_lag:rudder", (("tau", 0.1),)),))
    lag = fit_added(frame, null, "actuator_lag:rudder", {"actuator_lag:rudder.tau": 0.08}, {})
    assert begins_nowhere(lag, "actuator_lag:rudder.rate", 0.008) and not begins_nowhere(lag, "actuator_lag:rudder.rate", 0.8)


def test_validation_is_judged_from_what_a_model_near_by_made_of_it():
    """Guards `before`: the same verdict in fewer steps, also from a model with other effects; from one that lost a segment, as anew."""
    frame, null = null_model((("actuator_lag:rudder", (("tau", 0.1),)),))
    lag = fit_added(frame, null, "actuator_lag:rudder", {"actuator_lag:rudder.tau": 0.08}, {})
    (problem,), (own,), (other,) = lag.problems, lag.judged, null.judged
    anew, again, across = (judge(problem, lag.table, before) for before in (None, own, other))
    assert again.deviance == pytest.approx(anew.deviance, abs=0.5) and across.deviance == pytest.approx(anew.deviance, abs=0.5)
    steps = [len(found.solution.history) for found in (anew, again, across)]
    assert steps[1] < steps[0] and steps[2] <= steps[0]
    lost = judge(problem, lag.table, replace(own, alive=np.zeros_like(own.alive)))
    assert lost.deviance == anew.deviance and np.array_equal(lost.own.starts, anew.own.starts)


def test_what_integrating_out_adds_has_its_say_on_unseen_loops():
    """Guards evidence in gusts: without the slope of the log determinant, as large for a segment as on train, unseen loops asked for
    another kite (CLa 1.4 instead of 5.6), and what was promised there was off by hundreds from model to model."""
    fitted, judged, _, B, H = linear(3)
    before = _asked_of(fitted, (judged,), np.zeros(N))[0]
    fitted.flights[0].slope = np.arange(1.0, N + 1)
    after = _asked_of(fitted, (judged,), np.zeros(N))[0]
    assert (H + B.T @ B) @ (after - before) == pytest.approx(0.5 * np.arange(1.0, N + 1))


@pytest.mark.parametrize("near_after, times, counted", [(1, 1, True), (2, 2, True), (99, fitted_model.JUDGED, False)])
def test_what_is_promised_far_from_where_loops_were_judged_is_not_counted(monkeypatch, near_after, times, counted):
    """Guards a stall in gusts (JSBSim): its onset was fitted next to a kink, and a linearisation promised 370 of deviance on unseen loops
    that were nowhere. They are judged where they ask to be until that is near."""
    fitted, judged, _, _, _ = linear(3)
    judged.names, judged.parameters = fitted.names, fitted.parameters
    fitted.flights = (SimpleNamespace(names=fitted.names, parameters=fitted.parameters),)
    asked = []

    def _asked_of(fitted, judged, moved):
        asked.append(moved)
        return (np.zeros(N) if len(asked) > near_after else 3.0 * np.ones(N)), 370.0, 1.0

    monkeypatch.setattr(fitted_model, "_asked_of", _asked_of)
    monkeypatch.setattr(fitted_model, "judge", lambda problem, table, before: judged)
    monkeypatch.setattr(fitted_model, "by_segment", lambda f: np.array([-1e6 * len(asked)]))
    _, _, _, deviance = fitted_model._unseen(fitted, [None], (judged,))
    moved = asked[-1]
    assert len(asked) == times + 1
    assert deviance == pytest.approx(-1e6 * len(asked) + moved @ fitted.solution.H @ moved - (370.0 if counted else 0.0) + 1.0)
    # a step that leads away is not taken: of a quick fit, which is far from its end, it may
    asked.clear()
    monkeypatch.setattr(fitted_model, "by_segment", lambda f: np.array([1e6 * len(asked)]))
    _, shift, step, deviance = fitted_model._unseen(fitted, [None], (judged,))
    assert deviance == 1e6 + 1.0 and not shift.any() and not step.any()


def test_what_unseen_loops_ask_is_the_slope_of_their_deviance():
    """Guards the same on a flight in gusts, against differences of the deviance of validation, nuisances fitted anew everywhere: right to
    a hundredth of what a standard deviation asks, and not without that slope."""
    log = flight(seed=5, duration=62.0, noise=True, effects=(("turbulence", (("sigma", 0.8), ("L", 150.0))),)).log
    n, names = len(log), ("CLa", "CL0", "Cmq")
    parts = Split(((0, int(0.6 * n)),), ((int(0.6 * n), n),), (), (1, 1, 0), "time")
    gusts = Gusts.of(DEVELOPMENT, log).at(dict.fromkeys(("horizontal gusts", "vertical gusts"), 0.8))
    problem = build(simulator_of(DEVELOPMENT, log), log, parts, 5.0, tuple(log.measured)).with_processes([gusts]).spaced(0.1)
    problem, table = replace(problem, names=names), problem.kite.parameters
    fitted = fit_together([Share(problem.misfit(), table, table, names)], tolerance=0.1, probes=16)
    found = fitted.flights[0].parameters
    judged = fitted_model.judge(problem, found)
    std = 1 / np.sqrt(np.diag(fitted.solution.H))

    def deviance(name, moved):
        at = found.with_values({name: found[name].value + moved})
        return fitted_model.by_segment(fitted_model.judge(problem, at, judged)).sum()

    asked = np.array([(deviance(name, -s) - deviance(name, s)) / 4 for name, s in zip(names, std, strict=True)])
    with_slope, without = std * fitted_model._validation(fitted, (judged,))[1], std * judged.information.b
    assert np.abs(with_slope - asked).max() < 0.01 and np.abs(without - asked).max() > 0.05


@pytest.mark.parametrize("seen", [False, True])
def test_a_parameter_of_which_train_says_nothing_stays_where_it_is(seen):
    """Guards a trace that ended in a traceback (a pitch moment that the library lacks: `LinAlgError: Singular matrix`): a candidate's own
    parameter had no say in any train loop. It stays, whether or not the unseen loops know it, and the others are judged as without it."""
    fitted, judged, _, _, H = linear(3)
    H[1] = H[:, 1] = 0.0
    if not seen:
        judged.information.H[1] = judged.information.H[:, 1] = judged.information.b[1] = 0.0
    shift, gained, wider = _asked_of(fitted, (judged,), np.zeros(N))
    others = [0, 2, 3]
    more, b = judged.information.H[np.ix_(others, others)], judged.information.b[others]
    known = H[np.ix_(others, others)]
    assert shift[1] == 0 and shift[others] == pytest.approx(np.linalg.solve(known + more, b))
    assert wider == pytest.approx(np.linalg.slogdet(known + more)[1] - np.linalg.slogdet(known)[1]) and np.isfinite(gained)


def test_loops_on_which_a_model_runs_away_say_nothing():
    """Guards a traceback on the AP2's flight: its model without bounds is unstable on validation loops, with an information of -1e171."""
    fitted, judged, *_ = linear(3)
    runs_away = SimpleNamespace(information=SimpleNamespace(H=-1e171 * np.ones((N, N)), b=1e150 * np.ones(N)), counted=range(3))
    step, gained, wider = _asked_of(fitted, [runs_away], np.zeros(N))
    assert not step.any() and gained == 0.0 and wider == 0.0
    assert _asked_of(fitted, [judged], np.zeros(N))[0].any()


def test_what_all_loops_want_is_what_a_fit_of_all_loops_finds():
    """Guards `shift` on a flight: to first order it leads to the parameters of a fit of train and validation together."""
    frame, null = null_model()
    flight = frame.flights[0]
    bounds = sorted((*flight.split.train, *flight.split.validation))
    both = replace(flight, split=replace(flight.split, train=tuple(bounds)))
    start = {n: null.table[n].value for n in null.problems[0].kite.parameters.free}
    again = fit_null(Frame((both,), frame.horizon, frame.outputs), start, (1.0,))
    std = np.sqrt(np.diag(np.linalg.inv(null.fit.solution.H)))
    moved = np.array([again.table[n].value - null.table[n].value for n in null.fit.names])
    kite = [i for i, n in enumerate(null.fit.names) if "." not in n]
    assert np.abs(null.shift[kite] / std[kite]).max() > 0.3  # there is something to be right about
    assert np.abs((moved - null.shift) / std)[kite].max() < 0.35


def test_a_true_model_leaves_noise_alone():
    """Guards chi-square on loops that were not fitted: one per degree of freedom."""
    _, null = null_model()
    assert null.chi2 == pytest.approx(1.0, abs=0.06) and null.fit.chi2 == pytest.approx(1.0, abs=0.03)
    assert null.flies == null.segments == len(null.train) + len(null.validation)
    light = null.light()
    assert light.deviance == null.deviance and light.chi2 == pytest.approx(null.chi2) and light.fit.flights[0].gram is None


def test_a_flight_is_identified_as_well_from_a_slow_log():
    """Guards logs of every rate (A1): what is fitted to rows of 25 and of 10 Hz predicts the test loops within 20 % of what is fitted to
    rows of 50 Hz, at the noise. In steps of 0.1 s not even the truth could."""
    declared, log, _ = short_flight({}, 31, 50.0, ("CL0", "CD0", "Cma", "Cndr", "dl"))
    errors = []
    for every in (1, 2, 5):
        rows = thinned(log, every)
        parts = split(find_loops(rows), log=rows)
        null = fit_null(Frame((TracedFlight(rows, parts, declared),), 2.0, tuple(rows.measured)), {}, (1.0,))
        prediction = predict(null.simulator, rows, parts.test, 3.0)
        errors.append(prediction.nrmse()["mean"])
        assert errors[-1] < 1.3 * prediction.noise_floor()["mean"] and prediction.diverged == 0
    assert errors == pytest.approx([errors[0]] * 3, rel=0.2)


@pytest.mark.parametrize("ends", [True, False])
def test_a_part_is_a_beginning_for_the_whole_where_the_model_comes_to_its_minimum_on_it(ends, monkeypatch):
    """Guards fits of long flights: from a part on which the model comes to its minimum all segments are fitted, to the same values; from
    one on which it does not (Thor), the whole is settled as if there had been no part, to the last bit."""
    frame, _ = null_model()
    flights, settled, asked = [Flight(p) for p in frame.problems(())], staged_fit._settled, []
    whole, _ = fit_flights(flights, ())

    def counting(problems, *given):
        asked.append(len(problems[0].fitted.segments))
        result, found = settled(problems, *given)
        failed = replace(result, solution=replace(result.solution, kkt=result.solution.cost))
        return (result if ends or len(asked) > 1 else failed), found

    monkeypatch.setattr(staged_fit, "SETTLED_ON", 6.0)
    monkeypatch.setattr(staged_fit, "_settled", counting)
    result, problems = fit_flights(flights, ())
    count = len(flights[0].problem.fitted.segments)
    assert asked == ([3] if ends else [3, count]) and count > 3
    assert len(problems[0].fitted.segments) == len(result.flights[0].alive) == count
    if ends:
        assert np.abs((result.solution.x - whole.solution.x) / np.sqrt(np.diag(whole.covariance))).max() < 0.3
    else:
        assert np.array_equal(result.solution.x, whole.solution.x)


def test_a_declared_model_is_not_led_astray_by_its_model_error():
    """Guards gains of candidates: beside model error the declared model of a late rudder came out 580 less likely than it is without, for a
    wind record that is known to 0.6 m/s errs more often at nearer nodes. Every candidate that did without seemed to gain as much."""
    flown = dev_like(DEVELOPMENT, 31, {"actuator_delay:rudder": {"tau": 0.03}}, duration=61.0)
    declared = flown.declared.model_copy(update={"wind": flown.declared.wind.model_copy(update={"std": 0.6})})
    frame = Frame((TracedFlight(flown.log, split(find_loops(flown.log), log=flown.log), declared),), 5.0, tuple(flown.log.measured))
    astray, null = _fit_null(frame, {}, (1.0, 2.5), (), lambda h, i, c: None), fit_null(frame, {}, (1.0, 2.5))
    assert astray.rest and not null.rest and astray.deviance - null.deviance > 300
    assert null.deviance <= fit_bare(frame, astray).deviance and null.fit.ended


@pytest.mark.parametrize(
    ("deviance", "ended", "flies", "taken"),
    [(-10.0, True, 9, True), (10.0, True, 9, False), (-10.0, False, 9, False), (-10.0, True, 8, False), (np.nan, True, 9, False)],
    ids=["likelier", "less likely", "not at its minimum", "fewer segments", "no number"],
)
def test_a_declared_model_that_needs_its_model_error_keeps_it(monkeypatch, deviance, ended, flies, taken):
    """Guards measured flights: a model that does not follow them without model error may be likelier by the segments that it loses."""
    helped = SimpleNamespace(rest={"moment_z": 0.1}, deviance=0.0, flies=9)
    bare = SimpleNamespace(deviance=deviance, flies=flies, fit=SimpleNamespace(ended=ended))
    monkeypatch.setattr(models, "_fit_null", lambda *of: helped)
    monkeypatch.setattr(models, "fit_bare", lambda frame, model: bare)
    monkeypatch.setattr(models, "fit_on", lambda frame, model: model)
    assert fit_null(None, {}, ()) is (bare if taken else helped)
