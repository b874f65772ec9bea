"""What stands behind a verdict on the page: why each candidate was taken or not, whiteness, correlations, the effect in action, the meaning
of words, the sheet of paper."""

import re
from dataclasses import replace

import numpy as np
import pytest
from reporting.small_evidence import evidence
from reporting.test_page import EVIL, Reader

from awescli.flightlog.consistency import most
from awescli.notation.quantities import MEASURED, SURFACES
from awescli.reporting.candidates import because, ranking
from awescli.reporting.correlation import correlation
from awescli.reporting.flight import checks
from awescli.reporting.headline import _share
from awescli.reporting.html import page
from awescli.reporting.in_action import gaining, made_of_it
from awescli.reporting.marks import Code, Link, OnScreen, Strong, plain, table
from awescli.reporting.one_page import one_page
from awescli.reporting.rendering import show
from awescli.reporting.residual import outliers
from awescli.reporting.terms import TERMS, TIPS
from awescli.reporting.whiteness import spectra, what_is_left
from awescli.reporting.words import CHANNELS

CANDIDATE = {
    "name": "wind_veer", "acts_on": "airflow", "score": 36.2, "p_value": 1e-8, "explained_share": 0.4, "plausible_size": True,
    "test_gain": 0.01, "outcome": "converged", "significant": True, "deviance_gain": 101.0,
}  # fmt: skip
BEST = {**CANDIDATE, "name": "actuator_lag", "acts_on": "rudder", "score": 195.0, "deviance_gain": 1744.0}


def ranked(*candidates):
    e = evidence()
    return replace(e, effects={**e.effects, "ranking": [BEST, *candidates]})


@pytest.mark.parametrize("change, says", [
    ({}, "It gains a deviance of 101, 1643 less than the best."),
    ({"significant": False, "p_value": 0.12, "score": 4.3}, "Its score of 4.30 is within chance for so many candidates (p = 0.12)."),
    ({"outcome": "failed"}, "Its score of 36.2 is significant, but its fit failed from every start."),
    ({"outcome": "not fitted"}, "Its score of 36.2 is significant, but far below the best (195): not fitted."),
    ({"outcome": "set aside"},
     "It gains a deviance of 101, and so may a controller that answers gusts better than the log shows them."),
    ({"outcome": "set aside", "deviance_gain": -8.0}, "It gains a deviance of −8.00, 1752 less than the best."),
    ({"outcome": "given up"},
     "Its score of 36.2 is significant, but its fit came to less than half of the best gain (1744), and was given up."),
    ({"plausible_size": False}, "It leads the declared model by a deviance of 101, but only at the end of its plausible range."),
])  # fmt: skip
def test_why_a_candidate_lost(change, says):
    """One sentence with the number that decided, for every way to lose."""
    c = {**CANDIDATE, **change}
    assert because(ranked(c), c, taken=False, rival=False) == says
    assert says in Reader(show(ranking(ranked(c)))).text


def test_what_is_set_aside_is_neither_the_best_nor_the_next():
    """Guards a page of a flight in gusts: a lag set aside with 63 was "the best", and "next" with 0 % of the gap beside a bias of 58."""
    aside = {**CANDIDATE, "name": "actuator_delay", "outcome": "set aside", "deviance_gain": 9999.0, "explained_share": 0.0}
    little = {**CANDIDATE, "deviance_gain": -2.0, "explained_share": 0.0}
    e = ranked(aside, little)
    assert because(e, little, False, False) == "It gains a deviance of −2.00, 1746 less than the best."
    found = {"name": BEST["name"], "acts_on": BEST["acts_on"]}
    e = replace(e, effects={**e.effects, "ranking": [{**BEST, "explained_share": 1.0}, aside, little]})
    assert "next" not in str(_share(e, found))
    e = replace(e, effects={**e.effects, "ranking": [{**BEST, "explained_share": 1.0}, aside, {**little, "explained_share": 0.4}]})
    assert "next" in str(_share(e, found))


def test_who_was_taken_and_who_does_as_well():
    e = ranked(CANDIDATE)
    assert because(e, BEST, taken=True, rival=False) == "Taken: it leads the declared model by a deviance of 1744."
    assert because(e, CANDIDATE, taken=False, rival=True).startswith("Rival: it leads the declared model by a deviance of 101, and")


def test_what_a_candidate_would_have_needed_where_nothing_was_found():
    e = ranked(CANDIDATE)
    criteria = [{"name": "effect_likelier", "value": 5.0, "threshold": 12.0, "pass": False, "says": "", "source": ""}]
    e = replace(e, effects={**e.effects, "effects": [], "criteria": criteria, "chi2": {"train_before": 2.0, "train_after": 2.0}})
    assert because(e, CANDIDATE, False, False) == "It gains a deviance of 101; 12.0 over an unnamed model error is required."


