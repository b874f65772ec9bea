"""What is the hybrid worth on flights it has never seen? python benchmarks/hybrid_campaign.py [--only SET] [--jobs N]

Every case is a flight of the development kite, flown by this project's simulator with noise and a wrong declaration (guesses 5-30 %
off): clean, or with an effect that no effect of the library can express. The parameters are identified, a network is trained with the
settings of `awes train-hybrid`, or with those of the thesis, and both models predict the test loops, 5 s ahead. The sets `development ...`
are those that settings were chosen on, with other seeds too; they share neither seeds nor effects with the sets that are reported.
Results go to benchmarks/results/hybrid/<case>.json as each case ends, so the run can be interrupted and resumed; the table is
benchmarks/results/hybrid.md.
"""

import argparse
import sys
import time
from collections.abc import Mapping
from pathlib import Path

import awescli  # noqa: F401  (thread settings before numpy)
from awescli.artifacts import write_text
from awescli.notation.parameters import Parameter
from awescli.notation.quantities import STATES
from awescli.notation.scalars import exp, maximum, sin, tanh
from awescli.physics.effects.base import Effect
from awescli.physics.instant import Load

sys.path.insert(0, str(Path(__file__).parent))
from campaign import add_options, kept, run_campaign  # noqa: E402

HERE = Path(__file__).parent
RESULTS = HERE / "results" / "hybrid"
HORIZON = 5.0
"""[s]"""

FORMS = {
    # settings were chosen on these
    "roll moment with heading": ("m_x", lambda at: sin(at.z.psi)),
    "pitch moment with alpha and airspeed": ("m_y", lambda at: at.alpha * at.V_a / 40.0),
    "drag with roll rate": ("f_x", lambda at: at.z.p),
    "saturated sideslip": ("f_y", lambda at: tanh(at.beta / 0.03)),
    # these are reported on
    "wing tip that stalls in sideslip": ("m_x", lambda at: tanh(at.beta / 0.05) * at.alpha / 0.1),
    "wake crossed low in the loop": ("f_z", lambda at: exp(-(((at.p_hat[2] + 0.5) / 0.05) * ((at.p_hat[2] + 0.5) / 0.05)))),
    "rudder that pitches": ("m_y", lambda at: (at.deflections["rudder"] / 0.2) * (at.deflections["rudder"] / 0.2)),
    "side force of a twisted fuselage": ("f_y", lambda at: at.z.q * at.R[2][1]),
    "yaw damping that gives way": ("m_z", lambda at: tanh(4.0 * at.z.r) * at.V_a / 40.0),
    "fabric that flaps at speed": ("f_x", lambda at: _ramp(at.V_a / 40.0 - 0.95)),
}  # fmt: skip
"""name -> (channel, form): a force or moment of k qbar S (b or c) form(instant), which no effect of the library and no single term of its
empirical bank can express, but for the development ones."""


def _ramp(a):
    """max(0, a)"""
    return maximum(a, 0.0 * a)


class Outside(Effect):
    """force or moment channel += k qbar S (b or c for moments) * form. The target is the name in FORMS."""

    name = "outside"
    doc = "an effect that the library lacks"
    parameters = (Parameter("k", 0.0, "-", -1.0, 1.0, source="benchmark"),)
    targets = tuple(FORMS)
    traceable = False

    def load(self, at, own):
        channel, form = FORMS[self.target]
        value = own.k * at.dynamic_pressure * at.values["S"] * form(at)
        if channel[0] == "m":
            value = value * at.values["c" if channel == "m_y" else "b"]
        vector, nothing = tuple(value if axis == channel[2] else 0.0 * value for axis in "xyz"), (0.0 * value,) * 3
        return Load(vector, nothing) if channel[0] == "f" else Load(nothing, vector)


SIZES = {
    "roll moment with heading": 0.004, "pitch moment with alpha and airspeed": 0.3, "drag with roll rate": -0.05,
    "saturated sideslip": 0.03,
    "wing tip that stalls in sideslip": 0.008, "wake crossed low in the loop": 0.15, "rudder that pitches": 0.06,
    "side force of a twisted fuselage": 0.1, "yaw damping that gives way": 0.009, "fabric that flaps at speed": -0.15,
}  # fmt: skip
"""Size k of each effect: the identified physics misses unseen loops by about three times the sensors' noise, or more. Nearer to the noise
floor not even a perfect model would lower the error by 40 %."""
DEVELOPMENT = tuple(FORMS)[:4]
AS_IN_THE_THESIS = {"hidden": (8, 8), "rate": 5e-4, "horizons": (5.0,), "rounds": 100}
"""The training of Rositani (2025): a small network, no curriculum, a slow Adam until the plateau."""
ASKED = {"lower": 0.40, "worst": 1.02, "clean": 0.02}
"""Issue: mean error at least 40 % lower, no state more than 2 % worse; clean flights change by less than 2 %."""


