"""LAWS: every kind of control law, and how one is written to an artifact and read back."""

import numpy as np

from awescli.control.gaussian_law import GaussianLaw
from awescli.control.law import Law
from awescli.control.linear_law import LinearLaw
from awescli.control.network_law import NetworkLaw
from awescli.control.pattern import Pattern
from awescli.notation.errors import BadInput, did_you_mean

LAWS: dict[str, type[Law]] = {"gaussian": GaussianLaw, "network": NetworkLaw, "linear": LinearLaw}


def to_artifact(law: Law) -> tuple[dict, dict[str, np.ndarray]]:
    """(controller.json as a plain dict, arrays by name)."""
    document = {
        "kind": law.kind,
        "surfaces": list(law.surfaces),
        "features": list(law.features),
        "centre": list(law.centre),
        "scale": list(law.scale),
        "limits": {name: list(pair) for name, pair in law.limits.items()},
        "constants": dict(law.constants),
        "pattern": None if law.pattern is None else law.pattern.to_dict(),
        "rate_limits": dict(law.rate_limits),
        "delay_s": law.delay_s,
        "unit": "rad",
        "metrics": dict(law.metrics),
    }
    return document, {name: np.asarray(a, dtype=float) for name, a in law.own_arrays().items()}


def from_artifact(document: dict, arrays: dict[str, np.ndarray]) -> Law:
    """The law that `to_artifact` wrote."""
    kind = document["kind"]
    if kind not in LAWS:
        raise BadInput(f"unknown kind of control law '{kind}'", where="controller.json", do=did_you_mean(kind, LAWS))
    own = {name: (float(a) if np.ndim(a) == 0 else np.asarray(a)) for name, a in arrays.items()}
    return LAWS[kind](
        surfaces=tuple(document["surfaces"]),
        features=tuple(document["features"]),
        centre=tuple(document["centre"]),
        scale=tuple(document["scale"]),
        limits={name: tuple(pair) for name, pair in document["limits"].items()},
        constants=dict(document["constants"]),
        pattern=None if document["pattern"] is None else Pattern(**document["pattern"]),
        rate_limits=dict(document["rate_limits"]),
        delay_s=document["delay_s"],
        metrics=document.get("metrics", {}),
        **own,
    )