def test_a_spectrum_is_drawn_as_it_was_measured():
    """Units: a power in rad2/Hz is shown in deg2/Hz; zero frequency, whose mean was taken out, is not shown."""
    e = evidence()
    e = replace(e, residuals={**e.residuals, "study_before_spectrum_phi": 2 * e.residuals["study_before_spectrum_phi"]})
    _, shown = spectra(e)
    panels = shown.body
    assert len(panels) == 6
    phi = panels[0]
    assert phi.id == "fig-spectrum-phi", "the channel that changed most comes first"
    before, after = phi.data
    assert np.allclose(after["y"], np.degrees(1) ** 2) and np.all(np.asarray(before["y"]) > 1.1 * np.degrees(1) ** 2)
    assert np.asarray(before["x"])[0] > 0 and phi.layout["yaxis"]["title"]["text"] == "[(°)²/Hz]"
    assert "1.02" in show(what_is_left(e)) and "70.0 %" in show(what_is_left(e))
    assert spectra(replace(e, residuals=None)) == ()


def test_correlations_are_those_of_the_matrix_without_the_record():
    """Names of the wind record's nuisances are no parameters; sign and size of each square are those of the fit."""
    squares = [(t["name"], *one) for t in correlation(evidence()).data for one in zip(t["x"], t["y"], t["text"], strict=True)]
    drawn = {(x, y): (name, said) for name, x, y, said in squares}
    assert drawn == {("lag.tau", "Ca"): ("together, 0.95 to 1", "0.970"), ("Ca", "Cb"): ("against each other, 0.6 to 0.8", "−0.700")}
    assert correlation(replace(evidence(), traced_params=None, params=None)) == ""


def test_values_that_were_left_out_are_counted():
    e = evidence()
    assert outliers(e) == ""
    text = show(outliers(replace(e, effects={**e.effects, "outliers": {"theta": 3, "a_z": 1}})))
    assert "left out" in text and "3 of pitch" in text and "1 of " in text


def test_the_effect_in_action_shows_what_it_made_and_the_channel_that_gains():
    e = evidence()
    received, made = made_of_it(e.actions[0]).data
    some = np.isfinite(made["y"])
    assert (received["name"], made["name"]) == ("set-point", "deflection, inferred")
    assert np.allclose(np.asarray(made["y"])[some], np.degrees(np.sin(np.tile(e.predictions["time"], 3) - 0.2)))
    worse = {n: 0.03 for n in e.effects["error"]["after"]} | {"r": 0.2}
    (figure,) = gaining(replace(e, effects={**e.effects, "error": {**e.effects["error"], "before": worse}}))
    assert "yaw rate r" in figure.title.lower()
    measured, without, with_it = ([v for v in t["y"] if np.isfinite(v)] for t in figure.data)
    error = np.degrees(e.residuals["test_before_r"][:3].reshape(-1))
    assert np.allclose(np.subtract(measured, without), error) and not np.allclose(without, with_it)


def test_words_have_their_meaning_beside_them():
    """Heads and channels of tables; all channels that sensors report; the meaning of a name from a file is nothing but text."""
    text = show(table(("channel", "NRMSE"), [("roll φ", 1.0), (f"roll φ{EVIL}", 2.0)]))
    elements = Reader(text).elements
    assert [a["title"] for tag, a in elements if tag == "abbr"] == [TIPS["roll φ"]] and "right wing down positive" in TIPS["roll φ"]
    assert [a.get("title") for tag, a in elements if tag == "button"][1:] == [None, TERMS["NRMSE"]]
    assert not [tag for tag, _ in elements if tag in ("script", "img")]
    assert all(CHANNELS[n] in TIPS for n in (*MEASURED, *SURFACES))


def test_data_checks_that_failed_come_first():
    e = evidence()
    good, warns, stops = (most(name, value, "m", 1.0, 5.0, "") for name, value in (("good", 0.5), ("warns", 2.0), ("stops", 9.0)))
    text = show(checks(replace(e, quality=replace(e.quality, checks=(good, warns, stops)))))
    assert text.index("stops") < text.index("warns") < text.index(">good<")


@pytest.mark.parametrize("evil", ["", EVIL])
def test_the_sheet_is_one_page_and_always_the_same(evil):
    sheet = one_page(evidence(evil=evil))
    assert sheet.startswith(b"%PDF") and len(re.findall(rb"/Type /Page\b", sheet)) == 1 and b"CreationDate" not in sheet
    assert sheet == one_page(evidence(evil=evil))


def test_the_sheet_does_without_what_did_not_run():
    e = evidence()
    bare = replace(e, effects=None, traced_params=None, residuals=None, actions=(), controller=None, hybrid=None, flown=None)
    assert one_page(bare).startswith(b"%PDF") and page(bare)


def test_paper_leaves_out_what_is_to_be_clicked():
    said = "The error fell.", OnScreen((" ", Link("x", "See the paths"), ".")), " ", Strong("So"), " & ", Code("<so>")
    assert plain(said) == "The error fell. So & <so>" and "See the paths" in show(said) and "&lt;so&gt;" in show(said)
