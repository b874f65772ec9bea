"""fit-controller: identify the flight controller from the log."""

from typing import Literal

from pydantic import Field

from awescli.stages.base import Names, Stage, StageConfig


class FitControllerConfig(StageConfig):
    """Settings of fit-controller."""

    kind: Literal["gaussian", "network", "linear"] = Field("gaussian", description="class of approximator")
    features: str | Names = Field(
        "auto", description="what the law sees: a named set (state, state_ned, invariant, curvature, heading), names of features, or auto"
    )
    surfaces: tuple[Literal["aileron", "elevator", "rudder", "flaps"], ...] | None = Field(
        None, description="surfaces the law drives; default all that move in the log"
    )
    folds: int = Field(4, ge=2, le=20, description="folds of whole loops for cross-validation")
    most_nonzeros: int = Field(79, ge=1, le=2000, description="most Gaussians the law may keep")
    prove: float = Field(60.0, gt=0, le=600, description="seconds that the law must fly the declared model in closed loop")
    compare: bool = Field(False, description="fit all three kinds and report them in one table")


class FitController(Stage):
    """Fit the law on train, choose on validation, report on test."""

    name = "fit-controller"
    help = "Identify the flight controller from the log: a law from measured states to surface set-points."
    Config = FitControllerConfig
    makes = ("controller.json", "controller.safetensors", "metrics.json")
    reads = ("flight", "kite")

    def run(self, context, config):
        from awescli.artifacts import write_json
        from awescli.estimation.controller_bounds import small_gain
        from awescli.estimation.controller_fit import ControllerConfig, fit_controller
        from awescli.physics.declaration import read_kite
        from awescli.simulation.survival import flies, loop_gain
        from awescli.stages.controller_artifact import wind_direction, write_controller
        from awescli.stages.flight_parts import flight_parts

        log, parts = flight_parts(context)
        kite = read_kite(context.kite)
        direction, known = wind_direction(log), (*parts.train, *parts.validation)
        task = context.progress.task(f"fitting a {config.kind} law", total=3)

        def fly(law) -> float:
            """Choices are made by flights from states of the train and validation parts only."""
            task.update(f"flying a {law.kind} law of {len(law.features)} features")
            return flies(kite, law, log, direction, config.prove, known)["share"]

        settings = config.model_dump(exclude={"prove"}) | {"seed": context.seed}
        fitted = fit_controller(log, parts.train, parts.validation, ControllerConfig(**settings), fly)
        task.advance()
        task.update("flying it in closed loop")
        proof = flies(kite, fitted.law, log, direction, config.prove)
        task.advance()
        gains = loop_gain(kite, fitted.law, log, direction)
        gain = {s: g | small_gain(g["gamma_error"], gains[s]) for s, g in fitted.report.get("gain", {}).items()}
        task.advance()
        write_controller(context.folder, fitted.law)
        write_json(context.folder / "metrics.json", fitted.report | {"outcome": "converged", "closed_loop": proof, "gain": gain})
        for kind, line in fitted.report["comparison"].items():
            if not line["nonzeros"]:
                context.progress.note(f"the {kind} law is zero everywhere")
        test = fitted.report["nrmse"].get("test", {})
        summary = {f"test NRMSE {surface}": value for surface, value in test.items()}
        return summary | {"non-zeros": fitted.report["nonzeros"], "closed loop": proof["outcome"]}
