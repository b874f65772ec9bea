"""From a log and a kite to a question: compile the model, cut the segments, settle weights and nuisance wind."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from awescli.estimation.gust_level import gust_level
from awescli.estimation.nuisance_wind import Gusts, RecordError
from awescli.estimation.simulation_error import with_gust_noise
from awescli.flightlog.split import Split, segments
from awescli.notation.errors import BadInput
from awescli.notation.parameters import ParameterTable
from awescli.physics.declaration import KiteDeclaration
from awescli.physics.disturbances import GUSTS, ROLL_GUST, both
from awescli.physics.kite import Kite
from awescli.simulation.rollout import Simulator
from awescli.simulation.segments import Observed, observe

GUSTY = 0.15
"""[m/s] above this the pitot says that the air was not calm: gusts are estimated in windows."""
GUSTY_TOLERANCE = 0.5
"""[chi-square] what a fit in gusty air need not gain any more: what integrating gusts out adds is known to no better."""
CALM_WINDOW = 1.25
"""[s] between the nodes of the recorded wind's own error in calm air: along a loop the kite passes heights at which stations erred
differently, which one constant per segment cannot follow."""
GUST_WINDOW = 0.5
"""[s] between the nodes of a gust at first: enough to find the parameters' neighbourhood, too few to stand in for what a poor guess gets
wrong. A fit settles them closer, see `fit.settled`."""


@dataclass(frozen=True)
class Question:
    """A flight cut up for one model: what to fit to, what to choose on, the nuisance wind, how gusty it was.

    simulator holds the kite with all parameters; names: the free ones; prior: their table as declared; seed_weights: as in `ask`.
    """

    simulator: Simulator
    kite: Kite
    fitted: Observed
    choice: Observed
    gusts: RecordError
    gust: float
    names: tuple[str, ...]
    prior: ParameterTable
    seed_weights: bool = False


def simulator_of(declaration: KiteDeclaration, log, extra: Sequence[str] = (), law=None) -> Simulator:
    """Compile the declared kite with `extra` effects at null, differentiable in its free parameters and in those of `extra`."""
    kite = Kite(declaration, log.wind.height, extra)
    own = {p.name for e in kite.effects if e.key in extra for p in e.rows()}
    wrt = [n for n in kite.parameter_names if kite.parameters[n].free or n in own or n in (*both((*GUSTS, ROLL_GUST)), *kite.record)]
    return Simulator(kite, wrt, law)


def without_record(kite: Kite, table: ParameterTable) -> ParameterTable:
    """The table with the wind record's fitted error taken out: what a kite file holds, and what predictions are scored with."""
    return table.with_values(dict.fromkeys(kite.record, 0.0))


def nuisance_wind(declaration: KiteDeclaration, log, kite: Kite) -> tuple[RecordError, float]:
    """(nuisance wind, gust level [m/s]): the recorded wind's own error in calm air, gusts in windows otherwise."""
    level = gust_level(log, kite)
    if level <= GUSTY:
        return RecordError(declaration.wind.std, CALM_WINDOW), level
    airspeed, span = float(log["V_a"][log.valid].mean()), kite.parameters["b"].value
    return Gusts(level, GUST_WINDOW, airspeed=airspeed, span=span), level


def ask(
    simulator: Simulator,
    log,
    split: Split,
    horizon: float,
    outputs: Sequence[str],
    parts=("train", "validation"),
    *,
    seed_weights: bool = False,
) -> Question:
    """Cut the log into segments of `horizon` seconds for fitting and for choosing.

    seed_weights: every channel weighted by its range over the flight, as the seed's Q does, instead of by its noise.
    """
    kite = simulator.kite
    gusts, level = nuisance_wind(kite.declaration, log, kite)
    steps = int(round(horizon / log.dt))
    observed = []
    for part in parts:
        first = segments(getattr(split, part), steps, valid=log.valid)
        if not len(first):
            raise BadInput(
                f"no segment of {horizon:g} s fits into the {part} loops of flight '{log.name}'",
                do="Use a shorter horizon, or a longer flight; `awes check` lists what was left out and why.",
            )
        cut = observe(log, kite, first, steps, outputs)
        if seed_weights:
            # 1 % of a channel's range takes the place of its noise: the seed's "weight matrix Q to normalize output magnitudes"
            spans = np.array([0.01 * (np.ptp(log[n]) or 1.0) for n in cut.outputs])
            cut = cut.with_sigma(np.where(np.isfinite(cut.sigma), spans, np.inf))
        observed.append(with_gust_noise(simulator, cut, gusts) if level > GUSTY else cut)
    names = (*kite.parameters.free, *kite.record)
    return Question(simulator, kite, observed[0], observed[-1], gusts, level, names, kite.parameters, seed_weights)
