"""Law: the contract of a flight controller, and how its features become saturated deflections.

A member of the family fills `outputs` (and may fill `outputs_of_matrix`, its fast path over many samples); everything else is final.
"""

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import ClassVar, Protocol

import numpy as np

from awescli.control.features import check_features, evaluate
from awescli.control.pattern import Pattern
from awescli.flightlog.log import FlightLog
from awescli.notation.angles import mean_direction
from awescli.notation.errors import BadInput
from awescli.notation.quantities import SURFACES
from awescli.notation.scalars import Scalar, select


def clamp(x: Scalar, lower: float, upper: float) -> Scalar:
    """x held within [lower, upper]."""
    x = select(x - lower, x, lower)
    return select(upper - x, x, upper)


class Commands(Protocol):
    """Whatever commands surfaces from the state: an identified law, one of path following, one that is held or amplified."""

    def deflections(self, z: Mapping[str, Scalar]) -> dict[str, Scalar]:
        """surface -> set-point [rad] at the state z."""
        ...


@dataclass(frozen=True, kw_only=True)
class Law(ABC):
    """A static map from the state to set-points of one or more surfaces.

    surfaces: those the law drives; features: names in FEATURES; centre, scale: of each feature, for standardisation;
    limits: surface -> (lower, upper) [rad]; constants: surface -> [rad], surfaces that never moved; pattern: the circle, or None;
    rate_limits: surface -> [rad/s], those that show a limiter, and delay_s [s]: properties of the set-point, applied by whoever
    simulates over time (simulation.closed_loop);
    metrics: what the fit reports about itself, plain numbers.
    """

    kind: ClassVar[str]

    surfaces: tuple[str, ...]
    features: tuple[str, ...]
    centre: tuple[float, ...]
    scale: tuple[float, ...]
    limits: Mapping[str, tuple[float, float]]
    constants: Mapping[str, float] = field(default_factory=dict)
    pattern: Pattern | None = None
    rate_limits: Mapping[str, float] = field(default_factory=dict)
    delay_s: float = 0.0
    metrics: Mapping = field(default_factory=dict)

    def __post_init__(self) -> None:
        # plain floats: a numpy scalar would make numpy the first to answer when it meets a recorded scalar
        for name in ("centre", "scale"):
            object.__setattr__(self, name, tuple(float(x) for x in getattr(self, name)))
        check_features(self.features)
        for name in self.surfaces:
            if name not in SURFACES or name not in self.limits:
                raise BadInput(f"surface '{name}' is unknown or has no limits", do=f"Known: {', '.join(SURFACES)}; give limits for each.")
        if not len(self.features) == len(self.centre) == len(self.scale):
            raise BadInput("features, centre and scale of a control law differ in length")

    @abstractmethod
    def outputs(self, x: tuple) -> tuple:
        """Unsaturated set-points [rad], one per surface, from the standardised features x: scalars in, scalars out."""

    @abstractmethod
    def own_arrays(self) -> dict[str, np.ndarray]:
        """The numbers of this kind of law; `type(law)(**common, **arrays)` makes it again."""

    def outputs_of_matrix(self, X: np.ndarray) -> np.ndarray:
        """Unsaturated set-points (N, S) of standardised features X (N, F). A fast path must equal `outputs` to 1e-12 relative."""
        outputs = self.outputs(tuple(X.T))
        return np.stack([np.broadcast_to(o, X.shape[0]) for o in outputs], axis=1)

    def deflections(self, z: Mapping) -> dict:
        """surface -> set-point [rad], saturated, at the state z (mapping of STATES, and what the features need, to scalars)."""
        x = evaluate(self.features, z, self.pattern)
        x = tuple((f - c) * (1.0 / s) for f, c, s in zip(x, self.centre, self.scale, strict=True))
        driven = {name: clamp(y, *self.limits[name]) for name, y in zip(self.surfaces, self.outputs(x), strict=True)}
        return driven | {name: float(value) for name, value in self.constants.items()}


def state_mapping(log: FlightLog, wind_direction: float | None = None) -> dict[str, np.ndarray | float]:
    """z of a flight log, each (N,): the 12 states, the winch inputs it has, and the wind direction where it is known [rad, from]."""
    z: dict[str, np.ndarray | float] = {name: log[name] for name in ("p_n", "p_e", "p_d", "phi", "theta", "psi", "p", "q", "r")}
    z["u"], z["v"], z["w"] = log.body_velocity
    z |= {name: log.inputs[name] for name in ("tether_length", "reel_out_speed") if name in log.inputs}
    wind = getattr(log, "wind", None)
    if wind_direction is None and wind is not None:
        wind_direction = mean_direction(wind.direction)
    return z if wind_direction is None else z | {"wind_direction": wind_direction}


def standardised_features(law: Law, z: Mapping) -> np.ndarray:
    """X (N, F) of a mapping of arrays (N,)."""
    n = np.shape(z["p_n"])[0]
    F = evaluate(law.features, z, law.pattern)
    return np.stack([(np.broadcast_to(f, n) - c) * (1.0 / s) for f, c, s in zip(F, law.centre, law.scale, strict=True)], axis=1)


def deflections_of_states(law: Law, z: Mapping) -> dict[str, np.ndarray]:
    """surface -> saturated set-point (N,) [rad] for a mapping of arrays (N,): the fast path, equal to `law.deflections`."""
    U = law.outputs_of_matrix(standardised_features(law, z))
    driven = {name: np.clip(U[:, i], *law.limits[name]) for i, name in enumerate(law.surfaces)}
    return driven | {name: np.full(U.shape[0], value) for name, value in law.constants.items()}


def deflections_of_log(law: Law, log: FlightLog, wind_direction: float | None = None) -> dict[str, np.ndarray]:
    """What the law would have commanded at every (noisy, measured) state of a flight log: surface -> (N,) [rad]."""
    return deflections_of_states(law, state_mapping(log, wind_direction))
