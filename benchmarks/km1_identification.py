"""Do KM1's published identified values return from its published initial ones? python benchmarks/km1_identification.py [--flights N]

Flights as data/make_km1_demo.py makes them, without its undeclared effect: KM1 with the published identified parameters, every flight with
noise and a wind record of its own. Fitted from data/kites/km1_initial.yaml, its values, bounds and prior, by `awes identify`'s defaults.
Results are kept per flight in benchmarks/results/km1/ (resumable); the table goes to benchmarks/results/km1_identification.md.
"""

import argparse
import importlib.util
import sys
from pathlib import Path

import numpy as np
from campaign import add_options, kept, run_campaign

import awescli  # noqa: F401  (thread settings before numpy)
from awescli.artifacts import write_text

HERE = Path(__file__).parent
RESULTS = HERE / "results" / "km1"
DATA = HERE.parent / "data"
SHOWN = ("mean", "phi", "theta", "psi")


def run_flight(name: str, seed: int) -> dict:
    """One flight and its fit: parameter -> row of params.json and the published value."""
    from awescli.estimation.identifiability import describe
    from awescli.estimation.problem import build, simulator_of, without_record
    from awescli.estimation.staged_fit import Flight, fit_flights
    from awescli.flightlog.loops import find_loops
    from awescli.flightlog.split import split
    from awescli.physics.declaration import read_kite
    from awescli.stages.flight_parts import score_parts

    spec = importlib.util.spec_from_file_location("make_km1_demo", DATA / "make_km1_demo.py")
    demo = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(demo)
    log = demo.flown(seed, {})
    declared, published = read_kite(DATA / "kites" / "km1_initial.yaml"), read_kite(DATA / "kites" / "km1_identified.yaml").table()
    parts, simulator = split(find_loops(log), log=log), simulator_of(declared, log)
    problem = build(simulator, log, parts, 5.0, tuple(log.measured))
    fit, _ = fit_flights([Flight(problem)], (1.0, 2.5))
    answer = describe(fit, set(problem.kite.record))
    identified = simulator.holding(without_record(simulator.kite, fit.flights[0].parameters))
    true = simulator.holding(simulator.kite.parameters.with_values({n: published[n].value for n in declared.parameters}))
    models = {"initial": simulator, "identified": identified, "published identified": true}
    return {
        "seed": seed, "outcome": fit.solution.outcome, "chi2": fit.chi2,
        "parameters": {n: {**row, "published": published[n].value} for n, row in answer["parameters"].items()},
        "test": {what: score_parts(s, log, parts, 5.0)["nrmse"]["test"] for what, s in models.items()},
    }  # fmt: skip


def table(results: list[dict]) -> str:
    count = len(results)
    lines = [
        "# KM1: from the published initial to the published identified values", "",
        f"`python benchmarks/km1_identification.py --flights {count}`: {count} flights of 150 s flown with the published identified "
        "values, fitted from the published initial ones on half of the loops. Errors in prior standard deviations, RMS over flights.", "",
        "| parameter | initial | published identified | found, mean | std, mean | error before | error after | excited | interval holds |",
        "|---|---|---|---|---|---|---|---|---|",
    ]  # fmt: skip
    inside = counted = 0
    seen, unseen = [], []
    for name in results[0]["parameters"]:
        rows = [r["parameters"][name] for r in results]
        true, unit = rows[0]["published"], rows[0]["prior_std"]
        found = np.array([row["value"] for row in rows])
        excited = [row for row in rows if row["excited"] and not row["at_bound"]]
        hits = sum(abs(row["value"] - true) < 1.96 * row["std"] for row in excited)
        inside, counted = inside + hits, counted + len(excited)
        (seen if len(excited) > count / 2 else unseen).append(name)
        held = f"{hits} of {len(excited)}" if excited else "-"
        lines.append(
            f"| {name} | {rows[0]['prior']:.4g} | {true:.4g} | {found.mean():.4g} | {np.mean([row['std'] for row in rows]):.2g} "
            f"| {abs(rows[0]['prior'] - true) / unit:.2f} | {np.sqrt(np.mean((found - true) ** 2)) / unit:.3f} "
            f"| {len(excited)} of {count} | {held} |"
        )
    lines += [
        "", f"What returns ({len(seen)}): {', '.join(seen)}. Intervals of excited parameters: {inside} of {counted} hold = "
        f"**{100 * inside / max(counted, 1):.1f} %**. chi2 {np.mean([r['chi2'] for r in results]):.3f}; "
        f"outcomes: {', '.join(sorted({r['outcome'] for r in results}))}.", "",
        f"What these flights cannot tell ({len(unseen)}): {', '.join(unseen)}: they stay near the prior. Only the rudder moves, so a "
        "derivative of a constant deflection (flaps, elevator) cannot be told from its coefficient's constant term.", "",
        "| test NRMSE at 5 s, median | mean of 12 states | phi | theta | psi |", "|---|---|---|---|---|",
    ]  # fmt: skip
    for what in results[0]["test"]:
        lines.append(f"| {what} | " + " | ".join(f"{np.median([r['test'][what][n] for r in results]):.4f}" for n in SHOWN) + " |")
    return "\n".join([*lines, ""])


def main(arguments=None) -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--flights", type=int, default=10)
    add_options(parser)
    options = parser.parse_args(arguments)
    cases = {str(seed): seed for seed in range(2100, 2100 + options.flights)}
    failed = run_campaign(run_flight, cases, RESULTS, options.jobs, options.scheduler)
    text = table(list(kept(RESULTS, cases).values()))
    write_text(RESULTS.parent / "km1_identification.md", text)
    print(text)
    return 3 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
