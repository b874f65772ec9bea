"""Identified flight controllers: error on unseen loops, sparsity, and whether they fly; d01, d02 and fresh synthetic flights in one table.

    python benchmarks/controller_flights.py [--dev FOLDER] [--flights d01 d02 ...] [--seeds 201 202 ...] [--out FILE]

Fitted on train, chosen on validation and by closed-loop flights from train and validation states of the declared kite, reported on test
(the last 30 % of the loops). The declared kite is what a user would declare: its free parameters are 5-30 % off. `identified`: the same
laws on the kite that is identified from the flight (5 s between re-initialisations, as `awes identify`). The fresh flights are drawn from
their seed; the method was developed on other ones (d03-d10, seeds 101-106). FOLDER holds the development flights; without it they are left
out.
"""

import awescli  # noqa: F401, I001  (before numpy: one BLAS thread)
import argparse
import importlib.util
from pathlib import Path

import yaml

from awescli.artifacts import write_text
from awescli.controller_fit.config import ControllerConfig
from awescli.controller_fit.fit import fit_controller
from awescli.estimation.problem import build, simulator_of, without_record
from awescli.estimation.staged_fit import fit_in_stages
from awescli.flightlog.loops import find_loops
from awescli.flightlog.read import read_flight
from awescli.flightlog.split import split
from awescli.physics.declaration import read_kite
from awescli.simulation.campaign_flights import dev_like
from awescli.simulation.survival import flies, loop_gain
from awescli.stages.controller_artifact import wind_direction

ROOT = Path(__file__).parent.parent
SECONDS = 60.0
HORIZON = 5.0
"""[s] between re-initialisations where the kite is identified."""
HEAD = ("flight", "kind", "test NRMSE", "smoothed states", "noise alone", "terms", "condition", "flies 60 s from", "shortest [s]",
        "path error 5 s [m]", "identified: from", "shortest [s]", "path error 5 s [m]")  # fmt: skip


def development(folder: Path):
    """(log, declared kite) of a development flight."""
    spec = importlib.util.spec_from_file_location("declare", ROOT / "examples" / "dev_kite" / "declare.py")
    declare = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(declare)
    text = yaml.safe_dump(declare.kite_of(yaml.safe_load((folder / "nominal.yaml").read_text())), sort_keys=False)
    kite = Path.cwd() / f"{folder.name}_declared.yaml"
    write_text(kite, text)
    try:
        return read_flight(folder), read_kite(kite)
    finally:
        kite.unlink()


def identify(log, kite, parts):
    """The declaration whose free parameters are fitted to train and validation."""
    simulator = simulator_of(kite, log)
    fitted, _ = fit_in_stages(build(simulator, log, parts, HORIZON, tuple(log.measured)), (1.0, 2.5))
    return simulator.holding(without_record(simulator.kite, fitted.parameters)).kite.declare(())


def flown(kite, law, log, direction: float) -> tuple[str, str, str]:
    """From how many states the law flies SECONDS, the shortest flight, and how far it leaves the flown path within 5 s."""
    proof = flies(kite, law, log, direction, SECONDS)
    lasted, path = proof["survival_s"], proof["path_error_5s_m"]
    return f"{sum(s >= proof['asked_s'] for s in lasted)} of {len(lasted)}", f"{min(lasted):.0f}", "-" if path is None else f"{path:.1f}"


def rows_of(name: str, log, kite) -> tuple[list[tuple], str]:
    """(a row of the table per kind, a line on features, steering and gains)."""
    parts, direction = split(find_loops(log), log=log), wind_direction(log)
    known = (*parts.train, *parts.validation)

    def fly(law) -> float:
        return flies(kite, law, log, direction, SECONDS, known)["share"]

    fitted = fit_controller(log, parts.train, parts.validation, ControllerConfig(compare=True), fly)
    identified = identify(log, kite, parts)
    rows = []
    for kind, line in fitted.report["comparison"].items():
        n, c, e = (line[key]["test"]["rudder"] for key in ("nrmse", "nrmse_smoothed", "noise_nrmse"))
        condition = line["condition"]
        rows.append((name, kind, f"{n:.4f}", f"{c:.4f}", f"{e:.4f}", line["nonzeros"], f"{condition:.0e}" if condition else "-",
                     *flown(kite, fitted.laws[kind], log, direction), *flown(identified, fitted.laws[kind], log, direction)))  # fmt: skip
    report = fitted.report
    gain = loop_gain(kite, fitted.law, log, direction)["rudder"]
    steering = report["steering"]
    measured = "unknown" if gain is None else f"{gain:.0f}"
    return rows, (
        f"- {name}: {', '.join(report['features']['chosen'])}; circle {steering['circle']}, "
        f"{steering['moved_deg']:.1f} deg beside the flown one, "
        f"slopes {steering['slopes']['rudder']}; hold {report['hold']:g}; "
        f"gamma of the error {report['gain']['rudder']['gamma_error']:.1e} rad, gain of the loop {measured} per rad."
    )


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--dev", type=Path, default=ROOT.parent / "shared" / "flights" / "dev")
    parser.add_argument("--flights", nargs="*", default=["d01", "d02"], help="development flights; the method was developed on d03 to d10")
    parser.add_argument("--seeds", type=int, nargs="*", default=[201, 202, 203, 204, 301, 302, 303, 304])
    parser.add_argument("--out", type=Path, default=ROOT / "benchmarks" / "results" / "controllers.md")
    arguments = parser.parse_args()
    truth = read_kite(ROOT / "data" / "kites" / "development.yaml")
    table, notes = [HEAD, tuple("---" for _ in HEAD)], []
    flights = [(d, lambda d=d: development(arguments.dev / d)) for d in arguments.flights if (arguments.dev / d).exists()]
    for seed in arguments.seeds:
        flights.append((f"seed {seed}", lambda seed=seed: _fresh(truth, seed)))
    for name, load in flights:
        rows, note = rows_of(name, *load())
        table += rows
        notes.append(note)
        for row in rows:
            print(*row, sep="\t", flush=True)
        print(note, flush=True)
    lines = [
        "# Identified flight controllers",
        "",
        f"`python benchmarks/{Path(__file__).name}`; what the columns are stands in the script.",
        "",
    ]
    lines += ["| " + " | ".join(map(str, row)) + " |" for row in table] + ["", *notes, ""]
    write_text(arguments.out, "\n".join(lines))


def _fresh(truth, seed: int):
    """A flight with the wind's record by height (even seeds) or from one station (odd ones), flown either way round."""
    made = dev_like(truth, seed, air="power" if seed % 2 else "table", turn=-1.0 if seed % 4 < 2 else 1.0)
    return made.log, made.declared


if __name__ == "__main__":
    main()
