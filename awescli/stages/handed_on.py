"""What a stage says of the parameters that it hands on: params.json of a traced model, and where fitted values come from."""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from awescli.physics.declaration import KiteDeclaration
    from awescli.tracing.fitted_model import FittedModel

FITTED = "identified by awes"
"""How the source of a fitted value begins."""
PRIOR = ", prior: "


def with_sources(declaration: "KiteDeclaration", params: Mapping[str, Any], flights: str) -> "KiteDeclaration":
    """The declaration with the source of every fitted value: the flights it was fitted to, its standard deviation, and what was known
    before. params: params.json; values that were not fitted keep their sources."""
    rows = dict(declaration.parameters)
    for name, fitted in params["parameters"].items():
        if name in rows:
            row = rows[name]
            # the prior of a value that was itself fitted to an earlier flight is stated once, not flight after flight
            before = row.source.partition(PRIOR)[2] if row.source.startswith(FITTED) else row.source
            unit = f" {row.unit}" if row.unit not in ("", "-") else ""
            said = f"{FITTED} from {flights} (std {fitted['std']:.3g}{unit}){PRIOR}{before or 'as declared'}"
            rows[name] = row.model_copy(update={"source": said})
    return declaration.model_copy(update={"parameters": rows})


def traced_params(model: "FittedModel", effects: Mapping[str, Any]) -> dict:
    """params.json of the model that tracing ended with, in the form of identify's, strengths and shapes of accepted effects included, with
    the intervals of effects.json. effects: effects.json."""
    from awescli.estimation.identifiability import describe, interval
    from awescli.stages.per_phase import phases_of

    params = describe(model.fit, set(model.problems[0].kite.record), phase_of=phases_of(model.fit.names))
    keys = {key.partition(":")[::2]: key for key in model.keys}
    for effect in [*effects["effects"], *(effects["by_prediction"] or {}).get("effects", ())]:
        key = keys.get((effect["name"], effect["acts_on"]), effect["name"])
        for short, size in effect["parameters"].items():
            if (row := params["parameters"].get(f"{key}.{short}")) is not None:
                row |= {"std": size["std"], "interval": interval(row["value"], size["std"])}
    return params
