"""The verdict on a residual, and everything that stands in effects.json."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from awescli.estimation.question import GUSTY, Question, ask, simulator_of, without_record
from awescli.estimation.simulation_error import SimulationError
from awescli.flightlog.split import Split
from awescli.notation.quantities import SURFACES
from awescli.physics.declaration import KiteDeclaration
from awescli.physics.effects.custom_term import CHANNELS, FEATURES, CustomTerm
from awescli.physics.kite import Kite, can_act, candidates, make_effect
from awescli.simulation.rollout import Simulator
from awescli.simulation.segments import Observed
from awescli.tracing.race import Contest, Runner, above_floor, contest_of, run
from awescli.tracing.roll_gusts import RollGusts, roll_gusts
from awescli.tracing.trace import Trace, trace

BETTER_SHARE = 0.05
"""By how much more of the gap empirical terms must explain than as many effects before the library's answer is doubted ..."""
AS_GOOD = 0.02
"""... and by how little less they may explain when they are fewer."""
LIKELIER = 6.63
"""Fall of the cost (prior included) that chance reaches in 1 % of cases with one more parameter: the 99 % quantile of chi-square."""
STILL = 1e-3
"""[rad] a surface that moves less than this over a flight does not move."""
COLLINEAR = 0.95
"""Cosine beyond which an effect and a parameter cannot be told apart."""


@dataclass(frozen=True)
class Finding:
    """verdict: one of the contract's five; model: the final model; effects: accepted keys with their rivals; traces: library and bank;
    roll_gusts: what of the gusts was missing too, where nothing but gusts is."""

    verdict: str
    model: Runner
    simulator: Simulator
    fitted: Observed
    rivals: dict[str, tuple[str, ...]]
    library: Trace
    bank: Trace | None
    suspects: tuple[tuple[str, str], ...]
    gust: float
    roll_gusts: RollGusts | None = None

    def effect(self, key: str):
        """An effect of the library or the bank by its key."""
        return make_effect(key, self.simulator.kite.declaration)

    def after(self) -> Simulator:
        """The final model, ready to predict."""
        return self.simulator.holding(without_record(self.simulator.kite, self.model.table))

    def declaration(self) -> KiteDeclaration:
        """The kite file of the final model: declared effects, accepted effects, new values; accepted strengths are free."""
        names = [n for n in self.model.names if n not in self.library.null.names]
        return self.simulator.kite.declare(self.model.keys, free=names, table=self.model.table)


def investigate(
    question: Question, null: Runner, keys: list[str], log, split: Split, horizon: float, *, rounds: int = 3,
    progress: Callable[[str], None] = lambda text: None,
) -> Finding:  # fmt: skip
    """Trace with the library, then with the bank of empirical terms where something is left, and weigh the two."""
    contest = contest_of(question)
    library = trace(contest, question.kite, keys, null, rounds=rounds, progress=progress)
    rivals = {r.accepted: r.rivals for r in library.rounds if r.accepted}
    bank, bank_simulator, unexplained = None, None, False
    if above_floor(library.final) > contest.floor_error or len(rivals) > 1:
        # several effects at once, or a rest that they leave: would fewer empirical terms do better?
        progress("weighing empirical terms against the library")
        most = rounds if above_floor(library.final) > contest.floor_error else len(rivals) - 1
        bank, bank_simulator = _bank(question, null, log, split, horizon, most, progress)
        unexplained = _better(bank, library)
    # who hides behind a parameter leaves nothing to see: where much is left, it is something else
    much_left = above_floor(null) > 10 * contest.floor_error
    elsewhere = bool(rivals) or unexplained or question.gust > GUSTY or much_left
    suspects = () if elsewhere else _suspects(contest, null, question.kite, keys)
    if unexplained:
        return Finding(
            "unexplained",
            bank.final,
            bank_simulator,
            question.fitted,
            {r.accepted: () for r in bank.rounds if r.accepted},
            library,
            bank,
            (),
            question.gust,
        )
    if rivals:
        verdict = "cannot_tell" if any(rivals.values()) else "found"
        return Finding(verdict, library.final, question.simulator, question.fitted, rivals, library, bank, (), question.gust)
    if suspects:
        return Finding("cannot_tell", null, question.simulator, question.fitted, {}, library, bank, suspects, question.gust)
    if question.gust > GUSTY:
        progress("looking for roll gusts")
        found = roll_gusts(contest, null)
        return Finding("not_deterministic", null, question.simulator, question.fitted, {}, library, bank, (), question.gust, found)
    verdict = "unexplained" if much_left else "none"
    return Finding(verdict, null, question.simulator, question.fitted, {}, library, bank, (), question.gust)


