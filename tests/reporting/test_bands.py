"""Bands on the page: drawn as they are in the arrays, around angles too, with the share that they hold; models without are named."""

from dataclasses import replace

import numpy as np
import pytest
from reporting.small_evidence import evidence

from awescli.reporting.plots import Figure, with_gaps
from awescli.reporting.prediction import BAND_POINTS, banded, bands_said, prediction


def figures(piece) -> list[Figure]:
    """All figures of a section or of what it holds."""
    if isinstance(piece, Figure):
        return [piece]
    parts = piece if isinstance(piece, (list, tuple)) else list(vars(piece).values()) if hasattr(piece, "__dict__") else []
    return [f for part in parts for f in figures(part)]


def panel(shown, name: str) -> Figure:
    return next(f for f in figures(prediction(shown)) if f.id == f"fig-{name}")


def test_the_band_of_the_last_physical_model_is_shaded():
    """Guards the figure: low and high edges as in predictions.npz, the second filled down to the first; a prediction without a band leaves
    a gap in it and none in the lines."""
    shown = evidence()
    assert banded(shown) == "with_effects" and shown.best == "hybrid"
    arrays = dict(shown.predictions)
    arrays["low_with_effects_V_a"] = arrays["low_with_effects_V_a"].copy()
    arrays["low_with_effects_V_a"][0] = arrays["high_with_effects_V_a"][0]
    *lines, low, high = panel(replace(shown, predictions=arrays), "V_a").data
    assert high["fill"] == "tonexty" and "fill" not in low
    assert arrays["measured_V_a"].size <= BAND_POINTS
    count = len(arrays["time"])
    for trace, edge in ((low, "low"), (high, "high")):
        drawn = with_gaps(arrays[f"{edge}_with_effects_V_a"])
        assert np.isnan(trace["y"][:count]).all() and trace["y"][count + 1 : 2 * count] == pytest.approx(drawn[count + 1 : 2 * count])
    assert np.isfinite(lines[0]["y"][:count]).all()


def test_an_angle_that_goes_round_takes_its_band_along():
    """Guards a yaw angle that passes a half turn: the band stays beside the measured line, which is drawn on."""
    shown = evidence()
    arrays = dict(shown.predictions)
    turning = np.linspace(3.0, 3.4, arrays["time"].size) + 0 * arrays["measured_psi"]
    wrapped = (turning + np.pi) % (2 * np.pi) - np.pi
    for n in ("measured_psi", "with_effects_psi"):
        arrays[n] = wrapped
    arrays["low_with_effects_psi"], arrays["high_with_effects_psi"] = wrapped - 0.1, wrapped + 0.1
    measured, *_, low, high = panel(replace(shown, predictions=arrays), "psi").data
    assert np.nanmax(np.abs((high["y"] + low["y"]) / 2 - measured["y"])) < 1e-9
    assert np.nanmax(high["y"] - low["y"]) == pytest.approx(0.2 * 180 / np.pi)


def test_the_share_inside_is_said_and_who_has_no_band():
    """Guards the sentence and the column."""
    shown = evidence()
    said = bands_said(shown)
    assert said.startswith("Shaded: where 90 % of all measured samples should lie") and "; 91 % do. No band:" in said
    assert shown.label("hybrid") in said and shown.label("identified") not in said
    without = replace(shown, scores={k: {**v, "bands": {"outcome": "none"}} if isinstance(v, dict) and "nrmse" in v else v
                                     for k, v in shown.scores.items()})  # fmt: skip
    assert bands_said(without) == "" and "fill" not in panel(without, "V_a").data[-1]
    lost = {**shown.scores["with_effects"]["bands"], "outcome": "2 of 9 predictions diverged"}
    some = replace(shown, scores={**shown.scores, "with_effects": {**shown.scores["with_effects"], "bands": lost}})
    assert "91 % do (2 of 9 predictions diverged, and have none)" in bands_said(some)
