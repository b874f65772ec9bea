"""Train f_nn (docs/equations.md (29)): Adam over growing horizons to a plateau of the validation error, then L-BFGS; the best weights win.

Training is a list of rounds. A round estimates the segments' starts anew with the present weights and runs one optimiser for some
iterations; at the last horizon it looks at validation after each of them, for L-BFGS passes the best point on its way into the noise.
Between rounds all there is to know stands in `State`, so an interrupted run goes on exactly.
"""

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from awescli.flightlog.log import FlightLog
from awescli.flightlog.split import Range
from awescli.learning.acceptance import gate, ungated, verdict
from awescli.learning.comparison import adam_alone
from awescli.learning.correction import Correction, HybridKite
from awescli.learning.horizon import Horizon, predictions
from awescli.learning.network_inputs import inputs_for
from awescli.learning.normalisation import drifting, outside_share, untrained
from awescli.learning.optimisers import Adam, Lowest, lbfgs
from awescli.learning.orthogonality import parametric
from awescli.learning.problem import Data, Problem
from awescli.notation.errors import BadInput, NumericalFailure
from awescli.notation.present import present
from awescli.physics.kite import Kite


@dataclass(frozen=True)
class TrainingConfig:
    """hidden: widths of the tanh layers; inputs: names in `correction.NETWORK_INPUTS`; horizons: predicted seconds, growing, the last
    one is what counts; warmup: seconds before a prediction that fit its start; batch: segments per Adam step; rate: Adam's;
    clip: greatest norm of a gradient; decay: weight decay; orthogonality: weight of the penalty on what the free parameters could do;
    adam_iterations, lbfgs_iterations: per round; rounds: most rounds per horizon and of L-BFGS; patience: rounds without progress that
    make a plateau; material: least relative gain on validation; budget: seconds; solver: rk4 (compiled, exact adjoint) or a name of
    `hybrid_torch.solver_names()` (torchdiffeq and autograd: slow); compare: also let Adam go on alone for as long as L-BFGS took;
    scaling, fade: as of `untrained`; gate: a correction must be proved on validation, else the lowest error there is enough; keep_drifting:
    use inputs too that leave their training range or tell the time; known_starts, by_range: as of `Problem`."""

    hidden: tuple[int, ...] = (16, 16)
    inputs: tuple[str, ...] | None = None
    horizons: tuple[float, ...] = (1.0, 2.5, 5.0)
    warmup: float = 1.0
    batch: int = 32
    rate: float = 0.01
    clip: float = 5.0
    decay: float = 1e-3
    orthogonality: float = 0.0
    adam_iterations: int = 40
    lbfgs_iterations: int = 50
    rounds: int = 5
    patience: int = 2
    material: float = 0.03
    budget: float = 120.0
    solver: str = "rk4"
    seed: int = 0
    compare: bool = False
    scaling: str = "standard"
    gate: bool = True
    fade: bool = True
    keep_drifting: bool = False
    known_starts: bool = False
    by_range: bool = False


