"""Values that no model is asked to follow (`estimation.outliers`), left out of a trace."""

from collections import Counter

from awescli.estimation.outliers import outliers
from awescli.tracing.fitted_model import FittedModel
from awescli.tracing.frame import Frame
from awescli.tracing.models import fit_on

PASSES = 4
"""In which they are looked for: the noise is too large until the farthest are gone."""


def without_outliers(frame: Frame, model: FittedModel) -> tuple[Frame, FittedModel, dict[str, int]]:
    """(the frame without outliers, the model fitted anew to what is left, channel -> how many, of all flights)."""
    many: Counter[str] = Counter()
    for _ in range(PASSES):
        found = [outliers(each) for each in zip(model.fit.flights, model.judged, strict=True)]
        if not any(found) or not model.fit.ended:
            break
        many.update({name: len(rows) for flight in found for name, rows in flight.items()})
        frame = frame.without(found)
        model = fit_on(frame, model)
    return frame, model, dict(many)
