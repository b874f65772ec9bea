"""What does a controller that feels the kite better than its log make of a rudder's time constant?

    python benchmarks/felt_by_controllers.py CACHE [--family F] [--kind K]

A flight of a KM1-like kite by JSBSim in gusts, with nothing missing, flown twice: by a law that sees the kite as it is, and by the same law
that sees what the sensors of the log say, their noise included; and by the law that sees the kite in our own simulator, whose gusts and
roll gusts are of the form that the model has. To each the lag of a rudder is fitted that has none. A record of the rudder counts as given:
what it says of gusts, because the law answered them, is not in the likelihood. Where it says more than the log's own gyros, estimates of
what acts between rudder and kite are biased (feedback: Ljung, System Identification, 1999, ch. 13). The last column is
what the lag gains of the same flight, flown again in other gusts by the model without it (`tracing/bootstrap.py`). The table goes to
benchmarks/results/felt_by_controllers.md.
"""

import argparse
import sys
from collections.abc import Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path
from types import SimpleNamespace
from unittest.mock import patch

import awescli  # noqa: F401  (thread settings before numpy)
from awescli.artifacts import write_text

RESULTS = Path(__file__).parent / "results" / "felt_by_controllers.md"
KEY, GUESS = "actuator_lag:rudder", 0.03
FELT = ("p", "q", "r", "phi", "theta", "psi", "p_n", "p_e", "p_d")
"""States of which the log has a sensor."""
ROLL = 0.033
"""[rad/s] roll gusts in our own simulator: what fits find in this flight of JSBSim's."""


def flown(kind: str, family: int, cache: Path, felt: Mapping[str, str]) -> Path:
    """Folder of a flight in the field of a kind whose strengths are all zero. felt: state -> property by which the law sees it, where that
    is not the truth."""
    import foreign_world
    from foreign_flights import KITE, Case, declared_text, drawn, start_of, written
    from foreign_world import Foreign, fly

    from awescli.physics.declaration import read_kite

    case, kite = Case(kind, "full", family, 0, "field"), read_kite(KITE)
    registered, folder = case.registered(), cache / f"felt-{family}-{kind}-{'sensors' if felt else 'truth'}"
    draw, nothing = drawn(case, registered), dict.fromkeys(registered.values("full"), 0.0)
    foreign = Foreign(kite, registered.world, nothing, draw.scene, draw.sensors, draw.turbulence)
    with patch.dict(foreign_world._TRUTH, felt):  # what the law is given is read by it
        flight = fly(foreign, draw.steering, start_of(kite, draw), rate=draw.rate, seed=case.seed)
    for name, text in written(flight, draw.scene, registered, case.seed, nothing).items():
        write_text(folder / name, text)
    write_text(folder / "kite.yaml", declared_text(kite, registered, case.seed))
    return folder


def read(folder: Path):
    """(log, declared kite) of a flight folder."""
    from awescli.flightlog.read import read_flight
    from awescli.physics.declaration import read_kite

    return read_flight(folder), read_kite(folder / "kite.yaml")


def flown_by_us(kind: str, family: int):
    """(log, declared kite) of the same kite, law, wind and level of turbulence in our own simulator, with a log without airspeed."""
    from foreign_flights import KITE, Case, declared, drawn

    from awescli.physics.declaration import read_kite
    from awescli.simulation.synthetic import fly, with_effects

    case, kite = Case(kind, "full", family, 0, "field"), read_kite(KITE)
    registered = case.registered()
    draw = drawn(case, registered)
    scene, gusty = draw.scene, with_effects(kite, {"turbulence": {"sigma": draw.turbulence, "roll": ROLL}})
    how = {"pattern": scene.pattern, "duration": scene.duration, "seed": family, "step": 0.0025}
    log = fly(gusty, draw.law.setpoints, scene.wind, scene.reel_out, **how)
    return replace(log, measured={n: x for n, x in log.measured.items() if n != "V_a"}), declared(kite, registered, case.seed)


def row(said: str, log, declared) -> str:
    """A flight's line of the table."""
    from awescli.flightlog.loops import find_loops
    from awescli.flightlog.split import split
    from awescli.tracing.bootstrap import gain_under_null
    from awescli.tracing.frame import Frame, TracedFlight
    from awescli.tracing.models import fit_added, fit_null, fit_on
    from awescli.tracing.tried import Tried

    frame = Frame((TracedFlight(log, split(find_loops(log), log=log), declared),), 5.0, tuple(log.measured), ())
    null, tau = fit_null(frame, {}, (1.0, 2.5)), f"{KEY}.tau"
    late = fit_on(frame, fit_added(frame, null, KEY, {tau: GUESS}, {}))
    gain = null.deviance - late.deviance
    again = gain_under_null(frame, null, Tried(SimpleNamespace(key=KEY), True, model=late, gain=gain))
    return f"| {said} | {1000 * late.table[tau].value:.0f} ms | {gain:.0f} | {null.unseen - late.unseen:.0f} | {again:.0f} |"


def main(arguments=None) -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("cache", type=Path, help="folder for the flights, outside of the repository")
    parser.add_argument("--family", type=int, default=41, help="of seeds")
    parser.add_argument("--kind", default="heading_bias", help="of foreign_kinds.yaml, whose conditions are flown without what it lacks")
    options = parser.parse_args(arguments)
    command = f"`python benchmarks/felt_by_controllers.py CACHE --family {options.family} --kind {options.kind}`"
    head = "| the law sees | lag of a rudder that has none | deviance it gains | on unseen loops | of the flight flown again |"
    lines = ["# A controller that feels the kite better than its log", "", command, "", head, "|" + "---|" * 5]
    flight = partial(flown, options.kind, options.family, options.cache)
    flights = {
        "the truth": lambda: read(flight({})),
        "the log's sensors": lambda: read(flight({name: f"sensor/{name}" for name in FELT})),
        "the truth, in our own simulator": lambda: flown_by_us(options.kind, options.family),
    }
    for said, make in flights.items():
        lines.append(row(said, *make()))
        print(lines[-1], flush=True)
    write_text(RESULTS, "\n".join(lines) + "\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