@dataclass(frozen=True)
class State:
    """Everything between two rounds. phase: index of the horizon, or len(horizons) for L-BFGS, or one more when done; round: within
    the phase; weights, adam: the present point; best, best_cost: lowest validation at the last horizon; idle: rounds without
    progress; reference: what progress is measured against; switch: weights and Adam as they were when L-BFGS began;
    evaluations: gradients (of all segments once) spent in each phase; seconds: spent; history: one row per round."""

    weights: np.ndarray
    adam: Adam
    best: np.ndarray
    best_cost: float
    phase: int = 0
    round: int = 0
    idle: int = 0
    reference: float = np.inf
    switch: tuple[np.ndarray, Adam] | None = None
    evaluations: float = 0.0
    seconds: float = 0.0
    history: tuple[tuple[float, ...], ...] = ()

    def to_arrays(self) -> dict[str, np.ndarray]:
        """Named arrays, for a checkpoint."""
        numbers = [self.best_cost, self.phase, self.round, self.idle, self.reference, self.evaluations, self.seconds, self.adam.count,
                   self.adam.rate, self.adam.clip, -1 if self.switch is None else self.switch[1].count]  # fmt: skip
        arrays = {
            "weights": self.weights, "best": self.best, "first": self.adam.first, "second": self.adam.second,
            "numbers": np.array(numbers, dtype=float), "history": np.array(self.history, dtype=float).reshape(-1, len(HISTORY)),
        }  # fmt: skip
        if self.switch is not None:
            arrays |= {"switch_weights": self.switch[0], "switch_first": self.switch[1].first, "switch_second": self.switch[1].second}
        return arrays

    @classmethod
    def from_arrays(cls, a: Mapping[str, np.ndarray], n: int | None = None, where: str = "checkpoint") -> "State":
        """What `to_arrays` gave, for a network of n weights (None: as many as it has). Raises BadInput for anything else."""
        try:
            best_cost, phase, round_, idle, reference, evaluations, seconds, count, rate, clip, switched = (float(v) for v in a["numbers"])
            vectors = [np.asarray(a[k], dtype=float) for k in ("weights", "best", "first", "second")]
            switch = None
            if switched >= 0:
                point, first, second = (np.asarray(a[f"switch_{k}"]) for k in ("weights", "first", "second"))
                switch = (point, Adam(first, second, int(switched), rate, clip))
            history = tuple(tuple(float(v) for v in row) for row in np.asarray(a["history"]).reshape(-1, len(HISTORY)))
        except (KeyError, ValueError, TypeError) as e:
            raise BadInput(f"not a training checkpoint: {e}", where, "Train from the beginning: --force.") from None
        n = vectors[0].size if n is None else n
        if any(v.shape != (n,) or not np.isfinite(v).all() for v in vectors):
            what = f"the checkpoint belongs to another network (this one has {n} weights)"
            raise BadInput(what, where, "Train from the beginning: --force.")
        weights, best, first, second = vectors
        adam = Adam(first, second, int(count), rate, clip)
        return cls(weights, adam, best, best_cost, int(phase), int(round_), int(idle), reference, switch, evaluations, seconds, history)


HISTORY = ("phase", "round", "horizon", "train", "validation", "validation_last_horizon", "diverged", "evaluations", "seconds")
"""Columns of `State.history`. Costs are in units of the physics' own squared error, 1 is pure physics. validation: where the round ended;
at the last horizon the lowest on its way."""


@dataclass(frozen=True)
class Trained:
    """What training gives back. correction: the network (null where nothing was learned); outcome: a name in
    `acceptance.OUTCOMES`;
    history: rows of HISTORY; metrics: plain numbers for metrics.json; state: the last one, to go on from; compared: the
    best weights of L-BFGS ("adam_lbfgs") and of Adam alone at equal gradients ("adam") and at equal wall time ("adam_equal_time"),
    whether they were accepted or not."""

    correction: Correction
    outcome: str
    history: tuple[tuple[float, ...], ...]
    metrics: dict
    state: State
    compared: Mapping[str, Correction] | None = None
    dropped: Mapping[str, str] = field(default_factory=dict)

    def kite(self, physics: Kite) -> Kite | HybridKite:
        """The model to go on with: the hybrid, or the physics itself where the correction is null."""
        return physics if self.correction.is_zero else HybridKite(physics, self.correction)


