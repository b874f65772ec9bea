"""Classes of control law as a picture: python examples/compare_controllers.py [PICTURE.html] [FLIGHT KITE.yaml]

Fits a sparse Gaussian law, one by linear programmes alone, a small network and a linear law to the first 70 % of the loops of a flight
(the bundled one, where none is named), prints a table, and draws what each commands on the last 30 %, its error there, and how long each
flies the declared kite.
"""

import awescli  # noqa: F401, I001  (before numpy: one BLAS thread)
import sys
from pathlib import Path

import numpy as np
from plotly.subplots import make_subplots

from awescli.control.law import deflections_of_log
from awescli.estimation.controller_fit import ControllerConfig, fit_controller
from awescli.flightlog.loops import find_loops
from awescli.flightlog.read import read_flight
from awescli.flightlog.split import split
from awescli.physics.declaration import read_kite
from awescli.simulation.survival import flies
from awescli.stages.controller_artifact import wind_direction

DATA = Path(__file__).parent.parent / "data"
COLOURS = {"gaussian": "#1f6fb4", "network": "#d95f02", "linear": "#7a7a7a", "convex": "#1b9e77"}
SECONDS = 60.0


def main(picture: Path, flight: Path = DATA / "km1_demo", kite_file: Path = DATA / "kites" / "km1_identified.yaml") -> dict[str, float]:
    log, kite = read_flight(flight), read_kite(kite_file)
    parts, direction = split(find_loops(log), log=log), wind_direction(log)
    known = (*parts.train, *parts.validation)
    config = ControllerConfig(surfaces=("rudder",), compare=True)
    fitted = fit_controller(
        log, parts.train, parts.validation, config, lambda law: flies(kite, law, log, direction, SECONDS, known)["share"]
    )

    titles = (
        "rudder on unseen loops",
        "error of the laws, at the measured, noisy states",
        f"closed loop: flown of {SECONDS:g} s, by start",
    )
    figure = make_subplots(3, 1, subplot_titles=titles, vertical_spacing=0.09, row_heights=[0.42, 0.3, 0.28])
    first, last = max(parts.test, key=lambda stretch: stretch[1] - stretch[0])
    last = min(last, first + int(20 / log.dt))
    time, flown = log.time[first:last], np.degrees(log["rudder"][first:last])
    figure.add_scatter(x=time, y=flown, name="flown", line={"width": 5, "color": "lightgrey"}, row=1, col=1)
    print("kind       test NRMSE  noise alone  terms  closed loop")
    errors = {}
    for kind, line in fitted.report["comparison"].items():
        proof = flies(kite, fitted.laws[kind], log, direction, SECONDS)
        errors[kind], noise = (line[key]["test"]["rudder"] for key in ("nrmse", "noise_nrmse"))
        commanded = np.degrees(deflections_of_log(fitted.laws[kind], log)["rudder"][first:last])
        style = {"legendgroup": kind, "line": {"color": COLOURS[kind], "width": 1.5}}
        figure.add_scatter(x=time, y=commanded, name=f"{kind}: NRMSE {errors[kind]:.4f}", row=1, col=1, **style)
        figure.add_scatter(x=time, y=commanded - flown, showlegend=False, row=2, col=1, **style)
        starts = [f"{s:.0f} s" for s in proof["starts_s"]]
        figure.add_bar(x=starts, y=proof["survival_s"], showlegend=False, legendgroup=kind, marker_color=COLOURS[kind], row=3, col=1)
        flown_s = f"{proof['outcome']}, {min(proof['survival_s']):.0f} s at least"
        print(f"{kind:9s} {errors[kind]:11.4f} {noise:12.4f} {line['nonzeros']:6d}  {flown_s}")
    for row, (x, y) in enumerate((("time [s]", "rudder [deg]"), ("time [s]", "error [deg]"), ("start in the flight", "flown [s]")), 1):
        figure.update_xaxes(title_text=x, row=row, col=1)
        figure.update_yaxes(title_text=y, row=row, col=1)
    figure.update_layout(height=1000, template="plotly_white", title=f"Identified control laws, flight {log.name}")
    figure.write_html(picture, include_plotlyjs=True)
    return errors


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else Path("controllers.html"), *map(Path, sys.argv[2:4]))
