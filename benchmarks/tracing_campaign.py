"""How often is the right effect named? python benchmarks/tracing_campaign.py [--only SET] [--seeds FAMILY] [--jobs N] [--scheduler ADDRESS]

Every case is a flight of the development kite, flown by this project's simulator with noise and a wrong declaration (guesses 5-30 % off,
in one set as far as their priors say), with an effect that the declaration lacks. Results go to
benchmarks/results/tracing/<family>/<case>.json as each case ends, so the run can be interrupted and resumed; the table is written to
benchmarks/results/tracing.md. Family 0 is for trying things out while the tracer is written; the table reports another one, that nothing
was tuned to. Answers are scored exactly (exact_scoring.py).
"""

import argparse
import math
import sys
import time
from collections import defaultdict
from collections.abc import Callable, Iterable
from dataclasses import replace
from pathlib import Path

import numpy as np
from calibration import brier, stated
from calibration import lines as calibration_lines
from campaign import add_options, commit, kept, run_campaign
from exact_scoring import OUTCOMES, RIGHT, Truth, answer_of, counted, outcome
from guesses_from_priors import guessed
from gust_length import drawn
from injection import FLOWN_BY_RUDDER, TETHERED, delayed, turned
from pumping_flights import pumping_like
from tracing_truths import BOUNDED, FORMS, GROSS, LARGE, LENGTHS, OUTSIDE, PAIRS, at_once, resized, sized
from wrong_bounds import with_wrong_bounds

import awescli  # noqa: F401  (thread settings before numpy)
from awescli.artifacts import write_text

OFF: dict[str, Callable] = {
    "accelerometers turned": lambda log, kite: turned(("a_x", "a_y", "a_z"), "y", log, kite, math.radians(8.0)),
    "receiver 0.4 s late": lambda log, kite: delayed(("p_n", "p_e", "p_d", "v_n", "v_e", "v_d"), log, kite, 0.4),
}
"""Gross errors that no effect of the library stands for."""
HERE = Path(__file__).parent
RESULTS = HERE / "results" / "tracing"


