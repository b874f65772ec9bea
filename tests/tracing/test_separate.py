"""The advice on what would tell rivals apart fits what they act on."""

import pytest

from awescli.notation.quantities import SURFACES
from awescli.physics.effects import EFFECTS
from awescli.physics.effects.base import PLACES, Effect
from awescli.tracing.separate import EXPERIMENTS, separate


def entry(name: str, acts_on: str, *rivals: dict) -> dict:
    return {"name": name, "acts_on": acts_on, "rivals": list(rivals)}


def test_every_effect_of_the_library_has_an_experiment():
    """Guards a new place or target: nobody is told to step a surface where the winch, a vane or a gyro is meant."""
    for name, effect in EFFECTS.items():
        if effect.empirical:
            continue
        for target in effect.targets or ("",):
            acts_on = target or next(p for p in PLACES if getattr(effect, p) is not getattr(Effect, p))
            assert acts_on in EXPERIMENTS, (name, target)
            assert ("that surface, sharp" in EXPERIMENTS[acts_on]) == (acts_on in SURFACES)


@pytest.mark.parametrize(
    ("name", "acts_on", "word"),
    [("clock_offset", "winch", "reel-out"), ("surface_bias", "roll", "aileron"), ("vane_bias", "alpha", "angle of attack"),
     ("imu_bias", "rates", "at rest"), ("actuator_lag", "rudder", "steps of that surface")],
)  # fmt: skip
def test_the_advice_is_about_what_the_effects_act_on(name, acts_on, word):
    """Guards canned advice: winch, roll, angle of attack and rates were told "steps of that surface"."""
    (said,) = separate([entry(name, acts_on, entry("tether_drag", "line"))])
    assert said.startswith(f"{name} and tether_drag: ") and word in said and "another tether length" in said
    assert ("steps of that surface" in said) == (acts_on in SURFACES)


def test_rivals_that_one_experiment_separates_are_told_once():
    """Guards "x against x"."""
    (said,) = separate([entry("actuator_lag", "rudder", entry("actuator_delay", "rudder"))])
    assert said.count("steps of that surface") == 1