def cases() -> dict[str, dict]:
    """name -> {set, form or None, seed}; perhaps training: settings that differ."""
    found = {}
    for i, form in enumerate(FORMS):
        label = "development outside" if form in DEVELOPMENT else "outside"
        seed = (500 if form in DEVELOPMENT else 9100) + i
        found[f"{label.replace(' ', '-')}-{form.replace(' ', '_')}"] = {"set": label, "form": form, "seed": seed}
    for form in tuple(FORMS)[len(DEVELOPMENT) :]:
        name = form.replace(" ", "_")
        found[f"thesis-{name}"] = {**found[f"outside-{name}"], "set": "as in the thesis", "training": AS_IN_THE_THESIS}
    for label, first, count in (("development clean", 9500, 1), ("clean", 9600, 4)):
        for i in range(count):
            found[f"{label.replace(' ', '-')}-{i}"] = {"set": label, "form": None, "seed": first + i}
    return found


def run_case(name: str, case: Mapping) -> dict:
    """Fly, declare wrongly, identify, train, predict what nobody was shown."""
    from awescli.estimation.prediction import predict
    from awescli.estimation.problem import build, simulator_of, without_record
    from awescli.estimation.staged_fit import fit_in_stages
    from awescli.flightlog.loops import find_loops
    from awescli.flightlog.split import split
    from awescli.learning.correction import hybrid_from_artifact
    from awescli.learning.explain import distil
    from awescli.learning.training import TrainingConfig, train
    from awescli.physics.declaration import read_kite
    from awescli.physics.effects import EFFECTS
    from awescli.physics.kite import Kite
    from awescli.simulation.campaign_flights import dev_like
    from awescli.simulation.rollout import Simulator

    EFFECTS.setdefault(Outside.name, Outside)  # here: a worker does not run this file, and would get a copy of a table named above
    truth = read_kite(HERE.parent / "data" / "kites" / "development.yaml")
    effects = {f"{Outside.name}:{case['form']}": {"k": SIZES[case["form"]]}} if case["form"] else {}
    flight = dev_like(truth, case["seed"], effects)
    log, parts, began = flight.log, split(find_loops(flight.log), log=flight.log), time.time()
    simulator = simulator_of(flight.declared, log)
    fitted, _ = fit_in_stages(build(simulator, log, parts, HORIZON, tuple(log.measured)), (1.0, 2.5))
    declaration = simulator.holding(without_record(simulator.kite, fitted.parameters)).kite.declare(())
    kite, identified = Kite(declaration, log.wind.height), time.time()
    # no limit of time: a result must not depend on what else the machine does
    compare = case["set"] in ("outside", "as in the thesis")
    config = TrainingConfig(seed=case["seed"], budget=float("inf"), compare=compare, **case.get("training", {}))
    # and no clock on the wall: beside other work, equal seconds would not be equal effort
    trained = train(kite, log, parts.train, parts.validation, config, clock=time.process_time)
    learned = time.time()

    def errors(correction):
        arrays, description = correction.to_arrays(), correction.description()
        prediction = predict(hybrid_from_artifact(description, arrays, declaration, log), log, parts.test, HORIZON)
        return prediction.nrmse() | {"diverged": prediction.diverged}

    before = predict(Simulator(kite, ()), log, parts.test, HORIZON)
    return {
        **case, "physics": before.nrmse(), "floor": before.noise_floor(), "hybrid": errors(trained.correction),
        "rejected": None if not trained.correction.is_zero else errors(trained.correction.with_weights(trained.state.best)),
        "outcome": trained.outcome, "validation": trained.metrics["validation"], "chi2": fitted.chi2,
        "gradients": trained.state.evaluations, "outside_box": trained.metrics["outside_box_validation"],
        "parametric_share": trained.metrics["parametric_share"], "comparison": trained.metrics.get("comparison"),
        "compared": {name: errors(c) for name, c in (trained.compared or {}).items()},
        "distilled": [str(f) for f in distil(log, kite, trained.correction, parts.train, parts.validation)],
        "seconds": {"identify": identified - began, "train": learned - identified},
    }  # fmt: skip


def ratios(result: Mapping, which: str = "hybrid") -> dict[str, float]:
    """State -> test NRMSE of the hybrid over that of the identified physics; `mean`: of the means over the 12 states."""
    return {n: result[which][n] / result["physics"][n] for n in (*STATES, "mean")}


def good(result: Mapping) -> bool:
    """Does a flight meet what the issue asks?"""
    r = ratios(result)
    if result["form"] is None:
        return abs(r["mean"] - 1) < ASKED["clean"]
    return r["mean"] <= 1 - ASKED["lower"] and max(r[n] for n in STATES) <= ASKED["worst"]


