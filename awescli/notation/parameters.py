"""Parameter: name, value, bounds, unit, free, source; and the table of them that a model is made of.

Estimators see only the vector of the free rows; physics sees only name -> number.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from awescli.notation.errors import BadInput, did_you_mean


@dataclass(frozen=True)
class Parameter:
    """One number of a model.

    name: unique in its table; value, lower, upper in `unit` (SI, radians inside); free: may an estimator move it;
    std: prior standard deviation where one is known (None: a quarter of the bounded range, see `prior_std`); relative: guesses of it err by
    a share, so that its prior is normal in the logarithm, std / value wide: its sign is known, and twice is as far off as half.
    """

    name: str
    value: float
    unit: str = "-"
    lower: float = -np.inf
    upper: float = np.inf
    free: bool = False
    source: str = ""
    std: float | None = None
    relative: bool = False

    def __post_init__(self) -> None:
        if not self.lower <= self.value <= self.upper:
            raise BadInput(
                f"value {self.value:g} of '{self.name}' is outside its bounds [{self.lower:g}, {self.upper:g}]",
                do="Move the value inside the bounds, or widen them.",
            )

    @property
    def prior_std(self) -> float:
        """Prior standard deviation: stated, or a quarter of the bounded range, or 30 % of the value."""
        if self.std is not None:
            return self.std
        if np.isfinite(self.upper - self.lower) and self.upper > self.lower:
            return (self.upper - self.lower) / 4
        return 0.3 * abs(self.value) or 1.0


class ParameterTable(Mapping[str, Parameter]):
    """An ordered, immutable table of parameters, name -> Parameter."""

    def __init__(self, rows: Iterable[Parameter]):
        self._rows: dict[str, Parameter] = {}
        for row in rows:
            if row.name in self._rows:
                raise BadInput(f"parameter '{row.name}' is declared twice", do="Keep one of the two rows.")
            self._rows[row.name] = row

    def __getitem__(self, name: str) -> Parameter:
        if name not in self._rows:
            raise BadInput(f"unknown parameter '{name}'", do=did_you_mean(name, self._rows))
        return self._rows[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._rows)

    def __len__(self) -> int:
        return len(self._rows)

    def __contains__(self, name: object) -> bool:
        return name in self._rows

    @property
    def rows(self) -> tuple[Parameter, ...]:
        return tuple(self._rows.values())

    @property
    def free(self) -> tuple[str, ...]:
        """Names of the parameters an estimator may move, in table order."""
        return tuple(p.name for p in self.rows if p.free)

    def vector(self, names: Iterable[str] | None = None) -> np.ndarray:
        """Values of `names` (default: all rows), shape (n,)."""
        return np.array([self[n].value for n in (self if names is None else names)], dtype=float)

    def deviations(self, names: Sequence[str], x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(How far values x (n,) of `names` are from these rows' in prior standard deviations, the slope of that), each (n,)."""
        rows = [self[n] for n in names]
        value, std, relative = (np.array([getattr(p, what) for p in rows]) for what in ("value", "prior_std", "relative"))
        share = np.where(relative, x, 1.0) / np.where(relative, value, 1.0)
        return np.where(relative, value * np.log(share), x - value) / std, 1 / (std * share)

    def with_values(self, values: Mapping[str, float]) -> "ParameterTable":
        """The same table with new values for some rows."""
        for name in values:
            self[name]
        return ParameterTable(replace(p, value=float(values.get(p.name, p.value))) for p in self.rows)

    def with_rows(self, rows: Iterable[Parameter]) -> "ParameterTable":
        """The table with `rows` replaced where the name exists and appended where it does not."""
        new = {r.name: r for r in rows}
        kept = [new.pop(p.name, p) for p in self.rows]
        return ParameterTable([*kept, *new.values()])
