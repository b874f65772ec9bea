"""Training: learns an effect that the model lacks, nothing from clean flight, goes on exactly where it was stopped."""

from dataclasses import replace

import numpy as np
import pytest
from learning.small_flight import declaration, small_flight, small_kite, small_segments

from awescli.learning.acceptance import OUTCOMES, gate, verdict
from awescli.learning.correction import Correction, evaluate
from awescli.learning.ensemble import spread, train_ensemble
from awescli.learning.explain import along, distil
from awescli.learning.normalisation import input_signals, samples_of, untrained
from awescli.learning.problem import Problem
from awescli.learning.training import HISTORY, State, TrainingConfig, train
from awescli.notation.errors import BadInput
from awescli.notation.parameters import ParameterTable
from awescli.notation.quantities import OUTPUTS, STATES
from awescli.physics.kite import Kite
from awescli.simulation.segments import smooth_states

CONFIG = TrainingConfig(hidden=(8,), horizons=(0.8, 2.5), warmup=0.6, rounds=3, adam_iterations=25, lbfgs_iterations=15)


@pytest.fixture(scope="module")
def draggy():
    """A flight whose kite has half as much drag again as the model says."""
    return small_flight(small_kite(CD0=0.09))


@pytest.fixture(scope="module")
def learned(draggy):
    log, ranges = draggy
    states = []
    return train(small_kite(), log, ranges[:6], ranges[6:], CONFIG, checkpoint=states.append), states


def test_missing_effect_is_learned(learned):
    trained, _ = learned
    assert trained.outcome == "trained"
    ratio = trained.metrics["validation_rmse_ratio"]
    assert np.mean(list(ratio.values())) < 0.6 and max(ratio.values()) < 1.02
    # what is kept is the best that any iteration at the last horizon passed, not the best end of a round
    lowest = min(row[HISTORY.index("validation_last_horizon")] for row in trained.history)
    assert trained.state.best_cost == lowest
    assert trained.metrics["validation"]["prediction"]["hybrid"] == pytest.approx(lowest, rel=1e-12)


def test_what_was_learned_is_drag(learned, draggy):
    log, ranges = draggy
    trained, _ = learned
    kite = small_kite()
    shares = along(log, kite, trained.correction).shares(log.valid)
    assert max(shares, key=shares.get) in ("u", "v", "w")
    formula = distil(log, kite, trained.correction, ranges[:6], ranges[6:])[0]
    # 0.03 more of drag coefficient: 0.03 * 3 m2 * 100 Pa / 8 kg = 1.1 m/s2 per 100 Pa against u
    assert formula.channel == "u" and formula.r2 > 0.5 and any("qbar" in t or t in ("V_a", "u") for t in formula.terms)


def test_clean_flight_teaches_nothing():
    log, ranges = small_flight(small_kite(), seed=3)
    trained = train(small_kite(), log, ranges[:6], ranges[6:], CONFIG)
    assert trained.outcome == "nothing_to_learn" and trained.correction.is_zero
    kite = small_kite()
    assert trained.kite(kite) is kite


def test_gate_asks_for_a_gain_that_is_certain_under_both_questions():
    random = np.random.default_rng(0)
    physics = 1 + 0.1 * random.random(12)
    clearly, barely, chance = 0.5 * physics, 0.99 * physics, physics - 0.05 * random.normal(size=12) - 0.02
    for predicted, smoothed, passes in (
        (clearly, clearly, True), (clearly, barely, False), (barely, clearly, False), (clearly, chance, False), (chance, clearly, False),
    ):  # fmt: skip
        passed, numbers = gate((physics, predicted), (physics, smoothed), 0.03)
        assert passed == passes
        assert passed == all(n["physics"] - n["hybrid"] > n["needed_gain"] for n in numbers.values())


