"""What effects.json says beside the verdict."""

import pytest
from pydantic import TypeAdapter, ValidationError
from tracing.annotated import holds

from awescli.artifacts.forms.words import Number
from awescli.tracing.rest import Rest
from awescli.tracing.summary import bounded, left


def shares(before: float, after: float, samples: int) -> float:
    rest = Rest(0.0, after, {"u": after}, {}, None, samples)
    return left(rest, before)["share"]


def test_what_is_left_of_nothing_is_nothing():
    """Guards the share that is left: of a chi-square that is at its own flight's floor (here 1.083: 2000 samples), nothing can be left,
    however the rest lies; beyond it, the share of the excess counts. A fixed 2 % called noise an excess."""
    assert shares(1.06, 1.05, 2000) == 0.0
    assert shares(3.0, 1.5, 2000) == pytest.approx(0.25)
    assert shares(1.06, 1.05, 200_000) == pytest.approx(5 / 6)
    assert shares(3.0, 0.9, 2000) == 0.0 and shares(3.0, 4.0, 2000) == 1.0


def test_annotations_are_looked_through():
    """Guards the guard: pairs that hold triples are seen, at any depth."""
    pairs = tuple[tuple[str, str], ...]
    assert holds((("a", "b"), ("c", "d")), pairs) and not holds((("a", "b"), ("c", "d", 1.0)), pairs)
    assert holds({"a": (1, None)}, dict[str, tuple[float, int | None]]) and not holds({"a": (1, "x")}, dict[str, tuple[float, int | None]])
    assert not holds(None, float) and not holds([("a", "b")], pairs)


def test_values_of_criteria_fit_into_the_file():
    """Guards effects.json of a model that is nowhere near the flight: 2e18 of deviance was a number that the file's own form refuses."""
    assert bounded(2e18) == 1e15 and bounded(-2e18) == -1e15 and bounded(0) == 0 and bounded("not compared") == "not compared"
    number = TypeAdapter(Number)
    assert number.validate_python(bounded(2e18)) == 1e15
    with pytest.raises(ValidationError):
        number.validate_python(2e18)
