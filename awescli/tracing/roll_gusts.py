"""Roll gusts: does what is left in gusty air look like a gradient of the vertical gust along the span?

Feedback hides them. A controller answers the roll that a gust makes, so that a model without roll gusts sees surfaces that move and a kite
that does not follow: the fit takes the derivatives of roll and of its surfaces for small. With roll gusts as nuisance beside those of the
wind they come back.
"""

from dataclasses import dataclass, replace

import numpy as np

from awescli.estimation.fit import fit, likeliest_gusts
from awescli.estimation.nuisance_wind import SETTLED_WINDOW, Gusts
from awescli.estimation.simulation_error import SimulationError, with_gust_noise
from awescli.simulation.gusts import roll_corner
from awescli.simulation.rollout import Simulator
from awescli.simulation.segments import Observed
from awescli.tracing.race import Contest, Runner, run
from awescli.tracing.trace import DECISIVE

ROUNDS = 2
"""How often model and level are fitted in turn."""
LEAST = 0.2
"""Roll gusts of less than this share of the specification's level are none."""


@dataclass(frozen=True)
class RollGusts:
    """Roll gusts that were found. plain, gusts: without and with them, alike in all else; before, after: the models fitted without and with
    them."""

    gusts: Gusts
    plain: Gusts
    before: Runner
    after: Runner

    @property
    def level(self) -> float:
        """[rad/s] standard deviation."""
        return float(self.gusts.stds[3])

    @property
    def memory(self) -> float:
        """[s] over which they last."""
        return 1 / roll_corner(self.gusts.airspeed, self.gusts.span)

    def on(self, simulator: Simulator, observed: Observed) -> dict:
        """What roll gusts are worth on segments that took no part; only their starts and gusts are fitted. chi2: -2 log likelihood over the
        degrees of freedom (a constant that no gusts change left out); channels: squared residual over that of the noise."""
        told: dict = {"chi2": {}, "channels": {name: {} for name in observed.outputs}}
        heard = with_gust_noise(simulator.holding(self.before.table), observed, self.plain)
        for which, runner, gusts in (("before", self.before, self.plain), ("after", self.after, self.gusts)):
            holding = simulator.holding(runner.table)
            judged = fit(holding, heard, runner.table, (), gusts=gusts, prior=False, iterations=6, tolerance=1.0)
            evidence = judged.information.deviance - _prior_volume(gusts, observed)
            told["chi2"][which] = float(evidence.sum() / judged.information.dof.sum())
            error = SimulationError(holding, heard, (), gusts)
            r = heard.residual(holding.rollout(error.segments(judged.own)))
            for name, level in zip(observed.outputs, np.nanmean(r * r, axis=(0, 1)), strict=True):
                told["channels"][name][which] = float(level)
        return told


def roll_gusts(contest: Contest, null: Runner) -> RollGusts | None:
    """Fit the model with and without roll gusts; None where they gain nothing on the choice segments, or hardly exist."""
    plain = replace(contest.gusts, window=SETTLED_WINDOW)
    begin = {"start": null.fit, "judged": null.judged} if contest.gusts.window == SETTLED_WINDOW else {}
    before = run(_in_air(contest, null, plain), null.table, (), null.names, **begin)
    gusts = replace(plain, roll=1.0)
    for _ in range(ROUNDS):
        here = _in_air(contest, null, gusts)
        after = run(here, null.table, (), null.names)
        # the level alone: with other lengths the gusts that move the kite would no longer be those of the model without
        level = likeliest_gusts(here.fitted, after.fit, gusts).stds[3]
        gusts = replace(gusts, roll=float(gusts.roll * level / gusts.stds[3]))
        if gusts.roll < LEAST:
            return None
    after = run(_in_air(contest, null, gusts), after.table, (), null.names, start=after.fit, judged=after.judged)
    without, with_them = (r.choice_deviance - _prior_volume(g, contest.choice) for r, g in ((before, plain), (after, gusts)))
    fall = without - with_them
    if fall.sum() < DECISIVE or (fall > 0).mean() <= 0.5:
        return None
    return RollGusts(gusts, plain, before, after)


def _in_air(contest: Contest, null: Runner, gusts: Gusts) -> Contest:
    """The contest with other gusts, and the noise that these leave between their nodes."""
    simulator = contest.simulator.holding(null.table)
    fitted, choice = (with_gust_noise(simulator, o, gusts) for o in (contest.fitted, contest.choice))
    return replace(contest, gusts=gusts, fitted=fitted, choice=choice)


def _prior_volume(gusts: Gusts, observed: Observed) -> float:
    """Log determinant of the prior precision of a segment's gusts, which makes deviances under different gusts comparable."""
    return float(np.linalg.slogdet(gusts.precision(observed.segments.steps, observed.segments.dt))[1])