def table(results: Mapping[str, Mapping]) -> str:
    """The report, reported sets first."""
    lines = ["# The hybrid on unseen loops", "", "`python benchmarks/hybrid_campaign.py`: development kite, flights of 150 s, "
             "predictions 5 s ahead of the test loops; NRMSE, mean over the 12 states.", ""]  # fmt: skip
    sets = {label: [r for r in results.values() if r["set"] == label] for label in dict.fromkeys(r["set"] for r in results.values())}
    for label in ("outside", "clean", "development outside", "development clean"):
        lines += _section(label, sets[label]) if label in sets else []
    compared = {title: sets[label] for label, title in COMPARED.items() if label in sets}
    return "\n".join(lines + (_optimisers(compared) if compared else [])) + "\n"


def _section(label: str, results: list[Mapping]) -> list[str]:
    met = sum(good(r) for r in results)
    asked = "changed by less than 2 %" if label.endswith("clean") else "mean at least 40 % lower, no state more than 2 % worse"
    lines = [f"## {label.capitalize()}: {met} of {len(results)} flights: {asked}", ""]
    if label.startswith("development"):
        lines += ["Settings were chosen on these flights; they prove nothing.", ""]
    lines += [
        "| effect | seed | physics | hybrid | noise floor | hybrid / physics | worst state | outcome |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for r in results:
        q = ratios(r)
        worst = max(STATES, key=q.get)
        lines.append(
            f"| {r['form'] or 'none'} | {r['seed']} | {r['physics']['mean']:.4f} | {r['hybrid']['mean']:.4f} | {r['floor']['mean']:.4f} | "
            f"**{q['mean']:.2f}** | {worst} {q[worst]:.2f} | {r['outcome'].replace('_', ' ')} |"
        )
    return [*lines, ""]


COMPARED = {
    "outside": "the settings of `awes train-hybrid`", "as in the thesis": "8-8 network, Adam at 5e-4 without curriculum, as the thesis",
}  # fmt: skip
"""Sets in which Adam also went on alone: which training it was."""


def _optimisers(trainings: Mapping[str, list[Mapping]]) -> list[str]:
    """Rositani (2025), figure 3, over the reported flights."""
    import numpy as np

    labels = {"adam_lbfgs": "Adam, then L-BFGS", "adam": "Adam alone, equal gradients", "adam_equal_time": "Adam alone, equal time"}
    channels = ("p_n", "p_e", "p_d", "mean")
    lines = [
        "## Adam alone, and Adam followed by L-BFGS (Rositani (2025), figure 3)", "",
        "From the same weights, where Adam had come to its plateau and L-BFGS took over; each keeps its lowest validation error, looked at "
        "after every step. Test NRMSE over that of Adam and L-BFGS, geometric mean over the flights of `outside`; in brackets on how many "
        "of them Adam and L-BFGS were better : worse (on the others neither found anything after the switch that validation preferred). "
        "Training, validation: squared error, relative to physics alone, in the end and where it was lowest. Time is that of the "
        "processor.", "",
        f"| | {' | '.join(channels)} | training | validation | gradients |", f"|{8 * '---|'}",
    ]  # fmt: skip
    for title, results in trainings.items():
        lines.append(f"| *{title}; {len(results)} flights* |{7 * ' |'}")
        for name, words in labels.items():
            cells = []
            for c in channels:
                q = np.array([r["compared"][name][c] / r["compared"]["adam_lbfgs"][c] for r in results])
                cells.append(f"{np.exp(np.log(q).mean()):.3f}" + (f" ({(q > 1).sum()} : {(q < 1).sum()})" if name != "adam_lbfgs" else ""))
            for part in ("training", "validation"):
                cells.append(f"{np.exp(np.mean([np.log(r['comparison'][part][name]) for r in results])):.4f}")
            both = [r["comparison"] for r in results]
            spent = np.mean([c["gradients"] if name == "adam_lbfgs" else c["spent"][name]["gradients"] for c in both])
            lines.append(f"| {words} | {' | '.join(cells)} | {spent:.0f} |")
    return lines


def say(name: str, result: Mapping) -> str:
    r = ratios(result)
    return f"{'good' if good(result) else 'MISSED'} {name}: {result['outcome']}, {r['mean']:.3f}, worst {max(r[n] for n in STATES):.3f}"


def main(arguments=None) -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--only", default="", help="only cases whose set or name begins so")
    add_options(parser)
    options = parser.parse_args(arguments)
    every = {n: c for n, c in cases().items() if n.startswith(options.only) or c["set"].startswith(options.only)}
    failed = run_campaign(run_case, every, RESULTS, options.jobs, options.scheduler, say)
    write_text(RESULTS.parent / "hybrid.md", table(kept(RESULTS, cases())))
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
