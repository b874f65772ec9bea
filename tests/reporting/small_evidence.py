"""A small made-up flight with all its artifacts, in milliseconds: what a page is made of."""

import numpy as np

from awescli.flightlog.log import FlightLog, WindRecord
from awescli.flightlog.loops import Loops
from awescli.flightlog.quality import data_quality
from awescli.flightlog.split import PARTS, split
from awescli.notation.quantities import MEASURED, STATES
from awescli.reporting.evidence import Action, Evidence

DT, LOOP, COUNT = 0.1, 80, 10
SCORED = (*STATES, "V_a", "tension")


def flight(name: str = "small", samples: int = LOOP * COUNT, wind: bool = True) -> FlightLog:
    """Circles at 100 m height, 150 m south-west of the winch."""
    t = np.arange(samples) * DT
    a = 2 * np.pi * t / (LOOP * DT)
    signals = {n: 0.1 * np.sin(a + i) for i, n in enumerate(MEASURED)}
    signals |= {"p_n": -150 + 30 * np.cos(a), "p_e": -60 + 30 * np.sin(a), "p_d": -100 + 20 * np.sin(a), "V_a": 30 + np.sin(a)}
    signals |= {"v_n": -23 * np.sin(a), "v_e": 23 * np.cos(a), "v_d": 15 * np.cos(a), "tension": 3000 + 900 * np.sin(a)}
    inputs = {"rudder": 0.2 * np.sin(a), "tether_length": 190 + 0.1 * t, "reel_out_speed": np.full(samples, 0.1)}
    one = np.ones((2, 1))
    record = WindRecord(np.array([0.0, t[-1]]), np.array([10.0]), 7 * one, one, 0 * one) if wind else None
    return FlightLog(name, 0.0, DT, t, signals, inputs, np.ones(samples, bool), wind=record)


def ahead(horizon: float, error: float) -> dict:
    """What evaluate says of one horizon."""
    errors = {n: error for n in (*SCORED, "mean")}
    return {"horizon_s": horizon, "predictions": 9, "diverged_predictions": 0, "nrmse": errors, "rmse": dict(errors)}


def power(share: float) -> dict:
    """What evaluate says of a model's mechanical power."""
    loops = [(8 + i, 2000.0 + 100 * i) for i in range(3)]
    rows = [{"loop": n, "seconds": 7.5, "of_seconds": 8.0, "measured_J": E, "predicted_J": E * (1 + share)} for n, E in loops]
    return {
        "mean_W": 280 * (1 + share), "measured_mean_W": 280.0, "error_share": share, "interval_share": [share - 0.01, share + 0.01],
        "seconds": 22.5, "loop_seconds": 24.0, "loops": 3, "by_loop": rows,
        "energy_per_loop_J": {"nrmse": abs(share), "relative_rmse": abs(share), "loops": 3},
        "interval_W": [270 * (1 + share), 290 * (1 + share)], "interval_level": 0.9,
        "std_W": {"parameters": 4.0, "wind": 3.0, "loops": 2.0},
        "by_phase": [told(share, phase="traction"), told(share, phase="retraction")],
        "by_cycle": [told(share, cycle=1, from_s=0.0, to_s=40.0, unseen_share=0.25)],
    }  # fmt: skip


def bands(model: str) -> dict:
    """What evaluate says of a model's bands."""
    if model == "hybrid":
        return {"outcome": "none: nothing says how well a network is known"}
    inside = {n: 0.91 for n in (*SCORED, "all")}
    width = {n: 0.5 for n in SCORED}
    return {"level": 0.9, "outcome": "computed", "predictions": 9, "inside": inside, "half_width": width, "std": {"noise": width}}


def told(share: float, **place) -> dict:
    """What evaluate says of the power of a part of the flight."""
    means = {"measured_mean_W": 280.0, "mean_W": 280 * (1 + share), "interval_W": [270 * (1 + share), 290 * (1 + share)]}
    return {**place, "seconds": 30.0, "of_seconds": 40.0, "measured_J": 8400.0, "predicted_J": 8400.0 * (1 + share), **means}


