"""What flights bring to a fit, and what it found about them."""

from dataclasses import dataclass, replace

import numpy as np

from awescli.estimation.gauss_newton import Solution
from awescli.estimation.information_filter import Information
from awescli.estimation.links import Gram
from awescli.estimation.misfit import DIVERGED_COST, Misfit, NuisanceValues
from awescli.notation.constraints import LinearConstraint
from awescli.notation.parameters import ParameterTable

UNFINISHED = 1e-3
"""Share of the cost (chi-square) that a fit may leave to another step and yet count as ended: a kink, as a dead band has one, stops it."""


@dataclass(frozen=True)
class Share:
    """What one flight brings to a fit.

    misfit: its simulator holds the values of all parameters that are not fitted, its names are the fitted ones; parameters, prior: tables
    to start from and to be weighed against; unknowns: what the names are called in the fit: two flights share a parameter where their
    names for it are the same; own: nuisances to begin from; slope: (n,) of the log determinant, of a fit before, kept as long as this one
    stays near it.
    """

    misfit: Misfit
    parameters: ParameterTable
    prior: ParameterTable
    unknowns: tuple[str, ...]
    own: NuisanceValues | None = None
    slope: np.ndarray | None = None

    @property
    def names(self) -> tuple[str, ...]:
        return self.misfit.names

    def table(self, rows: ParameterTable) -> ParameterTable:
        """The fitted rows of `rows` (this flight's names) under their names in the fit."""
        return ParameterTable(replace(rows[n], name=u) for n, u in zip(self.names, self.unknowns, strict=True))

    def constraints(self) -> tuple[LinearConstraint, ...]:
        """The kite's constraints in the names of the fit."""
        renamed = dict(zip(self.names, self.unknowns, strict=True))
        return tuple(c.renamed(renamed) for c in self.misfit.simulator.kite.constraints)


@dataclass(frozen=True)
class Fit:
    """What a fit found about one flight.

    parameters: all rows, new values for the fitted ones; misfit, own: of the segments, at the solution; solution: of all flights; gram,
    information: there, in the order of the misfit's names; counted: indices of the segments that do; alive: (K,) samples before a segment
    diverged; covariance: (n, n) of the fitted parameters, prior included; chi2: squared whitened residual per degree of freedom;
    slope: (n,) what the log determinant of the nuisances added to the gradient there.
    """

    parameters: ParameterTable
    misfit: Misfit
    own: NuisanceValues
    solution: Solution
    gram: Gram
    information: Information
    counted: np.ndarray
    alive: np.ndarray
    covariance: np.ndarray
    chi2: float
    slope: np.ndarray

    @property
    def names(self) -> tuple[str, ...]:
        return self.misfit.names

    @property
    def flies(self) -> np.ndarray:
        """(K,) which segments did not diverge."""
        return self.alive > self.misfit.observed.segments.steps

    @property
    def deviance(self) -> float:
        """-2 log likelihood of the segments that counted, parameters held, nuisances integrated out; that of a segment that diverged is its
        price."""
        return deviance_of(self.misfit, self.information, self.counted, self.flies)


@dataclass(frozen=True)
class JointFit:
    """What a fit found from one or several flights.

    names: all unknowns; parameters, prior: tables that hold them (and the first flight's other rows); covariance: (n, n); chi2: of all
    segments; constraints: in the names of the fit; places: per flight, where its names stand among the unknowns.
    """

    names: tuple[str, ...]
    parameters: ParameterTable
    prior: ParameterTable
    solution: Solution
    covariance: np.ndarray
    chi2: float
    constraints: tuple[LinearConstraint, ...]
    flights: tuple[Fit, ...]
    places: tuple[np.ndarray, ...]

    @property
    def still_to_gain(self) -> float:
        """Share of the cost that another step would promise."""
        return float(self.solution.kkt / max(self.solution.cost, 1e-300))

    @property
    def ended(self) -> bool:
        """Did the fit come to its minimum, or next to it?"""
        return self.still_to_gain <= UNFINISHED

    @property
    def deviance(self) -> float:
        """Of all flights, see `Fit.deviance`."""
        return sum(f.deviance for f in self.flights)

    @property
    def known(self) -> np.ndarray:
        """(n, n) information of all segments on the unknowns, without the prior."""
        lifted = [_lifted(f.information.H, place, len(self.names)) for f, place in zip(self.flights, self.places, strict=True)]
        return np.sum(lifted, axis=0)

    def with_covariance(self, covariance: np.ndarray) -> "JointFit":
        """The same fit with another covariance (n, n), the flights' own included."""
        flights = tuple(replace(f, covariance=covariance[np.ix_(place, place)]) for f, place in zip(self.flights, self.places, strict=True))
        return replace(self, covariance=covariance, flights=flights)


def deviance_of(misfit: Misfit, information: Information, counted: np.ndarray, flies: np.ndarray) -> float:
    """-2 log likelihood of one flight, as of `Fit.deviance`."""
    lost = DIVERGED_COST * misfit.observed.measured[0].size * np.count_nonzero(~flies)
    return float(information.deviance[counted].sum() + misfit.log_noise[counted].sum()) + lost


def _lifted(a: np.ndarray, place: np.ndarray, n: int) -> np.ndarray:
    """E'a E: a flight's information among all n unknowns, E the selection of its own ones."""
    whole = np.zeros((n,) * a.ndim)
    whole[np.ix_(*[place] * a.ndim)] = a
    return whole
