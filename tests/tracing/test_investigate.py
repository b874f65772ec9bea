"""The order of an investigation: empirical terms are weighed where they may lead, and nowhere else."""

from types import SimpleNamespace

import pytest

from awescli.tracing import investigate
from awescli.tracing.criteria import CRITERIA


def model(deviance: float, keys=(), rest=()):
    return SimpleNamespace(deviance=deviance, keys=keys, rest=dict.fromkeys(rest, 1.0))


NULL = model(1000.0, rest=("force_x",))


@pytest.mark.parametrize(
    "found, beside, before, weighed",
    [
        (model(1000.0), 50.0, 50.0, False),  # nothing was found: there is nothing to lead
        (model(400.0, ("sideslip_drag",)), 9.0, 90.0, False),  # nothing adds anything to what was found
        (model(400.0, ("sideslip_drag",)), 11.0, 90.0, True),
        (model(400.0, ("sideslip_drag",)), 11.0, 59.0, False),  # no term comes near what was gained
        (model(400.0, ("sideslip_drag", "air_density")), 11.0, 31.0, True),  # but two may
        (model(400.0, ("sideslip_drag",), ("force_x",)), 0.0, 61.0, True),  # beside model error no score says that nothing is added
        (model(400.0, ("sideslip_drag",), ("force_x",)), 0.0, 59.0, False),
    ],
)
def test_empirical_terms_are_weighed_where_they_may_lead(monkeypatch, found, beside, before, weighed):
    """Guards the time of an answer that no term comes near, and the doubt in all others. Scores of the best term beside what was found, and
    of the model before."""
    scores = {id(found): beside, id(NULL): before}
    monkeypatch.setattr(
        investigate, "screen",
        lambda frame, here, terms: SimpleNamespace(scores=[SimpleNamespace(drop=scores[id(here)]), SimpleNamespace(drop=1.0)]),
    )  # fmt: skip
    assert CRITERIA.beyond_score == 10 and CRITERIA.empirical == 10
    assert investigate.lacks_terms(None, NULL, found, ("a term",)) is weighed
