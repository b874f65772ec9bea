"""Where does the screening put an effect that is there, in gusts? python benchmarks/screening_in_gusts.py CACHE [--family F] [--kinds K]

Flights of a KM1-like kite by JSBSim in logs as the field has them (foreign_flights.py), kept in CACHE, screened twice: by the score of the
squared residual alone, and by that of the likelihood in which gusts are integrated out. Family 40 and these kinds are those that the second
one was developed on. The table goes to benchmarks/results/screening_in_gusts.md.
"""

import argparse
import sys
from pathlib import Path
from unittest.mock import patch

import awescli  # noqa: F401  (thread settings before numpy)
from awescli.artifacts import write_text

RESULTS = Path(__file__).parent / "results" / "screening_in_gusts.md"
KINDS = ("lift_drift", "lift_stall", "wind_shear", "mass_offset", "parasitic_drag")


def screened(folder: Path):
    """(screening by squares alone, screening with gusts integrated out) of a flight folder's declared model."""
    from awescli.flightlog.loops import find_loops
    from awescli.flightlog.read import read_flight
    from awescli.flightlog.split import split
    from awescli.physics.declaration import read_kite
    from awescli.tracing.frame import Frame, TracedFlight
    from awescli.tracing.investigate import library_keys
    from awescli.tracing.models import fit_null
    from awescli.tracing.screen import screen

    log, declared = read_flight(folder), read_kite(folder / "kite.yaml")
    flight = TracedFlight(log, split(find_loops(log), log=log), declared)
    frame = Frame((flight,), 5.0, tuple(log.measured), ())
    null, keys = fit_null(frame, {}, (1.0, 2.5)), library_keys(declared, log)
    with patch("awescli.tracing.screen.gusty", lambda model: False):
        alone = screen(frame, null, keys)
    return alone, screen(frame, null, keys)


def row(kind: str, folder: Path) -> str:
    """A flight's line of the table."""
    cells = []
    for found in screened(folder):
        place, score = next((i, s) for i, s in enumerate(found.scores, 1) if s.key.partition(":")[0] == kind)
        first = found.scores[0]
        cells += [f"{first.key} {first.drop:.0f}", f"{score.drop:.0f}, no. {place}"]
    return f"| {kind} | " + " | ".join(cells) + " |"


def main(arguments=None) -> int:
    from foreign_flights import Case, flight_folder

    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("cache", type=Path, help="folder for the flights, outside of the repository")
    parser.add_argument("--family", type=int, default=40, help="of seeds")
    parser.add_argument("--kinds", nargs="+", default=KINDS, help="names of foreign_kinds.yaml that are called as their effect is")
    options = parser.parse_args(arguments)
    head = "| lacks | first by squares alone (deviance promised) | the effect there | first with gusts integrated out | the effect there |"
    command = f"`python benchmarks/screening_in_gusts.py CACHE --family {options.family} --kinds {' '.join(options.kinds)}`"
    lines = ["# Screening in gusts", "", command, "", head, "|" + "---|" * 5]
    for kind in options.kinds:
        lines.append(row(kind, flight_folder(Case(kind, "full", options.family, air="field"), options.cache.absolute())))
        print(lines[-1], flush=True)
    write_text(RESULTS, "\n".join(lines) + "\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
