"""How often is the right effect named on a world that is not ours? python benchmarks/foreign_campaign.py CACHE [--families 0 1] [--kinds K]

Flights of a KM1-like kite by JSBSim (foreign_world.py), of the kinds in foreign_kinds.yaml: effects of the library, effects in neither the
library nor the bank of empirical terms, and nothing at all under all kinds of conditions. Flights are made once and kept in CACHE. The
answer to each is kept as a line of JSON in benchmarks/results/foreign/<commit>/, so that a campaign can be interrupted and resumed; scored
exactly (exact_scoring.py), they make benchmarks/results/foreign.md. Families 0 and 1 are for development: rules may be set on them. Every
other family is flown once, after the rules stand. (Answers of code that is not committed stay under its last commit with a `+`: remove
the folder before you fly again.)
"""

import argparse
import sys
import time
from collections import defaultdict
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from calibration import lines as calibration_lines
from calibration import stated
from campaign import add_options, commit, kept, run_campaign
from exact_scoring import OUTCOMES, RIGHT, Truth, answer_of, counted, outcome
from foreign_kinds import SHARES, read_kinds

import awescli  # noqa: F401  (thread settings before numpy)
from awescli.artifacts import write_text

HERE = Path(__file__).parent
RESULTS = HERE / "results" / "foreign"
DEVELOPMENT = (0, 1)
"""Families of seeds that rules may be set on."""


def answered(folder: Path) -> dict[str, Any]:
    """A flight folder, traced as a user would: effects.json, as plain data. The only lines here that know how a flight is traced."""
    from awescli.estimation.prediction import predict
    from awescli.flightlog.loops import find_loops
    from awescli.flightlog.read import read_flight
    from awescli.flightlog.split import split
    from awescli.notation.errors import AwesError
    from awescli.physics.declaration import read_kite
    from awescli.tracing.flight import trace_flight
    from awescli.tracing.summary import summary

    try:
        log, declared = read_flight(folder), read_kite(folder / "kite.yaml")
        parts = split(find_loops(log), log=log)
        finding = trace_flight(declared, log, parts)
        before, after = (predict(model, log, parts.test, 5.0) for model in (finding.before(), finding.after()))
        return summary(finding, log, 5.0, before, after)
    except AwesError as e:
        return {"verdict": "failed", "why": str(e).splitlines()[0]}


def cases(families: Iterable[int], kinds: Iterable[str], sizes: Iterable[str], air: str, repeats: int, cache: Path, made_by: str) -> dict:
    """name -> what run_case needs. Clean kinds have one size and their own air."""
    from foreign_flights import Case

    found = {}
    for family in families:
        for name in kinds:
            clean = read_kinds()[name].group == "clean"
            for size in ("full",) if clean else sizes:
                for repeat in range(repeats):
                    case = Case(name, size, family, repeat, "calm" if clean else air)
                    found[f"{family}/{case.name}"] = {**vars(case), "cache": str(cache), "commit": made_by}
    return found


def run_case(name: str, case: Mapping[str, Any]) -> dict[str, Any]:
    """Fly where the cache has no such flight, trace, keep what was said."""
    from foreign_flights import Case, flight_folder

    from awescli.notation.errors import AwesError

    begin = time.perf_counter()
    try:
        folder = flight_folder(Case(**{key: case[key] for key in ("kind", "size", "family", "repeat", "air")}), Path(case["cache"]))
    except AwesError as e:
        return {"case": name, **case, "verdict": "failed", "why": f"not flown: {e}"}
    flown, clock = time.perf_counter(), time.process_time()
    told = answered(folder)
    return {
        "case": name, **case, "fly_s": round(flown - begin, 2), "wall_s": round(time.perf_counter() - flown, 2),
        "cpu_s": round(time.process_time() - clock, 2), "flight": folder.name,
        **{key: told.get(key) for key in ("verdict", "why", "probability", "chi2", "gust_m_s", "unexplained")},
        "error": {key: value["mean"] for key, value in told.get("error", {}).items() if isinstance(value, Mapping)},
        "effects": told.get("effects", []), "ranking": [f"{r['name']}:{r['acts_on']}" for r in told.get("ranking", ())[:3]],
    }  # fmt: skip


def truth_of(result: Mapping[str, Any]) -> Truth:
    """What was right for a flight. An effect whose name the code does not know yet is outside of its library."""
    from awescli.physics.effects import EFFECTS

    kind = read_kinds()[result["kind"]]
    known = tuple(a for a in kind.answers if all(key.strip().partition(":")[0] in EFFECTS for key in a.split("+")))
    group = "outside" if kind.group == "library" and not known else kind.group
    return Truth(group, known, result["air"] != "calm" or kind.conditions.turbulence[1] > 0)


def scored(result: Mapping[str, Any]) -> str:
    """One of exact_scoring.OUTCOMES."""
    return outcome(truth_of(result), answer_of(result))


def claimed(results: Iterable[Mapping[str, Any]]) -> list[tuple[float, bool]]:
    """(probability that an answer gives itself, was it right?) of all that state one."""
    return [(stated(answer_of(r), r["probability"]), scored(r) in RIGHT) for r in results if r.get("probability")]


