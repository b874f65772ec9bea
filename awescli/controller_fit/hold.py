"""What a quiet flight cannot tell: how the law answers a kite off its circle. Prior knowledge, as samples that were never flown.

States of the flight are displaced as a whole: moved outward along the sphere, or turned about the line, with attitude, velocity and rates
of the body. Asked there is the logged set-point plus what `controller_steering` found the controller to steer by. A
small weight leaves the fit to the data where they speak; which weight is needed is decided by flying (controller_fit: fly). Every class of
law takes these rows, since they are samples like any others.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from awescli.control.pattern import Pattern
from awescli.controller_fit.centres import thin
from awescli.controller_fit.problem import Problem, fit_on_everything
from awescli.controller_fit.ridge import affine_design
from awescli.controller_fit.samples import Samples, feature_matrix, samples_at
from awescli.controller_fit.steering import Steering

POINTS = 100
DISPLACED = ((0.15, 0.0), (-0.15, 0.0), (0.0, 0.3), (0.0, -0.3), (0.3, -0.3), (-0.3, 0.3))
"""(outward [radii], course [rad]): several times what a calm flight shows (1-2 % of a radius, 0.05 rad)."""


@dataclass(frozen=True)
class Hold:
    """X: (K, F) standardised features of displaced states; U: (K, S) what is asked there [rad]; strength: their weight, 1 = the log's."""

    X: np.ndarray
    U: np.ndarray
    strength: float

    def rows(self, regressors: Callable, samples: int) -> tuple[np.ndarray, np.ndarray] | None:
        """(A, u) to be stacked under a regression of `samples` rows; None where nothing is asked. regressors: X -> A."""
        if not self.X.size or self.strength <= 0:
            return None
        weight = self.strength * np.sqrt(samples / self.X.shape[0])
        return weight * regressors(self.X), weight * self.U


def no_hold(problem: Problem) -> Hold:
    """Nothing is asked."""
    return Hold(np.empty((0, len(problem.features))), np.empty((0, problem.U.shape[1])), 0.0)


def steering_hold(samples: Samples, problem: Problem, steering: Steering, strength: float) -> Hold:
    """The hold of a law on problem.features; none where no surface steers."""
    steers = np.isfinite(steering.course)
    if strength <= 0 or not steers.any():
        return no_hold(problem)
    rows = thin(problem.train, POINTS)
    z, U, pattern = samples_at(samples.smoothed, rows), problem.U[rows], steering.pattern
    affine = fit_on_everything(problem, affine_design, 1e-4, problem.rows)[0]
    X, asked = [], []
    for outward, course in DISPLACED:
        moved = displaced(z, pattern, outward * pattern.radius, course)
        X.append(feature_matrix(moved, problem.features, pattern, problem.centre, problem.scale))
        change = steering.course * course + steering.radius * outward * pattern.radius
        # a surface that does not steer goes on as the affine law says: it is not to bend where nothing is flown
        asked.append(U + np.where(steers, change, (X[-1] - problem.X[rows]) @ affine[1:]))
    return Hold(np.concatenate(X), np.concatenate(asked), strength)


def displaced(z: dict, pattern: Pattern, outward: float, course: float) -> dict:
    """z with the kite moved by `outward` [m] along the sphere away from the circle's centre, and turned by `course` [rad] about the line
    (outward positive). All in the kite's own axes (u, v, w, p, q, r) is as it was."""
    P = np.stack([z["p_n"], z["p_e"], z["p_d"]], axis=1)
    length = np.linalg.norm(P, axis=1, keepdims=True)
    s_e, c_e, s_a, c_a = np.sin(pattern.elevation), np.cos(pattern.elevation), np.sin(pattern.azimuth), np.cos(pattern.azimuth)
    axis = np.cross([c_e * c_a, c_e * s_a, -s_e], P)
    axis /= np.linalg.norm(axis, axis=1, keepdims=True)
    carried = Rotation.from_rotvec(axis * outward / length)
    line = carried.apply(P) / length
    turned = Rotation.from_rotvec(-pattern.turn * course * line) * carried
    attitude = turned * Rotation.from_euler("ZYX", np.stack([z["psi"], z["theta"], z["phi"]], axis=1))
    psi, theta, phi = attitude.as_euler("ZYX").T
    return z | dict(zip(("p_n", "p_e", "p_d"), (length * line).T, strict=True)) | {"phi": phi, "theta": theta, "psi": psi}
