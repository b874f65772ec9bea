"""Our row beside published ones on real flights: python benchmarks/leader_tables.py FOLDER --kite KITE.yaml [--horizon S] [--only GROUP]

FOLDER is what a user downloaded (leader_layouts.py says which two layouts are read); nothing of it is shipped here. Every group is fitted
to its fit part, chosen on its development part, and predicted from the published starts over the published windows, scored as published.
Rows of others are read from the download itself. Their aeroplane is benchmarks/sport_cub.yaml. `awes` is the identified kite;
`awes, linear` the ARX of `awes evaluate`.
"""

import argparse
import sys
import time
from pathlib import Path

import numpy as np
from leader_layouts import Group, Table, read_table
from leader_scores import SCORES

import awescli  # noqa: F401  (thread settings before numpy)
from awescli.estimation.linear_baseline import LinearBaseline, linear_baseline
from awescli.estimation.prediction import forecast, predict
from awescli.estimation.problem import build, simulator_of
from awescli.estimation.staged_fit import Flight, fit_flights, fit_output_error
from awescli.notation.errors import AwesError
from awescli.notation.quantities import STATES
from awescli.physics.declaration import KiteDeclaration, read_kite
from awescli.simulation.rollout import Simulator


def identified(kite: KiteDeclaration, group: Group, horizon: float) -> Simulator:
    """The kite identified as `awes identify` does: filter error, and output error where that predicts validation better."""
    simulator = simulator_of(kite, group.log)
    flights = [Flight(build(simulator, group.log, group.split, horizon, tuple(group.log.measured)), group.name)]
    found = []
    for fit in (fit_flights, fit_output_error):
        (fitted,) = fit(flights, [])[0].flights
        table = simulator.kite.parameters
        held = simulator.holding(table.with_values({n: fitted.parameters[n].value for n in table.free}))
        found.append((predict(held, group.log, group.split.validation, horizon).nrmse()["mean"], held))
    return min(found, key=lambda entry: entry[0])[1]


def states_ahead(model: Simulator | LinearBaseline, group: Group, first: np.ndarray, ahead: int) -> dict[str, np.ndarray]:
    """The 12 states predicted from the samples `first`, (K, ahead + 1) each."""
    if isinstance(model, LinearBaseline):
        y = model.forecast(first, ahead)
        return {n: y[..., model.signals.outputs.index(n)] for n in STATES}
    trajectories, skip = forecast(model, group.log, first, ahead, min(group.history, int(round(1.0 / group.log.dt))))
    return {n: trajectories[n][:, skip:] for n in STATES}


def our_rows(table: Table, kite: KiteDeclaration, horizon: float) -> dict[str, dict[str, float]]:
    """method -> seconds ahead -> score; a linear row where windows have a history, for without one it has nothing to go on."""
    measure, score = SCORES[table.score]
    squares: dict[tuple[str, str], list[np.ndarray]] = {}
    for group in table.groups:
        begin = time.perf_counter()
        models = {"awes": identified(kite, group, horizon)}
        if group.history:
            models["awes, linear"] = linear_baseline(group.log, group.split, models["awes"].kite, horizon)
        for name, model in models.items():
            for seconds, first in group.windows.items() if model is not None else ():
                ahead = int(round(float(seconds) / group.log.dt))
                rows = first[:, None] + np.arange(ahead + 1)[None]
                own = {n: group.log[n][rows] for n in STATES}
                squares.setdefault((name, seconds), []).append(measure(own, states_ahead(model, group, first, ahead)))
        print(f"{group.name}: {time.perf_counter() - begin:.0f} s", flush=True)
    found: dict[str, dict[str, float]] = {}
    for (name, seconds), of_groups in squares.items():
        found.setdefault(name, {})[seconds] = score(of_groups)
    return found


def printed(table: Table, ours: dict[str, dict[str, float]]) -> str:
    """Published rows and ours, best first at the shortest horizon that all have."""
    rows = table.published | ours
    horizons = sorted({h for at in ours.values() for h in at}, key=float)
    windows = {h: sum(len(g.windows.get(h, ())) for g in table.groups) for h in horizons}
    head = " | ".join(f"{h} s ({windows[h]} windows)" for h in horizons)
    lines = [f"## {table.name}", "", f"| method | {head} |", "|" + "---|" * (len(horizons) + 1)]
    for name in sorted(rows, key=lambda n: rows[n].get(horizons[0], np.inf)):
        shown = [f"{rows[name][h]:.3f}" if h in rows[name] else "-" for h in horizons]
        lines.append(f"| {f'**{name}**' if name in ours else name} | {' | '.join(shown)} |")
    return "\n".join(lines) + "\n"


def main(arguments=None) -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path, help="what was downloaded")
    parser.add_argument("--kite", type=Path, required=True, help="kite file of the aeroplane")
    parser.add_argument("--horizon", type=float, default=1.0, help="seconds of a fitted segment")
    parser.add_argument("--only", default="", help="groups whose name begins so")
    options = parser.parse_args(arguments)
    try:
        kite = read_kite(options.kite)
        for table in read_table(options.folder):
            groups = tuple(g for g in table.groups if g.name.startswith(options.only))
            if groups:
                chosen = Table(table.name, groups, table.score, table.published if len(groups) == len(table.groups) else {})
                print(printed(chosen, our_rows(chosen, kite, options.horizon)))
    except AwesError as e:
        print(e, file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
