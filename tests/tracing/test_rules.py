"""What is accepted and what is not, on made-up costs: the rules that keep a wrong name away, without a flight."""

from types import SimpleNamespace

import numpy as np
import pytest

from awescli.tracing.race import FLOOR_ERROR, GUSTY_FLOOR_ERROR, GUSTY_MATERIAL, MATERIAL
from awescli.tracing.trace import Round, Trace, _admissible, _credible, _decide, _material, _unbeaten
from awescli.tracing.verdict import _better

DOF, BLOCKS = 1000.0, 10
CALM = SimpleNamespace(material=MATERIAL, floor_error=FLOOR_ERROR)
GUSTY = SimpleNamespace(material=GUSTY_MATERIAL, floor_error=GUSTY_FLOOR_ERROR)


def runner(chi2: float, key: str = "", keys: tuple[str, ...] = (), wobble: float = 0.0, extra: float = 0.0):
    """A model whose blocks cost chi2 per degree of freedom in fit and choice alike, give or take `wobble`, plus `extra` in all."""
    cost = np.full(BLOCKS, chi2 * DOF / BLOCKS + extra / (2 * BLOCKS)) + wobble * np.where(np.arange(BLOCKS) % 2, 1.0, -1.0)
    fit = SimpleNamespace(information=SimpleNamespace(dof=np.full(BLOCKS, DOF / BLOCKS)))
    return SimpleNamespace(
        keys=(*keys, key), train_cost=cost, choice_cost=cost.copy(), train_deviance=cost, choice_deviance=cost.copy(), choice_dof=DOF,
        choice_chi2=float(cost.sum() / DOF), fit=fit,
    )  # fmt: skip


def rounds(*steps: tuple[str, float, float]) -> list[Round]:
    return [Round((), key, (), (), before, after) for key, before, after in steps]


def test_far_from_the_floor_a_gain_must_be_a_good_part_of_what_is_missing():
    """Guards against naming an effect that explains 5 % of a large residual, and for one of 5 % that reaches the noise."""
    assert not _material(CALM, runner(3.0), runner(2.9))
    assert _material(CALM, runner(3.0), runner(2.7))
    assert _material(CALM, runner(1.05), runner(1.0))


def test_in_gusty_air_a_smaller_gain_counts():
    """Guards the material gain: estimated gusts take up most of what an effect does, so that little of it is left to be gained."""
    before, after = runner(1.0), runner(0.999)
    for r in (before, after):
        r.choice_cost, r.choice_deviance, r.choice_dof = 20 * r.choice_cost, 20 * r.choice_deviance, 20 * DOF
    assert _material(GUSTY, before, after) and not _material(CALM, before, after)


def test_a_gain_that_two_blocks_carry_alone_is_none():
    """Guards the block-wise certainty: most blocks lose a little, two win much."""
    after = runner(3.0)
    after.choice_deviance = np.where(np.arange(BLOCKS) < 8, after.choice_cost * 1.05, after.choice_cost * 0.02)
    assert after.choice_deviance.sum() < 0.9 * runner(3.0).choice_cost.sum() and not _material(CALM, runner(3.0), after)


def test_at_the_floor_a_gain_on_few_blocks_counts_unless_one_carries_it():
    """Guards effects that show on few loops, as stall does; far from the floor the same gain is none."""
    def after(before: float, gains: list[float]):
        r = runner(before)
        r.choice_deviance = r.choice_cost - np.array([*gains, *[-1.0] * (BLOCKS - len(gains))])
        return r

    assert _material(GUSTY, runner(1.0), after(1.0, [25.0, 20.0])) and not _material(GUSTY, runner(1.0), after(1.0, [45.0]))
    assert not _material(GUSTY, runner(1.3), after(1.3, [25.0, 20.0]))


@pytest.mark.parametrize(
    "air, gain, chi2, counts", [(GUSTY, 2.2, 1.03, True), (GUSTY, 2.2, 1.05, False), (CALM, 5.0, 1.015, True), (CALM, 5.0, 1.03, False)]
)
def test_within_the_floors_own_error_there_is_no_gap_to_explain(air, gain, chi2, counts):
    """Guards effects in gusty air whose chi-square is 3 % above its floor, which is within the floor's error there: what is certain counts
    there without a tenth of that excess; above it the same gain does not."""
    before, after = runner(chi2), runner(chi2)
    for r in (before, after):
        r.choice_cost, r.choice_deviance, r.choice_dof = 20 * r.choice_cost, 20 * r.choice_deviance, 20 * DOF
    after.choice_deviance = before.choice_deviance - gain + 0.3 * np.cos(np.arange(BLOCKS))
    assert _material(air, before, after) is counts


