"""Make the bundled flight: python data/make_km1_demo.py [FOLDER] [SECONDS]   (default: data/km1_demo, 150 s)

KM1's published identified parameters, flown by our path-following law, with one effect that the declared kite file
(data/kites/km1_initial.yaml) does not contain. Same command, same bytes. data/km1_demo/README.md says what was chosen and why.
A longer flight pays out the same line more slowly; examples/thesis/README.md uses one of 36 minutes.
"""

import math
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np

from awescli.artifacts import write_text
from awescli.control.path_following import PathFollowing
from awescli.control.pattern import Pattern
from awescli.flightlog.kitemill_csv import to_kitemill_csv
from awescli.flightlog.log import FlightLog
from awescli.physics.declaration import read_kite
from awescli.simulation.made_wind import as_measured, wind_record
from awescli.simulation.synthetic import ReelOut, fly, with_effects

HERE = Path(__file__).parent
DEG = math.pi / 180

SEED = 2022
DURATION = 150.0
UNDECLARED = {"actuator_lag:rudder": {"tau": 0.2}}

HEIGHTS = np.array([0.0, 100.0, 200.0, 300.0, 400.0, 600.0])
PUBLISHED_WIND = np.array([13.0, 14.32, 13.82, 10.63, 9.18, 10.0])
"""Profile [m/s] of the identified flight and its direction, -54.5939 deg (HybridModel.py, see parameters of KM1)."""
WIND_SHARE = 0.85
"""At the full published profile the identified parameters pull 9 kN; at 85 % of it load and airspeed come near the published box."""

LAW = PathFollowing(
    Pattern(elevation=27.9 * DEG, azimuth=126.7 * DEG, radius=66.0, turn=1.0),
    semi_span=3.7, k_radius=1.0, chi_max=0.6, k_course=2.0, k_feedforward=1.4, k_rate=3.0, limit=30 * DEG,
    trims={"aileron": -0.8 * DEG, "elevator": 3.5 * DEG, "flaps": 10.0 * DEG},
)  # fmt: skip
REEL_OUT = ReelOut(length=480.0, speed=0.5, swing=0.3, period=9.3)


def flown(seed: int = SEED, effects=UNDECLARED, duration: float = DURATION) -> FlightLog:
    """The flight, with noise and wind record drawn from the seed; duration: [s]."""
    truth = with_effects(read_kite(HERE / "kites" / "km1_identified.yaml"), effects)
    wind = wind_record(HEIGHTS, WIND_SHARE * PUBLISHED_WIND, -54.5939 * DEG, duration, drift=0.01, turn=0.01, seed=seed)
    return fly(
        truth, LAW.setpoints, wind, replace(REEL_OUT, speed=REEL_OUT.speed * DURATION / duration), pattern=LAW.pattern,
        duration=duration, seed=seed,
        recorded_wind=as_measured(wind, seed + 1), name="km1_demo",
    )  # fmt: skip


def main(folder: Path, duration: float = DURATION) -> None:
    log = flown(duration=duration)
    kite, weather = to_kitemill_csv(log)
    write_text(folder / "kite.csv", kite)
    write_text(folder / "wind.csv", weather)
    print(f"{folder}: {len(log)} samples, {log.time[-1]:.0f} s")


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else HERE / "km1_demo", float(sys.argv[2]) if len(sys.argv) > 2 else DURATION)
