"""Make a flight of a kite with something that no effect of the library is: python make_flight.py FOLDER [SEED]

FOLDER/flight is the log, FOLDER/kite.yaml what its user declares: every free parameter 5-30 % off, and nothing of the effect below. All is
drawn from the seed: same command, same bytes.
"""

import sys
from pathlib import Path

import awescli  # noqa: F401, I001  (before numpy: one BLAS thread)
from awescli.artifacts import write_text
from awescli.flightlog.kitemill_csv import to_kitemill_csv
from awescli.notation.parameters import Parameter
from awescli.notation.scalars import tanh
from awescli.physics.declaration import kite_text, read_kite
from awescli.physics.effects import EFFECTS
from awescli.physics.effects.base import Effect
from awescli.physics.instant import Load
from awescli.simulation.campaign_flights import dev_like

TRUTH = Path(__file__).parents[2] / "data" / "kites" / "development.yaml"
SEED = 12
SECONDS = 200.0
SIZE = 0.006


class YawThatGivesWay(Effect):
    """Yawing moment k qbar S b tanh(4 r) V_a / 40: against slow turns stiff, against fast ones not, r in rad/s, V_a in m/s. It is no
    product of powers, so no term of an aerodynamic table holds it."""

    name = "yaw_that_gives_way"
    doc = "an effect that the library lacks"
    parameters = (Parameter("k", 0.0, "-", -1.0, 1.0, source="example"),)
    traceable = False

    def load(self, at, own):
        moment = own.k * at.dynamic_pressure * at.values["S"] * at.values["b"] * tanh(4.0 * at.z.r) * at.V_a / 40.0
        return Load((0.0 * moment,) * 3, (0.0 * moment, 0.0 * moment, moment))


def main(folder: Path, seed: int = SEED) -> None:
    EFFECTS[YawThatGivesWay.name] = YawThatGivesWay  # in this process only: the commands that get the log know nothing of it
    made = dev_like(read_kite(TRUTH), seed, {YawThatGivesWay.name: {"k": SIZE}}, duration=SECONDS)
    kite, wind = to_kitemill_csv(made.log)
    write_text(folder / "flight" / "kite.csv", kite)
    write_text(folder / "flight" / "wind.csv", wind)
    write_text(folder / "kite.yaml", kite_text(made.declared))
    print(f"{folder}: {len(made.log)} samples, {made.log.time[-1]:.0f} s")


if __name__ == "__main__":
    if len(sys.argv) not in (2, 3):
        sys.exit("usage: python make_flight.py FOLDER [SEED]")
    main(Path(sys.argv[1]), *map(int, sys.argv[2:]))
