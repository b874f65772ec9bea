"""The figures as files: all of them, drawn from what the page holds, with the numbers behind them."""

import csv
import io
import xml.etree.ElementTree as ET
from dataclasses import replace
from functools import cache

import matplotlib
import numpy as np
import pytest
from reporting.small_evidence import evidence

from awescli.reporting.drawing import drawn
from awescli.reporting.html import story
from awescli.reporting.marks import blocks
from awescli.reporting.paper import INDEX, figure_files, light_colours, table_of
from awescli.reporting.plots import Figure, axis, bars, line

SVG = "{http://www.w3.org/2000/svg}"


@cache
def usual() -> dict[str, bytes]:
    return dict(figure_files(evidence()))


def figures_of(e) -> dict[str, Figure]:
    return {p.id: p for s in story(e) for p in blocks(s.body) if isinstance(p, Figure)}


def rows(name: str) -> list[dict[str, str]]:
    return list(csv.DictReader(io.StringIO(usual()[name].decode())))


def texts(svg: bytes) -> str:
    return " ".join("".join(e.itertext()) for e in ET.fromstring(svg).iter(f"{SVG}text"))


def test_loops_are_counted_in_whole_numbers():
    """Guards an axis of loops that was ticked at 2.5 and 7.5."""
    ticks = texts(usual()["loops.svg"]).partition(" loop of the flight")[0].split()
    assert ticks == [str(row["loop"]) for row in evidence().scores[evidence().best]["by_loop"]]


def test_every_figure_of_the_page_is_there_as_picture_and_table():
    figures = figures_of(evidence()).values()
    names = {f.id.removeprefix("fig-") for f in figures}
    assert set(usual()) == {f"{n}.{kind}" for n in names for kind in ("png", "svg", "csv")} | {INDEX} and len(names) > 25
    assert [r["figure"] for r in rows(INDEX)] == [f.id.removeprefix("fig-") for f in figures] and all(r["split"] for r in rows(INDEX))
    for f in figures:
        name = f.id.removeprefix("fig-")
        picture = usual()[f"{name}.png"]
        assert picture.startswith(b"\x89PNG") and matplotlib.image.imread(io.BytesIO(picture)).std() > 0.01  # not an empty sheet
        assert f.title in texts(usual()[f"{name}.svg"]) and f.split in texts(usual()[f"{name}.svg"])


def test_the_numbers_in_a_table_are_those_of_the_artifacts():
    e = evidence()
    models = {(r["series"], r["category"]): float(r["NRMSE [% of range]"]) for r in rows("models.csv")}
    assert models["as declared", "u"] == 100 * e.nrmse("initial")["u"] and models["hybrid", "φ"] == 100 * e.nrmse("hybrid")["phi"]
    measured = [r for r in rows("p_n.csv") if r["series"] == "measured"]
    values = np.array([float(r["position north [m]"] or "nan") for r in measured])
    truth = e.predictions["measured_p_n"]
    assert np.array_equal(values[np.isfinite(values)], truth.reshape(-1))
    path = [r for r in rows("3d-prediction.csv") if r["series"] == "hybrid" and r["up [m]"]]
    assert np.array_equal([float(r["up [m]"]) for r in path], -e.predictions["hybrid_p_d"].reshape(-1))


def test_units_stand_on_the_axes():
    assert "NRMSE [% of range]" in texts(usual()["models.svg"]) and "[m/s]" in texts(usual()["u.svg"])
    assert {"east [m]", "north [m]", "up [m]"} <= set(rows("3d-flight.csv")[0])


def test_names_from_files_stay_text_on_paper_too():
    evil = "$\\frac{<b>&@ink$phase\n"
    figure = figures_of(evidence(name=evil, evil=evil))["fig-shifts"]
    assert "$\\frac{<b>&@ink$phase" in texts(drawn(figure, light_colours(), {})["svg"])
    assert b"$\\frac{<b>&@ink$phase" in table_of(figure, {})


def test_equal_evidence_makes_equal_files():
    again = drawn(figures_of(evidence())["fig-models"], light_colours(), {})
    assert again == {kind: usual()[f"models.{kind}"] for kind in ("png", "svg")}


def test_bars_stand_where_their_numbers_say():
    """Read back from the picture: the tallest coloured column of a bar chart has the height of its number."""
    layout = {"yaxis": axis("[%]", range=[0, 10])}
    heights = {}
    for value in (2.0, 8.0):
        figure = Figure("fig-x", "x", [bars(["a"], [value], "one", "@blue")], layout, split="test")
        picture = matplotlib.image.imread(io.BytesIO(drawn(figure, light_colours(), {})["png"]))[..., :3]
        blue = matplotlib.colors.to_rgb(light_colours()["blue"])
        heights[value] = int((np.abs(picture - blue).max(axis=2) < 0.02).sum(axis=0).max())
    assert heights[8.0] / heights[2.0] == pytest.approx(4, rel=0.02)


@pytest.mark.parametrize("trace", [{"type": "pie", "x": [1], "y": [1]}, line([1], [1], "one", "@blue", dash="wavy")])
def test_what_cannot_be_drawn_is_an_error(trace):
    with pytest.raises((KeyError, ValueError)):
        drawn(Figure("fig-x", "x", [trace], split="test"), light_colours(), {})


def test_flights_without_a_controller_or_tracing():
    whole = evidence()
    some = replace(whole, controller=None, commanded={}, effects=None, residuals=None)
    assert "fig-models" in figures_of(some) and "fig-residual" not in figures_of(some)
