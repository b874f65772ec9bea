"""A kite with an effect beside the same without it, at one instant or on a short flight: what the tests of effects compare."""

import numpy as np
from kites import DEVELOPMENT, at_point, lively, moved_before, sizes

from awescli.notation.quantities import OUTPUTS, SURFACES
from awescli.physics.effects.past import BEHIND, past_of
from awescli.physics.kite import Kite
from awescli.simulation.rollout import Simulator

HEIGHTS = (10.0, 100.0, 200.0)


def both(key, values=None, **changes):
    """(instant with the effect, instant without) at the same point."""
    plain, kite = Kite(DEVELOPMENT, HEIGHTS), Kite(DEVELOPMENT, HEIGHTS, (key,))
    kite = kite.with_values({f"{key}.{n}": v for n, v in values.items()} if values else sizes(key))
    return kite.instant(*at_point(kite, **changes)), plain.instant(*at_point(plain, **changes))


def reported(key, **changes):
    """(outputs with the effect, outputs without) by name."""
    plain, kite = Kite(DEVELOPMENT, HEIGHTS), Kite(DEVELOPMENT, HEIGHTS, (key,)).with_values(sizes(key))
    return tuple(dict(zip(OUTPUTS, k.outputs(*at_point(k, **changes)), strict=True)) for k in (kite, plain))


def flown(key, calm, values=None, seconds=2.0, setpoint=None, step=0.005):
    """(kite, trajectories, segments) of the kite with an effect on a lively segment; setpoint: of the rudder, (N+1,)."""
    from dataclasses import replace

    kite = Kite(DEVELOPMENT, calm.log.wind.height, (key,) if key else ())
    segments = lively(kite, calm.log, count=2, seconds=seconds).segments
    if setpoint is not None:
        setpoints, inputs = segments.setpoints.copy(), segments.inputs.copy()
        setpoints[:, :, SURFACES.index("rudder")] = setpoint
        rate = np.gradient(setpoint, segments.dt)
        inputs[:, :, kite.input_names.index("rudder_rate")] = rate
        # it has come as it goes on
        inputs[:, :, [i for i, n in enumerate(kite.input_names) if n in past_of("rudder")]] = 0.0
        moved_before(kite, inputs, "rudder", -rate[0] * np.array(BEHIND))
        segments = replace(segments, setpoints=setpoints, inputs=inputs)
    result = Simulator(kite, (), step=step).rollout(segments, values)
    assert not result.diverged.any()
    return kite, result, segments


def deflection(kite, result, segments, values) -> np.ndarray:
    """(N+1,) true rudder of the first segment."""
    kite = kite.with_values(values)
    c = [float(v) for v in kite.parameters.vector()]
    return kite.instant(list(result.states[0].T), list(segments.inputs[0].T), c).deflections["rudder"]
