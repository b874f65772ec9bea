"""train-hybrid: let a small network learn what the physics leaves, through the rollout (Rositani section 5)."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, get_args

from pydantic import Field

from awescli.notation.errors import BadInput
from awescli.stages.ahead import HandedOnConfig, unread_controller
from awescli.stages.answers import ANSWER, change
from awescli.stages.base import KITE_FILE, Context, Inputs, Names, Need, Seconds, Stage

if TYPE_CHECKING:
    from awescli.flightlog.log import FlightLog
    from awescli.flightlog.split import Range, Split
    from awescli.learning.correction import Correction
    from awescli.physics.kite import Kite

CHECKPOINT = "training-{}.npz"
"""In the stage's scratch, one for each network; `State.to_arrays`."""


Torchdiffeq = Literal["rk4_classical", "euler", "midpoint", "heun2", "heun3", "dopri8", "dopri5", "bosh3", "fehlberg2", "adaptive_heun"]
TORCHDIFFEQ: tuple[str, ...] = get_args(Torchdiffeq)
"""Solvers of `hybrid_torch.solver_names()`, which only torch could tell; rk4_classical has the tableau of rk4."""


class TrainHybridConfig(HandedOnConfig):
    """Settings of train-hybrid."""

    hidden: tuple[Annotated[int, Field(ge=1, le=512)], ...] = Field(
        (16, 16), min_length=1, max_length=4, description="widths of the tanh layers (Rositani: 8, 8)"
    )
    inputs: Names | None = Field(None, description="what the network sees; default states, flow angles, surfaces, line")
    horizons: tuple[Seconds, ...] = Field(
        (1.0, 2.5, 5.0), min_length=1, description="predicted seconds, growing; the last one is what counts [s]"
    )
    warmup: float = Field(1.0, gt=0.1, le=5, description="seconds before a prediction that its start is estimated from [s]")
    scaling: Literal["standard", "minmax"] = Field(
        "standard", description="network inputs by mean and standard deviation, or by minimum and maximum to -1..1 (Rositani)"
    )
    drifting: Literal["leave_out", "keep"] = Field(
        "leave_out", description="inputs that leave their training range on validation, or tell the time"
    )
    weights: Literal["error", "range"] = Field(
        "error", description="what an error of a state is counted in: what physics leaves of it, or its range (Rositani)"
    )
    gate: bool = Field(True, description="keep a correction only where validation proves it, else where validation falls at all (Rositani)")
    fade: bool = Field(True, description="the correction fades outside the states it was trained on; else it acts everywhere (Rositani)")
    solver: Literal["rk4"] | Torchdiffeq = Field(
        "rk4", description="rk4: compiled, exact adjoint; the others: torchdiffeq and autograd, slow"
    )
    batch: int = Field(32, ge=8, description="segments per Adam step")
    rate: float = Field(0.01, gt=0, le=1, description="Adam's step size")
    clip: float = Field(5.0, gt=0, description="greatest norm of a gradient")
    decay: float = Field(1e-3, ge=0, description="weight decay: physics explains first")
    orthogonality: float = Field(0.0, ge=0, description="weight of the penalty on what the free parameters could do instead")
    rounds: int = Field(5, ge=1, le=100, description="most rounds per horizon, and of L-BFGS")
    patience: int = Field(2, ge=1, description="rounds without progress that make a plateau")
    material: float = Field(0.03, ge=0, lt=1, description="least relative gain on validation for a correction to be kept")
    budget: float = Field(120.0, gt=0, description="seconds of training, all networks together [s]")
    members: int = Field(1, ge=1, le=20, description="networks from different seeds; their spread is the model's uncertainty")
    compare: bool = Field(False, description="also let Adam go on alone for as many gradients, and seconds, as L-BFGS (Rositani figure 3)")


