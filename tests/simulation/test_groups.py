"""Groups on all cores: each is done whole, in order, once, however many there are."""

import time

import pytest

from awescli.engine.machine import LANES
from awescli.simulation import groups


@pytest.mark.parametrize("cores", [1, 2, 3, 5])
@pytest.mark.parametrize("count", [0, 1, 2, 3, 5, 7, 16])
def test_every_part_of_every_group_is_done_once_and_in_order(monkeypatch, cores, count):
    """Guards groups that are handed from thread to thread: a part may not begin before the one before it has ended."""
    monkeypatch.setattr(groups, "cores", lambda: cores)
    done, inside = {group: [] for group in range(count)}, set()

    def work(group):
        for first, until in groups.parts(20):
            if first:
                yield
            assert group not in inside
            inside.add(group)
            time.sleep(1e-4 * ((group + first) % 3))
            done[group] += range(first, until)
            inside.remove(group)

    groups.each_group(work, count)
    assert all(samples == list(range(20)) for samples in done.values())


def test_an_error_ends_what_is_still_waiting(monkeypatch):
    """Guards against a failure, or an interruption, that waits for hundreds of groups that nobody wants any more."""
    done = []

    def work(group):
        if group == 0:
            raise ValueError("first")
        time.sleep(2e-3)
        done.append(group)
        yield

    monkeypatch.setattr(groups, "cores", lambda: 2)
    with pytest.raises(ValueError, match="first"):
        groups.each_group(work, 200)
    assert len(done) <= 20


def test_an_error_in_a_part_is_raised(monkeypatch):
    monkeypatch.setattr(groups, "cores", lambda: 2)

    def work(group):
        yield
        if group == 2:
            raise ValueError("part")

    with pytest.raises(ValueError, match="part"):
        groups.each_group(work, 3)


def test_members_of_groups():
    assert groups.groups_of(LANES) == 1 and groups.groups_of(LANES + 1) == 2
    assert list(range(LANES + 3))[groups.members(1)] == [LANES, LANES + 1, LANES + 2]
    assert groups.parts(1) == [(0, 1)]