def _better(bank: Trace, library: Trace) -> bool:
    """Do empirical terms beat what the library found, on unseen loops: as good with fewer terms, clearly better with as many, or where it
    found nothing?"""
    terms, effects = (_explained(t) for t in (bank, library))
    if not effects:
        return bool(terms)
    fewer, as_many = terms[: len(effects) - 1], terms[len(effects) - 1 : len(effects)]
    return any(t > effects[-1] - AS_GOOD for t in fewer) or any(t > effects[-1] + BETTER_SHARE for t in as_many)


def _explained(t: Trace) -> list[float]:
    """After each accepted effect: the share explained of the choice chi-square's excess over 1."""
    gap = max(t.null.choice_chi2 - 1, 1e-9)
    return [1 - max(r.chi2_after - 1, 0.0) / gap for r in t.rounds if r.accepted]


def bank_keys(declaration, moving) -> list[str]:
    """The empirical terms that a flight could show and a kite could fly with: every channel times every feature, surfaces only where they
    move, nothing that has to be read from a log."""
    still = {"rudder", "elevator", "aileron"} - set(moving)
    keys = [f"{CustomTerm.name}:{c}*{f}" for c in CHANNELS for f in FEATURES if f not in still]
    return [k for k in keys if not make_effect(k, declaration).reads and can_act(k, declaration)]


def _bank(question: Question, start: Runner, log, split, horizon, rounds, progress) -> tuple[Trace, Simulator]:
    """The same search over empirical terms, from the best model so far."""
    moving = [s for s in SURFACES if s in log.inputs and np.ptp(log.inputs[s]) > STILL]
    keys = bank_keys(question.kite.declaration, moving)
    declared = question.kite.declare(start.keys, free=[n for n in start.names if n not in question.names], table=start.table)
    simulator = simulator_of(declared, log, keys)
    asked = ask(simulator, log, split, horizon, question.fitted.outputs)
    prior = simulator.kite.parameters.with_rows(
        replace(simulator.kite.parameters[n], value=question.prior[n].value) for n in question.prior if n in simulator.kite.parameters
    )
    # the same gusts and noise as the library's
    fitted, choice = (new.with_noise(old.added) for new, old in ((asked.fitted, question.fitted), (asked.choice, question.choice)))
    contest = contest_of(replace(asked, prior=prior, gusts=question.gusts, fitted=fitted, choice=choice))
    here = run(contest, simulator.kite.parameters, (), start.names, start=start.fit, judged=start.judged)
    return trace(contest, simulator.kite, keys, here, rounds=rounds, progress=progress), simulator


def _suspects(contest: Contest, null: Runner, kite: Kite, keys) -> tuple[tuple[str, str], ...]:
    """(effect, parameter) pairs: a parameter was driven to its bound by what an effect on the same column would explain.

    A constant moment hides in the derivative of a surface that never moves: the fit is good, but the derivative is at the end
    of what its user thinks possible.
    """
    at_bound = [n for n in null.names if _at_bound(null.table[n])]
    if not at_bound:
        return ()
    strong = {p.name: e for e in kite.effects if e.key in keys and not e.probes and not e.shapes for p in e.rows()}
    problem = SimulationError(contest.simulator.holding(null.table), contest.fitted, null.names, contest.gusts)
    problem.own = null.fit.own
    x = np.array([null.table[n].value for n in null.names])
    info, _ = problem.information(x, parameters=(*null.names, *strong))
    H = info.H.sum(0)
    found = []
    for bound in at_bound:
        i = null.names.index(bound)
        for j, (name, effect) in enumerate(strong.items(), start=len(null.names)):
            cosine = abs(H[i, j]) / np.sqrt(max(H[i, i] * H[j, j], 1e-300))
            if cosine < COLLINEAR or len(effect.parameters) > 1:
                continue
            trial = run(
                contest, null.table.with_rows([replace(null.table[name], free=True)]), (effect.key,), (*null.names, name), null.fit
            )
            # the parameter comes back from its bound, and the whole is more likely than before
            if not _at_bound(trial.table[bound]) and trial.fit.solution.cost < null.fit.solution.cost - LIKELIER:
                found.append((cosine, effect.key, bound, trial))
    found.sort(key=lambda f: f[3].fit.solution.cost)
    return tuple((key, bound, trial) for _, key, bound, trial in found[:2])


def _at_bound(p) -> bool:
    width = p.upper - p.lower
    return bool(np.isfinite(width) and (p.value < p.lower + 1e-6 * width or p.value > p.upper - 1e-6 * width))


def library_keys(declaration: KiteDeclaration, log, wanted=None) -> list[str]:
    """Keys of the effects to try on a log: those asked for, else all that it could show. Raises BadInput for an unknown one."""
    moving = [s for s in SURFACES if s in log.inputs and np.ptp(log.inputs[s]) > STILL]
    if wanted is None:
        return candidates(declaration, list(log.measured), moving)
    for key in wanted:
        make_effect(key, declaration)
    return [k for k in wanted if k not in declaration.effects]
