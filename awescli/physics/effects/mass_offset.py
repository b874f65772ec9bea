"""The kite weighs more than declared, and balances elsewhere."""

from types import SimpleNamespace

from awescli.notation.parameters import Parameter
from awescli.physics.effects.base import Effect
from awescli.physics.instant import Body, Instant


class MassOffset(Effect):
    """m += dm; centre of mass at (dx, 0, dz) from the point to which the aerodynamic moments and r_t refer."""

    name = "mass_offset"
    doc = "mass and centre of mass other than declared"
    parameters = (
        Parameter("dm", 0.0, "kg", -20.0, 20.0, source="2 % between Makani serials; a third of a kite for a wrong file"),
        Parameter("dx", 0.0, "m", -0.15, 0.15, source="3-9 cm between Makani serials"),
        Parameter("dz", 0.0, "m", -0.15, 0.15, source="3-9 cm between Makani serials"),
    )

    def body(self, body: Body, at: Instant, own: SimpleNamespace) -> Body:
        x, y, z = body.cg
        return body._replace(mass=body.mass + own.dm, cg=(x + own.dx, y, z + own.dz))
