"""Trace a residual to the effect that is missing: gate, screen, race, accept, again; then the unknown, then the verdict."""

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np

from awescli.estimation.simulation_error import SimulationError
from awescli.physics.kite import Kite
from awescli.tracing.race import Contest, Runner, above_floor, enter, finish, run, settled
from awescli.tracing.screen import Score, Screening, holm, screen

COMPETITORS = 5
"""How many of the best screened candidates are re-fitted in a round."""
AGREE = 0.05
"""Level of the test that not a few segments alone speak for a candidate. No stricter: an effect may show on few of them, as stall does."""
CLOSE = 3
"""How many of a round's runners are tried again once a later effect is in the model."""
ROUNDS = 3
"""At most so many effects are accepted one after the other."""
SHARE_OF_GAP = 0.1
"""Least share of what the choice cost still stands above its floor: far from the floor almost any term gains something, and an effect
that explains a few per cent of what is missing is not what is missing."""
EXPLAINS = 0.5
"""Where the residual is above the floor, effects that leave more than half of the excess on unseen loops are no answer."""
NO_EXCESS = 0.005
"""Relative excess of the cost below which there is nothing of which a share could be explained."""
CERTAIN = 1.5
"""Standard errors by which the mean log ratio of the choice segments' costs must exceed zero."""
DECISIVE = 10.0
"""Least lead in cost (-2 log likelihood) over a rival, beside one standard error of the paired differences."""


@dataclass(frozen=True)
class Entry:
    """One candidate's record in the ranking."""

    key: str
    score: float
    p_value: float
    explained_share: float
    plausible: bool
    gain: float
    chi2: float
    outcome: str


@dataclass(frozen=True)
class Round:
    """One round: who was screened, who raced, who was accepted ("" for nobody), and its rivals; dropped: who was accepted at first but
    explains too little of the whole."""

    entries: tuple[Entry, ...]
    accepted: str
    rivals: tuple[str, ...]
    untestable: tuple[str, ...]
    chi2_before: float
    chi2_after: float
    dropped: str = ""


@dataclass(frozen=True)
class Trace:
    """What tracing found. verdict: see `verdict.py`; null, final: the models before and after; rounds: the record; detectable: key -> least
    size that would have shown; sizes_of: key -> the parameter whose size that is."""

    null: Runner
    final: Runner
    rounds: tuple[Round, ...]
    detectable: dict[str, float] = field(default_factory=dict)
    sizes_of: dict[str, str] = field(default_factory=dict)


def trace(
    contest: Contest,
    kite: Kite,
    keys: list[str],
    null: Runner,
    *,
    rounds: int = ROUNDS,
    progress: Callable[[str], None] = lambda text: None,
) -> Trace:
    """Search the effects `keys` of `kite` (which holds them at null) for what the fitted model `null` lacks."""
    models, record, fields = [null], [], []
    remaining = list(keys)
    detectable: dict[str, float] = {}
    sizes_of: dict[str, str] = {}
    for number in range(rounds):
        progress(f"round {number + 1}: screening {len(remaining)} candidates")
        here = models[-1]
        screening = _screened(contest, here, kite, remaining)
        if number == 0:
            sizes_of = {s.key: s.moving[0] for s in screening.scores}
            detectable = {s.key: float(3.5 * s.std[0] * (s.variant.at[s.moving[0]] if s.variant.secant else 1)) for s in screening.scores}
        entries, admissible = _race(contest, here, kite, screening, progress)
        finalists = _unbeaten(admissible) + [r for r in _close(admissible, here) if _unfinished(kite, r)]
        best, rivals = _decide([_refined(contest, kite, finish(contest, r)) for r in dict.fromkeys(finalists)])
        accepted, chi2 = best.keys[-1] if best else "", here.choice_chi2
        if best:
            contest, best = settled(contest, best)
        record.append(Round(entries, accepted, rivals, screening.untestable, chi2, best.choice_chi2 if best else chi2))
        if best is None:
            break
        models.append(best)
        fields.append(_close(admissible, here))
        # what cannot be told from an accepted effect is its rival, not a further effect
        remaining = [k for k in remaining if k != accepted and k not in rivals]
    models, record = _credible(contest, models, record)
    progress("going back over what was accepted")
    final, record = _revisited(contest, models[-1], record, fields)
    return Trace(null, final, tuple(record), detectable, sizes_of)


def _unbeaten(admissible: list[Runner]) -> list[Runner]:
    """The likeliest first, then those that it does not lead for certain."""
    return [r for i, r in enumerate(admissible) if i == 0 or not _ahead(admissible[0], r)]


def _unfinished(kite: Kite, r: Runner) -> bool:
    """Has its last effect shapes that are not fitted yet? Then being beaten as it stands decides nothing."""
    return any(e.shapes for e in kite.effects if e.key == r.keys[-1])


