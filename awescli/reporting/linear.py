"""What the linear baseline says of the models, in plain words."""

from collections.abc import Callable, Collection, Mapping
from typing import Any

from awescli.reporting.words import listed, number


def beside_linear(scores: Mapping[str, Any], models: Collection[str], label: Callable[[str], str] = str) -> str:
    """One sentence; empty where evaluate left no baseline (awes 0.1). scores: evaluate's metrics.json; models: to speak of; label: words of
    one."""
    baseline = scores.get("baseline")
    if baseline is None:
        return ""
    if baseline["outcome"] == "too_short":
        return "There is no linear model to compare with: the train part is too short for one"
    lags = f"{baseline['order']} lag{'s' if baseline['order'] > 1 else ''} of {baseline['step_s']:g} s"
    away = "; unstable, its predictions that run away are counted" if baseline["outcome"] == "unstable" else ""
    called = f"a linear model of the same inputs (ARX, {lags}{away})"
    block = scores["linear"]
    horizon, its = f"{block['horizon_s']:g}", number(block["nrmse"]["test"]["mean"])
    # what the user declared is no step of ours, but before anything is fitted it is all there is
    known = {m: at for m, at in baseline["not_beaten"].items() if m in models}
    fitted = {m: at for m, at in known.items() if m != "initial"} or known
    alike: dict[tuple[str, ...], list[str]] = {}
    for model, at in fitted.items():
        alike.setdefault(tuple(at), []).append(model)
    said = []
    for at, models in alike.items():
        who, one = listed([label(m) for m in models]), len(models) == 1
        own = listed([number(scores[m]["nrmse"]["test"]["mean"]) for m in models])
        does = f"{'does' if one else 'do'} not beat" if at else "beats" if one else "beat"
        ahead = f" {listed(list(at))} s ahead" if at else ""
        yet = at and horizon not in at
        pair = f"{own} against {its}"
        told = f"; at {horizon} s {'it does' if one else 'they do'}, {pair}" if yet else f": {pair} at {horizon} s"
        said.append(f"{who} {does} {'it' if said else called}{ahead}{told}")
    return "; ".join(said)
