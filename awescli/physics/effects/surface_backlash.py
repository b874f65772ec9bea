"""Play in a linkage, with memory."""

from types import SimpleNamespace

from awescli.notation.parameters import Parameter
from awescli.notation.quantities import CONTROL_SURFACES
from awescli.notation.scalars import Scalar
from awescli.physics.declaration import KiteDeclaration
from awescli.physics.effects.base import Effect
from awescli.physics.effects.lag import SHORTEST, clipped
from awescli.physics.effects.past import moves, past_of
from awescli.physics.instant import Instant

NARROWEST = 1e-5
"""[rad] a play narrower than this is none."""


class SurfaceBacklash(Effect):
    """delta stays where it is while the set-point moves within +-width/2 of it, and is pushed along beyond (the play operator; Tao &
    Kokotovic, Adaptive Control of Systems with Actuator and Sensor Nonlinearities, ch. 2).

    The state remembers where the surface was: delta = set-point - min(max(set-point - state, -width/2), width/2), the exact play of that
    memory, and SHORTEST d(state)/dt = delta - state. In the limit of a short time the memory is the surface itself; as it is, a reversal
    is late by the SHORTEST lag that is stepped through. At width 0 delta is the set-point, whatever the memory says.
    """

    name = "surface_backlash"
    doc = "play in a linkage: the surface follows only beyond it"
    parameters = (Parameter("width", 0.0, "rad", 0.0, 0.15, source="play of 0.5-3 deg"),)
    targets = CONTROL_SURFACES
    instrument = "actuator"
    states = ("remembered",)
    units = ("target",)

    def __init__(self, target: str = "", declaration: KiteDeclaration | None = None):
        super().__init__(target, declaration)
        self.inputs = past_of(target)

    def _surface(self, setpoint: Scalar, at: Instant, own: SimpleNamespace) -> Scalar:
        (remembered,) = self.own_states(at)
        return setpoint - clipped(setpoint - remembered, own.width / 2)

    def actuate(self, deflections: dict, at: Instant, own: SimpleNamespace) -> dict:
        return {**deflections, self.target: self._surface(deflections[self.target], at, own)}

    def start_spreads(self, own: SimpleNamespace) -> tuple:
        # the play itself: a linkage with next to none remembers next to nothing
        return (max(own.width, NARROWEST) / 8,)

    def rates(self, at: Instant, own: SimpleNamespace) -> tuple:
        (remembered,) = self.own_states(at)
        return ((self._surface(self.received(at)[self.target], at, own) - remembered) / SHORTEST,)

    def initial(self, at: Instant, own: SimpleNamespace) -> tuple:
        # pushed along by the set-points of the past
        behind = at.inputs[past_of(self.target)[-1]]
        for _, _, after in moves(self.target, at):
            behind = after - clipped(after - behind, own.width / 2)
        return (self.received(at)[self.target] + behind,)
