"""Three classes of control law on the bundled flight, as a picture: python examples/compare_controllers.py [PICTURE.html]

Fits a sparse Gaussian law, a small network and a linear law to the first 70 % of the flight and draws what each commands on the last 30 %.
"""

import awescli  # noqa: F401, I001  (before numpy: one BLAS thread)
import sys
from pathlib import Path

import numpy as np
import plotly.graph_objects as go

from awescli.control.law import deflections_of_log
from awescli.estimation.controller_fit import ControllerConfig, fit_controller
from awescli.flightlog.loops import find_loops
from awescli.flightlog.read import read_flight
from awescli.flightlog.split import split


def main(picture: Path) -> dict[str, float]:
    log = read_flight(Path(__file__).parent.parent / "data" / "km1_demo")
    parts = split(find_loops(log))
    first, last = parts.test[0][0], parts.test[-1][1]
    time = log.time[first:last]
    figure = go.Figure(layout={"title": "rudder on unseen loops", "xaxis_title": "time [s]", "yaxis_title": "rudder [deg]"})
    figure.add_scatter(x=time, y=np.degrees(log["rudder"][first:last]), name="flown", line={"width": 4, "color": "lightgrey"})
    errors = {}
    for kind in ("gaussian", "network", "linear"):
        fitted = fit_controller(log, parts.train, parts.validation, ControllerConfig(kind=kind))
        errors[kind] = fitted.report["nrmse"]["test"]["rudder"]
        commanded = deflections_of_log(fitted.law, log)["rudder"][first:last]
        figure.add_scatter(x=time, y=np.degrees(commanded), name=f"{kind}: NRMSE {errors[kind]:.4f}")
        print(f"{kind:9s} test NRMSE {errors[kind]:.4f}, non-zeros {fitted.report['nonzeros']}")
    figure.write_html(picture, include_plotlyjs=True)
    return errors


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else Path("controllers.html"))
