"""What a quiet flight cannot tell: how the law answers a kite off its circle. Prior knowledge of the two slopes, as rows of the regression.

Along an undisturbed flight radius and course error are nearly functions of phase, speed and rates, so that laws of the same misfit differ
in everything that holds the kite on the circle; fitted freely they predict the rudder to 0.8 % of its range and lose the kite within
seconds. The remedy stays convex: at sampled states the slopes du/d(course error) and du/d(radius error) are asked to be those of a kite
that steers for its circle, with a strength that is chosen by flying (see controller_fit: fly).
"""

from dataclasses import dataclass

import numpy as np

from awescli.control.gaussian_law import design_slope
from awescli.estimation.controller_centres import thin
from awescli.estimation.controller_linear import affine_design
from awescli.estimation.controller_problem import Problem, fit_on_everything

POINTS = 150


@dataclass(frozen=True)
class Hold:
    """slopes: feature number -> (S,) wanted slope [rad per standard deviation]; strength: 1 weighs one slope like one sample."""

    slopes: dict[int, np.ndarray]
    strength: float

    def rows(self, problem: Problem, centres: np.ndarray, width: float, samples: int) -> tuple[np.ndarray, np.ndarray] | None:
        """(A, u) to be stacked under a regression of `samples` rows; None where nothing is asked."""
        if not self.slopes or self.strength <= 0:
            return None
        X = problem.X[thin(problem.everything, POINTS)]
        weight = self.strength * np.sqrt(samples / X.shape[0])
        A = np.concatenate([design_slope(X, centres, width, j) for j in self.slopes])
        u = np.concatenate([np.broadcast_to(g, (X.shape[0], g.size)) for g in self.slopes.values()])
        return weight * A, weight * u


def steering_hold(problem: Problem, radius: float, strength: float) -> Hold:
    """The slopes of a kite that steers for a point one loop radius ahead on its circle.

    Course: the slope of the affine law on the same features, which averages over the flight and keeps its sign. Radius: the course
    slope over the look-ahead distance; one radius of the loop is the longest look-ahead that still points at the circle.
    """
    names = problem.features
    if "course_error" not in names or "radius_error" not in names:
        return Hold({}, strength)
    course, offset = names.index("course_error"), names.index("radius_error")
    slope = fit_on_everything(problem, affine_design, 1e-4, problem.rows)[0][1 + course]
    per_rad = slope / problem.scale[course]
    return Hold({course: slope, offset: per_rad / radius * problem.scale[offset]}, strength)
