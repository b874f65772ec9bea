"""Every stage ends in at most six lines of 80 columns that hold the answer, and one more where data checks are not good."""

import json
import re
import shutil

import pytest
from typer.testing import CliRunner

from awescli.artifacts import read_json
from awescli.cli import build_app
from awescli.stages import STAGES
from awescli.stages.answers import lines_of, number, sized
from awescli.stages.trace_residual import SAYS, answer_lines, detectable
from awescli.tracing.verdict import OBJECTIONS

APP = build_app(STAGES)


@pytest.fixture(scope="module")
def run(small_run, tmp_path_factory):
    """A small run of all stages in its own folder, as a user types it: (folder, what `awes run` printed)."""
    folder = shutil.copytree(small_run, tmp_path_factory.mktemp("answers") / "run")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        patch.setenv("COLUMNS", "80")
        yield folder, (folder / "printed.txt").read_text()


def ending(stdout: str, stage: str) -> list[str]:
    """The lines of a stage's answer: the last one that begins with its name, and what is indented below."""
    lines = stdout.splitlines()
    at = max(i for i, line in enumerate(lines) if line.startswith(f"{stage}: ") and "runs (" not in line)
    end = next((i for i in range(at + 1, len(lines)) if not lines[i].startswith("  ")), len(lines))
    return lines[at:end]


@pytest.mark.slow
@pytest.mark.parametrize("stage", [s.name for s in STAGES])
def test_a_stage_ends_in_six_lines_of_80_columns(run, stage):
    lines = ending(run[1], stage)
    assert lines[-1].startswith("  data, not good: usable loops"), lines  # the flight was cut to five
    assert len(lines) <= 7 and max(map(len, lines)) <= 80, lines
    alone = CliRunner().invoke(APP, [stage], env={"COLUMNS": "80"})
    assert alone.stdout.splitlines()[-len(lines) :] == lines  # skipped, the answer still ends it


@pytest.mark.slow
def test_the_answers_are_those_of_the_artifacts(run):
    """Effect with size and interval, error before -> after -> noise, where the report is; every scored channel in the table."""
    folder, stdout = run
    effects, scores = (read_json(folder / "out" / f) for f in ("trace-residual/effects.json", "evaluate/metrics.json"))
    traced = " ".join(" ".join(ending(stdout, "trace-residual")).split())
    tau = effects["effects"][0]["parameters"]["tau"]
    assert f"found: actuator_lag on rudder, tau {sized(tau)}" in traced
    error = [number(effects["error"][k]["mean"]) for k in ("before", "after", "noise_floor")]
    assert f"{error[0]} -> {error[1]} (noise alone {error[2]})" in traced and "report: awes evaluate --report" in traced
    evaluated = " ".join(" ".join(ending(stdout, "evaluate")).split())
    assert f"with_effects {number(scores['with_effects']['nrmse']['test']['mean'])}" in evaluated
    assert "report: out/evaluate/report.html" in evaluated and (folder / "out" / "evaluate" / "report.html").is_file()
    # one model has one error, whoever tells it
    shown = [scores[m]["nrmse"]["test"]["mean"] for m in ("identified", "with_effects")]
    metrics = [read_json(folder / "out" / stage / "metrics.json") for stage in ("identify", "trace-residual")]
    assert shown == pytest.approx([m["nrmse"]["test"]["mean"] for m in metrics], rel=1e-6)
    assert shown[1] == pytest.approx(effects["error"]["after"]["mean"], rel=1e-6)
    assert effects["error"]["before"]["mean"] < 1.25 * shown[0]
    table = stdout[stdout.index("evaluate: errors") :].splitlines()
    assert [line.split()[0] for line in table[2:17]] == [n for n in scores["initial"]["nrmse"]["test"] if n != "rudder"]
    assert {"p", "q", "r", "V_a", "tension"} <= {line.split()[0] for line in table[2:17]}
    assert max(map(len, table)) <= 80


@pytest.mark.slow
def test_tracing_leaves_params_and_says_where_fitted_values_come_from(run):
    """params.json in identify's form, effects included, with intervals; sources of fitted values name flight and prior, others stay."""
    folder, _ = run
    identified, traced = (read_json(folder / "out" / stage / "params.json") for stage in ("identify", "trace-residual"))
    effects = read_json(folder / "out" / "trace-residual" / "effects.json")
    assert set(traced) == set(identified)
    rows, before = traced["parameters"], identified["parameters"]
    assert set(before) < set(rows) and set(next(iter(rows.values()))) == set(next(iter(before.values())))
    for name, size in effects["effects"][0]["parameters"].items():
        row = rows[f"actuator_lag:rudder.{name}"]
        assert (row["value"], row["std"]) == (size["value"], size["std"])
    for row in rows.values():
        low, high = row["interval"]
        assert high - row["value"] == pytest.approx(1.96 * row["std"], rel=1e-3) and low + high == pytest.approx(2 * row["value"])
    from awescli.physics.declaration import read_kite

    declared = read_kite(folder / "kite.yaml").parameters
    for stage, params in (("identify", identified), ("trace-residual", traced)):
        kite = read_kite(folder / "out" / stage / "kite.yaml").parameters
        for name, row in kite.items():
            if name in params["parameters"]:
                std, old = params["parameters"][name]["std"], declared[name].source if name in declared else ""
                assert re.fullmatch(rf"identified by awes from flight \(std {std:.3g}[^)]*\), prior: .+", row.source), (name, row.source)
                assert row.source.endswith(old)
            elif name in declared:
                assert row.source == declared[name].source, name
            else:  # of an accepted effect, and not fitted
                assert not row.source.startswith("identified"), name


