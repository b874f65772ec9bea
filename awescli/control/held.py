"""A law some of whose surfaces are held where a phase of the flight wants them."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class Held:
    """The set-points of `law` (anything with `deflections`, or None for no law), but those in `hold` (surface -> [rad])."""

    law: Any
    hold: Mapping[str, float]

    def __getattr__(self, name: str) -> Any:
        return getattr(self.law, name)

    def deflections(self, z: Mapping) -> dict:
        """surface -> set-point [rad] at the state z."""
        return {**(self.law.deflections(z) if self.law is not None else {}), **self.hold}
