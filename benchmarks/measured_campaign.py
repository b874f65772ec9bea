"""Is an effect named that was put into a measured flight? python benchmarks/measured_campaign.py --thor FOLDER --ap2 FOLDER [--only NAME]

Real air, real noise, and a declared model that lacks more than what was put in: each case is the record of the University of Minnesota's
Thor or of Ampyx' AP2 (not in this repository: the options name the folders) with one effect of known size (injection.py), so large that
3 s predictions change by 4, 2 or 1 times their floor (injected_size.py), or a copy of the record with nothing put in (untouched_copies.py).
The untouched log holds effects of its own, so answers are scored exactly (exact_scoring.py) by what they say beyond the answer to the
untouched log. Results go to benchmarks/results/measured/<commit>/, one file a case; the table to benchmarks/results/measured.md.
"""

import argparse
import sys
import time
from collections import defaultdict
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from campaign import add_options, commit, kept, run_campaign
from exact_scoring import OUTCOMES, Answer, Truth, answer_of, counted, outcome

import awescli  # noqa: F401  (thread settings before numpy)
from awescli.artifacts import write_text

HERE = Path(__file__).parent
RESULTS = HERE / "results" / "measured"
FLOORS = {"full": 4.0, "half": 2.0, "quarter": 1.0}
"""Size -> times their floor by which 3 s predictions change."""
PLANS = {"thor": "umn_thor", "ap2": "ampyx_ap2"}
"""Flight -> the example whose kite file and plan it is traced with."""
INTERVAL = 1.96


def cases(folders: Mapping[str, Path], made_by: str) -> dict[str, dict[str, Any]]:
    """name -> what run_case needs, the untouched flights first. folders: flight -> where its log is."""
    from injection import FREE, TETHERED
    from untouched_copies import COPIES

    found: dict[str, dict[str, Any]] = {}
    kinds = {"thor": FREE, "ap2": TETHERED}
    for flight, folder in folders.items():
        every = {"flight": flight, "folder": str(folder), "commit": made_by}
        found[f"{flight}-untouched"] = {**every, "set": "untouched"}
        found |= {f"{flight}-{size}-{key}": {**every, "set": size, "key": key} for key in kinds[flight] for size in FLOORS}
        found |= {f"{flight}-copy-{name.replace(' ', '_')}": {**every, "set": "copy", "copy": name} for name in COPIES}
    return found


def run_case(name: str, case: Mapping[str, Any]) -> dict[str, Any]:
    """Read, put in, trace, keep what was said."""
    from awescli.flightlog.read import read_flight
    from awescli.notation.errors import AwesError
    from awescli.physics.declaration import read_kite
    from awescli.stages import STAGES
    from awescli.stages.plan import read_plan

    begin, clock = time.perf_counter(), time.process_time()
    try:
        plan = read_plan(HERE.parent / "examples" / PLANS[case["flight"]] / "stages.yaml", STAGES, {"flight": case["folder"]})
        log, kite = read_flight(plan.flight), read_kite(plan.kite)
        log, kite, put_in = changed(case, log, kite, parted(plan, log))
        told = answered(log, kite, parted(plan, log), plan.settings["trace-residual"])
    except AwesError as e:
        return {"case": name, **case, "verdict": "failed", "why": str(e).splitlines()[0]}
    return {
        "case": name, **case, **put_in, "cpu_s": round(time.process_time() - clock, 2), "wall_s": round(time.perf_counter() - begin, 2),
        **{key: told.get(key) for key in ("verdict", "reason", "probability", "chi2", "unexplained", "kinematics")},
        "error": {key: value["mean"] for key, value in told["error"].items() if isinstance(value, Mapping)},
        "effects": told["effects"], "ranking": [f"{r['name']}:{r['acts_on']}" for r in told["ranking"][:3]],
    }  # fmt: skip


