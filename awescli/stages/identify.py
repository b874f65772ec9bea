"""identify: estimate the free parameters of the kite from the flight (seed eq. 11)."""

from typing import Literal

from pydantic import Field

from awescli.stages.base import KITE_FILE, Need, Stage, StageConfig


class IdentifyConfig(StageConfig):
    """Settings of identify."""

    horizon: float = Field(5.0, gt=0.2, le=60, description="seconds between re-initialisations [s]")
    curriculum: tuple[float, ...] = Field((1.0, 2.5), description="shorter horizons that are fitted first, one after the other [s]")
    surfaces: Literal["recorded", "controller"] = Field(
        "recorded", description="replay the recorded set-points, or close the loop with the fitted controller (seed eq. 11d)"
    )
    weights: Literal["noise", "seed"] = Field(
        "noise", description="noise: every measured channel by its noise; seed: position, attitude and tension by their range"
    )
    outputs: tuple[str, ...] | None = Field(None, description="measured channels that count; default all of the log")
    prior: bool = Field(True, description="weigh deviations from the declared values by their prior standard deviations")


class Identify(Stage):
    """Fit on train; validation and test are only predicted."""

    name = "identify"
    help = "Estimate the free parameters of the kite from the flight."
    Config = IdentifyConfig
    makes = ("params.json", KITE_FILE, "metrics.json")

    def needs(self, config):
        return (Need("fit-controller", required=config.surfaces == "controller"),)

    def run(self, context, config):
        from awescli.artifacts import write_json, write_text
        from awescli.estimation.answer import describe
        from awescli.estimation.question import ask, fit_in_stages, simulator_of, without_record
        from awescli.physics.declaration import kite_text, read_kite
        from awescli.stages.flight_parts import flight_parts, law_upstream, score_parts

        log, parts = flight_parts(context)
        declared = read_kite(context.kite)
        simulator = simulator_of(declared, log)
        if config.surfaces == "controller":
            simulator = simulator_of(declared, log, law=law_upstream(context, simulator.kite, log))
        question = ask(simulator, log, parts, config.horizon, outputs_of(log, config), seed_weights=config.weights == "seed")
        task = context.progress.task("Gauss-Newton")
        fitted, question = fit_in_stages(
            question, log, parts, [h for h in config.curriculum if h < config.horizon], prior=config.prior,
            on_iteration=lambda h, i, cost: (task.advance(), task.update(f"{h:g} s, iteration {i}: cost {cost:.6g}")),
        )  # fmt: skip
        answer = describe(fitted, question.prior, simulator.kite.record)
        identified = simulator.holding(without_record(simulator.kite, fitted.parameters))
        metrics = {
            "outcome": fitted.solution.outcome, "chi2": fitted.chi2, "gust_m_s": question.gust,
            "cost_history": list(fitted.solution.history), "surfaces": config.surfaces,
            "initial": score_parts(simulator, log, parts, config.horizon),
            **score_parts(identified, log, parts, config.horizon),
        }  # fmt: skip
        write_json(context.folder / "params.json", answer)
        write_text(context.folder / KITE_FILE, kite_text(identified.kite.declare(())))
        write_json(context.folder / "metrics.json", metrics)
        bounded = [n for n, row in answer["parameters"].items() if row["at_bound"]]
        unseen = [n for n, row in answer["parameters"].items() if not row["excited"]]
        if bounded:
            context.progress.note(f"at their bounds: {', '.join(bounded)}")
        if held := [row["constraint"] for row in answer["constraints"] if row["active"]]:
            context.progress.note(f"constraints that hold the fit back: {'; '.join(held)}")
        if unseen:
            context.progress.note(f"hardly seen by this flight, kept near their priors: {', '.join(unseen)}")
        return {
            "outcome": fitted.solution.outcome, "chi2": fitted.chi2,
            "test NRMSE before": metrics["initial"]["nrmse"]["test"]["mean"], "after": metrics["nrmse"]["test"]["mean"],
        }  # fmt: skip


def outputs_of(log, config) -> tuple[str, ...]:
    """The channels that count: those asked for, else all measured ones (weights: seed leaves velocities and rates out)."""
    from awescli.notation.errors import BadInput, did_you_mean
    from awescli.notation.quantities import MEASURED

    wanted = config.outputs
    if wanted is None:
        left_out = {"v_n", "v_e", "v_d", "p", "q", "r", "a_x", "a_y", "a_z", "V_a", "alpha", "beta"} if config.weights == "seed" else set()
        return tuple(n for n in MEASURED if n in log and n not in left_out)
    for name in wanted:
        if name not in log.measured:
            raise BadInput(f"the flight has no measured channel '{name}'", "identify.outputs", did_you_mean(name, log.measured))
    return wanted
