"""What can be flown: a kite, or what stands in its place, physics with a network on top."""

from collections.abc import Iterable, Mapping, Sequence
from typing import Protocol

import numpy as np

from awescli.notation.constraints import LinearConstraint
from awescli.notation.parameters import Parameter, ParameterTable
from awescli.notation.scalars import Scalar
from awescli.physics.declaration import KiteDeclaration
from awescli.physics.effects.base import Effect
from awescli.physics.instant import Instant


class FlightModel(Protocol):
    """Three functions of vectors, `derivative`, `outputs`, `initial`, and the names of what stands in these vectors: as `kite.Kite`."""

    declaration: KiteDeclaration
    heights: tuple[float, ...]
    effects: list[Effect]
    by_place: dict[str, list[Effect]]
    tether: Effect | None
    parameters: ParameterTable
    parameter_names: tuple[str, ...]
    state_names: tuple[str, ...]
    x_names: tuple[str, ...]
    input_names: tuple[str, ...]
    constraints: tuple[LinearConstraint, ...]
    record: tuple[str, ...]
    own_in_phase: tuple[tuple[str, str, str], ...]

    @property
    def start_spread(self) -> np.ndarray:
        """(n_e,) standard deviations of the effects' states where a rollout begins."""
        ...

    def instant(self, x: Sequence[Scalar], u: Sequence[Scalar], c: Sequence[Scalar]) -> Instant:
        """One instant, filled."""
        ...

    def derivative(self, x: Sequence[Scalar], u: Sequence[Scalar], c: Sequence[Scalar]) -> list:
        """d/dt of the 12 states and the effects' states."""
        ...

    def initial(self, x: Sequence[Scalar], u: Sequence[Scalar], c: Sequence[Scalar]) -> list:
        """The effects' states at the start of a rollout."""
        ...

    def outputs(self, x: Sequence[Scalar], u: Sequence[Scalar], c: Sequence[Scalar]) -> list:
        """What the sensors report and what was commanded."""
        ...

    def with_values(self, values: Mapping[str, float]) -> "FlightModel":
        """The same with other parameter values."""
        ...

    def with_rows(self, rows: Iterable[Parameter]) -> "FlightModel":
        """The same with other rows of parameters."""
        ...

    def declare(self, keys: Sequence[str], free: Sequence[str] = (), table: ParameterTable | None = None) -> KiteDeclaration:
        """The declaration of its physics, with effects added."""
        ...