def parted(plan, log):
    """The parts of a flight as the stages of the plan deal them."""
    from awescli.flightlog.cycles import pieces
    from awescli.flightlog.split import split

    return split(pieces(log, plan.split.of), **plan.split.model_dump(exclude={"of"}), log=log)


def changed(case: Mapping[str, Any], log, kite, parts):
    """(log, kite, what was put in) of a case."""
    from injected_size import sized
    from injection import TETHERED
    from untouched_copies import COPIES

    if "copy" in case:
        return COPIES[case["copy"]](log, kite), kite, {}
    if "key" not in case:
        return log, kite, {}
    kind = TETHERED[case["key"]]
    value, reached = sized(kind, log, kite, parts.test, FLOORS[case["set"]])
    return *kind.inject(log, kite, value), {"parameter": kind.parameter, "value": value, "null": kind.null, "floors": reached}


def answered(log, kite, parts, settings) -> dict[str, Any]:
    """effects.json, with the settings of the example's plan, and what kinematics alone says. The only lines here that know how a flight is
    traced."""
    from awescli.estimation.prediction import predict
    from awescli.stages.trace_residual import kinematics
    from awescli.tracing.flight import trace_flight
    from awescli.tracing.summary import summary

    finding = trace_flight(kite, log, parts, horizon=settings.horizon, curriculum=settings.curriculum)
    before, after = (predict(model, log, parts.test, settings.horizon) for model in (finding.before(), finding.after()))
    return summary(finding, log, settings.horizon, before, after) | {"kinematics": kinematics(log)}


def beyond(result: Mapping[str, Any], untouched: Mapping[str, Any]) -> Answer:
    """What an answer names that the answer to the untouched flight does not: other effects, and the same ones with sizes that lie outside
    of each other's joint 95 % interval. Where nothing is left of what was named, the answer says nothing new."""
    if result["verdict"] in ("failed", "not_testable"):
        return Answer(result["verdict"])
    known = {(e["name"], e["acts_on"]): e["parameters"] for e in untouched.get("effects", ())}
    new = [e for e in result.get("effects", ()) if not _same_size(e["parameters"], known.get((e["name"], e["acts_on"])))]
    if new:
        return answer_of({"verdict": result["verdict"], "effects": new})
    fresh = not result.get("effects") and result["verdict"] == "unexplained" and untouched.get("verdict") != "unexplained"
    return Answer("unexplained" if fresh else "none")


def _same_size(sizes: Mapping[str, Any], known: Mapping[str, Any] | None) -> bool:
    """Was an effect there before, in these sizes?"""
    if known is None:
        return False
    pairs = [(sizes[n], known[n]) for n in sizes if n in known]
    return all(abs(a["value"] - b["value"]) <= INTERVAL * ((a["std"] or 0.0) ** 2 + (b["std"] or 0.0) ** 2) ** 0.5 for a, b in pairs)


def scored(result: Mapping[str, Any], untouched: Mapping[str, Any]) -> str:
    """One of exact_scoring.OUTCOMES."""
    truth = Truth("library", (result["key"],)) if "key" in result else Truth("clean")
    return outcome(truth, beyond(result, untouched))


def inside(result: Mapping[str, Any], untouched: Mapping[str, Any]) -> bool | None:
    """Does the 95 % interval of the size that an injection has been named with, less what was there before, hold what was put in? None
    where it was not named."""
    of = {side: _size(told, result) for side, told in (("after", result), ("before", untouched))}
    if of["after"] is None:
        return None
    before = of["before"] or {"value": result["null"], "std": 0.0}
    off = of["after"]["value"] - before["value"] - (result["value"] - result["null"])
    return abs(off) <= INTERVAL * ((of["after"]["std"] or 0.0) ** 2 + (before["std"] or 0.0) ** 2) ** 0.5


