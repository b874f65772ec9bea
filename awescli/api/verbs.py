"""The functions: each runs one stage of the command line, with the stage's settings as keyword arguments.

Common arguments. out: folder for the results; None: a temporary one, which goes with the last result that needs it. progress: an object
with `task` and `note` (`awescli.stages.base.Progress`) that is notified of its progress. settings: what `awes STAGE --help` lists, under
the same names.

All raise BadInput (`awescli.notation.errors`) for what the caller can mend, before anything long is computed, and NumericalFailure for a
computation without a usable answer.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from awescli.api.inputs import Flight, Kite, read_flight, read_kite
from awescli.api.models import Controller, Hybrid, Identification, Tracing
from awescli.api.proofs import Prediction, Report, Simulation
from awescli.api.results import Result, result
from awescli.api.work import Origin, run
from awescli.notation.errors import BadInput

if TYPE_CHECKING:
    from awescli.stages.base import Progress

Model = Kite | Identification | Tracing | Hybrid
Folder = str | Path | None


def fit_controller(
    flight: Flight | str | Path, kite: Kite | str | Path, *, out: Folder = None, seed: int = 0, split: Mapping[str, Any] | None = None,
    progress: "Progress | None" = None, **settings: Any,
) -> Controller:  # fmt: skip
    """Identify the flight controller from the log: a law from measured states to surface set-points [rad], docs/equations.md (19)
    (`awes fit-controller`).

    flight, kite: as read, or their paths; out: folder of the results, None: a temporary one; seed: of everything random; split: shares and
    order of train, validation and test, as in stages.yaml; progress: is notified of it; settings: those of `awes fit-controller`.
    Raises BadInput for a flight, kite or setting that cannot be used, NumericalFailure where no law can be fitted.
    """
    return result(Controller, run("fit_controller", "fit-controller", _origin(flight, kite, seed, split), settings, out, progress))


def identify(
    flight: Flight | str | Path, kite: Kite | str | Path, *, controller: Controller | None = None, out: Folder = None, seed: int = 0,
    split: Mapping[str, Any] | None = None, progress: "Progress | None" = None, **settings: Any,
) -> Identification:  # fmt: skip
    """Estimate the free parameters of the kite from the flight, docs/equations.md (20) to (24) (`awes identify`).

    flight, kite: as read, or their paths; controller: for surfaces="controller", and for whatever later follows from this result and flies
    by it; out: folder of the results, None: a temporary one; seed: of everything random; split: shares and order of train, validation and
    test, as in stages.yaml; progress: is notified of it; settings: those of `awes identify`. Raises BadInput for what cannot be
    used, NumericalFailure where the model cannot be simulated or fitted.
    """
    origin = _with(_origin(flight, kite, seed, split), controller)
    return result(Identification, run("identify", "identify", origin, settings, out, progress))


def trace(identified: Identification, *, out: Folder = None, progress: "Progress | None" = None, **settings: Any) -> Tracing:
    """Find what still repeats in the residual, trace it to the effect that the model lacks, add it, prove it on unseen loops,
    docs/equations.md (23) to (27) (`awes trace-residual`). A flight that is not testable is a result too: its `verdict` says so.

    identified: what `identify` gave; out: folder of the results, None: a temporary one; progress: is notified of it; settings: those of
    `awes trace-residual`. Raises BadInput for what cannot be used, NumericalFailure for a computation without a usable answer.
    """
    _expect(identified, Identification, "trace")
    return result(Tracing, run("trace", "trace-residual", identified.origin, settings, out, progress))


def train(model: Identification | Tracing, *, out: Folder = None, progress: "Progress | None" = None, **settings: Any) -> Hybrid:
    """Train a small network on what the physics of `model` leaves, docs/equations.md (28) and (29) (`awes train-hybrid`).

    model: what `identify` or `trace` gave; out: folder of the results, None: a temporary one; progress: is notified of it;
    settings: those of `awes train-hybrid`. Raises BadInput for what cannot be used, NumericalFailure for training
    without a usable answer.
    """
    _expect(model, (Identification, Tracing), "train")
    return result(Hybrid, run("train", "train-hybrid", model.origin, settings, out, progress))


def simulate(
    model: Model, flight: Flight | str | Path | None = None, *, controller: Controller | None = None, out: Folder = None,
    progress: "Progress | None" = None, **settings: Any,
) -> Simulation:  # fmt: skip
    """Fly a model by itself, from a measured state, and write what its sensors would say as a log (`awes simulate`).

    model: a kite or a result; flight: gives start, wind and winch; needed with a kite, a result has its own. controller: flies it, where
    the result does not stand on one; without any, set surfaces="recorded" (the log's set-points) or "path_following" (a built-in law on the
    circle that was flown). phases: of pumping cycles, as in a plan; each says itself who steers. out: folder of the results, None: a
    temporary one; progress: is notified of it; settings: those of `awes simulate`. Raises BadInput for what cannot be used,
    NumericalFailure where the model cannot be simulated.
    """
    origin, label = _of_model(model, flight, "simulate")
    origin = _with(origin, controller)
    steering = [p.get("law", "path_following") for p in settings.get("phases", ())] or [settings.get("surfaces", "controller")]
    winches = [dict(p.get("winch", {})).get("fitted", False) for p in settings.get("phases", ())]
    if ("controller" in steering or any(winches)) and "fit-controller" not in origin.made:
        do = 'Give controller=fit_controller(flight, kite), or surfaces="recorded" or "path_following".'
        raise BadInput("there is no controller to fly by", "simulate()", do)
    return result(Simulation, run("simulate", "simulate", origin, {"model": label, **settings}, out, progress))


def predict(
    *models: Model, flight: Flight | str | Path | None = None, horizon: float = 5.0, horizons: Sequence[float] = (0.5, 1.0, 2.0, 5.0, 10.0)
) -> Prediction:
    """Predict `horizon` seconds ahead, again and again, and compare with what was measured on loops that nothing was fitted to.

    models: results of one flight, or kites; flight: another flight than the results', or that for kites (its test part is what counts);
    horizon: [s] of the errors and arrays; horizons: [s] further ones at which the mean error is given. The numbers are those of
    `awes evaluate`, NRMSE by docs/equations.md (30). Raises BadInput for models of different flights, two of one name, or no such horizon.
    """
    from awescli.stages.base import Silent
    from awescli.stages.blas import one_blas_thread
    from awescli.stages.evaluate import EvaluateConfig
    from awescli.stages.nested_models import model_of, score_models

    if not models:
        raise BadInput("there is no model", "predict()", "Give a kite or a result: predict(identified).")
    results = [m for m in models if not isinstance(m, Kite)]
    origin, _ = _of_model((results or list(models))[-1], flight, "predict")
    origin = origin.joined(*(m.origin for m in results)) if flight is None else origin
    labels = ["initial" if isinstance(m, Kite) else m.label for m in models]
    if twice := {n for n in labels if labels.count(n) > 1}:
        what = f"two of these models are both '{sorted(twice)[0]}'"
        raise BadInput(what, "predict()", "Predict them one after the other.")
    try:
        config = EvaluateConfig.model_validate({"horizon": horizon, "horizons": tuple(horizons)})
    except ValueError as e:
        raise BadInput(f"not a horizon that can be predicted: {e.errors()[0]['msg']}", "predict()", "Give seconds, 0.2 to 60.") from None  # type: ignore[attr-defined]
    context = origin.context()
    with one_blas_thread():
        log = origin.flight.log
        parts = context.inputs.parts_of(log, origin.flight.path)
        simulators = {
            label: model_of(label, m.path if isinstance(m, Kite) else m.origin.made[m.stage].intact().folder / "kite.yaml", log)
            for label, m in zip(labels, models, strict=True)
        }
        metrics, arrays = score_models(simulators, context, log, parts, config, Silent())
    return Prediction(origin, origin.flight, horizon, tuple(labels), metrics, arrays)


def report(*results: Result, out: Folder = None, progress: "Progress | None" = None, **settings: Any) -> Report:
    """Score every model on unseen loops, and write the page that shows it all (`awes evaluate --report`).

    results: of one flight; all that they stand on comes in too. out: with a folder the page is FOLDER/evaluate/report.html, None: in a
    temporary one; progress: is notified of it; settings: those of `awes evaluate`. Raises BadInput for results of different flights.
    """
    if not results:
        raise BadInput("there is nothing to report", "report()", "Give results: report(traced).")
    for each in results:
        _expect(each, Result, "report")
    first, *others = (r.origin for r in results)
    return result(Report, run("report", "evaluate", first.joined(*others), {"report": True, **settings}, out, progress))


def _origin(flight: Flight | str | Path, kite: Kite | str | Path, seed: int, split: Mapping[str, Any] | None) -> Origin:
    return Origin(_flight(flight), kite if isinstance(kite, Kite) else read_kite(kite), seed, dict(split or {}))


def _flight(flight: Flight | str | Path) -> Flight:
    return flight if isinstance(flight, Flight) else read_flight(flight)


def _of_model(model: Model, flight: Flight | str | Path | None, verb: str) -> tuple[Origin, str]:
    """(where a model comes from, its name among the nested models). On another flight a model is its kite file, without origin."""
    _expect(model, (Kite, Identification, Tracing, Hybrid), verb)
    if isinstance(model, Kite):
        if flight is None:
            raise BadInput("a kite knows no flight", f"{verb}()", f"Give one: {verb}(kite, flight=...).")
        return Origin(_flight(flight), model), "initial"
    if flight is None:
        return model.origin, model.label
    if verb == "simulate" and isinstance(model, Hybrid):
        raise BadInput("a hybrid flies from the flight that it was trained on", "simulate()", "Leave the flight out.")
    return Origin(_flight(flight), model.kite, model.origin.seed, model.origin.split), "initial"


def _with(origin: Origin, controller: Controller | None) -> Origin:
    if controller is None:
        return origin
    _expect(controller, Controller, "controller=")
    return origin.joined(controller.origin)


def _expect(value: Any, kinds: Any, verb: str) -> None:
    """Raise BadInput where an argument is of another kind."""
    if not isinstance(value, kinds):
        wanted = " or ".join(k.__name__ for k in (kinds if isinstance(kinds, tuple) else (kinds,)))
        raise BadInput(f"{type(value).__name__} was given, {wanted} is needed", f"{verb}()", "See help(awescli).")
