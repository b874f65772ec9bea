"""Weight of the kite."""

from types import SimpleNamespace

from awescli.notation.frames import rotate_back
from awescli.physics.effects.base import Effect
from awescli.physics.instant import Instant, Load


class Gravity(Effect):
    """f_g = R^T (0, 0, m g), docs/equations.md (6). Acts at the centre of mass."""

    name = "gravity"
    doc = "weight"
    always = True
    weight = True

    def load(self, at: Instant, own: SimpleNamespace) -> Load:
        return Load(rotate_back(at.R, (0.0, 0.0, at.body.mass * at.values["g"])), (0.0, 0.0, 0.0))
