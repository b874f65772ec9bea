"""What is not known of surfaces that were read with noise: which there are, and where they act."""

from dataclasses import replace

import numpy as np
import pytest
from kites import DEVELOPMENT, at_point, flight

from awescli.estimation.processes.surface_noise import SurfaceNoise
from awescli.flightlog.log import Unknown
from awescli.physics.disturbances import RECORDED


@pytest.mark.parametrize("surface", ["rudder", "elevator", "aileron"])
def test_a_kite_answers_it_as_it_answers_the_surface(kite, surface):
    """Guards the place: by how much a surface is set otherwise than recorded is added before the actuators."""
    x, u, c = at_point(kite)
    recorded, other = list(u), list(x)
    recorded[kite.input_names.index(RECORDED[surface])] += 0.02
    other[kite.x_names.index(surface)] += 0.02
    derivative = kite.derivative(x, recorded, c)
    assert derivative == pytest.approx(kite.derivative(other, u, c), rel=1e-12)
    assert np.abs(np.subtract(derivative, kite.derivative(x, u, c))).max() > 1e-6


def test_only_what_was_read_with_noise_is_unknown():
    """Guards exact set-points, and surfaces that move nothing on a kite: neither has a process."""
    flown = flight(seed=3, duration=10.0)
    assert SurfaceNoise.of(flown.declared, flown.log).groups == ()
    noisy = replace(flown.log, unknown={"rudder": Unknown(0.001, 0.2), "aileron": Unknown(0.001, 0.2)})
    terms = {c: {m: p for m, p in of.items() if "aileron" not in m} for c, of in DEVELOPMENT.aerodynamics.terms.items()}
    without = DEVELOPMENT.model_copy(update={"aerodynamics": DEVELOPMENT.aerodynamics.model_copy(update={"terms": terms})})
    (group,) = SurfaceNoise.of(without, noisy).groups
    assert (group.axes, group.level, group.memory) == ((RECORDED["rudder"],), 0.001, 0.2) and group.of_level.spread == 0
