"""Weight of the paid-out line."""

from awescli.notation.frames import rotate_back
from awescli.notation.parameters import Parameter
from awescli.physics.effects.base import Effect
from awescli.physics.instant import Load


class TetherWeight(Effect):
    """Half of the line's weight, mu l_t g / 2, hangs on the kite (the other half on the winch). The line's inertia, mu l_t / 3
    along its motion, is below 2 % of the kite's mass here and not included."""

    name = "tether_weight"
    doc = "half the line's weight hangs on the kite"
    of_line = True
    parameters = (Parameter("mu", 0.0, "kg/m", 0.0, 0.05, source="0.0074 kg/m for 3.5 mm Dyneema"),)

    def load(self, at, own):
        weight = own.mu * at.line.length * at.values["g"] / 2
        return Load(rotate_back(at.R, (0.0 * weight, 0.0 * weight, weight)), (0.0, 0.0, 0.0))
