"""Tables in 80 columns: whatever they hold, no line is wider and nothing is lost."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from awescli.cli.tables import table_lines
from awescli.notation.quantities import STATES

SENTENCE = "RMS of what the Euler angles do minus the body rates, averaged over a second where the kite flies"


def test_many_channels_of_few_models_are_turned():
    """Twelve states and more, of four models: channels become rows."""
    names = ("mean", *STATES, "V_a", "tension")
    errors = {model: {n: 0.01234 for n in names} for model in ("initial", "identified", "with_effects", "hybrid")}
    lines = table_lines(errors, 80)
    assert max(map(len, lines)) <= 80 and lines[0].split() == list(errors)
    assert [line.split()[0] for line in lines[1:]] == list(names) and lines[1].count("0.01234") == 4


def test_sentences_are_broken_where_there_is_room_and_put_below_where_there_is_none():
    roomy = table_lines({"a": {"value": 1.5, "means": SENTENCE}, "b": {"value": 2.0, "means": "short"}}, 80)
    assert max(map(len, roomy)) <= 80 and len(roomy) == 4 and roomy[2].startswith(" " * 10)
    row = {"value": 1.234, "limit": 3.0, "unit": "deg/s", "": "NOT GOOD", "means": SENTENCE}
    tight = table_lines({"attitude against rates, averaged": row}, 80)
    assert max(map(len, tight)) <= 80 and tight[2].strip().startswith("RMS of what")


def test_numbers_that_do_not_fit_are_cut_into_blocks():
    table = {f"row {i}": {f"column number {j}": 1.0 * i * j for j in range(12)} | {"unit": "m"} for i in range(30)}
    lines = table_lines(table, 80)
    assert max(map(len, lines)) <= 80 and sum("row 29" in line for line in lines) >= 3
    assert all(any(f"column number {j}" in line for line in lines) for j in range(12))


TEXTS = st.text("abcdefg hij.,", max_size=60).map(str.strip)


ROWS = st.dictionaries(st.sampled_from(["a", "b", "value", "means", "unit"]), TEXTS | st.floats(-9, 9), min_size=1)


@given(st.dictionaries(TEXTS, ROWS, min_size=1))
def test_no_line_is_too_wide_and_no_word_is_lost(table):
    lines = table_lines(table, 80)
    assert max(map(len, lines), default=0) <= 80
    words = {w for row in table.values() for cell in row.values() if isinstance(cell, str) for w in cell.split() if len(w) <= 24}
    assert words <= set(" ".join(lines).split()) | {""}


@pytest.mark.parametrize("width", [40, 60, 80, 140])
def test_names_and_values(width):
    lines = table_lines({"found": 3, "missing": SENTENCE}, width)
    assert max(map(len, lines)) <= width and lines[0].split() == ["found", "3"]
