"""What do derivatives of measured flight become once air and model error are random beside them?
python benchmarks/derivatives_in_gusts.py --ap2 FOLDER --thor FOLDER

Each flight is fitted three times, to the train blocks of its example's plan: by output error (what `awes identify` ends with there), in
gusts (`identify.air: gusts`), and in gusts with a delay of each moving surface free. The delays have two witnesses: the likelihood, and
derivatives that come to what was published. Results go to benchmarks/results/derivatives_in_gusts.md.
"""

import argparse
import time
from collections.abc import Sequence
from pathlib import Path

from campaign import commit
from measured_campaign import PLANS, parted

import awescli  # noqa: F401  (thread settings before numpy)
from awescli.artifacts import write_text

HERE = Path(__file__).parent
TABLE = HERE / "results" / "derivatives_in_gusts.md"
NAMES = {"ap2": "Ampyx AP2, 49 s", "thor": 'UMN Ultra Stick 25e "Thor", 366 s'}
SHORT = 0.03
"""[s] where the fit of a delay begins."""


def fits(flight: str, folder: Path) -> list[dict]:
    """The fits of a flight: what was fitted, the values of its parameters, deviance, prediction error."""
    import numpy as np

    from awescli.estimation.prediction import predict
    from awescli.estimation.staged_fit import Flight, fit_flights, fit_output_error, levels_of
    from awescli.flightlog.read import read_flight
    from awescli.physics.declaration import read_kite
    from awescli.stages import STAGES
    from awescli.stages.plan import read_plan
    from awescli.tracing.fitted_model import FittedModel, bounded
    from awescli.tracing.frame import Frame, TracedFlight
    from awescli.tracing.investigate import moving
    from awescli.tracing.models import fit_added, fit_on

    plan = read_plan(HERE.parent / "examples" / PLANS[flight] / "stages.yaml", STAGES, {"flight": str(folder)})
    log, kite = read_flight(plan.flight), read_kite(plan.kite)
    parts, settings = parted(plan, log), plan.settings["identify"]
    frame = Frame((TracedFlight(log, parts, kite),), settings.horizon, tuple(log.measured))
    shorter, (problem,) = [h for h in settings.curriculum if h < settings.horizon], frame.problems(())
    delays = [f"actuator_delay:{surface}" for surface in moving(log) if surface != "throttle"]

    def beside_delays(model: FittedModel) -> FittedModel:
        """From its levels and noise: two models whose noise differs could not be compared."""
        for key in delays:
            model = fit_added(frame, model, key, {f"{key}.tau": SHORT}, {}, alone=False)
        return fit_on(frame, model)

    found: list[dict] = []
    for name in ("output error", "in gusts", "in gusts, delays free"):
        begin = time.perf_counter()
        if name == "output error":
            model = FittedModel.of((), (), *fit_output_error([Flight(problem)], shorter))
        elif name == "in gusts":
            model = FittedModel.of((), (), *fit_flights([Flight(problem)], shorter, in_gusts=True))
        else:
            model = beside_delays(model).widened()
        fit, unseen = model.fit, (parts.validation, parts.test)
        errors = [predict(model.simulator, log, part, settings.horizon).nrmse()["mean"] for part in unseen]
        std = dict(zip(fit.names, np.sqrt(np.diag(fit.covariance)), strict=True))
        found.append(
            {
                "name": name, "rows": {n: (fit.parameters[n].value, s, n in bounded(fit)) for n, s in std.items()},
                "prior": {n: problem.prior[n].value for n in fit.names if n in problem.prior}, "record": set(problem.kite.record),
                "outcome": fit.solution.outcome, "still": fit.still_to_gain, "train": float(model.train.sum()),
                "flies": model.flies, "segments": model.segments, "errors": errors, "horizon": settings.horizon,
                "levels": levels_of(model.problems[0].processes), "wall_s": time.perf_counter() - begin,
            }
        )  # fmt: skip
    return found


def told(flight: str, found: Sequence[dict]) -> str:
    """The table of a flight."""
    names = [n for n in dict.fromkeys(n for f in found for n in f["rows"]) if n not in found[0]["record"]]
    prior = found[0]["prior"]
    lines = [
        f"## {NAMES[flight]}", "", "| | declared | " + " | ".join(f["name"] for f in found) + " |", "|---|" + "---|" * (len(found) + 1),
        *(f"| {n} | {_declared(prior.get(n))} | " + " | ".join(_cell(f["rows"].get(n)) for f in found) + " |" for n in names),
        "| outcome, share of the cost still promised | | " + " | ".join(f"{f['outcome']}, {f['still']:.0e}" for f in found) + " |",
        f"| deviance of the fitted blocks gained by the delays | | | | {found[1]['train'] - found[2]['train']:.0f} |",
        "| segments flown, validation included | | " + " | ".join(f"{f['flies']} of {f['segments']}" for f in found) + " |",
        "| NRMSE ahead, validation, test | | " + " | ".join(_errors(f) for f in found) + " |",
        "| levels of processes | | " + " | ".join(_levels(f) for f in found) + " |",
        "| time | | " + " | ".join(f"{f['wall_s']:.0f} s" for f in found) + " |",
    ]  # fmt: skip
    return "\n".join(lines)


def _declared(value: float | None) -> str:
    return "" if value is None else f"{value:.3g}"


def _cell(row: tuple[float, float, bool] | None) -> str:
    return "" if row is None else f"{row[0]:.3g} +- {1.96 * row[1]:.2g}{' (bound)' if row[2] else ''}"


def _errors(f: dict) -> str:
    return ", ".join(f"{e:.3g}" for e in f["errors"]) + f" ({f['horizon']:g} s)"


def _levels(f: dict) -> str:
    return ", ".join(f"{name} {level:.2g}" for name, level in f["levels"].items() if name != "wind record") or "none"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--ap2", type=Path, help="folder with the log of the Ampyx AP2")
    parser.add_argument("--thor", type=Path, help="folder with the log of the University of Minnesota's Thor")
    folders = {f: folder for f, folder in vars(parser.parse_args()).items() if folder}
    tables = [told(flight, fits(flight, folder)) for flight, folder in folders.items()]
    made = f"`python benchmarks/derivatives_in_gusts.py --ap2 FOLDER --thor FOLDER`, commit {commit()}"
    head = ["# Derivatives of measured flights, in gusts", "", f"{made}. +-: half of the 95 % interval.", "", ""]
    write_text(TABLE, "\n".join(head) + "\n\n".join(tables) + "\n")
    print(TABLE.read_text())


if __name__ == "__main__":
    main()
