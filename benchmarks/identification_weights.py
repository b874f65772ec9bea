"""Which weights find the parameters better? python benchmarks/identification_weights.py [--flights N]

Flights of the development kite, flown by this project, in calm air and in turbulence, every one with wind, noise, wind record and
declaration of its own. Each is fitted twice: `weights: noise` (every channel by its noise; segment starts and the wind's error in
windows are eliminated exactly, which is the weighting by their propagated covariance) and `weights: seed` (position, attitude and tension,
each by its range). Compared are errors against the truth of parameters that the noise-weighted fit calls excited. Results are kept
per flight in benchmarks/results/weights/ (resumable); the table goes to benchmarks/results/identification_weights.md.
"""

import argparse
import sys
from pathlib import Path

import numpy as np
from campaign import add_options, kept, run_campaign

import awescli  # noqa: F401  (thread settings before numpy)
from awescli.artifacts import write_text

HERE = Path(__file__).parent
RESULTS = HERE / "results" / "weights"
AIRS = {"calm": {}, "turbulent": {"turbulence": {"sigma": 0.9}}}
WEIGHTS = ("noise", "seed")


def run_flight(name: str, case: dict) -> dict:
    """One flight, both weights: errors of the parameters and on unseen loops."""
    from awescli.estimation.identifiability import describe
    from awescli.estimation.problem import build, simulator_of, without_record
    from awescli.estimation.staged_fit import Flight, fit_flights
    from awescli.flightlog.loops import find_loops
    from awescli.flightlog.split import split
    from awescli.physics.declaration import read_kite
    from awescli.simulation.campaign_flights import dev_like
    from awescli.stages.flight_parts import score_parts
    from awescli.stages.identify import IdentifyConfig, outputs_of

    truth = read_kite(HERE.parent / "data" / "kites" / "development.yaml")
    flight = dev_like(truth, case["seed"], AIRS[case["air"]])
    parts, simulator = split(find_loops(flight.log), log=flight.log), simulator_of(flight.declared, flight.log)
    true, result = flight.flown.table(), {"initial": score_parts(simulator, flight.log, parts, 5.0)["nrmse"]["test"]["mean"]}
    for weights in WEIGHTS:
        outputs = outputs_of(flight.log, IdentifyConfig(weights=weights))
        problem = build(simulator, flight.log, parts, 5.0, outputs, by_range=weights == "seed")
        fit, _ = fit_flights([Flight(problem)], (1.0, 2.5))
        answer = describe(fit, set(problem.kite.record))
        rows, groups = answer["parameters"], [f["parameters"] for f in answer["common_factors"]]
        identified = simulator.holding(without_record(simulator.kite, fit.flights[0].parameters))
        result[weights] = {
            "outcome": fit.solution.outcome, "test": score_parts(identified, flight.log, parts, 5.0)["nrmse"]["test"]["mean"],
            "common_factor": max(groups, key=len) if groups else [],
            "parameters": {n: [(r["value"] - true[n].value) / true[n].value, r["std"] / abs(true[n].value), r["excited"]]
                           for n, r in rows.items()},
        }  # fmt: skip
    return result


def errors(result: dict, weights: str, group: list[str]) -> dict[str, float]:
    """Relative errors; those of a `group` whose common factor no flight can tell (it stands where the prior has put it) without it."""
    found = {n: row[0] for n, row in result[weights]["parameters"].items()}
    factor = float(np.median([1 + found[n] for n in group])) if group else 1.0
    return {n: (1 + e) / factor - 1 if n in group else e for n, e in found.items()}


def table(results: dict[str, dict]) -> str:
    lines = [
        "# Weights of the fit", "",
        f"`python benchmarks/identification_weights.py --flights {len(results) // len(AIRS)}`: flights of 150 s of the development "
        "kite, half fitted, test on unseen loops; declarations 5-30 % off. Errors relative to the truth, RMS over flights, without the "
        "common factor that no flight can tell; coverage: share of |error| < 1.96 std, factor included; parameters that the "
        "noise-weighted fit calls excited.", "",
    ]  # fmt: skip
    # one kite: the factor is the same in all flights, found or not
    group = max((r[w]["common_factor"] for r in results.values() for w in WEIGHTS), key=len)
    for air in AIRS:
        here = [r for n, r in results.items() if n.startswith(air)]
        lines += [f"## {air.capitalize()} air, {len(here)} flights", ""]
        lines += ["| parameter | flights | error, noise | error, seed | times better |", "|---|---|---|---|---|"]
        ratios, covered = [], {w: [] for w in WEIGHTS}
        for name in here[0]["noise"]["parameters"]:
            of = [r for r in here if r["noise"]["parameters"][name][2]]
            if len(of) < len(here) / 2:
                continue
            error = {w: float(np.sqrt(np.mean([errors(r, w, group)[name] ** 2 for r in of]))) for w in WEIGHTS}
            for w in WEIGHTS:
                covered[w] += [abs(r[w]["parameters"][name][0]) < 1.96 * r[w]["parameters"][name][1] for r in of]
            ratios.append(error["seed"] / error["noise"])
            lines.append(f"| {name} | {len(of)} | {100 * error['noise']:.2g} % | {100 * error['seed']:.2g} % | {ratios[-1]:.2g} |")
        test = {w: float(np.median([r[w]["test"] for r in here])) for w in WEIGHTS}
        worse = sum(r["noise"]["test"] > r["seed"]["test"] for r in here)
        coverage = {w: f"{100 * np.mean(covered[w]):.1f} %" for w in WEIGHTS}
        lines += [
            "", f"Median over parameters: **{np.median(ratios):.2g} times** more accurate with `noise` ({min(ratios):.2g} to "
            f"{max(ratios):.2g}). Coverage of 95 % intervals: noise {coverage['noise']}, seed {coverage['seed']}. Test NRMSE at 5 s, "
            f"median: initial {np.median([r['initial'] for r in here]):.4f}, noise {test['noise']:.5f}, seed {test['seed']:.5f}; noise is "
            f"worse on {worse} of {len(here)} flights.", "",
        ]  # fmt: skip
    return "\n".join(lines)


def main(arguments=None) -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--flights", type=int, default=20, help="flights in each kind of air")
    add_options(parser)
    options = parser.parse_args(arguments)
    cases = {f"{air}-{30000 + i}": {"air": air, "seed": 30000 + i} for air in AIRS for i in range(options.flights)}
    failed = run_campaign(run_flight, cases, RESULTS, options.jobs, options.scheduler)
    text = table(kept(RESULTS, cases))
    write_text(RESULTS.parent / "identification_weights.md", text)
    print("\n".join(line for line in text.splitlines() if line.startswith("Median")))
    return 3 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
