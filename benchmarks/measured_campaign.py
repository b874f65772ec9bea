"""Is an effect named that was put into a measured flight? python benchmarks/measured_campaign.py --thor FOLDER --ap2 FOLDER [--only NAME]

Real air, real noise, and a declared model that lacks more than what was put in: each case is the record of the University of Minnesota's
Thor or of Ampyx' AP2 (not in this repository: the options name the folders) with one effect of known size (injection.py), so large that
3 s predictions change by 4, 2 or 1 times their floor (injected_size.py), or a copy of the record with nothing put in (untouched_copies.py).
The untouched log holds effects of its own, so answers are scored exactly (exact_scoring.py) by what they say beyond the answer to the
untouched log. Named is what the verdict names; where there is none, what predicts unseen flight better; what kinematics alone see; and what
is said of all instruments beside gusts and model error.
Results go to benchmarks/results/measured/<commit>/, one file a case; the table to benchmarks/results/measured.md.
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
        if case.get("only") == "kinematics":
            return {"case": name, **case, **put_in, **seen_alone(log)}
        told = answered(log, kite, parted(plan, log), plan.settings["trace-residual"])
    except AwesError as e:
        return {"case": name, **case, "verdict": "failed", "why": str(e).splitlines()[0]}
    return {
        "case": name, **case, **put_in, "cpu_s": round(time.process_time() - clock, 2), "wall_s": round(time.perf_counter() - begin, 2),
        **{key: told.get(key) for key in ("verdict", "reason", "probability", "chi2", "unexplained", "kinematics")},
        "error": {key: value["mean"] for key, value in told["error"].items() if isinstance(value, Mapping)},
        "effects": named_by(told), "measured": measured_by(told, log),
        "ranking": [f"{r['name']}:{r['acts_on']}" for r in told["ranking"][:3]],
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


def named_by(told: Mapping[str, Any]) -> list[Mapping[str, Any]]:
    """The effects that effects.json names, once for everything that names one. by: the verdict ("effects"), "by_prediction" where there is
    none, "kinematics", or all "instruments" beside gusts and model error; each has a size of its own."""
    by = {
        "effects": told["effects"],
        "by_prediction": (told["by_prediction"] or {}).get("effects", ()),
        "kinematics": [_with_size(e) for e in told["kinematics"]],
        "instruments": [_with_size(e) for e in told.get("instruments", ()) if e["found"]],
    }
    return [{**e, "by": source} for source, named in by.items() for e in named]


def measured_by(told: Mapping[str, Any], log) -> list[Mapping[str, Any]]:
    """What kinematics and all instruments beside gusts and model error measure without naming it, as `named_by`: an error that is there
    before one is put in, and too small or too uncertain for a name."""
    from awescli.flightlog.reconstruction.flight_path import reconstruct

    small = [{"name": e.name, "acts_on": e.target or "", "size": e.size, "std": e.std} for e in reconstruct(log).errors if not e.found]
    by = {"kinematics": small, "instruments": [e for e in told.get("instruments", ()) if not e["found"]]}
    return [{**_with_size(e), "by": source} for source, errors in by.items() for e in errors]


def _with_size(told: Mapping[str, Any]) -> dict[str, Any]:
    """An error of a sensor or an actuator in the form of an effect of the verdict."""
    sizes = {told.get("parameter", "size"): {"value": told["size"], "std": told["std"]}}
    return {"name": told["name"], "acts_on": told["acts_on"], "rivals": told.get("rivals", []), "parameters": sizes}


def seen_alone(log) -> dict[str, Any]:
    """What kinematics alone says of a log, in the form of an answer: `found` where it names something, with all that it measured."""
    from awescli.flightlog.reconstruction.flight_path import reconstruct

    seen = reconstruct(log).errors
    effects = [
        {"name": e.name, "acts_on": e.target or "", "rivals": [], "parameters": {"size": {"value": e.size, "std": e.std}}}
        for e in seen if e.found
    ]  # fmt: skip
    sizes = [[_key_of(e.name, e.target, e.acts_on), e.size, e.std] for e in seen]
    return {"verdict": "found" if effects else "none", "effects": effects, "sizes": sizes}


def _key_of(name: str, target: str | None, channels: Iterable[str]) -> str:
    """As injection.py calls it; of several gyros the one that is off is the pitch rate's."""
    return f"{name}:{target}" if target and (target not in ("rates", "accelerations") or "q" in channels) else name


