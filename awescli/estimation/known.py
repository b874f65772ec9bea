"""What is known of a model beside its values: how well its parameters are, what is random beside them, how noisy the sensors are."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from awescli.estimation.processes.base import Process
from awescli.physics.flight_model import FlightModel

AT_END = 1 - 1e-6
"""Share of its range from which an error of the record stands at the end of it."""


@dataclass(frozen=True)
class Known:
    """What is known of a model beside its values. names: of parameters and of errors of the wind record; covariance (n, n); record (n,)
    bool, which of them are the record's; found (n,): by how much they are believed to differ from what is predicted with (the fitted
    error of the record; kite files leave it out). processes: what is random in time, with its levels; factors: channel -> factor on the
    declared noise. accuracy (n,): of the record as it was declared, one standard deviation; zero for parameters."""

    names: tuple[str, ...]
    covariance: np.ndarray
    record: np.ndarray
    found: np.ndarray
    processes: tuple[Process, ...] = ()
    factors: Mapping[str, float] = field(default_factory=dict)
    accuracy: np.ndarray = field(default_factory=lambda: np.zeros(1))

    @classmethod
    def declared(cls, kite: FlightModel) -> "Known":
        """Of a kite that nothing was fitted to: the stated prior deviations."""
        names = (*kite.parameters.free, *kite.record)
        std, record = np.array([kite.parameters[n].prior_std for n in names]), np.isin(names, kite.record)
        return cls(names, np.diag(std**2), record, np.zeros(len(names)), accuracy=np.where(record, std, 0.0))

    @classmethod
    def fitted(cls, params: Mapping, kite: FlightModel) -> "Known":
        """Of what a fit left in params.json; what the kite does not have (of another flight) is left out. An error of the record at the end
        of its range is none (`physics.kite.record_errors`): it stands for what the model lacks, and is not believed."""
        rows = params["parameters"] | params["wind_record_error"]
        correlation = params["correlation"]
        kept = [i for i, n in enumerate(correlation["names"]) if n in kite.parameter_names and n in rows]
        names = tuple(correlation["names"][i] for i in kept)
        std = np.array([rows[n]["std"] for n in names])
        record = np.isin(names, kite.record)
        believed = [n in kite.record and abs(rows[n]["value"]) < AT_END * kite.parameters[n].upper for n in names]
        found = np.array([rows[n]["value"] if b else 0.0 for n, b in zip(names, believed, strict=True)])
        covariance = np.array(correlation["matrix"])[np.ix_(kept, kept)] * np.outer(std, std)
        return cls(names, covariance, record, found, accuracy=np.array([kite.parameters[n].prior_std for n in names]) * record)

    def draws(self, kite: FlightModel, count: int, seed: int, of: np.ndarray | None = None) -> list[dict[str, float]]:
        """`count` kites that might be this one: parameter -> value, from a normal distribution about the kite's own and what was found,
        kept within bounds. of: (n,) which of the names; default those of the kite: the record's errors are of one flight."""
        of = np.flatnonzero(~self.record if of is None else of)
        rows = [kite.parameters[self.names[i]] for i in of]
        random, centre = np.random.default_rng(seed), np.array([p.value for p in rows]) + self.found[of]
        lower, upper = (np.array([getattr(p, end) for p in rows]) for end in ("lower", "upper"))
        covariance = self.covariance[np.ix_(of, of)]
        std = np.maximum(np.sqrt(np.diag(covariance)), np.finfo(float).tiny)
        # in units of the deviations, for parameters differ by ten powers of ten; what rounding makes negative is nothing
        size, axes = np.linalg.eigh(covariance / np.outer(std, std))
        drawn = centre + (random.standard_normal((count, len(of))) * np.sqrt(np.maximum(size, 0.0))) @ axes.T * std
        return [{p.name: float(v) for p, v in zip(rows, np.clip(x, lower, upper), strict=True)} for x in drawn]

    def variances(self, J: np.ndarray) -> dict[str, float]:
        """Of a quantity with sensitivities J (n,): all together, of the parameters and of the record alone."""
        parts = {"together": np.ones(len(J), bool), "parameters": ~self.record, "wind": self.record}
        return {part: max(float((J * of) @ self.covariance @ (J * of)), 0.0) for part, of in parts.items()}

    def room(self, J: np.ndarray) -> float:
        """Variance of such a quantity by parameters as they are known and the record as it was declared."""
        return self.variances(J)["parameters"] + float(((J * self.accuracy) ** 2).sum())
