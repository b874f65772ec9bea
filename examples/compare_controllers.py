"""Classes of control law as a picture: python examples/compare_controllers.py [PICTURE.html] [FLIGHT KITE.yaml]

Fits a sparse Gaussian law, one by linear programmes alone, a small network and a linear law to the train and validation loops of a flight
(the bundled one, where none is named), prints a table, and draws what each commands on test loops, its error there, and how long each
flies the declared kite.
"""

import sys
from pathlib import Path

import numpy as np
from plotly.subplots import make_subplots

from awescli import fit_controller, read_flight, read_kite

DATA = Path(__file__).parent.parent / "data"
LAWS = {
    "gaussian": ("#1f6fb4", {"kind": "gaussian"}), "convex": ("#1b9e77", {"kind": "gaussian", "method": "convex"}),
    "network": ("#d95f02", {"kind": "network"}), "linear": ("#7a7a7a", {"kind": "linear"}),
}  # fmt: skip
SECONDS = 60.0


def main(picture: Path, flight: Path = DATA / "km1_demo", kite_file: Path = DATA / "kites" / "km1_identified.yaml") -> dict[str, float]:
    flown, kite = read_flight(flight), read_kite(kite_file)
    log = flown.log
    titles = (
        "rudder on unseen loops",
        "error of the laws, at the measured, noisy states",
        f"closed loop: flown of {SECONDS:g} s, by start",
    )
    figure = make_subplots(3, 1, subplot_titles=titles, vertical_spacing=0.09, row_heights=[0.42, 0.3, 0.28])
    print("kind       test NRMSE  noise alone  terms  closed loop")
    errors, shown = {}, None
    for kind, (colour, how) in LAWS.items():
        law = fit_controller(flown, kite, **how, surfaces=["rudder"], closed_loop_time=SECONDS)
        if shown is None:  # 20 s of the longest test stretch
            first, last = max(law.parts.test, key=lambda stretch: stretch[1] - stretch[0])
            shown = slice(first, min(last, first + int(20 / log.dt)))
            time, measured = log.time[shown], np.degrees(log["rudder"][shown])
            figure.add_scatter(x=time, y=measured, name="flown", line={"width": 5, "color": "lightgrey"}, row=1, col=1)
        errors[kind], noise, proof = law.errors["rudder"], law.metrics["noise_nrmse"]["test"]["rudder"], law.metrics["closed_loop"]
        commanded = np.degrees(law.commanded["rudder"][shown])
        style = {"legendgroup": kind, "line": {"color": colour, "width": 1.5}}
        figure.add_scatter(x=time, y=commanded, name=f"{kind}: NRMSE {errors[kind]:.4f}", row=1, col=1, **style)
        figure.add_scatter(x=time, y=commanded - measured, showlegend=False, row=2, col=1, **style)
        starts = [f"{s:.0f} s" for s in proof["starts_s"]]
        figure.add_bar(x=starts, y=proof["survival_s"], showlegend=False, legendgroup=kind, marker_color=colour, row=3, col=1)
        flew = f"{proof['outcome']}, {min(proof['survival_s']):.0f} s at least"
        print(f"{kind:9s} {errors[kind]:11.4f} {noise:12.4f} {law.metrics['nonzeros']:6d}  {flew}")
    for row, (x, y) in enumerate((("time [s]", "rudder [deg]"), ("time [s]", "error [deg]"), ("start in the flight", "flown [s]")), 1):
        figure.update_xaxes(title_text=x, row=row, col=1)
        figure.update_yaxes(title_text=y, row=row, col=1)
    figure.update_layout(height=1000, template="plotly_white", title=f"Identified control laws, flight {log.name}")
    figure.write_html(picture, include_plotlyjs=True)
    return errors


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else Path("controllers.html"), *map(Path, sys.argv[2:4]))
