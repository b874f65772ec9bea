"""Groups of LANES segments on all cores.

The work on a group is a generator: where it yields, another thread may take it up. ctypes lets go of Python's lock during a call, so
plain threads do.
"""

import os
from collections import deque
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import AbstractContextManager, nullcontext
from functools import partial
from threading import Lock

from awescli.engine.machine import LANES


def cores() -> int:
    """Cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def groups_of(segments: int) -> int:
    """How many groups hold so many segments."""
    return -(-segments // LANES)


def members(group: int) -> slice:
    """The segments of a group: LANES of them, fewer in the last one."""
    return slice(group * LANES, (group + 1) * LANES)


def parts(samples: int) -> list[tuple[int, int]]:
    """(first, until) of as many parts of a rollout as there are cores: so finely can groups be shared out evenly."""
    n = min(cores(), samples)
    return [(i * samples // n, (i + 1) * samples // n) for i in range(n)]


def each_group(work: Callable[[int], Iterator], groups: int) -> None:
    """Run work(0), ..., work(groups - 1) to their ends, on all cores; the calling thread works too.

    The last ones, if threads would be left without one, are shared out by their parts, in turns: three groups take two threads one and a
    half times as long as one group, not twice. Threads live for one call: a pool that is kept would not survive a fork.
    """
    threads = min(groups, cores())
    shared = threads + groups % threads if threads > 1 and groups % threads else 0
    turns = deque(partial(_finish, work(group), nullcontext()) for group in range(groups - shared))
    begun = [(work(group), Lock()) for group in range(groups - shared, groups)]
    for part in (_take_up,) * (threads - 1) + (_finish,):
        turns.extend(partial(part, *group) for group in begun)
    if threads <= 1:
        _take_turns(turns)
        return
    with ThreadPoolExecutor(threads - 1) as pool:
        others = [pool.submit(_take_turns, turns) for _ in range(threads - 1)]
        _take_turns(turns)
        for other in others:
            other.result()


def each_part(work: Callable[[slice], None], count: int) -> None:
    """Run work(slice) on as many parts of `count` segments as there are cores."""
    bounds = parts(count)

    def run(i: int) -> Iterator:
        work(slice(*bounds[i]))
        yield

    each_group(run, len(bounds))


def _take_turns(turns: deque[Callable[[], None]]) -> None:
    """One after the other, until none is left; where one fails, the other threads begin no more."""
    try:
        while True:
            try:
                turn = turns.popleft()
            except IndexError:
                return
            turn()
    except BaseException:
        turns.clear()
        raise


def _finish(work: Iterator, alone: AbstractContextManager) -> None:
    with alone:
        for _ in work:
            pass


def _take_up(work: Iterator, alone: AbstractContextManager) -> None:
    """The next part: whoever comes to it waits until the part before it is done."""
    with alone:
        next(work, None)