def train(
    kite: Kite, log: FlightLog, train_ranges: Sequence[Range], validation_ranges: Sequence[Range],
    config: TrainingConfig = TrainingConfig(), progress: Callable[[str, float], None] = lambda text, cost: None, *,
    law: Callable | None = None, state: State | None = None, checkpoint: Callable[[State], None] = lambda state: None,
    clock: Callable[[], float] = time.monotonic,
) -> Trained:  # fmt: skip
    """Learn what the physics of `kite` leaves on the training ranges (half-open samples), judged on the validation ranges.

    law: closes the loop as in `Simulator` (None: recorded set-points); state: go on from there; checkpoint(state) after every round.
    """
    names, dropped = inputs_for(kite, config.inputs), {}
    if not config.keep_drifting:
        names, dropped = usable_inputs(kite, log, train_ranges, validation_ranges, names)
    box = {"scaling": config.scaling, "fade": config.fade}
    correction = untrained(log, kite, train_ranges, names, config.hidden, config.seed, validation_ranges, **box)
    dropped |= {n: "never changes in training" for n in names if n not in correction.inputs}
    problem = Problem(
        kite, log, correction, config.warmup, law=law, decay=config.decay, solver=config.solver,
        parametric=parametric(log, kite, correction, train_ranges), orthogonality=config.orthogonality,
        known_starts=config.known_starts, by_range=config.by_range,
    )  # fmt: skip
    horizons = _usable(config.horizons, log, train_ranges, validation_ranges, config)
    sets = [Horizon(problem, h, train_ranges, validation_ranges, correction.weights) for h in horizons]
    n = correction.weights.size
    if state is None:
        adam = Adam.fresh(n, config.rate, config.clip)
        state = State(correction.weights, adam, correction.weights, float(sets[-1].baseline.mean()))
    elif state.weights.shape != (n,):
        raise BadInput(f"the checkpoint has {state.weights.size} weights, this network has {n}", do="Train from the beginning: --force.")
    began, before = clock(), state.seconds
    out_of_time = False
    while state.phase <= len(sets):
        if state.seconds > config.budget:
            out_of_time = True
            break
        state = _round(problem, sets, state, config, lambda: before + clock() - began)
        last = dict(zip(HISTORY, state.history[-1], strict=True))
        name = "L-BFGS" if last["phase"] == len(sets) else f"Adam, {last['horizon']:g} s"
        progress(f"{name}, round {int(last['round']) + 1}: validation {last['validation_last_horizon']:.3f}", last["train"])
        checkpoint(state)
    return _concluded(problem, sets, state, config, correction, dropped, out_of_time, (train_ranges, validation_ranges), clock)


def usable_inputs(
    kite: Kite, log: FlightLog, train_ranges: Sequence[Range], validation_ranges: Sequence[Range], names: Sequence[str]
) -> tuple[tuple[str, ...], dict[str, str]]:
    """(names to use, left out: name -> reason)"""
    drift = drifting(log, kite, names, train_ranges, validation_ranges)
    return tuple(n for n in names if n not in drift), {n: "leaves its training range on validation, or runs with time" for n in drift}


