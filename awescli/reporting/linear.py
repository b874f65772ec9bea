"""What the linear baseline says of the models, in plain words."""

from collections.abc import Callable, Collection, Mapping
from typing import Any

from awescli.reporting.words import listed, number

NONE = "There is no linear model to compare with: the train part is too short for one"


def beside_linear(scores: Mapping[str, Any], models: Collection[str], label: Callable[[str], str] = str) -> str:
    """One sentence; empty where evaluate left no baseline (awes 0.1). scores: evaluate's metrics.json; models: to speak of; label: words of
    one."""
    baseline = scores.get("baseline")
    if baseline is None or baseline["outcome"] == "too_short":
        return NONE if baseline else ""
    lags = f"{baseline['order']} lag{'s' if baseline['order'] > 1 else ''} of {baseline['step_s']:g} s"
    away = "; unstable, its predictions that run away are counted" if baseline["outcome"] == "unstable" else ""
    called = f"a linear model of the same inputs (ARX, {lags}{away})"
    block = scores["linear"]
    horizon, its = f"{block['horizon_s']:g}", number(block["nrmse"]["test"]["mean"])
    said = []
    for alike, at in _alike(baseline, models):
        who, one = listed([label(m) for m in alike]), len(alike) == 1
        pair = f"{listed([number(scores[m]['nrmse']['test']['mean']) for m in alike])} against {its}"
        does = f"{'does' if one else 'do'} not beat" if at else "beats" if one else "beat"
        yet = at and horizon not in at
        against = f"; at {horizon} s {'it does' if one else 'they do'}, {pair}" if yet else f": {pair} at {horizon} s"
        said.append(f"{who} {does} {'it' if said else called}{_ahead(at)}{against}")
    return "; ".join(said)


def briefly(scores: Mapping[str, Any], models: Collection[str]) -> str:
    """The same for one line of a terminal that has shown the numbers: which models do not beat it, and at which horizons."""
    baseline = scores["baseline"]
    if baseline["outcome"] == "too_short":
        return NONE
    called = f"a linear model (ARX{', unstable' if baseline['outcome'] == 'unstable' else ''})"
    groups = _alike(baseline, models)
    losing = [f"{listed(alike)} {'does' if len(alike) == 1 else 'do'} not beat {called}{_ahead(at)}" for alike, at in groups if at]
    every = [m for alike, _ in groups for m in alike]
    return "; ".join(losing) or f"{listed(every)} {'beats' if len(every) == 1 else 'beat'} {called} at every horizon"


def _alike(baseline: Mapping[str, Any], models: Collection[str]) -> list[tuple[list[str], list[str]]]:
    """(models, horizons at which none of them beats the baseline), simplest first."""
    known = {m: at for m, at in baseline["not_beaten"].items() if m in models}
    # what the user declared is no step of ours, but before anything is fitted it is all there is
    fitted = {m: at for m, at in known.items() if m != "initial"} or known
    groups: dict[tuple[str, ...], list[str]] = {}
    for model, at in fitted.items():
        groups.setdefault(tuple(at), []).append(model)
    return [(alike, list(at)) for at, alike in groups.items()]


def _ahead(at: list[str]) -> str:
    return f" {listed(at)} s ahead" if at else ""