class TrainHybrid(Stage):
    """Train on train, stop and decide on validation, report on test."""

    name = "train-hybrid"
    help = "Train a small network on what the physics leaves: Adam, then L-BFGS, through the rollout."
    Config = TrainHybridConfig
    makes = ("network.safetensors", "network.json", "metrics.json", "correction.npz", KITE_FILE)

    def needs(self, config: TrainHybridConfig) -> tuple[Need, ...]:
        return (
            Need("fit-controller", required=config.surfaces == "controller"), Need("identify"), Need("trace-residual", required=False),
        )  # fmt: skip

    def unread(self, config: TrainHybridConfig, upstreams: Mapping[str, Path]) -> tuple[str, ...]:
        return unread_controller(config.surfaces, upstreams)

    def check(self, inputs: Inputs, config: TrainHybridConfig) -> Iterator[tuple[str, BadInput]]:
        from awescli.learning.network_inputs import check_inputs
        from awescli.notation.errors import BadInput

        _ = inputs.parts, inputs.declared
        for name in config.inputs or ():
            try:
                check_inputs([name])
            except BadInput as e:
                yield "inputs", e
        if config.surfaces == "controller" and config.solver != "rk4":
            yield "solver", replays_only(config.solver)

    def run(self, context: Context, config: TrainHybridConfig) -> dict[str, Any]:
        import numpy as np

        from awescli.artifacts import read_arrays, write_arrays, write_json, write_tensors, write_text
        from awescli.learning.correction import hybrid_from_artifact
        from awescli.learning.ensemble import spread, train_ensemble
        from awescli.learning.explain import along, distil
        from awescli.learning.normalisation import outside_share
        from awescli.learning.training import HISTORY, State, TrainingConfig
        from awescli.physics.declaration import kite_text, read_kite
        from awescli.physics.kite import Kite
        from awescli.simulation.rollout import Simulator
        from awescli.stages.flight_parts import closed_loop, flight_parts, score_parts

        log, parts = flight_parts(context)
        declaration = read_kite(context.model_kite())
        closed = config.closes_the_loop(context)
        if closed and config.solver != "rk4":
            raise replays_only(config.solver)
        driven, law = closed_loop(context, declaration, log, closed)
        kite, in_loop = (Kite(d, log.recorded_wind.height) for d in (declaration, driven))
        chosen: dict[str, Any] = {k: v for k, v in config.model_dump().items() if k != "inputs" and k in TrainingConfig.__annotations__}
        chosen |= {"horizons": horizons_within(context, config, log, parts), "known_starts": config.known_starts}
        chosen |= {"keep_drifting": config.drifting == "keep", "by_range": config.weights == "range"}
        chosen |= {"inputs": config.inputs} if config.inputs else {}
        settings = TrainingConfig(**chosen, seed=context.seed)

        def saved(member):
            return context.scratch / CHECKPOINT.format(member)

        def resume(member):
            file = saved(member)
            return State.from_arrays(read_arrays(file, "awes train-hybrid --force"), where=str(file)) if file.is_file() else None

        task = context.progress.task("training")

        def progress(text: str, cost: float) -> None:
            task.advance()
            task.update(f"{text}, training {cost:.4g}")

        ensemble = train_ensemble(
            in_loop, log, parts.train, parts.validation, settings, config.members,
            progress, law=law, resume=resume,
            checkpoint=lambda member, state: write_arrays(saved(member), state.to_arrays()),
        )  # fmt: skip
        best = ensemble.best
        correction, description = best.correction, best.correction.description()
        task.update("scoring on unseen loops")
        horizon = best.metrics["horizons"][-1]
        before = score_parts(Simulator(in_loop, (), law), log, parts, horizon, config.known_starts)

        def scored(network) -> dict:
            model = hybrid_from_artifact(network.description(), network.to_arrays(), driven, log, law)
            return score_parts(model, log, parts, horizon, config.known_starts)

        after = scored(correction)
        profile = along(log, kite, correction)
        # times stand in the provenance, so that equal runs leave equal artifacts
        timeless = {k: v for k, v in best.metrics.items() if k != "seconds"}
        columns = [name for name in HISTORY if name != "seconds"]
        rows = [[v for name, v in zip(HISTORY, row, strict=True) if name in columns] for row in best.history]
        metrics = {
            **timeless, "surfaces": "controller" if closed else "recorded", "initial_states": config.initial_states,
            "before": before, **after, "outside_box_test": outside_share(log, kite, correction, parts.test),
            "share_of_acceleration": profile.shares(log.valid), "history": {"columns": columns, "rows": rows},
            "distilled": [str(f) for f in distil(log, kite, correction, parts.train, parts.validation)],
        }  # fmt: skip
        for name, other in (best.compared or {}).items():
            metrics["comparison"].setdefault("test", {})[name] = scored(other)["nrmse"]["test"]
        if config.members > 1:
            learned = [c for c in ensemble.corrections if not c.is_zero]
            metrics["ensemble"] = {"members": config.members, "learned": len(learned), "outcomes": [m.outcome for m in ensemble.members]}
            if len(learned) > 1:
                metrics["ensemble"]["spread"] = spread_over_test(kite, learned, log, parts.test, horizon, spread)
        write_tensors(context.folder / "network.safetensors", correction.to_arrays())
        write_json(context.folder / "network.json", description)
        write_json(context.folder / "metrics.json", metrics)
        arrays = {"time": log.time, "correction": profile.values, "physics": profile.physics, "fade": np.asarray(profile.fade)}
        write_arrays(context.folder / "correction.npz", arrays)
        write_text(context.folder / KITE_FILE, kite_text(declaration))
        for name, reason in best.dropped.items():
            context.progress.note(f"network input '{name}' was left out: it {reason}")
        if metrics["outside_box_test"] > 0.05:
            share = 100 * metrics["outside_box_test"]
            context.progress.note(f"on {share:.0f} % of the test loops the correction faded: the flight left what it was trained on")
        return {
            "outcome": best.outcome, "test NRMSE before": before["nrmse"]["test"]["mean"], "after": after["nrmse"]["test"]["mean"],
            "outside its box": metrics["outside_box_test"], "seconds of training": round(best.metrics["seconds"], 1),
            ANSWER: [
                f"{best.outcome}: {best.metrics['sentence']}",
                change(before["nrmse"]["test"]["mean"], after["nrmse"]["test"]["mean"], after["noise_floor"]["mean"], horizon),
            ],
        }  # fmt: skip


