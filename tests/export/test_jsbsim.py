"""JSBSim flies the exported aircraft as the simulator flies the model; what it has no counterpart for is refused by name."""

import numpy as np
import pytest
from export.flying import in_jsbsim, put, relative
from export.models import compared, free, with_controller, with_heavy_line, with_network, with_one, with_restless_controller, with_states
from kites import every_key

from awescli.export.jsbsim_aircraft import jsbsim_files
from awescli.notation.errors import BadInput


@pytest.mark.parametrize("case", [with_states, with_controller, free], ids=lambda f: f.__name__)
def test_jsbsim_flies_the_same_ten_seconds(case, tmp_path):
    """To a thousandth of every channel's range."""
    flown = case()
    found, span = in_jsbsim(put(tmp_path, jsbsim_files(flown.model)), flown.tables, flown.ride), np.ptp(flown.outputs, axis=0)
    moving = span > 0
    worst = relative(found, flown.outputs, np.where(moving, span, 1.0))
    assert worst[moving].max() < 1e-3, dict(zip([s.name for s in flown.model.outputs], worst, strict=True))


@pytest.mark.parametrize("frames", [400, 800, 1600])
def test_a_controller_keeps_its_own_rate_whatever_the_frames_are(frames, tmp_path):
    """50 Hz, also where JSBSim runs at other rates than the one of the README; the error falls with the frames."""
    flown = with_restless_controller()
    assert compared(flown, in_jsbsim(put(tmp_path, jsbsim_files(flown.model)), flown.tables, flown.ride, frames)) < 1e-3 * 400 / frames


def test_a_network_is_refused_by_name():
    with pytest.raises(BadInput, match="the network has no counterpart in JSBSim") as refused:
        jsbsim_files(with_network().model)
    assert "--model with_effects" in refused.value.do


@pytest.mark.parametrize("key", every_key())
def test_every_effect_is_flown(key, tmp_path):
    """A second with one effect: to a thousandth of what each channel reaches."""
    flown = with_one(key)
    assert compared(flown, in_jsbsim(put(tmp_path, jsbsim_files(flown.model)), flown.tables, flown.ride)) < 1e-3


def test_what_moves_with_the_kite_resists_at_its_centre_of_mass(tmp_path):
    """Guards the one load that JSBSim has for it: its own mass is the same in all directions, and has no line on it."""
    flown = with_heavy_line()
    assert compared(flown, in_jsbsim(put(tmp_path, jsbsim_files(flown.model)), flown.tables, flown.ride)) < 1e-3
