"""The library of effects as plain rows, read off EFFECTS itself: what `awes effects` prints."""

from math import isfinite
from typing import Any

from awescli.notation.parameters import Parameter
from awescli.physics.effects import EFFECTS
from awescli.physics.effects.base import PLACES, Effect


def library() -> list[dict[str, Any]]:
    """One row an effect: name, doc, place (where in an instant it acts), targets (what it may act on, empty where there is one such place),
    role (`in every kite`, `candidate`: what trace-residual looks for, or `on request`), key (as a kite file names it), parameters."""
    return [
        {
            "name": name,
            "doc": effect.doc,
            "place": next(p for p in PLACES if getattr(effect, p) is not getattr(Effect, p)),
            "targets": list(effect.targets),
            "role": "in every kite" if effect.always else "candidate" if effect.traceable else "on request",
            "key": f"{name}:{effect.targets[0]}" if effect.targets else name,
            "parameters": [_row(p, p.name in effect.shapes) for p in effect.parameters],
        }
        for name, effect in EFFECTS.items()
    ]


def _row(p: Parameter, shape: bool) -> dict[str, Any]:
    """A parameter: null is the value at which the effect is absent, lower and upper what is plausible; shape: it only gives form."""
    ends = {end: value if isfinite(value) else None for end, value in (("lower", p.lower), ("upper", p.upper))}
    return {"name": p.name, "unit": p.unit, "null": p.value, **ends, "shape": shape, "source": p.source}