def test_verdict_says_whether_there_was_nothing_or_too_little_to_learn_from():
    random = np.random.default_rng(1)
    physics = np.array([3.0, 2.0])
    told = {}
    for left in (1.05, 30.0):
        accepted, evidence = gate((physics, physics * [0.6, 1.1]), (left * np.ones(2), left * (0.9 + 0.1 * random.random(2))), 0.03)
        assert not accepted
        told[left] = verdict(accepted, evidence, 2, 0.06, diverging=False, out_of_time=False)
    assert told[1.05] == ("nothing_to_learn", OUTCOMES["nothing_to_learn"])
    outcome, sentence = told[30.0]
    assert outcome == "too_short"
    # (3.0 + 2.0) -> (1.8 + 2.2): 20 % lower, 0.5 on the mean; spread of the gains 1.2 and -0.2 is 0.99, of one independent segment
    assert "on 2 validation segments" in sentence and "falls by 20%, 0.5 standard errors where 3 are asked" in sentence
    assert "training segments it falls by 94%" in sentence


def test_penalised_correction_leaves_to_parameters_what_they_can_do(draggy):
    """The missing drag IS a parameter of the model, when it is free: asked to keep off it, the network may not learn it."""
    log, ranges = draggy
    plain = declaration()
    rows = (replace(p, free=p.name == "CD0", std=0.02 if p.name == "CD0" else None) for p in plain.table().rows)
    kite = Kite(plain.with_parameters(ParameterTable(rows)), (10.0,))
    short = replace(CONFIG, horizons=(0.8,), rounds=2)
    free, held = (train(kite, log, ranges[:6], ranges[6:], replace(short, orthogonality=w)) for w in (0.0, 30.0))
    assert free.metrics["parametric_share"] > 0.3
    assert held.metrics["parametric_share"] < 0.3 * free.metrics["parametric_share"]
    assert held.state.best_cost > free.state.best_cost


def test_resumed_training_is_the_uninterrupted_one(learned, draggy):
    log, ranges = draggy
    whole, states = learned
    for stop in (2, len(states) - 2):  # within Adam, within L-BFGS
        kept = {k: v.copy() for k, v in states[stop].to_arrays().items()}
        resumed = train(small_kite(), log, ranges[:6], ranges[6:], CONFIG, state=State.from_arrays(kept, whole.correction.weights.size))
        assert np.array_equal(resumed.correction.weights, whole.correction.weights)
        # also as text: a count that comes back as 2.0 makes another file
        assert repr([row[:-1] for row in resumed.history]) == repr([row[:-1] for row in whole.history])


def test_budget_is_an_outcome(draggy, learned):
    """Guards the time budget: of rounds that take 7 s each, a budget of 20 s allows three, and what they learned is kept; a budget that is
    never reached (9 rounds, 63 s of 120) is no outcome."""
    log, ranges = draggy
    ticks = iter(range(0, 100000, 7))
    trained = train(small_kite(), log, ranges[:6], ranges[6:], replace(CONFIG, budget=20.0), clock=lambda: float(next(ticks)))
    assert (trained.outcome, len(trained.history), trained.state.seconds) == ("budget_reached", 3, 21.0)
    assert not trained.correction.is_zero and len(learned[0].history) > 3


def test_ensemble_agrees_where_it_was_trained(draggy):
    log, ranges = draggy
    short = replace(CONFIG, rounds=1, compare=True)
    ensemble = train_ensemble(small_kite(), log, ranges[:6], ranges[6:], short, 2)
    assert len({c.fingerprint() for c in ensemble.corrections}) == 2 and any(m is ensemble.best for m in ensemble.members)
    first, second = ensemble.members
    assert second.compared is None and set(first.compared) == {"adam_lbfgs", "adam", "adam_equal_time"}
    numbers = first.metrics["comparison"]
    # Adam alone went on for at least as many gradients, or seconds, as L-BFGS, and for no more than a round longer
    assert numbers["gradients"] <= numbers["spent"]["adam"]["gradients"] <= numbers["gradients"] + CONFIG.adam_iterations
    assert numbers["seconds"] <= numbers["spent"]["adam_equal_time"]["seconds"]
    assert np.array_equal(first.compared["adam_lbfgs"].weights, first.state.best)
    # of one start, by one rule: nobody is worse on validation than where both began
    assert all(numbers["validation"][name] <= numbers["validation"]["switch"] for name in first.compared)
    mean, deviation = spread(small_kite(), ensemble.corrections, small_segments(small_kite(), 3, 50))
    speed = OUTPUTS.index("V_a")
    assert 0 < np.nanmean(deviation[..., speed]) < 0.05 * np.nanmean(mean[..., speed])


