"""The table of power per phase and cycle, and what the first screen says of the interval."""

from dataclasses import replace

from reporting.small_evidence import evidence

from awescli.reporting.marks import plain
from awescli.reporting.phase_power import phase_table
from awescli.reporting.power import power_claim
from awescli.reporting.rendering import show
from awescli.reporting.words import number


def test_phases_and_cycles_stand_in_the_table_with_intervals():
    """Guards that each phase and cycle has a row of its own for what was measured and for every model, with its interval, and by how much
    its energy is off: a table that grows downwards, whatever there is to compare."""
    found = evidence()
    html = show(phase_table(found))
    for piece in ("traction", "retraction", "cycle 1, 25 % unseen", "30.0 of 40.0", "0.280"):
        assert piece in html, piece
    assert html.count("<tr>") == 1 + 3 * (1 + len(found.models)) and html.count(" to ") >= 3 * len(found.models)
    first = found.scores[found.models[0]]["power"]["by_phase"][0]
    assert number(100 * (first["predicted_J"] - first["measured_J"]) / first["measured_J"]) in html


def test_where_intervals_lie_is_said():
    """Guards the note: a filtered prediction does not use the wind that a fit has found."""
    found = evidence()
    assert "of the wind that the fit has found" in show(phase_table(found))
    filtered = show(phase_table(replace(found, scores={**found.scores, "initial_states": "filtered"})))
    assert "they lie about the values" in filtered and "has found" not in filtered


def test_a_flight_without_phases_has_no_table():
    """Guards artifacts of before: a block without by_phase makes no table, and no claim of an interval."""
    found = evidence()
    bare = {m: b | {"power": {k: v for k, v in b["power"].items() if k not in ("by_phase", "by_cycle", "interval_W")}}
            for m, b in found.scores.items() if m in found.models}  # fmt: skip
    old = replace(found, scores={**found.scores, **bare})
    assert phase_table(old) == "" and "(90 %)" not in plain(power_claim(old)) and power_claim(old)


def test_the_claim_says_whether_the_interval_holds():
    """Guards the sentence: 290 W times (1 - 0.1 / 27) is above 280 W, 290 W times (1 - 0.1) is not."""
    assert "which holds the measured value" in plain(power_claim(evidence()))
    found = evidence()
    declared = {k: v for k, v in found.scores.items() if k not in ("identified", "with_effects", "hybrid")}
    assert "which does not hold" in plain(power_claim(replace(found, scores=declared)))