def table(results: list[dict], agreed: str) -> str:
    """Totals, kinds, and every flight."""
    commits = sorted({r["commit"] for r in results})
    head = "| " + " | ".join(("", "flights", *OUTCOMES)) + " |\n|" + "---|" * (2 + len(OUTCOMES))
    lines = [
        "# Foreign campaign", "",
        f"{len(results)} flights of a KM1-like kite by JSBSim, families {_listed(r['family'] for r in results)} of seeds, traced by commit "
        f"{', '.join(commits)}; scored exactly.", "", agreed, "", _times(results), "", head,
    ]  # fmt: skip
    totals, kinds = defaultdict(list), defaultdict(list)
    for r in results:
        group = truth_of(r).group
        totals[f"{group}, {r['size']}, {r['air']}" if group != "clean" else "clean"].append(scored(r))
        kinds[group, r["kind"], r["size"], r["air"]].append(scored(r))
    lines += [_row(name, outcomes) for name, outcomes in sorted(totals.items())]
    lines += ["", "## Every kind", "", head]
    lines += [_row(f"{group}: {kind}, {size}, {air}", outcomes) for (group, kind, size, air), outcomes in sorted(kinds.items())]
    lines += ["", *calibration_lines(claimed(results)), "## Every flight", ""]
    lines += ["| flight | lacks | outcome | verdict | named | probability | chi2 before -> after |", "|" + "---|" * 7]
    return "\n".join([*lines, *(_line(r) for r in results)]) + "\n"


def _row(name: str, outcomes: list[str]) -> str:
    return f"| {name} | {len(outcomes)} | " + " | ".join(str(n) if n else "" for n in counted(outcomes)) + " |"


def _line(r: Mapping[str, Any]) -> str:
    named = "; ".join(" or ".join(":".join(name) for name in entry) for entry in answer_of(r).named) or (r.get("why") or "")
    if r.get("unexplained"):
        named += f" {r['unexplained']['expression'] or r['unexplained']['channel']}"
    chi2 = "{train_before:.3f} -> {train_after:.3f}".format(**r["chi2"]) if r.get("chi2") else ""
    sure = "".join(f"{p:.2f}" for p, _ in claimed([r]))
    return f"| {r['case']} | {read_kinds()[r['kind']].lacks} | {scored(r)} | {r['verdict']} | {named} | {sure} | {chi2} |"


def _listed(families) -> str:
    return ", ".join(f"{f}{' (development)' if f in DEVELOPMENT else ''}" for f in sorted(set(families)))


def _times(results: list[dict]) -> str:
    wall = sorted(r["wall_s"] for r in results if "wall_s" in r)
    if not wall:
        return "No flight was traced."
    return f"A trace takes {wall[len(wall) // 2]:.0f} s (median; longest {wall[-1]:.0f} s) in a worker with one thread."


def agreement_line() -> str:
    """A clean flight against our equations, in a sentence."""
    from foreign_agreement import clean_agreement

    worst = clean_agreement()
    return (
        "Agreement first: over 5 s open loop, through 60 s of a clean flight, our equations and JSBSim differ by "
        f"{1e3 * worst['position']:.2f} mm and {57.2958 * worst['attitude']:.4f} deg at most (2 mm and 0.003 deg are asked)."
    )


def main(arguments=None) -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("cache", type=Path, help="folder for the flights, outside of the repository")
    parser.add_argument("--families", type=int, nargs="+", default=[0], help="of seeds; 0 and 1 for development, others are flown once")
    parser.add_argument("--kinds", nargs="+", default=[], help="names of foreign_kinds.yaml, or groups (library, outside, clean)")
    parser.add_argument("--size", nargs="+", choices=list(SHARES), default=["full"], help="of the effects")
    parser.add_argument("--air", choices=("calm", "gusts", "field"), default="calm", help="of effects; field: all that logs have")
    parser.add_argument("--repeats", type=int, default=1, help="flights of every kind and family")
    add_options(parser)
    options = parser.parse_args(arguments)
    every = read_kinds()
    if unknown := [k for k in options.kinds if k not in every and k not in {kind.group for kind in every.values()}]:
        parser.error(f"unknown kinds: {', '.join(unknown)}; there are: {', '.join(every)}")
    wanted = [name for name, kind in every.items() if not options.kinds or name in options.kinds or kind.group in options.kinds]
    agreed = agreement_line()
    print(agreed, flush=True)
    made_by = commit()
    todo = cases(options.families, wanted, options.size, options.air, options.repeats, options.cache.absolute(), made_by)
    failed = run_campaign(run_case, todo, RESULTS / made_by, options.jobs, options.scheduler, say)
    if results := list(kept(RESULTS / made_by, todo).values()):
        text = table(results, agreed)
        write_text(RESULTS.with_suffix(".md"), text)
        print(text.partition("## Every flight")[0])
    return 3 if failed else 0


def say(name: str, result: dict) -> str:
    return f"{scored(result):12s} {name}: {result['verdict']} {[e['name'] for e in result.get('effects', ())]}"


if __name__ == "__main__":
    sys.exit(main())
