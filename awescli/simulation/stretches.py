"""A flight in stretches: the compiled loop over time, stopped at samples and gone on with, and short flights between two samples."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from awescli.engine.lanes import abreast, lane_rows
from awescli.simulation import kernels
from awescli.simulation.stepping import Stepping

Sizes = tuple[int, int, int, int]
"""n_s, n_sp, n_u, n_y"""


def beside_lanes(a: np.ndarray) -> np.ndarray:
    """(..., LANES), the same in all lanes."""
    return abreast(np.ascontiguousarray(a[None], dtype=float))


class Stretch:
    """The loop of a rollout, some samples at a time: `work` holds the state between them. All lanes fly the same.

    x0 (n_s,): start of the flight; programs: addresses of f, g, initial; h: [s] between samples.
    """

    def __init__(self, x0: np.ndarray, programs: tuple, sizes: Sizes, h: float, stepping: Stepping, more_rows: int = 0):
        n_s, n_sp, n_u, n_y = sizes
        self.work = lane_rows(kernels.rows_of_loop(n_s + n_sp, n_s, n_u, n_y) + more_rows)
        self.x0, self.programs, self.sizes, self.h, self.stepping = beside_lanes(x0), programs, sizes, h, stepping

    def begin_at(self, x: np.ndarray) -> None:
        """The next stretch begins at the state x (n_x,)."""
        self.work[: len(x)] = x[:, None]

    def fly(
        self, law: int, c: np.ndarray, first: int, until: int, setpoints: np.ndarray, inputs: np.ndarray, X: np.ndarray, Y: np.ndarray
    ) -> int:
        """Fill samples first..until-1 of X and Y; returns the first sample that diverged, or how many there are."""
        samples, before = len(setpoints), max(first - 1, 0)  # a loop that begins at sample 0 begins from the start
        here = slice(before, min(until + 1, samples))
        count, places = here.stop - here.start, slice(first - before, until - before)
        sent = (beside_lanes(a[here]) for a in (setpoints, inputs))
        states, outputs, alive = self._run(law, c, samples - before, places, *sent, count=count)
        X[first:until], Y[first:until] = states[places, :, 0], outputs[places, :, 0]
        return samples if alive == count else before + alive

    def _run(
        self, law: int, c: np.ndarray, samples: int, places: slice, setpoints: np.ndarray, inputs: np.ndarray, count: int
    ) -> tuple[np.ndarray, np.ndarray, int]:
        n_s, n_sp, _, n_y = self.sizes
        states, outputs, alive = lane_rows(count, n_s + n_sp), lane_rows(count, n_y), np.full(kernels.LANES, count)
        sizes = (*self.sizes, samples, self.stepping.substeps, self.h, self.stepping.first, self.stepping.onward)
        arrays = (self.x0, setpoints, inputs, c, states, outputs, alive, self.work)
        kernels.rollout_loop()(*kernels.passed(*self.programs, law, *sizes, places.start, places.stop, *arrays))
        return states, outputs, int(alive[0])


@dataclass(frozen=True)
class Leg:
    """From one sample to the next: the state (n_x,) there, held set-points in it, and the inputs (n_u,) at both ends."""

    x: np.ndarray
    u: np.ndarray
    u_after: np.ndarray

    def inputs_at(self, share: float) -> np.ndarray:
        """(n_u,) on the way."""
        return self.u + share * (self.u_after - self.u)


@dataclass(frozen=True)
class Side:
    """What flies on one side of a switch. law: address of its program, or 0; c (n_c, LANES): parameters; reset: of the state (n_s,)."""

    law: int
    c: np.ndarray
    reset: Callable[[np.ndarray], np.ndarray]


@dataclass(frozen=True)
class BetweenSamples:
    """Flights that begin and end between two samples h [s] apart, set-points held."""

    programs: tuple
    sizes: Sizes
    h: float
    stepping: Stepping

    def flown(self, x: np.ndarray, u: tuple[np.ndarray, np.ndarray], seconds: float, c: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(state (n_x,), outputs (n_y,)) after some seconds from the state x, inputs running from u[0] to u[1]; c (n_c, LANES)."""
        n_s, n_sp, _, n_y = self.sizes
        stretch = Stretch(x[:n_s], self.programs, self.sizes, seconds, self.stepping)
        stretch.begin_at(x)
        X, Y = np.empty((3, n_s + n_sp)), np.empty((3, n_y))
        # the sample before the first is there because a loop that begins at sample 0 begins from the start of the flight
        stretch.fly(0, c, 1, 3, np.repeat(x[None, n_s:], 3, axis=0), np.stack([u[0], u[0], u[1]]), X, Y)
        return X[2], Y[2]

    def passed(self, leg: Leg, c: np.ndarray, beyond: Callable[[np.ndarray, np.ndarray, np.ndarray, float], float]) -> float:
        """Share of the way at which beyond(state, outputs, inputs, share) comes to zero; it is below zero where the leg begins."""
        from scipy.optimize import root_scalar

        def at(share: float) -> float:
            u = leg.inputs_at(share)
            x, y = self.flown(leg.x, (leg.u, u), share * self.h, c) if share > 0 else (leg.x, self.outputs(leg.x, leg.u, c))
            return beyond(x, y, u, share)

        begins, ends = at(0.0), at(1.0)
        if not begins < 0 < ends:
            return 1.0
        return float(root_scalar(at, bracket=(0.0, 1.0), method="brentq", xtol=1e-14, rtol=1e-14).root)

    def outputs(self, x: np.ndarray, u: np.ndarray, c: np.ndarray) -> np.ndarray:
        """(n_y,) at a state."""
        return self.flown(x, (u, u), 0.0, c)[1]

    def set_points(self, law: int, x: np.ndarray, u: np.ndarray, c: np.ndarray) -> np.ndarray:
        """(n_sp,) what a law says at a state; without one what is held there."""
        n_s, n_sp, _, n_y = self.sizes
        stretch = Stretch(x[:n_s], self.programs, self.sizes, 0.0, self.stepping)
        stretch.begin_at(x)
        X, Y = np.empty((2, n_s + n_sp)), np.empty((2, n_y))
        stretch.fly(law, c, 1, 2, np.repeat(x[None, n_s:], 2, axis=0), np.stack([u, u]), X, Y)
        return X[1, n_s:]

    def begun(self, x: np.ndarray, u: np.ndarray, old: Side, new: Side) -> np.ndarray:
        """(n_x,) the state with which a phase takes over from the state x: reset, and set-points moved by what the laws differ in."""
        n_s = self.sizes[0]
        reset = new.reset(x[:n_s])
        said = (self.set_points(side.law, at, u, side.c) for side, at in ((old, x), (new, np.concatenate([reset, x[n_s:]]))))
        before, after = said
        return np.concatenate([reset, x[n_s:] + (after - before)])

    def switched(self, leg: Leg, share: float, old: Side, new: Side, after: np.ndarray) -> np.ndarray:
        """(n_x,) state at the end of the leg: `after`, that of the old phase, and by how much the new one differs from it since `share` of
        the way. Phases that are alike leave every bit."""
        u, left = leg.inputs_at(share), (1 - share) * self.h
        here, _ = self.flown(leg.x, (leg.u, u), share * self.h, old.c)
        ends = (self.flown(x, (u, leg.u_after), left, c)[0] for x, c in ((here, old.c), (self.begun(here, u, old, new), new.c)))
        flown_old, flown_new = ends
        return after + (flown_new - flown_old)
