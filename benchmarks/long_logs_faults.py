"""Faults of real logs, put into a clean one at known places: gaps, stamps that repeat or run backward, dropouts, spikes, stuck sensors."""

from collections.abc import Callable
from dataclasses import dataclass, field

import awescli  # noqa: F401  (thread settings before numpy)

# isort: split
import numpy as np
import polars as pl

from awescli.flightlog.kitemill_csv import to_kitemill_csv
from awescli.flightlog.log import FlightLog


@dataclass
class Faulty:
    """A table in the making. untrue: row -> must not be called valid at its old value; named: words that the reader must say."""

    frame: dict[str, np.ndarray]
    rate: float
    rng: np.random.Generator
    drop: np.ndarray = field(init=False)
    named: dict[str, str] = field(default_factory=dict)
    used: list[tuple[int, int]] = field(default_factory=list)

    def __post_init__(self):
        self.drop = np.zeros(len(self.frame["epoch_ms"]), bool)

    def place(self, seconds: float) -> slice:
        """A stretch of the flown middle that no other fault touches, with a margin around it."""
        n, length, margin = self.drop.size, max(1, int(round(seconds * self.rate))), int(3 * self.rate)
        for _ in range(1000):
            first = int(self.rng.integers(int(0.25 * n), int(0.75 * n) - length))
            if all(first + length + margin < a or first > b + margin for a, b in self.used):
                self.used.append((first, first + length))
                return slice(first, first + length)
        raise ValueError("the log is too short for so many faults")


def gaps(f: Faulty) -> None:
    for seconds in (0.5, 2.0, 12.0):
        f.drop[f.place(seconds)] = True
    f.named["gaps"] = "gaps are longer than"


def short_gaps(f: Faulty) -> None:
    for _ in range(3):
        f.drop[f.place(min(0.1, 1 / f.rate))] = True


def repeated(f: Faulty) -> None:
    part = f.place(0.5)
    f.frame["epoch_ms"][part] = f.frame["epoch_ms"][part.start]
    f.named["repeated"] = "repeated time stamp"


def backward(f: Faulty) -> None:
    part = f.place(0.8)
    f.frame["epoch_ms"][part] -= 5000.0
    f.named["backward"] = "run backward"


def stray(f: Faulty) -> None:
    for value in (0.0, 4e12):
        f.frame["epoch_ms"][f.place(1 / f.rate).start] = value
    f.named["stray"] = "stray time stamp"


def unreadable_stamp(f: Faulty) -> None:
    f.frame["epoch_ms"][f.place(1 / f.rate).start] = np.nan
    f.named["unreadable"] = "without a readable time stamp"


def dropout(f: Faulty) -> None:
    for column, seconds in (("phi", 1.0), ("V_a", 6.0), ("r_eb_eN", 0.4), ("rudder_sp", 1.5), ("tether_length", 2.0)):
        f.frame[column][f.place(seconds)] = np.nan
    f.named["missing_cells"] = "missing values"


def zeros(f: Faulty) -> None:
    for column in ("r_eb_eN", "V_a"):
        f.frame[column][f.place(0.6)] = 0.0
    f.named["dropout"] = "jumps to"


def stuck(f: Faulty) -> None:
    for column in ("q", "psi", "LoadFiltered", "tether_length"):
        part = f.place(4.0)
        f.frame[column][part] = f.frame[column][part.start]
    f.named["stuck"] = "stands still"


def saturated(f: Faulty) -> None:
    limit = np.nanpercentile(f.frame["LoadFiltered"], 97)
    f.frame["LoadFiltered"] = np.minimum(f.frame["LoadFiltered"], limit)
    f.named["saturated"] = "is cut off at"


def spikes(f: Faulty) -> None:
    for column, size in (("V_a", 300.0), ("r_eb_eD", 2000.0), ("theta", 150.0), ("LoadFiltered", 9000.0), ("rudder_sp", 900.0)):
        for sign in (1, -1):
            f.frame[column][f.place(1 / f.rate).start] += sign * size
    f.named["spikes"] = "spikes"


def compass(f: Faulty) -> None:
    """Heading from 0 to 360 deg."""
    f.frame["psi"] = np.mod(f.frame["psi"], 360.0)


def without_optional(f: Faulty) -> None:
    for column in ("a_eb_bX", "elevator_sp"):
        del f.frame[column]


def other_order(f: Faulty) -> None:
    names = list(f.rng.permutation(list(f.frame)))
    f.frame = {"camber_sp": np.zeros(f.drop.size), **{str(n): f.frame[str(n)] for n in names}, "battery": np.ones(f.drop.size)}


FAULTS: tuple[Callable[[Faulty], None], ...] = (
    gaps, short_gaps, repeated, backward, stray, unreadable_stamp, dropout, zeros, stuck, saturated, spikes, compass, without_optional,
    other_order,
)  # fmt: skip


def spoil(log: FlightLog, faults, seed: int) -> tuple[pl.DataFrame, str, Faulty]:
    """(table of kite.csv, text of wind.csv, what was done) of a clean log with faults put in."""
    text, wind = to_kitemill_csv(log)
    clean = pl.read_csv(text.encode(), infer_schema_length=None)
    columns = {name: clean[name].to_numpy().astype(float, copy=True) for name in clean.columns}
    faulty = Faulty(columns, 1 / log.dt, np.random.default_rng(seed))
    for fault in faults:
        fault(faulty)
    frame = pl.DataFrame({k: pl.Series(x).fill_nan(None) for k, x in faulty.frame.items()})
    return frame.filter(~faulty.drop), wind, faulty


def hard_to_use(log: FlightLog, label: np.ndarray) -> FlightLog:
    """The same flight with a slack line in the first traction phase and surfaces that do not move in the last, 30 s each."""
    traction = np.flatnonzero(label == "traction")
    length, settled = int(30 / log.dt), int(30 / log.dt)
    slack = slice(traction[0] + settled, traction[0] + settled + length)
    still = slice(traction[-1] - settled - length, traction[-1] - settled)
    measured = {k: x.copy() for k, x in log.measured.items()}
    inputs = {k: x.copy() for k, x in log.inputs.items()}
    measured["tension"][slack] = 10.0 + 0.02 * (measured["tension"][slack] - 2500.0)
    for name in ("aileron", "rudder"):
        inputs[name][still] = 0.05
    return FlightLog(log.name, log.start, log.dt, log.time, measured, inputs, log.valid, log.wind)