def beyond(result: Mapping[str, Any], untouched: Mapping[str, Any]) -> Answer:
    """What an answer names that the answer to the untouched flight does not. Where nothing is left of what was named, the answer says
    nothing new."""
    if result["verdict"] == "failed":
        return Answer("failed")
    if new := _new(result, untouched):
        of = {True: "cannot_tell", False: "found"}[result["verdict"] == "cannot_tell" or any(e["rivals"] for e in new)]
        return answer_of({"verdict": of, "effects": new})
    if result["verdict"] == "not_testable":
        return Answer("not_testable")
    fresh = not result.get("effects") and result["verdict"] == "unexplained" and untouched.get("verdict") != "unexplained"
    return Answer("unexplained" if fresh else "none")


def _new(result: Mapping[str, Any], untouched: Mapping[str, Any]) -> list[Mapping[str, Any]]:
    """Effects that the untouched flight does not show, each once: others, and the same ones with sizes that lie outside of each other's
    joint 95 % interval, compared with what the same means said. An effect that changes its place with a rival says the same."""
    swapped = {_alike(e, r) for e in untouched.get("effects", ()) for r in e["rivals"]}
    new = [
        e for e in result.get("effects", ())
        if not _same_size(e["parameters"], _before(e, untouched)) and not any(_alike(r, e) in swapped for r in e["rivals"])
    ]  # fmt: skip
    return list({_key(e): e for e in reversed(new)}.values())[::-1]


def _before(effect: Mapping[str, Any], untouched: Mapping[str, Any]) -> Mapping[str, Any] | None:
    """Sizes of an effect in the untouched flight, by the same means if they named it there; None where nothing did."""
    there = [e for e in untouched.get("effects", ()) if _key(e) == _key(effect)]
    return next((e["parameters"] for e in [*(e for e in there if e.get("by") == effect.get("by")), *there]), None)


def _key(effect: Mapping[str, Any]) -> tuple[str, str]:
    """(name, what it acts on, where that is not said by the name)."""
    return effect["name"], effect["acts_on"].replace("report", "")


def _alike(effect: Mapping[str, Any], rival: Mapping[str, Any]) -> tuple[tuple[str, str], tuple[str, str]]:
    """Which effect led which rival."""
    return _key(effect), _key(rival)


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
    """Does the 95 % interval of the size that an injection has been named with, less what was there before by the same means, named or not,
    hold what was put in? None where it was not named."""
    name, _, target = result["key"].partition(":")
    effect = next((e for e in _new(result, untouched) if e["name"] == name and target in ("", e["acts_on"])), None)
    after = effect and _size(effect["parameters"], result)
    if effect is None or after is None:
        return None
    # kinematics says by how much a sensor is off
    none = {"value": 0.0 if effect["parameters"].keys() == {"size"} else result["null"], "std": 0.0}
    there = {"effects": [*untouched.get("effects", ()), *untouched.get("measured", ())]}
    before = _size(_before(effect, there) or {}, result) or none
    off = after["value"] - before["value"] - (result["value"] - result["null"])
    return abs(off) <= INTERVAL * ((after["std"] or 0.0) ** 2 + (before["std"] or 0.0) ** 2) ** 0.5


def _size(sizes: Mapping[str, Any], result: Mapping[str, Any]) -> Mapping[str, Any] | None:
    """Value and standard deviation of the injected parameter among the sizes of an effect."""
    return next((sizes[n] for n in (result["parameter"], "size") if n in sizes), None)


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
        "the answer to the untouched log. Named is what the verdict names or, without one, what predicts better; what kinematics see, and",
        "what is said of all instruments beside gusts and model error, too.",
        "",
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


