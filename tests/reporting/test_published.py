"""The thesis' published numbers beside a run's: each number beside that of the same model."""

from types import SimpleNamespace

from awescli.reporting.published import NUMBERS, beside_thesis, published
from awescli.reporting.rendering import show


def scored(**of_channel) -> dict:
    return {"nrmse": {"test": {name: of_channel.get(name, 0.5) for name in NUMBERS if name != "rudder"}}}


SCORES = {"initial": scored(phi=0.4), "identified": scored(phi=0.1, u=0.2), "hybrid": scored(p_n=0.03, u=0.05, phi=0.9)}
LAW, TRAINED = {"nrmse": {"test": {"rudder": 0.01}}}, {"comparison": {"test": {"adam": {"p_n": 0.04}}}}


def test_every_number_stands_beside_that_of_its_own_step():
    """Guards the columns against models mixed up: angles are the identified model's, positions Adam's and the hybrid's, velocities the
    hybrid's beside the physics'."""
    rows = {row["channel"]: row for row in beside_thesis(SCORES, LAW, TRAINED)}
    assert (rows["rudder"]["before"], rows["rudder"]["after"], rows["rudder"]["thesis_after"]) == (None, 0.01, 0.0181)
    assert (rows["phi"]["before"], rows["phi"]["after"]) == (0.4, 0.1) and (rows["phi"]["thesis_before"]) == 0.453
    assert (rows["p_n"]["before"], rows["p_n"]["after"], rows["p_n"]["thesis_after"]) == (0.04, 0.03, 0.080)
    assert (rows["u"]["before"], rows["u"]["after"], rows["u"]["thesis_before"]) == (0.2, 0.05, 0.143)
    without = {row["channel"]: row for row in beside_thesis({"initial": SCORES["initial"]}, None, None)}
    assert without["rudder"]["after"] is None and without["phi"]["before"] == 0.4 and without["u"]["after"] is None


def test_the_page_says_that_the_flights_differ():
    html = show(published(SimpleNamespace(scores={"beside_thesis": beside_thesis(SCORES, LAW, TRAINED)})))
    assert "different flights" in html and html.count("<tr>") == len(NUMBERS) + 1 and "0.0181" in html
    assert published(SimpleNamespace(scores={})) == ""