def _size(told: Mapping[str, Any], result: Mapping[str, Any]) -> Mapping[str, Any] | None:
    """Value and standard deviation of the injected parameter in an answer."""
    name, _, target = result["key"].partition(":")
    found = (e["parameters"] for e in told.get("effects", ()) if e["name"] == name and target in ("", e["acts_on"]))
    return next((p[result["parameter"]] for p in found if result["parameter"] in p), None)


def table(results: Iterable[Mapping[str, Any]]) -> str:
    """What was said, by flight and size, and case by case. Cases of a flight whose untouched log was not traced are left out."""
    results = list(results)
    untouched = {r["flight"]: r for r in results if r["set"] == "untouched"}
    judged = [r for r in results if r["set"] != "untouched" and r["flight"] in untouched]
    by_set: dict[tuple[str, str], list[Mapping[str, Any]]] = defaultdict(list)
    for r in judged:
        by_set[r["flight"], r["set"]].append(r)
    commits = ", ".join(sorted({r["commit"] for r in results}))
    lines = [
        "# Effects put into measured flights", "",
        f"`python benchmarks/measured_campaign.py --thor FOLDER --ap2 FOLDER`, by commit {commits}; scored exactly, by what is said beyond",
        "the answer to the untouched log:", "",
        *(f"- {flight}: `{r['verdict']}`, {_named(r) or 'no names'}" for flight, r in untouched.items()), "",
        f"| flight | set | cases | {' | '.join(OUTCOMES)} | sizes inside their 95 % interval |", "|" + "---|" * (4 + len(OUTCOMES)),
    ]  # fmt: skip
    for (flight, of), group in by_set.items():
        counts = counted(scored(r, untouched[flight]) for r in group)
        held = [h for r in group if "value" in r and (h := inside(r, untouched[flight])) is not None]
        shown = f"{sum(held)} of {len(held)}" if held else ""
        lines.append(f"| {flight} | {of} | {len(group)} | {' | '.join(str(n or '') for n in counts)} | {shown} |")
    lines += ["", "| case | put in | times the floor | outcome | verdict | named |", "|---|---|---|---|---|---|"]
    for r in judged:
        put = f"{r['parameter']} = {r['value']:.4g}" if "value" in r else ""
        floors = f"{r['floors']:.2f}" if "floors" in r else ""
        lines.append(f"| {r['case']} | {put} | {floors} | {scored(r, untouched[r['flight']])} | {r['verdict']} | {_named(r)} |")
    return "\n".join(lines) + "\n"


def _named(result: Mapping[str, Any]) -> str:
    return ", ".join(f"{e['name']}:{e['acts_on']}" if e["acts_on"] else e["name"] for e in result.get("effects", ()))


def main(arguments=None) -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--thor", type=Path, help="folder with thor_flight75_2012_10_10.mat")
    parser.add_argument("--ap2", type=Path, help="folder with validationDataFC114_1_v2_pc.mat")
    parser.add_argument("--only", nargs="*", default=[""], help="only cases whose name begins so; the untouched flights always")
    add_options(parser)
    options = parser.parse_args(arguments)
    folders = {name: folder.resolve() for name, folder in (("thor", options.thor), ("ap2", options.ap2)) if folder}
    if not folders:
        parser.error("name the folder of a measured log: --thor FOLDER, --ap2 FOLDER, or both")
    made_by = commit()
    every, folder = cases(folders, made_by), RESULTS / made_by
    wanted = {n: c for n, c in every.items() if c["set"] == "untouched" or n.startswith(tuple(options.only))}
    failed = run_campaign(run_case, wanted, folder, options.jobs, options.scheduler, say)
    write_text(RESULTS.parent / "measured.md", table(kept(folder, every).values()))
    return 3 if failed else 0


def say(name: str, result: Mapping[str, Any]) -> str:
    put = f" ({result['parameter']} = {result['value']:.4g}, {result['floors']:.2g} floors)" if "value" in result else ""
    return f"{name}{put}: {result['verdict']} {_named(result)} {result.get('why', '')}".rstrip()


if __name__ == "__main__":
    sys.exit(main())
