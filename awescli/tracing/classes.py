"""Classes: which effects a flight cannot tell from one that was accepted, beaten or not.

At the solution, what the candidates and all free parameters would do stands in one information matrix. With x the strengths of an effect A
and J the information that is left when the other free parameters have absorbed what they can, B in the place of A would leave a deviance of

    x' (J_aa - J_ab J_bb^-1 J_ba) x,   at its own strengths   J_bb^-1 J_ba x.

Where that is little, B is fitted instead of A, and the evidence decides.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from awescli.notation.parameters import Parameter
from awescli.physics.kite import make_effect
from awescli.tracing.candidates import Variant, variants
from awescli.tracing.criteria import CRITERIA, Criteria
from awescli.tracing.fitted_model import FittedModel
from awescli.tracing.frame import Frame
from awescli.tracing.models import Say, fit_instead
from awescli.tracing.screen import CandidateColumns, Score, firm, informed
from awescli.tracing.shapes import plausible, refined


@dataclass(frozen=True)
class Rival:
    """A model that is as good: the final one with `key` instead of an effect. lag: deviance by which it falls behind (negative: it
    leads)."""

    key: str
    model: FittedModel
    lag: float


def rivals(
    frame: Frame, final: FittedModel, keys: Sequence[str], gains: Mapping[str, float], beaten: Sequence[str] = (),
    close: Sequence[str] = (), passed_over: float = 0.0, criteria: Criteria = CRITERIA, progress: Say = lambda text: None,
) -> dict[str, tuple[Rival, ...]]:  # fmt: skip
    """Accepted effect -> what the flights cannot tell from it, nearest first. gains: of the accepted effects (`Search.gains`), which say
    how far they must lead; beaten: effects that have lost to it by their own fit and need not be tried again; close: those that have not,
    and are tried however far they lie to first order (a mass that is a third too large is not near); passed_over: deviance that is left to
    effects which got no name, and that a lead must exceed: two forms that both are not quite the one that is there differ by as much."""
    others = [k for k in keys if k not in final.keys]
    every = [v for key in others for v in variants(make_effect(key, frame.declared), frame.onsets())]
    columns = CandidateColumns(every)
    H = informed(frame, final, others, columns, frame.horizon)[0]
    found = {}
    for key in final.keys:
        near = _near(final, key, every, columns, H)
        reach, lead = max(criteria.in_reach(criteria.look_alike, gains[key]), passed_over), max(criteria.lead(gains[key]), passed_over)
        near = [s for s in near if s.key in close] + [s for s in near if s.drop < reach and s.key not in (*beaten, *close)]
        tried = []
        for s in near[: criteria.competitors]:
            progress(f"fitting {s.key} instead of {key}")
            strengths, shapes = s.start(_rows(frame, s.key))
            model = refined(frame, fit_instead(frame, final, key, s.key, strengths, shapes), criteria)
            lag = model.deviance - final.deviance
            # a fit that did not come to its end has not fallen behind
            alike = lag < lead or (s.key in close and not model.fit.ended)
            if alike and model.flies >= final.flies and plausible(model, s.key):
                tried.append(Rival(s.key, model.widened().light(), lag))
        found[key] = tuple(sorted(tried, key=lambda r: r.lag))
    return found


def _rows(frame: Frame, key: str) -> dict[str, Parameter]:
    return {p.name: p for p in make_effect(key, frame.declared).rows()}


def _near(final: FittedModel, key: str, every: Sequence[Variant], columns: CandidateColumns, H: np.ndarray) -> list[Score]:
    """For each other effect the variant that would leave least: a score whose `drop` is what it leaves; what it leaves first."""
    names = final.fit.names
    own = [i for i, n in enumerate(names) if n.startswith(f"{key}.")]
    rest = [i for i in range(len(names)) if i not in own]
    asked = own + list(range(len(names), len(H)))
    J = H[np.ix_(asked, asked)] - H[np.ix_(asked, rest)] @ np.linalg.solve(firm(H[np.ix_(rest, rest)]), H[np.ix_(rest, asked)])
    n = len(own)
    null = {p.name: p.value for p in make_effect(key, final.problems[0].kite.declaration).rows()}
    x = np.array([final.table[names[i]].value - null[names[i]] for i in own])
    found: dict[str, list[Score]] = {}
    for v in every:
        place = [n + i for i in columns.place(v)]
        A, B, C = J[:n, :n], firm(J[np.ix_(place, place)]), J[np.ix_(range(n), place)]
        size = np.linalg.solve(B, C.T @ x)
        left = float(x @ A @ x - x @ C @ size)
        if v.secant and size[0] <= 0:
            continue
        std = np.sqrt(np.maximum(np.diag(np.linalg.inv(B)), 0.0))
        found.setdefault(v.key, []).append(Score(v, v.moving[: len(place)], left, size, std, 1.0, 1.0, tuple(place)))
    return sorted((min(group, key=lambda s: s.drop) for group in found.values()), key=lambda s: s.drop)
