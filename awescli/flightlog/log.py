"""FlightLog: one flight, equally long signals, finite, SI, NED/FRD, one uniform clock, frozen."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from types import MappingProxyType

import numpy as np

from awescli.notation.errors import BadInput, did_you_mean
from awescli.notation.frames import rotate_back, rotation_body_to_ned
from awescli.notation.quantities import INPUTS, MEASURED, OF_LINE


@dataclass(frozen=True)
class WindRecord:
    """The wind as a station or a lidar recorded it, on its own slow clock.

    time: (M,) s on the flight's clock; height: (H,) m above the winch, ascending; speed: (M, H) m/s;
    direction: (M, H) rad, where the wind comes from, clockwise from north, unwrapped in time and height;
    down: (M, H) m/s vertical wind, positive down; density: (M,) kg/m3, or None where the log has none. All finite, else BadInput is raised.
    """

    time: np.ndarray
    height: np.ndarray
    speed: np.ndarray
    direction: np.ndarray
    down: np.ndarray
    density: np.ndarray | None = None

    def __post_init__(self) -> None:
        for name in ("time", "height", "speed", "direction", "down", "density"):
            values = getattr(self, name)
            if values is not None and not np.isfinite(values).all():
                raise BadInput(f"the wind record holds a {name} that is no finite number", do="Mend the weather file.")


@dataclass(frozen=True)
class Unknown:
    """What is not known of a signal: an error of standard deviation `std` [its unit] that lasts `memory` [s] (Ornstein-Uhlenbeck)."""

    std: float
    memory: float


@dataclass(frozen=True)
class FlightLog:
    """One flight on a uniform clock.

    name: the folder's name; start: unix time of sample 0 [s]; dt: sample interval [s]; time: (N,) s from the start.
    measured: what sensors reported (names in `quantities.MEASURED`), each (N,); inputs: what was commanded
    (names in `quantities.INPUTS`), each (N,). Signals the log lacks are absent, never zero-filled.
    valid: (N,) bool, False where a sample was filled over a gap or failed a check and must not be fitted or scored.
    wind: WindRecord, or None. groups: signal name -> clock group ("onboard", "winch", "weather").
    notes: what the reader did to the file (removed stamps, filled gaps, ...), one sentence each; counters: the same, counted.
    causes: why samples are not valid ("gap", "V_a stuck", ...) -> (K, 2) half-open sample ranges; they may overlap.
    fresh: signal name -> (N,) bool, True where its sensor gave a new value; between them the signal is interpolated and says nothing.
    Signals that are not in it are new at every sample.
    unknown: name of a recorded input -> what is not known of it, where it was read with noise (`surface_noise`).
    """

    name: str
    start: float
    dt: float
    time: np.ndarray
    measured: Mapping[str, np.ndarray]
    inputs: Mapping[str, np.ndarray]
    valid: np.ndarray
    wind: WindRecord | None = None
    groups: Mapping[str, str] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    counters: Mapping[str, int] = field(default_factory=dict)
    causes: Mapping[str, np.ndarray] = field(default_factory=dict)
    fresh: Mapping[str, np.ndarray] = field(default_factory=dict)
    unknown: Mapping[str, Unknown] = field(default_factory=dict)

    def __post_init__(self) -> None:
        for table, known in ((self.measured, MEASURED), (self.inputs, INPUTS)):
            for name, signal in table.items():
                if name not in known:
                    raise BadInput(f"unknown signal '{name}' in flight '{self.name}'", do=did_you_mean(name, known))
                if signal.shape != self.time.shape or not np.isfinite(signal).all():
                    raise BadInput(f"signal '{name}' of flight '{self.name}' is not {self.time.shape[0]} finite samples")
                signal.setflags(write=False)
        object.__setattr__(self, "measured", MappingProxyType(dict(self.measured)))
        object.__setattr__(self, "inputs", MappingProxyType(dict(self.inputs)))
        object.__setattr__(self, "groups", MappingProxyType(dict(self.groups)))
        object.__setattr__(self, "counters", MappingProxyType(dict(self.counters)))
        object.__setattr__(self, "causes", MappingProxyType(dict(self.causes)))
        object.__setattr__(self, "fresh", MappingProxyType(dict(self.fresh)))
        object.__setattr__(self, "unknown", MappingProxyType(dict(self.unknown)))

    def __len__(self) -> int:
        return self.time.shape[0]

    def __getitem__(self, name: str) -> np.ndarray:
        """A signal by name: measured, commanded, or derived (u, v, w from the NED velocity and the Euler angles)."""
        if name in self.measured:
            return self.measured[name]
        if name in self.inputs:
            return self.inputs[name]
        if name in ("u", "v", "w"):
            return self.body_velocity["uvw".index(name)]
        known = [*self.measured, *self.inputs, "u", "v", "w"]
        raise BadInput(f"flight '{self.name}' has no signal '{name}'", do=did_you_mean(name, known))

    def __contains__(self, name: str) -> bool:
        return name in self.measured or name in self.inputs

    @property
    def recorded_wind(self) -> WindRecord:
        """The wind record of a flight that has one. Raises BadInput where it has none."""
        if self.wind is None:
            raise BadInput(f"flight '{self.name}' has no wind record", do="Put a weather file beside the log, or map one in flight.yaml.")
        return self.wind

    @property
    def on_line(self) -> bool:
        """Whether the log has anything of a line; if not, it is of a free flight."""
        return any(name in self for name in OF_LINE)

    def is_new(self, name: str) -> np.ndarray:
        """(N,) bool: the samples at which a signal's sensor gave a new value."""
        return self.fresh.get(name, np.ones(len(self), bool))

    def without_values(self, rows: Mapping[str, Sequence[int]]) -> "FlightLog":
        """The same without some values, signal -> samples: its sensor said nothing there."""
        gone = {name: self.is_new(name) & ~np.isin(np.arange(len(self)), of) for name, of in rows.items()}
        return replace(self, fresh={**self.fresh, **gone})

    @property
    def body_velocity(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """(u, v, w) = R^T v_ned, each (N,) m/s: as noisy as both of its sources."""
        m = self.measured
        R = rotation_body_to_ned(m["phi"], m["theta"], m["psi"])
        return rotate_back(R, (m["v_n"], m["v_e"], m["v_d"]))

    def between(self, first: int, last: int) -> "FlightLog":
        """Samples first..last-1 as a log of their own; the clock keeps its origin."""
        cut = slice(first, last)
        return replace(
            self,
            time=self.time[cut],
            measured={k: s[cut] for k, s in self.measured.items()},
            inputs={k: s[cut] for k, s in self.inputs.items()},
            valid=self.valid[cut],
            fresh={name: new[cut] for name, new in self.fresh.items()},
            causes={cause: inside for cause, bounds in self.causes.items() if len(inside := _clipped(bounds, first, last))},
        )


def runs_of(mask: np.ndarray) -> np.ndarray:
    """Half-open (first, last) ranges in which `mask` is True, (K, 2)."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], mask, [False]]).astype(np.int8)))
    return edges.reshape(-1, 2)


def _clipped(bounds: np.ndarray, first: int, last: int) -> np.ndarray:
    """What of the ranges (K, 2) lies in first..last-1, counted from `first`."""
    inside = np.clip(bounds, first, last) - first
    return inside[inside[:, 1] > inside[:, 0]]
