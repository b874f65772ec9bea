"""simulate: fly the model on its own and write the flight as a log; compare it with the flight it set out from."""

from typing import Literal

from pydantic import Field

from awescli.stages.base import KITE_FILE, Need, Stage, StageConfig

HORIZONS = (0.5, 1.0, 2.0, 5.0, 10.0)
"""[s] after the start at which the simulated flight is compared with the measured one."""

MODELS = {"identified": "identify", "with_effects": "trace-residual"}
"""Model on the ladder -> the stage whose kite file it is."""


class SimulateConfig(StageConfig):
    """Settings of simulate."""

    surfaces: Literal["controller", "recorded", "path_following"] = Field(
        "controller", description="who moves the surfaces: the fitted controller, the log, or a built-in law that follows the flown circle"
    )
    model: Literal["newest", "declared", "identified", "with_effects"] = Field("newest", description="which model flies")
    effects: dict[str, dict[str, float]] = Field({}, description="effects switched on, e.g. {actuator_lag:rudder: {tau: 0.2}}")
    start: float = Field(0.0, ge=0, description="where in the flight it sets out [s]")
    duration: float = Field(60.0, gt=0, le=3600, description="how long it flies [s]; beyond the log, winch and wind go on as they were")
    noise: bool = Field(True, description="add the kite file's sensor noise to the written log")
    substeps: int = Field(2, ge=1, le=20, description="integration steps per sample")


class Simulate(Stage):
    """Set out from a measured state, fly on, write what the sensors would say."""

    name = "simulate"
    help = "Fly a model in closed loop (or with replayed surfaces) and write the flight as a log."
    Config = SimulateConfig
    makes = ("flight/kite.csv", "flight/wind.csv", "metrics.json")

    def needs(self, config):
        upstream = [Need("fit-controller")] if config.surfaces == "controller" else []
        upstream += [Need(stage, required=config.model == model) for model, stage in MODELS.items() if config.model in (model, "newest")]
        return tuple(upstream)

    def run(self, context, config):
        from dataclasses import replace

        from awescli.artifacts import write_json, write_text
        from awescli.flightlog.kitemill_csv import to_kitemill_csv
        from awescli.flightlog.read import missing_for_model, read_flight
        from awescli.notation.errors import BadInput
        from awescli.physics.declaration import read_kite
        from awescli.simulation.rollout import setpoints_of
        from awescli.simulation.segments import smooth_states
        from awescli.simulation.synthetic import LoggedReelOut, as_recorded, simulate_flight, with_effects

        log = read_flight(context.flight)
        if missing := missing_for_model(log):
            raise BadInput(f"flight '{log.name}' lacks what a model needs: {'; '.join(missing)}", str(context.flight), "See `awes check`.")
        first = int(round(config.start / log.dt))
        if first >= len(log) - 1:
            raise BadInput(f"the flight is only {log.time[-1]:.1f} s long", "simulate.start", f"Start before {log.time[-1]:.1f} s.")
        declaration = with_effects(read_kite(self._kite(context, config)), config.effects)
        duration = config.duration
        if config.surfaces == "recorded":
            duration = min(duration, (len(log) - 1 - first) * log.dt)
        law, pattern = self._law(context, config, log, declaration)
        samples = int(round(duration / log.dt)) + 1
        recorded = setpoints_of(log)[[min(first + k, len(log) - 1) for k in range(samples)]]
        wind = replace(log.wind, time=log.wind.time - log.time[first])
        context.progress.task(f"flying {duration:g} s")
        flown = simulate_flight(
            declaration, law, wind, LoggedReelOut(log, first), pattern=pattern, duration=duration, dt=log.dt,
            start=smooth_states(log)[first], setpoints=recorded, seed=context.seed, substeps=config.substeps,
        )  # fmt: skip
        epoch = log.start + float(log.time[first])
        written = as_recorded(flown, declaration, wind, seed=context.seed, noise=config.noise, name="flight", epoch=epoch)
        kite, weather = to_kitemill_csv(written)
        write_text(context.folder / "flight" / "kite.csv", kite)
        write_text(context.folder / "flight" / "wind.csv", weather)
        survived = (len(flown.time) - 1) * flown.dt
        metrics = {
            "outcome": "departed" if flown.departed else "flew_on",
            "survived_s": survived,
            "asked_s": duration,
            "seed": context.seed,
            "nrmse": compared(log, first, flown),
        }
        write_json(context.folder / "metrics.json", metrics)
        errors = {f"error over {horizon} s": block["mean"] for horizon, block in metrics["nrmse"].items()}
        return {"outcome": metrics["outcome"], "flew": f"{survived:.1f} of {duration:g} s", **errors}

    @staticmethod
    def _kite(context, config):
        """The kite file of the model that is to fly."""
        if config.model == "declared":
            return context.kite
        if config.model in MODELS:
            return context.upstream(MODELS[config.model]) / KITE_FILE
        return context.model_kite()

    @staticmethod
    def _law(context, config, log, declaration):
        """(law for the simulator or None, pattern or None)."""
        from awescli.physics.kite import Kite
        from awescli.simulation.closed_loop import loop
        from awescli.stages.controller_artifact import read_controller, wind_direction

        if config.surfaces == "controller":
            law = read_controller(context.upstream("fit-controller"))
            return loop(law, Kite(declaration, log.wind.height), wind_direction(log)), law.pattern
        if config.surfaces == "path_following":
            law = follower_of(log, declaration)
            return law.setpoints, law.pattern
        return None, None


def follower_of(log, declaration):
    """The path-following law on the circle that the log flies, other surfaces at their medians there."""
    import numpy as np

    from awescli.control.law import state_mapping
    from awescli.control.path_following import PathFollowing
    from awescli.estimation.controller_pattern import fit_pattern
    from awescli.notation.quantities import SURFACES

    rudder = declaration.surfaces.get("rudder")
    trims = {name: float(np.median(log[name])) for name in SURFACES if name in log.inputs and name != "rudder"}
    limit = min(-rudder.lower, rudder.upper) if rudder else 0.5
    span = declaration.parameters["b"].value
    return PathFollowing(fit_pattern(state_mapping(log), log.valid), semi_span=span / 2, limit=limit, trims=trims)


def compared(log, first: int, flown) -> dict:
    """Horizon [s, as text] -> channel -> NRMSE of the true (noise-free) simulated flight against the log; only horizons that both reach."""
    import numpy as np

    from awescli.notation.quantities import STATES
    from awescli.simulation import scores

    names = [n for n in (*STATES, "V_a", "tension") if n in STATES or n in log]
    reach = min(len(flown.time), len(log) - first)
    blocks = {}
    for horizon in HORIZONS:
        count = int(round(horizon / log.dt)) + 1
        if count > reach:
            break
        rows = slice(first, first + count)
        block = {n: scores.nrmse(scores.error(log[n][rows], flown.outputs[n][:count], n), scores.span(log[n], n)) for n in names}
        blocks[f"{horizon:g}"] = block | {"mean": float(np.mean([block[n] for n in STATES]))}
    return blocks
