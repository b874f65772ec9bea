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


def with_delays(kite, log):
    """The declaration with a delay of each surface that moves, free."""
    from awescli.physics.kite import Kite
    from awescli.tracing.investigate import moving

    keys = [f"actuator_delay:{surface}" for surface in moving(log) if surface != "throttle"]
    names = [f"{key}.tau" for key in keys]
    whole = Kite(kite, log.recorded_wind.height, tuple(keys))
    return whole.declare(keys, free=names, table=whole.parameters.with_values(dict.fromkeys(names, SHORT)))


def fits(flight: str, folder: Path) -> list[dict]:
    """The fits of a flight: what was fitted, the table of its parameters, deviance, prediction error."""
    import numpy as np

    from awescli.estimation.prediction import predict
    from awescli.estimation.problem import build, simulator_of, without_record
    from awescli.estimation.staged_fit import Flight, fit_flights, fit_output_error, levels_of
    from awescli.flightlog.read import read_flight
    from awescli.physics.declaration import read_kite
    from awescli.stages import STAGES
    from awescli.stages.plan import read_plan
    from awescli.tracing.models import bounded

    plan = read_plan(HERE.parent / "examples" / PLANS[flight] / "stages.yaml", STAGES, {"flight": str(folder)})
    log, kite = read_flight(plan.flight), read_kite(plan.kite)
    parts, settings = parted(plan, log), plan.settings["identify"]
    shorter = [h for h in settings.curriculum if h < settings.horizon]
    found = []
    for name, declared, in_gusts in (
        ("output error", kite, False), ("in gusts", kite, True), ("in gusts, delays free", with_delays(kite, log), True),
    ):  # fmt: skip
        problem = build(simulator_of(declared, log), log, parts, settings.horizon, tuple(log.measured))
        begin = time.perf_counter()
        if in_gusts:
            fit, (problem,) = fit_flights([Flight(problem)], shorter, in_gusts=True)
        else:
            fit, (problem,) = fit_output_error([Flight(problem)], shorter)
        held = problem.simulator.holding(without_record(problem.kite, fit.flights[0].parameters))
        errors = [predict(held, log, part, settings.horizon).nrmse()["mean"] for part in (parts.validation, parts.test)]
        std = dict(zip(fit.names, np.sqrt(np.diag(fit.covariance)), strict=True))
        rows = {n: (float(fit.parameters[n].value), float(s), n in bounded(fit)) for n, s in std.items()}
        found.append(
            {
                "name": name, "rows": rows, "prior": {n: problem.prior[n].value for n in fit.names}, "outcome": fit.solution.outcome,
                "deviance": fit.flights[0].deviance, "chi2": fit.chi2, "levels": levels_of(problem.processes), "errors": errors,
                "wall_s": time.perf_counter() - begin, "horizon": settings.horizon, "record": set(problem.kite.record),
            }
        )  # fmt: skip
    return found


def told(flight: str, found: Sequence[dict]) -> str:
    """The table of a flight."""
    names = [n for n in dict.fromkeys(n for f in found for n in f["rows"]) if n not in found[0]["record"]]
    prior = {n: v for f in found for n, v in f["prior"].items()}
    lines = [
        f"## {NAMES[flight]}", "", "| | declared | " + " | ".join(f["name"] for f in found) + " |", "|---|" + "---|" * (len(found) + 1),
        *(f"| {n} | {prior[n]:.3g} | " + " | ".join(_cell(f["rows"].get(n)) for f in found) + " |" for n in names),
        "| outcome | | " + " | ".join(f["outcome"] for f in found) + " |",
        "| deviance of the fitted blocks beside the fit before | | | | "
        f"{found[2]['deviance'] - found[1]['deviance']:.0f} |",
        "| NRMSE ahead, validation, test | | " + " | ".join(_errors(f) for f in found) + " |",
        "| levels of processes | | " + " | ".join(_levels(f) for f in found) + " |",
        "| time | | " + " | ".join(f"{f['wall_s']:.0f} s" for f in found) + " |",
    ]  # fmt: skip
    return "\n".join(lines)


def _cell(row: tuple[float, float, bool] | None) -> str:
    return "" if row is None else f"{row[0]:.3g} +- {1.96 * row[1]:.2g}{' (bound)' if row[2] else ''}"


def _errors(f: dict) -> str:
    return ", ".join(f"{e:.3g}" for e in f["errors"]) + f" ({f['horizon']:g} s)"


def _levels(f: dict) -> str:
    return ", ".join(f"{name} {level:.2g}" for name, level in f["levels"].items() if name != "wind record") or "none"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    for flight, name in NAMES.items():
        parser.add_argument(f"--{flight}", type=Path, help=f"folder with the log of {name}")
    folders = {f: folder for f, folder in vars(parser.parse_args()).items() if folder}
    tables = [told(flight, fits(flight, folder)) for flight, folder in folders.items()]
    head = [
        "# Derivatives of measured flights, in gusts", "",
        f"`python benchmarks/derivatives_in_gusts.py --ap2 FOLDER --thor FOLDER`, commit {commit()}. +-: half of the 95 % interval.", "",
    ]  # fmt: skip
    write_text(TABLE, "\n".join(head) + "\n\n".join(tables) + "\n")
    print(TABLE.read_text())


if __name__ == "__main__":
    main()