def test_who_is_likelier_than_the_answer_is_heard():
    """Guards the name against a worse one that alone is material: once something is missing, likelihood says what; who gains on the fit
    segments alone still does not count, nor anybody where nothing is material."""
    def after(train: float, choice: float):
        r = runner(1.0)
        r.train_deviance, r.choice_deviance = r.train_cost - train / BLOCKS, r.choice_cost - choice / BLOCKS
        return r

    material, likelier, overfitted, worse = after(20.0, 15.0), after(40.0, 8.0), after(90.0, -5.0), after(5.0, 8.0)
    assert _admissible(GUSTY, runner(1.0), [material, overfitted, worse, likelier]) == [likelier, material]
    assert _admissible(GUSTY, runner(1.0), [likelier, overfitted, worse]) == []


@pytest.mark.parametrize("last, kept", [(1.005, 3), (1.3, 2)])
def test_what_only_mends_the_form_of_an_effect_is_dropped(last, kept):
    """Guards a second name for the rest of a form that is not the library's: kept where the floor is reached, dropped where not."""
    models = [runner(9.0), runner(1.8, "a"), runner(last, "b", ("a",))]
    left, record = _credible(CALM, models, rounds(("a", 9.0, 1.8), ("b", 1.8, last)))
    assert len(left) == kept and [r.accepted for r in record] == ["a", "b" if kept == 3 else ""]
    assert record[1].dropped == ("" if kept == 3 else "b")


def test_a_second_effect_of_its_own_size_stays_although_something_is_left():
    """Guards pairs: the second effect explains a third of all that was missing."""
    models = [runner(9.0), runner(4.0, "a"), runner(1.3, "b", ("a",))]
    assert len(_credible(CALM, models, rounds(("a", 9.0, 4.0), ("b", 4.0, 1.3)))[0]) == 3


def test_what_leaves_most_of_a_large_residual_is_no_answer():
    """Guards a real flight: gains on unseen loops that leave 60 % of the excess drop out, whatever their number."""
    models = [runner(9.0), runner(7.0, "a"), runner(5.8, "b", ("a",))]
    left, record = _credible(CALM, models, rounds(("a", 9.0, 7.0), ("b", 7.0, 5.8)))
    assert left == models[:1] and [r.dropped for r in record] == ["a", "b"] and not any(r.accepted for r in record)
    assert len(_credible(CALM, [runner(1.15), runner(1.06, "a")], rounds(("a", 1.15, 1.06)))[0]) == 2


def test_rivals_are_those_whom_the_winner_does_not_lead_for_certain():
    """Guards `cannot_tell`: a lead of less than 10 in cost, or of less than one standard error of the blocks, is none."""
    best, close, noisy, far = (runner(1.0, "best"), runner(1.0, "close", extra=8.0), runner(1.0, "noisy", extra=30.0, wobble=20.0),
                               runner(1.0, "far", extra=40.0))  # fmt: skip
    assert _decide([far, close, best, noisy]) == (best, ("close", "noisy"))
    assert _unbeaten([best, close, far]) == [best, close]
    assert _decide([]) == (None, ())


def traced(*after: float) -> Trace:
    steps = zip((9.0, *after), after, strict=False)
    return Trace(runner(9.0), runner(after[-1] if after else 9.0), tuple(rounds(*((f"e{i}", *s) for i, s in enumerate(steps)))))


@pytest.mark.parametrize(
    "bank, library, better",
    [
        ((), (), False), ((2.0,), (), True),
        # one effect that explains most is not beaten by three empirical terms together, only by the first alone
        ((5.0, 2.0, 1.0), (1.8,), False), ((1.1,), (1.8,), True), ((1.7,), (1.8,), False),
        # several effects are beaten by fewer terms that do as well
        ((1.2,), (3.0, 1.2), True), ((4.0, 1.3), (3.0, 1.2), False),
    ],
)  # fmt: skip
def test_empirical_terms_are_weighed_at_equal_numbers(bank, library, better):
    """Guards both errors: a wrong name where terms do better, and `unexplained` where a named effect has not quite the library's form."""
    assert _better(traced(*bank), traced(*library)) is better


@pytest.mark.parametrize("before, after, kept", [(1.3, 1.2, 1), (1.3, 1.1, 2), (1.021, 1.015, 2)])
def test_what_leaves_more_than_half_is_no_answer_unless_it_reaches_the_floor(before, after, kept):
    """Guards an effect that explains a third of a large residual, and a small one whose rest is within what the floor is known to."""
    left, record = _credible(CALM, [runner(before), runner(after, "a")], rounds(("a", before, after)))
    assert len(left) == kept and [r.accepted for r in record] == ["a" if kept == 2 else ""]
