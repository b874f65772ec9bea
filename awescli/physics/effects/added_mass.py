"""Air that moves with the wing."""

from awescli.notation.parameters import Parameter
from awescli.physics.effects.base import Effect


class AddedMass(Effect):
    """(pi/4) rho c^2 b of air is accelerated with the wing along body z."""

    name = "added_mass"
    doc = "apparent mass along body z"
    parameters = (Parameter("m_a", 0.0, "kg", -5.0, 10.0, source="(pi/4) rho c^2 b = 1-3 kg"),)

    def body(self, body, at, own):
        return body._replace(added_z=body.added_z + own.m_a)