def replays_only(solver: str) -> BadInput:
    """The mistake of a solver that cannot close the loop."""
    return BadInput(f"solver '{solver}' replays recorded set-points only", do="Use solver: rk4, or surfaces: recorded.")


def horizons_within(context: Context, config: TrainHybridConfig, log: "FlightLog", parts: "Split") -> tuple[float, ...]:
    """The horizons that fit into every part of the flight, at least one, where they may be shortened; else all."""
    from awescli.stages.ahead import horizon_within

    if config.too_long == "refuse":
        return config.horizons
    longest = horizon_within(context, config, max(config.horizons), [(log, parts)])
    return (*(h for h in config.horizons if h < longest), longest)


def spread_over_test(
    kite: "Kite", corrections: "Sequence[Correction]", log: "FlightLog", ranges: "Sequence[Range]", horizon: float, spread: Callable
) -> dict[str, float]:
    """Channel -> root mean square standard deviation of the members' predictions of the test loops."""
    import numpy as np

    from awescli.flightlog.split import segments
    from awescli.notation.quantities import MEASURED, OUTPUTS
    from awescli.simulation.segments import observe

    steps = int(round(horizon / log.dt))
    observed = observe(log, kite, segments(ranges, steps, stride=steps, valid=log.valid), steps, MEASURED)
    _, deviation = spread(kite, corrections, observed.segments)
    sizes = np.sqrt(np.nanmean(deviation**2, axis=(0, 1)))
    return {name: float(s) for name, s in zip(OUTPUTS, sizes, strict=True) if np.isfinite(s)}