def table_of_kinematics(results: Iterable[Mapping[str, Any]]) -> str:
    """What kinematics alone says, by kind: of errors of sensors, which it can tell, of others, where it must be silent, and of copies."""
    results = list(results)
    untouched = {r["flight"]: r for r in results if r["set"] == "untouched"}
    commits = ", ".join(sorted({r["commit"] for r in results}))
    lines = [
        "# Effects put into measured flights, seen by kinematics alone", "",
        f"`python benchmarks/measured_campaign.py --kinematics --thor FOLDER --ap2 FOLDER`, by commit {commits}. `right`: what was put in",
        "is named and no other; empty: no name; `inside`: what the size has changed by lies within 1.96 standard deviations.", "",
        *(f"- {flight}, untouched: {_named(r) or 'no names'}" for flight, r in untouched.items()), "",
        "| flight | put in | full | half | quarter | inside |", "|---|---|---|---|---|---|",
    ]  # fmt: skip
    judged = [r for r in results if r["set"] != "untouched" and r["flight"] in untouched]
    told_of = {(r["flight"], r.get("key", "copies"), r.get("copy", r["set"])): r for r in judged if "sizes" in r}
    said = {case: scored(r, untouched[r["flight"]]) for case, r in told_of.items()}
    for flight, key in dict.fromkeys((flight, key) for flight, key, _ in said if key != "copies"):
        named = [r for case, r in told_of.items() if case[:2] == (flight, key) and said[case] == "right"]
        told = [i for r in named if (i := _changed_inside(r, untouched[flight])) is not None]
        cells = " | ".join(_shown(said.get((flight, key, size), "failed")) for size in FLOORS)
        lines.append(f"| {flight} | {key} | {cells} | {f'{sum(told)} of {len(told)}' if told else ''} |")
    lines.append("")
    for flight in untouched:
        copies = [outcome for (of, key, _), outcome in said.items() if of == flight and key == "copies"]
        lines.append(f"- {flight}, untouched copies: {sum(o == 'right' for o in copies)} of {len(copies)} without a name")
    wrong = sum(o == "wrong" for o in said.values())
    return "\n".join([*lines, f"- wrong names: {wrong} of {len(said)}"]) + "\n"


def _shown(outcome: str) -> str:
    return {"right": "right", "wrong": "**wrong**"}.get(outcome, "")


def _changed_inside(result: Mapping[str, Any], untouched: Mapping[str, Any]) -> bool | None:
    """Has a size changed by what was put in, within its joint interval?"""
    now, before = ({key: (size, std) for key, size, std in r["sizes"]}.get(result["key"]) for r in (result, untouched))
    if now is None or before is None:
        return None
    off = now[0] - before[0] - (result["value"] - result["null"])
    return abs(off) <= INTERVAL * (now[1] ** 2 + before[1] ** 2) ** 0.5


def _named(result: Mapping[str, Any]) -> str:
    keys = dict.fromkeys(_key(e) for e in result.get("effects", ()))
    return ", ".join(f"{name}:{target}" if target else name for name, target in keys)


def main(arguments=None) -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--thor", type=Path, help="folder with thor_flight75_2012_10_10.mat")
    parser.add_argument("--ap2", type=Path, help="folder with validationDataFC114_1_v2_pc.mat")
    parser.add_argument("--only", nargs="*", default=[""], help="only cases whose name begins so; the untouched flights always")
    parser.add_argument("--kinematics", action="store_true", help="only what kinematics alone sees: no model, nothing traced")
    add_options(parser)
    options = parser.parse_args(arguments)
    folders = {name: folder.resolve() for name, folder in (("thor", options.thor), ("ap2", options.ap2)) if folder}
    if not folders:
        parser.error("name the folder of a measured log: --thor FOLDER, --ap2 FOLDER, or both")
    made_by = commit()
    every, folder = cases(folders, made_by), RESULTS / made_by
    if options.kinematics:
        every, folder = {n: c | {"only": "kinematics"} for n, c in every.items()}, folder / "kinematics"
    wanted = {n: c for n, c in every.items() if c["set"] == "untouched" or n.startswith(tuple(options.only))}
    failed = run_campaign(run_case, wanted, folder, options.jobs, options.scheduler, say)
    name, shown = ("measured_kinematics.md", table_of_kinematics) if options.kinematics else ("measured.md", table)
    write_text(RESULTS.parent / name, shown(kept(folder, every).values()))
    return 3 if failed else 0


def say(name: str, result: Mapping[str, Any]) -> str:
    put = f" ({result['parameter']} = {result['value']:.4g}, {result['floors']:.2g} floors)" if "value" in result else ""
    return f"{name}{put}: {result['verdict']} {_named(result)} {result.get('why', '')}".rstrip()


if __name__ == "__main__":
    sys.exit(main())