def test_network_survives_the_file_and_tampering_is_noticed(learned):
    correction = learned[0].correction
    arrays, description = correction.to_arrays(), correction.description()
    again = Correction.from_arrays(arrays, description)
    assert np.array_equal(again.weights, correction.weights) and again.inputs == correction.inputs
    bent = {**arrays, "weights": arrays["weights"] + np.eye(1, arrays["weights"].size)[0] * 1e-9}
    for bad, said in (
        ((bent, description), "do not belong together"),
        (({**arrays, "weights": arrays["weights"][:-1]}, description), "not 254 finite numbers|finite numbers"),
        ((arrays, {**description, "inputs": description["inputs"][::-1]}), "do not belong together"),
        ((arrays, {**description, "inputs": ["nonsense"]}), "unknown network input"),
        (({"weights": arrays["weights"]}, description), "lacks"),
        ((arrays, {}), "not a correction network"),
    ):
        with pytest.raises(BadInput, match=said):
            Correction.from_arrays(*bad)


def test_checkpoint_of_another_network_is_refused(learned):
    arrays = learned[1][0].to_arrays()
    with pytest.raises(BadInput, match="another network"):
        State.from_arrays(arrays, 7)
    with pytest.raises(BadInput, match="not a training checkpoint"):
        State.from_arrays({}, 7)


def test_without_a_gate_the_lowest_validation_error_is_enough(draggy):
    """Guards `gate: false`: a gain that the gate would not call proved is kept, and the sentence says so; no gain is no_gain."""
    log, ranges = draggy
    strict = replace(CONFIG, material=0.99, rounds=1)
    kept, refused = (train(small_kite(), log, ranges[:6], ranges[6:], replace(strict, gate=g)) for g in (False, True))
    assert refused.correction.is_zero and not kept.correction.is_zero
    assert kept.outcome == "trained" and "would have said no" in kept.metrics["sentence"] and kept.metrics["proved"] is False
    still = train(small_kite(), log, ranges[:6], ranges[6:], replace(strict, gate=False, rate=1e-12, adam_iterations=1, lbfgs_iterations=0))
    assert (still.outcome == "no_gain") == still.correction.is_zero


def test_from_measured_states_there_is_no_warm_up(draggy):
    """Guards `known_starts`: predictions begin at the smoothed measured states, whatever the weights say; and errors counted by range, with
    which physics still has cost 1."""
    log, ranges = draggy
    kite = small_kite()
    correction = untrained(log, kite, ranges, ("u", "w", "V_a"), (4,), 0)
    problem = Problem(kite, log, correction, 0.6, known_starts=True, by_range=True)
    observed = problem.observed(np.array([60, 400]), 100)
    data = problem.data(observed, correction.weights)
    assert problem.warmup == 2 and data.observed is observed
    np.testing.assert_array_equal(observed.segments.starts, smooth_states(log)[[58, 398]])
    spans = np.ptp(np.stack([log[n] for n in STATES], axis=1)[log.valid], axis=0)
    np.testing.assert_allclose(data.sigma / spans, data.sigma[0] / spans[0])
    assert problem.costs(data, correction.weights).mean() == pytest.approx(1.0, rel=0.02)


def test_min_max_scaling_and_no_fade(draggy):
    """Guards the scaling by range: every input runs from -1 to 1 over the training flight; without a fade it acts far beyond."""
    log, ranges = draggy
    names, kite = ("u", "phi", "wind_speed", "V_a"), small_kite()
    plain = untrained(log, kite, ranges, names, (4,), 0)
    scaled = untrained(log, kite, ranges, names, (4,), 0, scaling="minmax", fade=False)
    z = ((input_signals(log, kite, scaled.inputs) - scaled.mean) / scaled.deviation)[samples_of(ranges, log.valid)]
    np.testing.assert_allclose([z.min(axis=0), z.max(axis=0)], [[-1.0] * z.shape[1], [1.0] * z.shape[1]], atol=1e-9)
    assert "phi" in scaled.inputs and "wind_speed" not in scaled.inputs  # this wind never changes
    far = [m + 8 * d for m, d in zip(plain.mean, plain.deviation, strict=True)]
    assert evaluate(far, plain)[1] < 0.01 and evaluate(far, scaled)[1] == 1.0
