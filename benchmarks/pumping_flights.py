"""Flights of pumping cycles for the tracing campaign: the kite and the phases of pumping_cycles.py, all else drawn from a seed."""

from collections.abc import Mapping

import numpy as np
from pumping_cycles import LAW, TRUTH, fly, on_winch, plan, wind

from awescli.notation.errors import NumericalFailure
from awescli.simulation.campaign_flights import CampaignFlight, perturbed
from awescli.simulation.made_wind import as_measured
from awescli.simulation.pumping import Pumping
from awescli.simulation.synthetic import as_recorded, with_effects

CYCLES = 4
STARTS = 16


def pumping_like(seed: int, effects: Mapping[str, Mapping[str, float]]) -> CampaignFlight:
    """A flight of CYCLES cycles with `effects` that its user does not declare, from the first start on the circle that ends them all.
    Raises NumericalFailure("departed") where none does."""
    random = np.random.default_rng([seed, 3])
    speed, longest, first = random.uniform(9.0, 11.5), random.uniform(320.0, 360.0), int(random.integers(STARTS))
    flown, air = with_effects(TRUTH, effects), wind(speed, seed=seed)
    pumping = Pumping.of(on_winch(flown), plan(longest))
    for k in range(STARTS):
        pumped = fly(pumping, air, speed, (first + k) % STARTS, CYCLES, seed=seed)
        if pumped.ended:
            log = as_recorded(pumped.flown, TRUTH, as_measured(air, seed + 1), seed=seed, name=f"pumping-{seed}")
            return CampaignFlight(log, flown, perturbed(TRUTH, seed), LAW)
    raise NumericalFailure("departed", f"with {', '.join(effects)} no start on the circle ends {CYCLES} cycles")
