"""Air that moves with the wing."""

from types import SimpleNamespace

from awescli.notation.parameters import Parameter
from awescli.physics.effects.base import Effect
from awescli.physics.instant import Body, Instant


class AddedMass(Effect):
    """(pi/4) rho c^2 b of air is accelerated with the wing along body z."""

    name = "added_mass"
    doc = "apparent mass along body z"
    parameters = (Parameter("m_a", 0.0, "kg", -5.0, 10.0, source="(pi/4) rho c^2 b = 1-3 kg"),)

    def body(self, body: Body, at: Instant, own: SimpleNamespace) -> Body:
        return body._replace(added_z=body.added_z + own.m_a)
