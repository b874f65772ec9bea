"""Flights for campaigns: a truth, what its user would declare of it, and the flight, all drawn from one seed.

Settings follow the development flights: line 260-400 m, V_a 25-57 m/s, one loop in about 9 s, rudder -7..18 deg, wind 9-10 m/s at 10 m.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from awescli.control.path_following import PathFollowing
from awescli.control.pattern import Pattern
from awescli.flightlog.log import FlightLog
from awescli.notation.parameters import ParameterTable
from awescli.physics.declaration import KiteDeclaration
from awescli.physics.effects.sizes import GROWS
from awescli.simulation.made_wind import as_measured, wind_record
from awescli.simulation.synthetic import ReelOut, fly, with_effects

DEG = np.pi / 180
HEIGHTS = (10.0, 50.0, 100.0, 150.0, 200.0, 250.0, 300.0)
"""[m] stations of a wind record with heights, as in the development flights."""
SHEAR = (0.10, 0.15)
"""Range of the power-law exponent of the wind over height (IEC 61400-1: 0.2 over land; less over sea)."""
WIDTH = (0.55, 1.65)
"""Bounds of a declared guess, as factors of it: they hold the truth for every guess that is up to 30 % off."""
TIP = 0.44
"""[rad] largest rudder, 25 deg."""


@dataclass(frozen=True)
class CampaignFlight:
    """log: the flight; flown: the kite as it is, undeclared effects included; declared: what its user would declare; law: who flew it."""

    log: FlightLog
    flown: KiteDeclaration
    declared: KiteDeclaration
    law: PathFollowing


def perturbed(declaration: KiteDeclaration, seed: int, spread: tuple[float, float] = (0.05, 0.3)) -> KiteDeclaration:
    """What a user would declare of a kite: every free parameter's guess is off by a share from `spread`, up or down, with bounds WIDTH
    around the guess. An offset (bounds on both sides of zero) is off by at most a quarter of its range and keeps its bounds."""
    random = np.random.default_rng(seed)
    rows = []
    for p in declaration.table().rows:
        share, sign, offset = random.uniform(*spread), random.choice((-1.0, 1.0)), random.uniform(-0.25, 0.25)
        if not p.free:
            rows.append(p)
        elif p.lower < 0 < p.upper or p.value == 0:
            width = p.upper - p.lower if np.isfinite(p.upper - p.lower) else 4 * p.prior_std
            rows.append(replace(p, value=float(np.clip(p.value + offset * width, p.lower, p.upper))))
        else:
            guess = p.value * (1 + sign * share)
            lower, upper = sorted((WIDTH[0] * guess, WIDTH[1] * guess))
            rows.append(replace(p, value=guess, lower=lower, upper=upper, std=None, source=f"guess, seed {seed}"))
    return declaration.with_parameters(ParameterTable(rows))


def lengthened(unit: str, length: float) -> float:
    """By how much a quantity in `unit` is larger on a kite `length` times as long, of the same density, in the same field of gravity."""
    mass, area = GROWS.get(unit, (0.0, 0.0))
    return length ** (3 * mass + 2 * area)


def similar(kite: KiteDeclaration, length: float) -> KiteDeclaration:
    """The kite `length` times as long in every direction, of the same density: it flies the same way, sqrt(length) times as fast
    (Froude's law)."""
    by = {p.name: lengthened(p.unit, length) for p in kite.table().rows}
    rows = [replace(p, **{n: getattr(p, n) * by[p.name] for n in ("value", "lower", "upper")}) for p in kite.table().rows]
    return kite.with_parameters(ParameterTable(rows))


def dev_like(
    truth: KiteDeclaration,
    seed: int,
    effects: Mapping[str, Mapping[str, float]] | None = None,
    *,
    air: Literal["table", "power"] = "table",
    duration: float = 150.0,
    turn: float = -1.0,
    noise: bool = True,
    step: float = 0.005,
    spread: tuple[float, float] = (0.05, 0.3),
    length: float = 1.0,
) -> CampaignFlight:
    """A flight of `truth` (data/kites/development.yaml), with `effects` (key -> values by short name) that its user does not declare.

    air: the wind's record has heights (table) or one station at 10 m and a declared exponent (power); turn: which way round, as
    `Pattern.turn`; length: the kite, its line and its pattern are so many times as long (`similar`), its speeds and the wind's go with the
    root of that; its instruments stay. All else is drawn from the seed. Raises NumericalFailure("departed") where an effect is too large to
    fly with.
    """
    random, fast = np.random.default_rng([seed, 1]), length**0.5
    azimuth, speed, exponent = random.uniform(-np.pi, np.pi), random.uniform(8.8, 10.0) * fast, random.uniform(*SHEAR)
    heights = np.array(HEIGHTS if air == "table" else HEIGHTS[:1]) * length
    trims = {"aileron": random.uniform(-0.5, 0.5), "elevator": random.uniform(-1.8, -1.0), "flaps": random.uniform(3.1, 4.5)}
    law = PathFollowing(
        Pattern(random.uniform(35.0, 36.0) * DEG, azimuth, random.uniform(50.0, 55.0) * length, turn),
        k_radius=0.7, k_course=1.5, k_rate=3.0, limit=TIP, trims={name: round(deg, 2) * DEG for name, deg in trims.items()},
    )  # fmt: skip
    paid_out, speed_out, swing = random.uniform(258.0, 280.0), random.uniform(0.82, 0.95), random.uniform(0.25, 0.4)
    reel_out = ReelOut(paid_out * length, speed_out * fast, swing * fast, random.uniform(8.0, 11.0) * fast)
    exponent = round(exponent, 3)
    profile = {"law": air, "exponent": exponent if air == "power" else 0.0, "reference_height": float(heights[0])}
    truth = similar(truth, length)
    truth = truth.model_copy(update={"wind": truth.wind.model_copy(update=profile)})
    wind = wind_record(
        heights, speed * (heights / heights[0]) ** exponent, azimuth + np.pi, duration,
        density=random.uniform(1.19, 1.24), drift=0.015, turn=0.01, seed=seed,
    )  # fmt: skip
    flown = with_effects(truth, effects or {})
    log = fly(
        flown, law.setpoints, wind, reel_out, pattern=law.pattern, duration=duration, seed=seed, noise=noise, step=step,
        recorded_wind=as_measured(wind, seed + 1), name=f"development-{seed}",
    )  # fmt: skip
    return CampaignFlight(log, flown, perturbed(truth, seed, spread), law)