def _close(admissible: list[Runner], here: Runner) -> list[Runner]:
    """The few best of a race that came at least half as far as its winner: with a further effect in the model they may do better."""
    return [r for r in admissible if _whole(here) - _whole(r) > (_whole(here) - _whole(admissible[0])) / 2][:CLOSE]


def _decide(finalists: list[Runner], place: int = -1) -> tuple[Runner | None, tuple[str, ...]]:
    """(the likeliest, keys of those that it does not lead for certain); place: of the effect in which the finalists differ"""
    if not finalists:
        return None, ()
    best = min(finalists, key=_whole)
    return best, tuple(r.keys[place] for r in finalists if r is not best and not _ahead(best, r))


def _credible(contest: Contest, models: list[Runner], record: list[Round]) -> tuple[list[Runner], list[Round]]:
    """Without the last effects where they explain little and the floor is not reached: there they mend the form of the first one; and
    without any where all together leave more than half of what is missing and do not reach the floor."""
    models, record = list(models), list(record)
    while len(models) > 2 and above_floor(models[-1]) > contest.floor_error:
        if above_floor(models[-2]) - above_floor(models[-1]) >= SHARE_OF_GAP * above_floor(models[0]):
            break
        models.pop()
    excess, left = (max(m.choice_chi2 - 1, 0.0) for m in (models[0], models[-1]))
    if left > max((1 - EXPLAINS) * excess, contest.floor_error):
        models = models[:1]
    for at in [i for i, r in enumerate(record) if r.accepted][len(models) - 1 :]:
        record[at] = replace(record[at], accepted="", rivals=(), chi2_after=record[at].chi2_before, dropped=record[at].accepted)
    return models, record


def _revisited(contest: Contest, final: Runner, record: list[Round], fields: list[list[Runner]]) -> tuple[Runner, list[Round]]:
    """One backward pass: in each earlier round the close ones may take the winner's place in the final model, which holds what the
    later rounds found; who is not beaten there is a rival."""
    record, accepted = list(record), [i for i, r in enumerate(record) if r.accepted]
    for i, r in enumerate(record):
        if not r.accepted or i == accepted[-1]:
            continue
        place = final.keys.index(r.accepted)
        tried = [_swapped(contest, final, place, other) for other in fields[i] if other.keys[-1] not in final.keys]
        final, rivals = _decide([final, *tried], place)
        record[i] = replace(r, accepted=final.keys[place], rivals=rivals)
    return final, record


def _swapped(contest: Contest, final: Runner, place: int, other: Runner) -> Runner:
    """The final model with the last effect of `other` instead of the effect that stands at `place`."""
    out, new = final.keys[place], other.keys[-1]
    null = {p.name: p.value for p in contest.simulator.kite.parameters.rows if p.name.startswith(f"{out}.")}
    own = [n for n in other.names if n.startswith(f"{new}.")]
    table = final.table.with_values({**null, **{n: other.table[n].value for n in own}})
    table = table.with_rows([*(replace(table[n], free=False) for n in null), *(replace(table[n], free=True) for n in own)])
    keys = tuple(new if k == out else k for k in final.keys)
    return run(contest, table, keys, (*(n for n in final.names if n not in null), *own), start=final.fit, judged=final.judged)


def _screened(contest: Contest, here: Runner, kite: Kite, keys: list[str]) -> Screening:
    problem = SimulationError(contest.simulator.holding(here.table), contest.fitted, here.names, contest.gusts)
    problem.own = here.fit.own
    precision = np.array([1 / here.table[n].prior_std ** 2 for n in here.names])
    centre = np.array([contest.prior[n].value for n in here.names])
    x = np.array([here.table[n].value for n in here.names])
    return screen(problem, x, precision, centre, kite, keys)


def _race(contest: Contest, here: Runner, kite: Kite, screening: Screening, progress):
    """(entries, the runners that may be what is missing, likeliest first)"""
    scores = screening.scores
    if not scores:
        return (), []
    abrupt = {e.key for e in kite.effects if e.abrupt}
    significant = dict(zip((s.key for s in scores), holm([s.p_value for s in scores]), strict=True))
    # who is close to a leader in direction competes with it, whatever its rank
    leaders = list(scores[:COMPETITORS])
    near = [s for s in scores[COMPETITORS : COMPETITORS + 8] if any(screening.cosine(s, leader) > 0.9 for leader in leaders[:2])]
    runners: dict[str, Runner] = {}
    # an abrupt effect cannot be screened by a linear test: it races whenever there is something left to explain
    switched = [s for s in scores if s.key in abrupt and s not in leaders and above_floor(here) > contest.floor_error]
    for s in leaders + near[:3] + switched:
        # far from the floor the choice segments decide; near it, chance must be ruled out first
        if not (significant[s.key] and s.agreement < AGREE) and above_floor(here) < contest.floor_error:
            continue
        progress(f"re-fitting with {s.key}")
        runners[s.key] = enter(contest, here, screening, s)
    entries = tuple(_entry(here, s, runners.get(s.key)) for s in scores)
    plausible = [runners[s.key] for s, e in zip(scores, entries, strict=True) if s.key in runners and e.plausible]
    return entries, _admissible(contest, here, plausible)


