"""Candidate effects as columns of a sensitivity: tangents where an effect is smooth at null, secants where it is flat there."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product

from awescli.physics.effects.base import Effect


@dataclass(frozen=True)
class Variant:
    """One way in which an effect may be present.

    key: the effect; moving: full names of the parameters that carry its strength; at: full name -> value at which the column is
    taken (shape parameters, and probe sizes of secants); secant: whether the column is a difference over the probe.
    """

    key: str
    moving: tuple[str, ...]
    at: dict[str, float]
    secant: bool

    @property
    def label(self) -> str:
        return f"{self.key}{sorted(self.at.items())}"


def variants(effect: Effect, onsets: Sequence[float] = ()) -> list[Variant]:
    """All variants of an effect: its grid of shapes times its grid of probes. onsets: [s] when one may begin that does so in flight."""
    strong = [p.name for p in effect.parameters if p.name not in effect.shapes]
    probes = {**effect.probes, effect.onset: onsets} if effect.onset else effect.probes
    names = list(probes)
    secant = any(name in strong for name in names)
    result = []
    for sizes in product(*(probes[n] for n in names)):
        at = {f"{effect.key}.{n}": v for n, v in zip(names, sizes, strict=True)}
        moving = tuple(f"{effect.key}.{n}" for n in strong if not secant or n in names)
        result.append(Variant(effect.key, moving, at, secant))
    return result