def evidence(name: str = "small", evil: str = "", samples: int = LOOP * COUNT, horizon: int = 50, hybrid: bool = True) -> Evidence:
    """Everything there can be. evil: put into every name that comes from users' files."""
    log = flight(name, samples)
    edges = np.arange(0, samples + 1, LOOP)
    loops = Loops("loops", np.stack([edges[:-1], edges[1:]], axis=1), f"{len(edges) - 1} loops of 8 s")
    parts = split(loops)
    models = ("initial", "identified", "with_effects", *(("hybrid",) if hybrid else ()))
    first = np.concatenate([np.arange(a, b - horizon, horizon) for a, b in parts.test])
    rows = first[:, None] + np.arange(horizon + 1)[None]
    predictions = {"first": first, "time": np.arange(horizon + 1) * DT}
    rng = np.random.default_rng(0)
    scores = {"horizon_s": 5.0, "noise_floor": {n: 0.003 for n in (*SCORED, "mean")}}
    for k, model in enumerate(models):
        errors = {n: 0.1 / 3**k for n in (*SCORED, "mean")}
        scores[model] = {
            "horizon_s": 5.0, "nrmse": {p: dict(errors) for p in ("train", "validation", "test")}, "outcome": "scored",
            "diverged_predictions": {"train": 0, "validation": 0, "test": 0}, 
            "by_horizon": {h: ahead(float(h), e / 3**k) for h, e in (("1", 0.05), ("5", 0.1))}, "one_step": ahead(DT, 0.004 / 3**k),
            "predictions": {p: 9 for p in PARTS}, "divergence_rate": {p: 0.0 for p in PARTS},
            "by_loop": [
                {"loop": i + 1, "part": PARTS[i % 3], "from_s": 8.0 * i, "to_s": 8.0 * i + 8, "nrmse": errors} for i in range(COUNT)
            ],
            "power": power(-0.1 / 3**k),
            "bands": bands(model), "rmse": {n: 1.0 for n in SCORED}, "r2": {n: 0.9 for n in SCORED}, "theil": {n: 0.1 for n in SCORED},
        }  # fmt: skip
        for n in SCORED:
            predictions[f"measured_{n}"] = log[n][rows]
            predictions[f"{model}_{n}"] = log[n][rows] + rng.standard_normal(rows.shape) * 0.3 / 3**k
            if model != "hybrid":
                predictions[f"low_{model}_{n}"], predictions[f"high_{model}_{n}"] = (predictions[f"{model}_{n}"] + h for h in (-0.5, 0.5))
    # a linear model as good as the identified one, but for a hair
    scores["linear"] = {k: v for k, v in scores["identified"].items() if k != "power"}
    scores["linear"]["nrmse"] = {p: {n: 0.99 * e for n, e in at.items()} for p, at in scores["identified"]["nrmse"].items()}
    scores["baseline"] = {
        "outcome": "fitted", "order": 2, "step_s": 0.1,
        "not_beaten": {m: {"initial": ["1", "5"], "identified": ["1", "5"]}.get(m, []) for m in models},
    }  # fmt: skip
    predictions |= {f"linear_{n}": predictions[f"identified_{n}"] for n in SCORED}
    row = {
        "value": 1.1, "std": 0.05, "unit": "-", "prior": 1.0, "prior_std": 0.2,
        "shift_in_prior_std": 0.5, "excited": True, "at_bound": True, "determined": "well",
        "partners": [f"Cb{evil}"], "advice": f"at its bound{evil}",
    }  # fmt: skip
    residuals = {"time": predictions["time"], "test_first": first}
    for n in SCORED:
        residuals[f"test_before_{n}"] = predictions[f"identified_{n}"] - predictions[f"measured_{n}"]
        residuals[f"test_after_{n}"] = predictions[f"with_effects_{n}"] - predictions[f"measured_{n}"]
    frequency = np.linspace(0, 1, 17)
    for which, height in (("before", 9.0), ("after", 1.0)):
        residuals[f"study_{which}_frequency"] = frequency
        residuals |= {f"study_{which}_spectrum_{n}": 1 + (height - 1) * np.exp(-4 * frequency) for n in SCORED}
    error = {n: 0.03 for n in (*SCORED, "mean")}
    late = np.sin(np.outer(np.ones(len(first)), residuals["time"]) - 0.2)
    action = Action(
        f"actuator_lag:rudder{evil}", f"rudder{evil}", "rad", "set-point", "deflection, inferred",
        (first[:, None] + np.arange(horizon + 1)[None]) * DT, np.sin(np.outer(np.ones(len(first)), residuals["time"])), late,
    )  # fmt: skip
    effects = {
        "verdict": "found", "sentence": f"An effect explains it.{evil}", "unexplained": None, "gust_m_s": 0.4,
        "not_testable": ["air_density"],
        "unnamed": {"name": "heading_bias", "acts_on": "report", "gain": 60.0, "sentence": f"Beside it heading_bias would gain{evil}"},
        "effects": [{
            "name": f"actuator_lag{evil}", "acts_on": "rudder", "doc": f"a lag{evil}",
            "rivals": [{"name": f"rival{evil}", "acts_on": "rudder"}],
            "parameters": {"tau": {"value": 0.21, "std": 0.01, "unit": "s"}},
        }],
        "ranking": [
            {"name": f"actuator_lag{evil}", "acts_on": "rudder", "score": 41.2, "p_value": 1e-6, "explained_share": 0.82,
             "plausible_size": True,
             "test_gain": 0.55, "outcome": "converged"},
            {"name": "wind_shear", "acts_on": "", "score": 1.2, "p_value": 0.5, "explained_share": 0.01, "plausible_size": True,
             "test_gain": 0.0, "outcome": "not raced"},
        ],
        "error": {"horizon_s": 5.0, "before": error, "after": error, "noise_floor": error, "split": "test",
                  "diverged_before": 0, "diverged_after": 1},
        "criteria": [
            {"name": "significant", "value": 41.2, "threshold": 10.0, "pass": True, "says": f"it is seen{evil}", "source": f"K&R{evil}"},
            {"name": "repeats", "value": f"0.2{evil}", "threshold": "-", "pass": None, "says": "it repeats", "source": "permutation"},
        ],
        "probability": {f"actuator_lag:rudder{evil}": 0.9, "something_else": 0.1},
        "chi2": {"train_before": 2.0, "train_after": 1.0}, "detectable": {"wind_shear": 0.001}, "separate": [f"fly otherwise{evil}"],
        "left": {"chi2": 1.0, "channels": {n: 1.02 for n in ("p_n", "phi")}},
        "residual": {which: {"loop_averaged_share": {"p_n": share, "phi": share}} for which, share in (("before", 0.7), ("after", 0.02))},
        "parameter_shifts": {f"Ca{evil}": {"prior": 1, "before": 2, "after": 1.1, "before_in_prior_std": 2.0, "after_in_prior_std": 0.1}},
        "roll_gusts": {
            "std_rad_s": 0.14, "worth": 45.0, "lasts_s": 0.3, "split": "test", "chi2": {"before": 49.0, "after": 18.0},
            "channels": {n: {"before": 200.0, "after": 4.0} for n in ("p", "phi")},
            "parameter_shifts": {f"Clp{evil}": {"prior": 1, "before": 2, "after": 1, "before_in_prior_std": 2, "after_in_prior_std": 0}},
        },
    }  # fmt: skip
    fit = {p: {"rudder": 0.01} for p in ("train", "validation", "test")}
    trained = {
        "outcome": "trained", "sentence": f"better{evil}", "validation_rmse_ratio": {"u": 0.5},
        "share_of_acceleration": {"u": 0.1}, "distilled": [f"du/dt += u{evil}"], "outside_box_test": 0.01,
        "comparison": {"test": {"adam": error, "adam_equal_time": error, "adam_lbfgs": error}},
        "validation": {"prediction": {"physics": 1.0, "hybrid": 0.5}},
        "ensemble": {"members": 3, "learned": 2, "spread": {"p_n": 0.1, "phi": 0.01}},
        "history": {"columns": ["train", "validation_last_horizon", "evaluations"],
                    "rows": [[1.0, 1.0, 10], [0.5, 0.6, 20], [0.4, 0.5, 5]]},
    }  # fmt: skip
    identify = {
        "outcome": "converged", "method": "filter error", "outputs": ["alpha"], "chi2": 1.1,
        "surfaces": "recorded", "horizon_s": 5.0, "noise_factors": {"alpha": 1.2},
        "nrmse": {part: {"mean": 0.01} for part in ("train", "validation", "test")},
        "processes": {f"gusts{evil}": {"level": 0.3, "unit": f"m/s{evil}", "memory_s": 5.0, "process": "gusts"}},
    }  # fmt: skip
    network = {"format": "awes correction 1", "inputs": [f"u{evil}"], "hidden": [8, 8], "width": 0.3, "fingerprint": "ab" * 32}
    flown = {
        "outcome": "flew_on", "survived_s": 30.0, "asked_s": 30.0, "start_s": 56.0, "unseen_s": 8.0, "model": models[-1],
        "surfaces": "controller",
        "effects": {f"actuator_lag:rudder{evil}": {"tau": 0.2}}, "wind": {"speed": 8.0, "direction": None, "height": 10.0, "shear": 0.14},
        "nrmse": {"5": {n: 0.02 for n in (*SCORED, "mean")}}, "path_error_m": {"5": 1.5},
    }  # fmt: skip
    start, reach = int(56 / DT), min(samples - int(56 / DT), 240)
    trajectory = {"time": 56 + np.arange(300) * DT}
    for n in SCORED:
        trajectory[f"measured_{n}"] = log[n][start : start + reach]
        trajectory[f"simulated_{n}"] = np.resize(log[n][start : start + reach], 300) + 0.1
    added = 0.1 * np.sin(np.arange(6) + log.time[:, None])
    correction = {"time": log.time, "correction": added, "physics": np.ones_like(added), "fade": np.ones(samples)}
    return Evidence(
        log=log, loops=loops, phases=np.full(samples, "traction"), quality=data_quality(log), parts=parts,
        scores=scores, predictions=predictions,
        controller={
            "kind": f"gaussian{evil}", "nonzeros": 3, "surfaces": ["rudder"], "nrmse": fit, "noise_nrmse": fit,
            "features": {"chosen": [f"p{evil}"], "how": f"chosen{evil}", "reasons": {}},
            "closed_loop": {"outcome": "departs", "asked_s": 60.0, "survival_s": [10.0, 60.0],
                            "starts_s": [0.0, 20.0], "path_error_5s_m": 2.0},
        },
        commanded={"rudder": log["rudder"] + 0.001}, identify=identify,
        params={"parameters": {f"Ca{evil}": row}},
        traced_params={
            "parameters": {f"lag{evil}.tau": row, f"Ca{evil}": row, "Cb": row},
            "correlation": {"names": [f"lag{evil}.tau", f"Ca{evil}", "record.speed_0", "Cb"],
                            "matrix": [[1, 0.97, 0, 0.1], [0.97, 1, 0, -0.7], [0, 0, 1, 0], [0.1, -0.7, 0, 1]]},
        },
        effects=effects, residuals=residuals, actions=(action,),
        hybrid=trained if hybrid else None, network=network if hybrid else None,
        correction=correction if hybrid else None, flown=flown, trajectory=trajectory,
        provenance={"identify": {
            "timing": {"started": "2026-01-01", "duration_s": 2.0},
            "stamp": {"inputs": {"flight": "ab" * 32}, "seed": 0, "settings": {"horizon": f"5{evil}"}, "code": "cd" * 32},
        }}, versions={"awes": "0", "numpy": "2"},
    )  # fmt: skip
