"""A whole run made small: the bundled flight cut to its first loops, with settings that leave no stage out and take a few seconds each.

For tests and campaigns that ask how awes behaves, not how well a flight is explained.
"""

from pathlib import Path

from awescli.artifacts import write_text

ROOT = Path(__file__).parent.parent
ROWS = 2200
"""44 s at 50 Hz: five loops."""

PLAN = """# all stages, each a few seconds
flight: flight
kite: kite.yaml
seed: 3
split: {train: 0.4, validation: 0.2, test: 0.4}
stages:
  fit-controller: {kind: linear, features: state, folds: 2, closed_loop_time: 5.0}
  identify: {horizon: 1.0, curriculum: [], outputs: [p_n, p_e, p_d, phi, theta, psi, V_a, tension]}
  trace-residual:
    horizon: 1.0
    curriculum: []
    rounds: 1
    candidates: ["actuator_lag:rudder", airspeed_scale]
    outputs: [p_n, p_e, p_d, phi, theta, psi, V_a, tension]
  # the budget [s] is far from what these rounds take: only then does the clock not decide the numbers
  train-hybrid: {hidden: [4], horizons: [0.5], warmup: 0.5, batch: 8, rounds: 1, patience: 1, budget: 100000.0}
  simulate: {surfaces: recorded, duration: 6.0}
  evaluate: {horizon: 1.0, horizons: [0.5], report: true}
"""


def make_small_run(folder: Path) -> Path:
    """Write flight, kite and plan into `folder`; returns the plan."""
    demo = ROOT / "data" / "km1_demo"
    lines = (demo / "kite.csv").read_text().splitlines(keepends=True)
    write_text(folder / "flight" / "kite.csv", lines[: ROWS + 1])
    write_text(folder / "flight" / "wind.csv", (demo / "wind.csv").read_text())
    write_text(folder / "kite.yaml", (ROOT / "data" / "kites" / "km1_initial.yaml").read_text())
    write_text(folder / "stages.yaml", PLAN)
    return folder / "stages.yaml"
