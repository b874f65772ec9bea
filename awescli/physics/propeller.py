"""A declared propeller: coefficients over the advance ratio, where it sits, which way it turns, and what makes it turn.

T = C_T(J) rho n^2 D^4, P = C_P(J) rho n^3 D^5, J = V / (n D), n in revolutions per second (Beard & McLain, Small Unmanned Aircraft,
ch. 4.3; the form of the UIUC propeller data base, Brandt & Selig 2011). V is the air's speed along the axis.
"""

from typing import Annotated, Literal, Self

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, model_validator

DEGREE = 4
"""Of the polynomial through a table: UIUC's tables of small propellers lie within 1 % of one."""
MISFIT = 0.03
"""Share of the largest coefficient by which a table may miss its polynomial (root mean square)."""
FASTEST_ADVANCE = 5.0
"""Advance ratio up to which C_P is searched for its zero: no propeller has such a pitch."""

Moderate = Annotated[float, Field(ge=-1e3, le=1e3)]
"""A coefficient, an advance ratio, a length [m]: beyond, a polynomial through it is no number to compute with."""


class _Frozen(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)


class SpeedLaw(_Frozen):
    """What makes the propeller turn.

    power: the speed at which the propeller takes the shaft power that the throttle gives (steady balance; what lags is the throttle:
    `actuator_lag:throttle`); proportional: throttle times `full`; recorded: the log's motor_speed.
    """

    law: Literal["power", "proportional", "recorded"] = Field("power", description="which of the three")
    shaft_power: tuple[Annotated[float, Field(ge=-1e9, le=1e9)], ...] = Field(
        (), max_length=100, description="law power: polynomial in the throttle, lowest power first [W]"
    )
    full: float | None = Field(None, gt=0, le=1e5, description="law proportional: revolutions per second at full throttle [1/s]")

    @model_validator(mode="after")
    def _complete(self) -> Self:
        if self.law == "power" and not self.shaft_power:
            raise ValueError("law power needs `shaft_power: [W, W, ...]`, a polynomial in the throttle")
        if self.law == "proportional" and self.full is None:
            raise ValueError("law proportional needs `full`, the revolutions per second at full throttle")
        return self


Coefficient = Annotated[tuple[Moderate, ...] | tuple[tuple[Moderate, Moderate], ...], Field(max_length=1000)]


class Propeller(_Frozen):
    """One propeller of a kite file's list `propellers`."""

    diameter: float = Field(gt=0, le=1e3, description="[m]")
    hub: tuple[Moderate, Moderate, Moderate] = Field(description="from the reference point, body axes [m]")
    axis: tuple[Moderate, Moderate, Moderate] = Field((1.0, 0.0, 0.0), description="direction of the thrust, body axes; any length")
    turns: Literal["clockwise", "counterclockwise"] = Field("clockwise", description="seen from behind")
    CT: Coefficient = Field(description="thrust coefficient: polynomial in J, lowest power first, or a table [[J, CT], ...]")
    CP: Coefficient = Field(description="power coefficient, likewise")
    windmill: float | None = Field(None, gt=0, le=1e3, description="advance ratio at which it turns freely; default: where CP is zero")
    speed: SpeedLaw = Field(description="what makes it turn")
    inertia: float = Field(0.0, ge=0, le=1e6, description="of all that turns with it [kg m2]")
    source: str = Field("", description="where its numbers come from")

    @model_validator(mode="after")
    def _sensible(self) -> Self:
        if not any(self.axis):
            raise ValueError("the axis has no direction")
        if not np.isfinite(self.thrust_polynomial).all() or self.power_polynomial[0] <= 0:
            raise ValueError("CP at J = 0 must be positive: a propeller that stands still in the air takes power to turn")
        if self.windmill is None and not np.isfinite(self.free_advance):
            raise ValueError("CP has no zero: give `windmill`, the advance ratio at which the propeller turns freely")
        return self

    @property
    def direction(self) -> tuple[float, float, float]:
        """Unit vector of the thrust."""
        x, y, z = np.array(self.axis) / np.linalg.norm(self.axis)
        return float(x), float(y), float(z)

    @property
    def sense(self) -> float:
        """+1: it turns about the axis of thrust by the right-hand rule, which is clockwise seen from behind."""
        return 1.0 if self.turns == "clockwise" else -1.0

    @property
    def thrust_polynomial(self) -> tuple[float, ...]:
        """C_T(J), lowest power first."""
        return _polynomial(self.CT, "CT")

    @property
    def power_polynomial(self) -> tuple[float, ...]:
        """C_P(J), lowest power first."""
        return _polynomial(self.CP, "CP")

    @property
    def free_advance(self) -> float:
        """Advance ratio at which it turns freely: beyond it the air drives the propeller, which then keeps it. inf where CP has no zero."""
        if self.windmill is not None:
            return self.windmill
        roots = np.polynomial.polynomial.polyroots(self.power_polynomial)
        real = roots[np.abs(roots.imag) < 1e-9].real
        inside = real[(real > 1e-6) & (real < FASTEST_ADVANCE)]
        return float(inside.min()) if inside.size else float("inf")


def _polynomial(coefficient: Coefficient, name: str) -> tuple[float, ...]:
    """The declared polynomial, or that which lies nearest to the declared table."""
    if not coefficient:
        raise ValueError(f"{name} is empty")
    polynomial = tuple(c for c in coefficient if not isinstance(c, tuple))
    if polynomial:
        return polynomial
    J, values = np.array(coefficient).T
    fit = np.polynomial.polynomial.polyfit(J, values, min(DEGREE, len(J) - 1))
    misfit = float(np.sqrt(np.mean((np.polynomial.polynomial.polyval(J, fit) - values) ** 2)))
    if misfit > MISFIT * np.abs(values).max():
        raise ValueError(f"the table {name} is not smooth: a polynomial of degree {DEGREE} misses it by {misfit:.2g}")
    return tuple(float(c) for c in fit)