def cases(family: int = 1) -> dict[str, dict]:
    """name -> {set, truth (key -> values), seed, ...}; seeds differ from those of any test, and from family to family."""
    found = {}
    for i, length in enumerate(2 * LENGTHS):
        found[f"length-{length:g}-clean-{i // 2}"] = {
            "set": f"{length:g} times as long, clean", "truth": {}, "seed": 11_900 + i, "length": length,
            "air": ("table", "power")[i // 2], "duration": 150.0 * length**0.5,
        }  # fmt: skip
    for i in range(20):
        found[f"clean-{i:02d}"] = {"set": "clean", "truth": {}, "seed": 1000 + i, "air": ("table", "power")[i % 2]}
    for i, key in enumerate(LARGE):
        for size in (1.0, 0.5, 0.25):
            for repeat in range(2):
                seed = 2000 + 10 * i + repeat
                found[f"calm-{key}-{size:g}-{repeat}"] = {
                    "set": f"calm x{size:g}", "truth": {key: sized(key, size)}, "seed": seed, "air": ("table", "power")[repeat],
                }  # fmt: skip
        for repeat in range(2):
            found[f"priors-{key}-{repeat}"] = {
                "set": "calm x1, guesses from priors", "truth": {key: sized(key, 1.0)}, "seed": 10_000 + 10 * i + repeat,
                "air": ("table", "power")[repeat],
            }  # fmt: skip
        for k, length in enumerate(LENGTHS):
            found[f"length-{length:g}-{key}"] = {
                "set": f"{length:g} times as long", "truth": {key: resized(key, length)}, "seed": 11_000 + 10 * i + k,
                "length": length,
                "air": ("table", "power")[i % 2], "duration": 150.0 * length**0.5,
            }  # fmt: skip
        found[f"five-{key}"] = {"set": "five flights, calm x0.25", "truth": {key: sized(key, 0.25)}, "seed": 9700 + 10 * i, "flights": 5}
        blown = {"sigma": 0.6, "L": round(drawn(3000 + i, family), 1)}
        found[f"turbulent-{key}"] = {"set": "turbulent x1", "truth": {key: sized(key, 1.0), "turbulence": blown}, "seed": 3000 + i}
        for name, air in (("calm", {}), ("gusts", {"turbulence": blown})):
            found[f"pumping-{name}-{key}"] = {
                "set": f"pumping, {name}", "truth": {key: sized(key, 1.0), **air}, "seed": 12_000 + 10 * i + len(air), "of": "cycles",
                # a winch that answers the load has no record ahead of it: its clock is wrong in the record alone
                **({"put_in": key} if key == "clock_offset:winch" else {}),
            }  # fmt: skip
        found[f"short-{key}"] = {"set": "40 s", "truth": {key: sized(key, 1.0)}, "seed": 4000 + i, "duration": 42.0}
    for i in range(6):
        blown = {"sigma": 0.8, "L": round(drawn(5000 + i, family), 1)}
        found[f"turbulent-clean-{i}"] = {"set": "turbulent clean", "truth": {"turbulence": blown}, "seed": 5000 + i}
        air = {"turbulence": blown} if i % 2 else {}
        found[f"pumping-clean-{i}"] = {"set": "pumping, clean", "truth": air, "seed": 12_900 + i, "of": "cycles"}
    errors = [(key, {key: {p: v}}) for key, of in GROSS.items() for p, values in of.items() for v in values]
    for i, (key, truth) in enumerate([*errors, *((key, {}) for key in OFF)]):
        for k, air in enumerate(("calm", "gusts")):
            blown = {"turbulence": {"sigma": 0.6, "L": round(drawn(13_000 + 10 * i + k, family), 1)}} if k else {}
            size = "".join(f"-{v:.3g}" for of in truth.values() for v in of.values())
            found[f"gross-{air}-{key.replace(' ', '_')}{size}"] = {
                "set": f"gross error, {air}" if truth else f"outside, gross error, {air}", "truth": {**truth, **blown},
                "put_in": key, "seed": 13_000 + 10 * i + k,
            }  # fmt: skip
    for i, (name, truth) in enumerate(OUTSIDE.items()):
        for repeat in range(2):
            found[f"outside-{name.replace(' ', '_')}-{repeat}"] = {"set": "outside", "truth": truth, "seed": 6000 + 10 * i + repeat}
    for i, pair in enumerate(PAIRS):
        found[f"pair-{'+'.join(pair)}"] = {"set": "pair", "truth": {k: sized(k, 1.0) for k in pair}, "seed": 7000 + i}
    for i in range(24):
        together = at_once(3 if i % 3 == 2 else 2, 9600 + i, family)
        found[f"together-{i:02d}-{'+'.join(together)}"] = {
            "set": {2: "drawn pair", 3: "drawn triple"}[len(together)], "truth": {k: sized(k, 1.0) for k in together}, "seed": 9600 + i,
            "air": ("table", "power")[i % 2],
        }  # fmt: skip
    for i, key in enumerate(("actuator_lag:rudder", "sideslip_drag", "airspeed_scale", "load_cell_lag")):
        truth = {key: sized(key, 1.0), "wind_offset": {"dN": 0.8, "dE": 0.5}}
        found[f"wrong-wind-{key}"] = {"set": "wrong wind too", "truth": truth, "seed": 8000 + i}
    for i, (name, (answer, truth, terms)) in enumerate(FORMS.items()):
        for repeat in range(2):
            found[f"form-{name.replace(' ', '_')}-{repeat}"] = {
                "set": "another form", "truth": truth, "terms": terms, "seed": 9000 + 10 * i + repeat, "answers": [answer],
            }  # fmt: skip
    for i, key in enumerate(("", "", "actuator_lag:rudder", "sideslip_drag", "airspeed_scale", "load_cell_lag")):
        truth = {key: sized(key, 1.0)} if key else {}
        found[f"bounds-{i}-{key or 'clean'}"] = {"set": "wrong bounds" + ("" if key else ", clean"), "truth": truth, "seed": 9500 + i}
    return {name: {**case, "seed": case["seed"] + 100_000 * family} for name, case in found.items()}


def run_case(name: str, case: dict) -> dict:
    """Fly, declare wrongly, trace, compare with the truth."""
    from awescli.estimation.as_declared import declared_checks
    from awescli.estimation.prediction import predict
    from awescli.flightlog.cycles import pieces
    from awescli.flightlog.loops import find_loops
    from awescli.flightlog.split import split
    from awescli.notation.errors import AwesError, BadInput
    from awescli.physics.declaration import read_kite
    from awescli.simulation.campaign_flights import dev_like
    from awescli.tracing.flight import trace_flight
    from awescli.tracing.frame import TracedFlight
    from awescli.tracing.summary import summary

    truth = read_kite(HERE.parent / "data" / "kites" / "development.yaml")
    begin, clock, made_by = time.process_time(), time.perf_counter(), commit()
    try:
        effects = _anchored(truth, case)
        put_in = case.get("put_in")
        flown = {key: values for key, values in effects.items() if key != put_in}
        how = {"air": case.get("air", "table"), "duration": case.get("duration", 150.0), "length": case.get("length", 1.0)}
        of = case.get("of", "loops")
        flight = dev_like(_with_terms(truth, case.get("terms", {})), case["seed"], flown, **how) if of == "loops" else pumping_like(
            case["seed"], flown
        )
        if put_in:
            log, kite = _put_in(put_in, effects.get(put_in, {}), flight.log, flight.declared)
            flight = replace(flight, log=log, declared=kite)
        declared = flight.declared.model_copy(update={"aerodynamics": truth.aerodynamics})
        if case["set"].endswith("from priors"):
            declared = guessed(declared, flight.flown.table(), case["seed"])
        if case["set"].startswith("wrong bounds"):
            declared = with_wrong_bounds(declared, truth, BOUNDED, case["seed"])
        if refused := [check.name for check in declared_checks(declared, flight.log) if check.stops]:
            raise BadInput(f"refused for {', '.join(refused)}")
        parts = split(pieces(flight.log, of), log=flight.log)
        others = [dev_like(truth, case["seed"] + n, effects, **how).log for n in range(1, case.get("flights", 1))]
        also = [TracedFlight(log, split(find_loops(log), log=log), declared, str(n)) for n, log in enumerate(others, 2)]
        finding = trace_flight(declared, flight.log, parts, also=also)
        before, after = (predict(model, flight.log, parts.test, 5.0) for model in (finding.before(), finding.after()))
        told = summary(finding, flight.log, 5.0, before, after)
        spent, lasted = time.process_time() - begin, time.perf_counter() - clock
        power = powers(finding, flight.log, parts, told)
    except AwesError as e:
        return {"case": name, **case, "commit": made_by, "verdict": "failed", "error": str(e)}
    return {
        "case": name, **case, "commit": made_by, "flown": effects, "verdict": told["verdict"],
        "cpu_s": round(spent, 2), "wall_s": round(lasted, 2),
        "effects": told["effects"], "probability": told["probability"], "chi2": told["chi2"], "gust": told["gust_m_s"],
        "before": told["error"].get("before", {}).get("mean"), "after": told["error"]["after"]["mean"],
        "floor": told["error"]["noise_floor"]["mean"], "power": power, "unexplained": told["unexplained"], "unnamed": told["unnamed"],
        "bounds": {"beside": beside(declared, truth), "told": sorted(told["outside_bounds"])},
        "top": [r["name"] for r in told["ranking"][:3]], "detectable": {k: v for k, v in told["detectable"].items() if k in effects},
    }  # fmt: skip


def _put_in(key: str, values: dict, log, kite) -> tuple:
    """(log, declared kite) with a gross error in the record."""
    if key in OFF:
        return OFF[key](log, kite)
    (value,) = values.values()
    return {**TETHERED, **FLOWN_BY_RUDDER}[key].inject(log, kite, value)


def beside(declared, truth) -> list[str]:
    """Parameters whose declared bounds do not hold what was flown."""
    flown = truth.parameters
    return sorted(p.name for p in declared.table().rows if p.name in flown and not p.lower <= flown[p.name].value <= p.upper)


def powers(finding, log, parts, told: dict) -> dict:
    """Mean power of the test loops, as shares of the measured one: error before and after, and the 90 % interval of the traced model."""
    from dataclasses import replace

    from awescli.estimation.known import Known
    from awescli.estimation.prediction_scores import scored
    from awescli.estimation.record_level import with_record_level
    from awescli.flightlog.loops import find_loops
    from awescli.stages.handed_on import traced_params

    loops, model, problem = find_loops(log).bounds, finding.after(), finding.model.problems[0]
    known = Known.fitted(traced_params(finding.model, told), model.kite)
    known = with_record_level(model, log, parts, 5.0, replace(known, processes=problem.processes, factors=problem.factors))
    found = {"before": scored(finding.before(), log, parts, loops, 5.0, ())[0]["power"]}
    found["after"] = scored(model, log, parts, loops, 5.0, (), told_by=(model, known))[0]["power"]
    measured = found["after"]["measured_mean_W"]
    return {which: p["error_share"] for which, p in found.items()} | {"interval": [w / measured - 1 for w in found["after"]["interval_W"]]}


def _with_terms(truth, terms: dict):
    """The kite with further aerodynamic terms, coefficient -> monomial -> (parameter, value), of which its user knows nothing."""
    from awescli.notation.parameters import Parameter

    table = {c: {**truth.aerodynamics.terms[c], **{m: name for m, (name, _) in new.items()}} for c, new in terms.items()}
    rows = [Parameter(name, value, "-", source="flown") for new in terms.values() for name, value in new.values()]
    aerodynamics = truth.aerodynamics.model_copy(update={"terms": {**truth.aerodynamics.terms, **table}})
    return truth.model_copy(update={"aerodynamics": aerodynamics}).with_parameters(truth.table().with_rows(rows))


def _anchored(truth, case: dict) -> dict:
    """The truth's effects; wind_shear's exponent counts from the declared one, which the seed draws."""
    effects = {k: dict(v) for k, v in case["truth"].items()}
    if "wind_shear" in effects and case.get("air") == "power":
        from awescli.simulation.campaign_flights import dev_like

        # the declared exponent depends on the seed only
        effects["wind_shear"]["a"] += dev_like(truth, case["seed"], {}, air="power", duration=12.0).declared.wind.exponent
    return effects


def seen(result: dict) -> bool:
    """Is the effect flown at least as large as what the tracer says this flight would have shown?"""
    from awescli.physics.effects import EFFECTS

    for key, least in result.get("detectable", {}).items():
        effect = EFFECTS[key.partition(":")[0]]
        null = {p.name: p.value for p in effect.parameters if p.name not in effect.shapes}
        strength = next(iter(null))
        if abs(result.get("flown", {})[key].get(strength, null[strength]) - null[strength]) >= least:
            return True
    return False


def truth_of(result: dict) -> Truth:
    """What was right for a flight; of several effects all. With wrong bounds and nothing else, something is missing that has no name,
    unless the answer tells these bounds: then nothing is."""
    effects = [key for key in result["truth"] if key != "turbulence"]
    gusty = "turbulence" in result["truth"]
    told = bool(result.get("bounds")) and result["bounds"]["told"] == result["bounds"]["beside"]
    if result["set"].endswith("clean") and (told or not result["set"].startswith("wrong bounds")):
        return Truth("clean", gusty=gusty)
    if result["set"].startswith("outside") or result["set"] == "wrong bounds, clean":
        return Truth("outside")
    return Truth("library", tuple(result.get("answers", (" + ".join(effects),))), gusty)


def scored(result: dict) -> str:
    """One of exact_scoring.OUTCOMES."""
    return outcome(truth_of(result), answer_of(result))


def claimed(results: Iterable[dict]) -> list[tuple[float, bool]]:
    """(probability that an answer gives itself, was it right?) of all that state one."""
    return [(stated(answer_of(r), r["probability"]), scored(r) in RIGHT) for r in results if r.get("probability")]


def inside(result: dict) -> list[bool]:
    """Of an effect that was named right and flown in the library's form: does each strength's 95 % interval hold the truth?"""
    values = {}
    for key, own in result.get("flown", {}).items() if "answers" not in result else ():
        values |= {(*key.partition(":")[::2], name): value for name, value in own.items()}
    return [
        abs(size["value"] - values[place]) <= 1.96 * size["std"]
        for e in result.get("effects", ())
        for name, size in e["parameters"].items()
        if (place := (e["name"], e["acts_on"] if (e["name"], e["acts_on"], name) in values else "", name)) in values
    ]


def table(results: list[dict], family: int) -> str:
    by_set: dict[str, list[dict]] = defaultdict(list)
    for r in results:
        by_set[r["set"]].append(r)
    commits = ", ".join(sorted({r.get("commit", "unknown") for r in results}))
    cpu, wall = (sorted(r[f"{which}_s"] for r in results if "cpu_s" in r) for which in ("cpu", "wall"))
    lines = [
        "# Tracing campaign", "",
        f"`python benchmarks/tracing_campaign.py --seeds {family}`, by commit {commits}: {len(results)} flights of the development kite,",
        "whole library, scored exactly;",
        f"a trace takes {wall[len(wall) // 2]:.0f} s (median; longest {wall[-1]:.0f} s), of processor time {cpu[len(cpu) // 2]:.0f} s "
        f"(longest {cpu[-1]:.0f} s).", "",
        f"| set | flights | {' | '.join(OUTCOMES)} | silent, and too small to be seen | sizes inside their 95 % interval | "
        "probability, mean | Brier | mean power off, before | after: median, 95 % of flights | inside its 90 % interval |",
        "|" + "---|" * (9 + len(OUTCOMES)),
    ]  # fmt: skip
    for name, group in by_set.items():
        counts, sizes = counted(map(scored, group)), [x for r in group for x in inside(r)]
        held = f"{sum(sizes)} of {len(sizes)}" if sizes else ""
        small = sum(scored(r) == "silent" and not seen(r) for r in group)
        pairs = claimed(group)
        sure = f"{sum(p for p, _ in pairs) / len(pairs):.2f} | {brier(pairs):.3f}" if pairs else " | "
        row = f"| {name} | {len(group)} | {' | '.join(str(n or '') for n in counts)} | {small or ''} | {held} | {sure} |"
        lines.append(row + _power(group))
    wrong = [r["bounds"] for r in results if r.get("bounds", {}).get("beside")]
    if wrong:
        exactly, others = sum(b["told"] == b["beside"] for b in wrong), sum(not set(b["told"]) <= set(b["beside"]) for b in wrong)
        lines += ["", f"Bounds beside the truth: told exactly on {exactly} of {len(wrong)} flights; others told on {others}."]
    beside_answers = [(f"{told['name']}:{told['acts_on']}", told["name"], r["truth"]) for r in results if (told := r.get("unnamed"))]
    if beside_answers:
        there = sum(key in truth or name in truth for key, name, truth in beside_answers)
        lines += ["", f"Told beside an answer, without a name: on {len(beside_answers)} flights; on {there} of them it is there."]
    lines += [
        "", *calibration_lines(claimed(results)), "## Every flight", "",
        "| flight | outcome | verdict | named | probability | chi2 before -> after | test error before -> after (floor) |",
        "|---|---|---|---|---|---|---|",
    ]  # fmt: skip
    lines += [_line(r) for r in sorted(results, key=lambda r: r["case"])]
    return "\n".join(lines) + "\n"


def _power(group: list[dict]) -> str:
    """The cells that say how far the mean power of test loops is off, before and after, and how often its interval holds it."""
    rows = [r["power"] for r in group if r.get("power")]
    if not rows:
        return " | | |"
    before, after = (np.abs([p[which] for p in rows]) * 100 for which in ("before", "after"))
    held = sum(low <= 0 <= high for low, high in (p["interval"] for p in rows))
    return f" {np.median(before):.2f} % | {np.median(after):.2f} %, {np.quantile(after, 0.95):.2f} % | {held} of {len(rows)} |"


def _line(r: dict) -> str:
    if r["verdict"] == "failed":
        return f"| {r['case']} | failed | failed: {r['error'].splitlines()[0]} | | | | |"
    named = ", ".join(" or ".join(":".join(name) for name in entry) for entry in answer_of(r).named)
    if r["unexplained"]:
        named += f"{r['unexplained']['expression'] or r['unexplained']['channel']}"
    if told := r.get("bounds", {}).get("told"):
        named += f"{'; ' if named else ''}bounds of {', '.join(told)}"
    sure = "".join(f"{p:.2f}" for p, _ in claimed([r]))
    chi2 = "{train_before:.3f} -> {train_after:.3f}".format(**r["chi2"]) if r["chi2"] else ""
    before = "" if r["before"] is None else f"{r['before']:.4f}"
    return (
        f"| {r['case']} | {scored(r)} | {r['verdict']} | {named} | {sure} | {chi2} | "
        f"{before} -> {r['after']:.4f} ({r['floor']:.4f}) |"
    )


def main(arguments=None) -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--only", default="", help="only cases whose set or name begins so")
    parser.add_argument("--seeds", type=int, default=1, metavar="FAMILY", help="family of seeds (0: for development)")
    add_options(parser)
    options = parser.parse_args(arguments)
    every, folder = cases(options.seeds), RESULTS / str(options.seeds)
    wanted = {n: c for n, c in every.items() if n.startswith(options.only) or c["set"].startswith(options.only)}
    failed = run_campaign(run_case, wanted, folder, options.jobs, options.scheduler, say)
    write_text(RESULTS.parent / "tracing.md", table(list(kept(folder, every).values()), options.seeds))
    return 3 if failed else 0


def say(name: str, result: dict) -> str:
    return f"{scored(result):12s} {name}: {result['verdict']} {[e['name'] for e in result.get('effects', ())]}"


if __name__ == "__main__":
    sys.exit(main())