EFFECT = {"name": "surface_effectiveness", "acts_on": "elevator", "rivals": [], "parameters": {}}
SIZES = {n: {"value": -123.456, "std": 0.01234, "unit": "N s/m"} for n in ("threshold", "inertia", "lateral")}

BESIDE = (
    "Beside it surface_effectiveness:elevator (less of a surface, beyond a threshold) would gain 3.2 % of what actuator_lag:rudder gains; "
    "it may be there, or make up for the form of that, and is not named"
)
REASON = f"surface_effectiveness:elevator comes nearest, but {' and '.join(OBJECTIONS.values())}."


@pytest.mark.parametrize("verdict", SAYS)
@pytest.mark.parametrize("count", [0, 1, 3])
@pytest.mark.parametrize("seen", [0, 1, 4])
@pytest.mark.parametrize("outside", [0, 1, 12])
@pytest.mark.parametrize("beside", [False, True])
def test_answers_of_tracing_stay_short_whatever_was_found(verdict, count, seen, outside, beside):
    rivals = [{"name": "surface_effectiveness", "acts_on": "elevator"}] * 4
    entry = EFFECT | {"parameters": SIZES, "rivals": rivals if verdict == "cannot_tell" else []}
    error = {"horizon_s": 5.0, **{k: {"mean": 0.0123456} for k in ("before", "after", "noise_floor")}}
    unexplained = {"expression": "; ".join(f"m_y += qbar*S*(+0.0{i}234*alpha*V_a)" for i in range(6))} if verdict == "unexplained" else None
    outside = outside if verdict in ("found", "none") else 0  # no others need a trace without bounds
    blamed = seen if verdict == "unexplained" and count == 0 else 0  # only where an answer is far off are instruments asked
    bounds = {f"Cmde_{i}": {"sentence": f"The kite file's bounds of Cmde_{i} do not hold what the flight says."} for i in range(outside)}
    effects = {
        "verdict": verdict,
        "reason": REASON if verdict == "unexplained" else None,
        "effects": [entry] * count,
        "error": error,
        "left": {"chi2": 1.234, "share": 0.5},
        "unexplained": unexplained,
        "kinematics": [{"sentence": "position late by 0.2603 s +- 0.0004"}] * seen,
        "instruments": [{"sentence": "heading_bias, b = 0.05 rad", "found": True}] * blamed,
        "outside_bounds": bounds,
        "unnamed": {"sentence": BESIDE} if beside and count else None,
    }
    lines = lines_of("trace-residual", answer_lines(effects, "out/trace-residual/kite.yaml"))
    assert max(map(len, lines)) <= 80 and len(lines) <= 6, lines
    assert "0.0123 -> 0.0123 (noise alone 0.0123)" in " ".join(lines) and verdict in lines[0] and "kite.yaml" in lines[-1]
    assert ("kinematics alone: position late by 0.2603 s" in " ".join(lines)) == (seen > 0)
    assert ("beside gusts and model error: heading_bias" in " ".join(lines)) == (blamed > 0)
    assert ("Cmde_0" in " ".join(lines)) == (outside > 0)
    if count == 1 and verdict == "found" and seen + outside < 2:
        assert "threshold -123.456 N s/m [" in " ".join(" ".join(lines).split())  # a size before a long sentence
    if count:
        assert "surface_effectiveness on elevator" in " ".join(" ".join(lines).split())


def test_sizes_that_would_have_been_seen_have_units():
    sizes, units = {"wind_offset": 0.5}, {"wind_offset": {"parameter": "dN", "unit": "m/s"}}
    row = {"size": 0.5, "parameter": "dN", "unit": "m/s"}
    effects = {"verdict": "none", "detectable": sizes, "detectable_units": units}
    assert detectable(effects) == {"would have been seen from": {"wind_offset": row}}
    assert detectable({**effects, "verdict": "found"}) == {}


def test_numbers_are_written_as_people_write_them():
    assert [number(x) for x in (0.0153, 41.24, 1.2e-5, 0.0, None, 1234567.0)] == ["0.0153", "41.2", "1.20e-05", "0", "-", "1234567"]
    assert sized({"value": 0.2012, "std": 0.003, "unit": "s"}) == "0.2012 s [0.1953, 0.2071]"
    json.dumps(sized({"value": 5.0, "std": 0.0, "unit": "-"}))
