"""Groups on all cores: each is done whole, in order, once, however many there are."""

import time

import pytest

from awescli.engine.machine import LANES
from awescli.simulation import groups


@pytest.mark.parametrize("cores", [1, 2, 3, 5])
@pytest.mark.parametrize("count", [1, 2, 3, 5, 7, 16])
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