def _admissible(contest: Contest, here: Runner, plausible: list[Runner]) -> list[Runner]:
    """Those with a material gain, likeliest first. Once there is one something is missing, and what it is likelihood decides: who is
    likelier than the best of them, and gains on unseen loops too, is as good as they are."""
    material = [r for r in plausible if _material(contest, here, r)]
    if material:
        least, unseen = min(map(_whole, material)), here.choice_deviance.sum()
        material += [r for r in plausible if _whole(r) < least and r.choice_deviance.sum() < unseen]
    return sorted(material, key=_whole)


def _refined(contest: Contest, kite: Kite, best: Runner) -> Runner:
    """The finalist with its shape parameters tried free: one that stands where it was probed is as uncertain as the strength, and stays
    free unless that does worse; one that stands at null, only where that lowers the cost decisively."""
    effect = next(e for e in kite.effects if e.key == best.keys[-1])
    for shape in effect.shapes:
        name, null = f"{effect.key}.{shape}", next(p.value for p in effect.parameters if p.name == shape)
        probed = best.table[name].value != null
        starts = (best.table[name].value,) if probed else (*effect.probes.get(shape, ()), *effect.refinements.get(shape, ()))
        worse = DECISIVE if probed else 0.0
        for value in starts:
            if value == null:
                continue
            table = best.table.with_values({name: value})
            table = table.with_rows([replace(table[name], free=True)])
            trial = run(contest, table, best.keys, (*best.names, name), start=best.fit, judged=best.judged)
            unseen = trial.choice_deviance.sum() - best.choice_deviance.sum()
            if _whole(trial) - _whole(best) < (worse or -DECISIVE) and unseen < worse:
                best = trial
    return best


def _whole(r: Runner) -> float:
    """Deviance of all loops."""
    return float(r.train_deviance.sum() + r.choice_deviance.sum())


def _entry(here: Runner, s: Score, r: Runner | None) -> Entry:
    """The record of one candidate; explained_share is of the train cost's excess over its degrees of freedom, 0 where there is none."""
    dof = float(here.fit.information.dof.sum())
    excess = float(here.train_cost.sum()) - dof

    def share(fall: float) -> float:
        return float(np.clip(fall / excess, -1, 1)) if excess > NO_EXCESS * dof else 0.0

    if r is None:
        return Entry(s.key, s.drop, s.p_value, share(s.drop), True, 0.0, here.choice_chi2, "not raced")
    explained = share(float((here.train_deviance - r.train_deviance).sum()))
    gain = float((here.choice_deviance - r.choice_deviance).sum() / here.choice_cost.sum())
    return Entry(s.key, s.drop, s.p_value, explained, _plausible(s, r), gain, r.choice_chi2, r.fit.solution.outcome)


def _plausible(s: Score, r: Runner) -> bool:
    """No strength sits at the end of its plausible range."""
    for name in s.moving:
        p = r.table[name]
        width = p.upper - p.lower
        null_at_lower = abs(p.lower) < 1e-12
        if p.value > p.upper - 1e-3 * width or (p.value < p.lower + 1e-3 * width and not null_at_lower):
            return False
    return True


def _material(contest: Contest, here: Runner, r: Runner) -> bool:
    """A gain on unseen loops that is certain (block-wise), worth having, and a good part of what is missing."""
    before, gain = here.choice_cost, here.choice_deviance - r.choice_deviance
    total = gain.sum()
    K = len(gain)
    # a log ratio per block: a few loud blocks must not decide alone
    ratio = np.log(np.maximum(before, 1e-9) / np.maximum(before - gain, 1e-9))
    certain = ratio.mean() > CERTAIN * ratio.std(ddof=1) / np.sqrt(K) if K > 2 else bool((ratio > 0).all())
    gap = max(before.sum() - here.choice_dof, 0.0)
    if above_floor(here) < contest.floor_error:
        # at the floor the noise is what the model says, and a gain as certain as its likelihood, unless one block carries it alone;
        # there is no gap of which it could be a share
        certain, gap = certain or (K > 2 and total - gain.max() > DECISIVE), 0.0
    return bool(certain and total > max(contest.material * before.sum(), SHARE_OF_GAP * gap, DECISIVE))


def _ahead(best: Runner, rival: Runner) -> bool:
    """Is the winner's lead more than chance, and more than a matter of form?"""
    d = np.concatenate([rival.train_deviance - best.train_deviance, rival.choice_deviance - best.choice_deviance])
    lead, chance = d.sum(), d.std(ddof=1) * np.sqrt(len(d))
    return bool(lead > max(DECISIVE, chance))