def _usable(
    horizons: Sequence[float],
    log: FlightLog,
    train_ranges: Sequence[Range],
    validation_ranges: Sequence[Range],
    config: TrainingConfig,
) -> list[float]:
    """Horizons that fit into the ranges, ascending; at least one."""

    def fits(h: float) -> bool:
        steps = max(2, int(round(h / log.dt)))
        both = (train_ranges, validation_ranges)
        return all(len(predictions(ranges, steps, warmup, max(1, steps // 2), log.valid)) for ranges in both)

    shorter = min(max((b - a for a, b in ranges), default=0) for ranges in (train_ranges, validation_ranges))
    warmup = 2 if config.known_starts else max(2, int(round(config.warmup / log.dt)))
    longest = (shorter - 2 - warmup) * log.dt
    fit = [h for h in sorted(horizons) if h <= longest and fits(h)]
    # gaps in the flight may leave less
    while not fit and longest > 0.2:
        fit, longest = ([float(longest)] if fits(longest) else []), 0.8 * longest
    if not fit:
        raise BadInput("training and validation ranges are too short to predict anything", do="Use a longer flight or a shorter warmup.")
    return fit


def _round(problem: Problem, sets: list[Horizon], state: State, config: TrainingConfig, seconds: Callable) -> State:
    """One round of the present phase, and the decision what comes next."""
    second_order = state.phase == len(sets)
    stage = sets[min(state.phase, len(sets) - 1)]
    if second_order and state.switch is None:
        # L-BFGS begins at the best point that Adam has found
        state = replace(state, weights=state.best, switch=(state.best, state.adam))
    data, last = stage.train(state.weights), sets[-1]
    watch = stage.lowest(state.weights) if stage is last else Lowest(lambda w: np.inf)
    weights, adam, spent, diverged = state.weights, state.adam, 0.0, 0
    if second_order:
        weights, cost, evaluations = lbfgs(lambda w: problem.gradient(data, w)[:2], weights, config.lbfgs_iterations, watch)
        spent = float(evaluations)
    else:
        weights, adam, cost, spent, diverged = _adam(problem, data, weights, adam, config, [state.phase, state.round], watch)
    passed, final = last.best_of(weights, watch.x)
    here = final if stage is last else float(stage.validation_costs(weights).mean())
    best, best_cost = (passed, final) if final < state.best_cost else (state.best, state.best_cost)
    better = here < 0.99 * state.reference
    idle, reference = (0, here) if better else (state.idle + 1, state.reference)
    # floats, as a checkpoint gives them back: a resumed run leaves the same bytes
    row = tuple(float(v) for v in (state.phase, state.round, stage.seconds, cost, here, final, diverged, spent, seconds()))
    state = replace(
        state, weights=weights, adam=adam, best=best, best_cost=best_cost, round=state.round + 1, idle=idle, reference=reference,
        evaluations=state.evaluations + spent, seconds=row[-1], history=(*state.history, row),
    )  # fmt: skip
    if idle >= config.patience or state.round >= config.rounds:
        state = replace(state, phase=state.phase + 1, round=0, idle=0, reference=np.inf)
    return state


def _adam(
    problem: Problem, data: Data, weights: np.ndarray, adam: Adam, config: TrainingConfig, place: Sequence[int], watch: Lowest
) -> tuple[np.ndarray, Adam, float, float, int]:
    """A round of Adam on minibatches of lane groups, drawn by (seed, phase, round): no random state to carry."""
    from awescli.engine.machine import LANES

    groups, per_batch = len(data.prepared.count), max(1, config.batch // LANES)
    rng = np.random.default_rng([config.seed, 1, *place])
    costs, diverged, spent, queue = [], 0, 0.0, []
    for _ in range(config.adam_iterations):
        if len(queue) < per_batch:
            queue += list(rng.permutation(groups))
        batch, queue = sorted(queue[:per_batch]), queue[per_batch:]
        cost, gradient, lost = problem.gradient(data, weights, None if len(batch) >= groups else batch)
        if np.isfinite(gradient).all():
            adam, weights = adam.step(weights, gradient)
            watch(weights)
        costs.append(cost)
        diverged = max(diverged, lost)
        spent += len(batch) / groups
    return weights, adam, float(np.mean(costs[-max(1, groups // per_batch) :])), spent, diverged


def _concluded(
    problem: Problem, sets: Sequence[Horizon], state: State, config: TrainingConfig, correction: Correction, dropped: Mapping[str, str],
    out_of_time: bool, ranges: tuple[Sequence[Range], Sequence[Range]], clock: Callable,
) -> Trained:  # fmt: skip
    """The verdict on the best weights, and the numbers that go with it."""
    last = sets[-1]
    costs = last.validation_costs(state.best)
    null = _nulled(correction)
    chi2 = [problem.smoothed(last.validation_observed, w, last.sigma).chi2 for w in (null, state.best)]
    proved, evidence = gate((last.baseline.mean(1), costs.mean(1)), chi2, config.material)
    accepted = proved if config.gate else bool(costs.mean() < last.baseline.mean())
    trained = correction.with_weights(state.best if accepted else null)
    rows = [dict(zip(HISTORY, row, strict=True)) for row in state.history]
    diverging = bool(rows) and min(row["validation_last_horizon"] for row in rows) > 10
    fitted = min((row["train"] for row in rows if row["horizon"] == last.seconds), default=None)
    outcome, sentence = verdict(accepted, evidence, len(costs), fitted, diverging=diverging, out_of_time=out_of_time)
    if not config.gate:
        outcome, sentence = ungated(outcome, sentence, accepted, proved)
    if not np.isfinite(trained.weights).all():
        raise NumericalFailure("not_finite", "training gave weights that are no numbers", do="Lower train-hybrid.rate.")
    ratio = np.sqrt(costs.mean(0) / last.baseline.mean(0))
    metrics = {
        "outcome": outcome, "sentence": sentence, "gate": config.gate, "proved": proved, "validation": evidence, "training": fitted,
        "validation_rmse_ratio": {n: float(r) for n, r in zip(problem.outputs, ratio, strict=True)},
        "horizons": [s.seconds for s in sets], "train_segments": len(last.train_observed.segments.first),
        "validation_segments": len(last.validation_observed.segments.first), "weights": int(correction.weights.size),
        "gradient_evaluations": state.evaluations, "seconds": state.seconds, "left_out_inputs": dict(dropped),
        "parametric_share": present(problem.parametric, "what parameters can do").share(correction.with_weights(state.best)),
        "outside_box_validation": outside_share(problem.log, problem.kite, correction, ranges[1]),
    }  # fmt: skip
    compared = None
    if config.compare and state.switch is not None:
        compared, metrics["comparison"] = compare(problem, last, len(sets), state, config, correction, clock)
    return Trained(trained, outcome, state.history, metrics, state, compared, dropped)


def _nulled(correction: Correction) -> np.ndarray:
    from awescli.engine.dense import layer_slices

    weights = correction.weights.copy()
    for part in layer_slices(correction.sizes)[-1]:
        weights[part] = 0.0
    return weights


def compare(
    problem: Problem, last: Horizon, phase: int, state: State, config: TrainingConfig, correction: Correction, clock: Callable
) -> tuple[dict[str, Correction], dict]:
    """(name -> correction, numbers) of L-BFGS, and of Adam alone from the same start at either limit; see `comparison`."""
    column = {name: i for i, name in enumerate(HISTORY)}
    rows = [row for row in state.history if row[column["phase"]] == phase]
    gradients = sum(row[column["evaluations"]] for row in rows)
    earlier = [row[column["seconds"]] for row in state.history if row[column["phase"]] < phase]
    seconds = rows[-1][column["seconds"]] - (earlier[-1] if earlier else 0.0)

    def one_round(weights, adam, number):
        # rounds that no phase has used: batches of their own
        watch = last.lowest(weights)
        weights, adam, _, spent, _ = _adam(problem, last.train(weights), weights, adam, config, [phase, number], watch)
        return weights, adam, spent, last.best_of(weights, watch.x)

    training = lambda w: float(problem.costs(last.train(w), w).mean())  # noqa: E731
    validation = lambda w: float(last.validation_costs(w).mean())  # noqa: E731
    switch = present(state.switch, "where L-BFGS took over")
    start, best = switch[0], state.best
    numbers = {
        "gradients": gradients, "seconds": seconds, "spent": {},
        "training": {"switch": training(start), "adam_lbfgs": training(state.weights)},
        "validation": {"switch": validation(start), "adam_lbfgs": validation(best)},
    }  # fmt: skip
    found = adam_alone(switch, one_round, validation(start), gradients, seconds, clock)
    corrections = {"adam_lbfgs": correction.with_weights(state.best)}
    for name, run in zip(("adam", "adam_equal_time"), found, strict=True):
        corrections[name] = correction.with_weights(run.best)
        numbers["training"][name] = training(run.last)
        numbers["validation"][name] = validation(run.best)
        numbers["spent"][name] = {"gradients": run.spent, "seconds": run.seconds}
    return corrections, numbers
