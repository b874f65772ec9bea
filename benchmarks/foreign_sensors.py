"""The sensors of a foreign kite: one `<sensor>` of JSBSim a channel, with lag, noise, drift, delay and quantisation of its own.

A sensor of JSBSim truncates where it quantises: half a step is added before, so that a step is no bias.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass, field

from foreign_kinds import Sensor, World
from foreign_names import STEP, Names, delayed

from awescli.physics.declaration import Noise

STATES = ("p_n", "p_e", "p_d", "v_n", "v_e", "v_d", "phi", "theta", "psi", "p", "q", "r")
"""Channels of the frame's own states."""
LOADS = ("a_x", "a_y", "a_z", "V_a", "alpha", "beta", "tension")
"""Channels that a sensor sees one frame later: accelerations, air data and loads are computed behind the flight control in a frame."""
ATTITUDE = ("phi", "theta", "psi")
BITS = {
    **{name: (24, -4000.0, 4000.0) for name in ("p_n", "p_e", "p_d")}, **{name: (16, -160.0, 160.0) for name in ("v_n", "v_e", "v_d")},
    **{name: (16, -8.0, 8.0) for name in (*ATTITUDE, "p", "q", "r")}, **{name: (14, -160.0, 160.0) for name in ("a_x", "a_y", "a_z")},
    "V_a": (12, 0.0, 100.0), "alpha": (14, -1.6, 1.6), "beta": (14, -1.6, 1.6), "tension": (14, -1000.0, 31000.0),
}  # fmt: skip
"""Channel -> (bits, lowest, highest) [SI]: steps of a tenth of the declared noise and less."""


@dataclass(frozen=True)
class Sensors:
    """noise: as the kite file declares it; factor: true over declared; drift, memory: standard deviation [rad] and memory [s] of an
    attitude that wanders; quiet: neither noise nor quantisation, so that the truth can be read."""

    noise: Noise = field(default_factory=Noise)
    factor: float = 1.0
    drift: float = 0.0
    memory: float = 10.0
    quiet: bool = False

    def components(self, names: Names, world: World) -> Iterator[str]:
        """The sensors' channel of the flight control: sensor/CHANNEL, from what it reads."""
        for channel in (*STATES, *LOADS):
            own = world.sensors.get(channel, Sensor())
            reads = own.reads or channel
            if channel in ATTITUDE and self.drift > 0:
                yield from self._wander(channel)
                reads = f"({reads}) + wander"
            yield names.also({"wander": f"drift/{channel}"}).component(f"reads/{channel}", reads)
            yield self._sensor(names, channel, own)

    def seeded(self) -> list[str]:
        """Properties that take a random seed, always in the same order."""
        if self.quiet:
            return []
        wandering = [f"drift/{channel}-noise" for channel in ATTITUDE] if self.drift > 0 else []
        return [f"{name}/randomseed" for name in (*(f"sensor/{c}" for c in (*STATES, *LOADS)), *wandering)]

    def _sensor(self, names: Names, channel: str, own: Sensor) -> str:
        """In the order in which JSBSim applies them: lag, noise, drift, bias, delay, quantisation."""
        lag = "" if own.lag is None else f"<lag>{1 / names.number(own.lag)!r}</lag>"
        drift = "" if own.drift_rate is None else f"<drift_rate>{names.number(own.drift_rate)!r}</drift_rate>"
        delay = "" if own.delay is None else delayed(names.number(own.delay))
        noise = bias = steps = ""
        if not self.quiet:
            std, share = self.noise.channels()[channel]
            variation, level = ("PERCENT", share) if share else ("ABSOLUTE", std)
            noise = f'<noise variation="{variation}" distribution="GAUSSIAN">{level * self.factor!r}</noise>'
            bits, low, high = BITS[channel]
            bias = f"<bias>{(high - low) / 2**bits / 2!r}</bias>"
            steps = f"<quantization><bits>{bits}</bits><min>{low!r}</min><max>{high!r}</max></quantization>"
        return f'<sensor name="sensor/{channel}"><input>reads/{channel}</input>{lag}{noise}{drift}{bias}{delay}{steps}</sensor>'

    def _wander(self, channel: str) -> Iterator[str]:
        """An Ornstein-Uhlenbeck process: white noise through JSBSim's lag filter, which leaves dt / (2 tau + dt) of its variance."""
        left = math.sqrt(STEP / (2 * self.memory + STEP))
        white = f'<noise variation="ABSOLUTE" distribution="GAUSSIAN">{self.drift / left!r}</noise>'
        yield f'<sensor name="drift/{channel}-noise"><input>drift/still</input>{white}</sensor>'
        yield f'<lag_filter name="drift/{channel}"><input>drift/{channel}-noise</input><c1>{1 / self.memory!r}</c1></lag_filter>'
