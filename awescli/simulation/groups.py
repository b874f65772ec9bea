"""Groups of LANES segments on all cores.

The work on a group is a generator: where it yields, another thread may take it up. ctypes lets go of Python's lock during a call, so
plain threads do.
"""

import os
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor

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
    """Run work(0), ..., work(groups - 1) to their ends, on all cores.

    The last ones, if threads would be left without one, are shared out by their parts, in turns: three groups take two threads one and a
    half times as long as one group, not twice. Threads live for one call: a pool that is kept would not survive a fork.
    """
    threads = min(groups, cores())
    if threads <= 1:
        for group in range(groups):
            _finish(work(group))
        return
    shared = threads + groups % threads if groups % threads else 0
    with ThreadPoolExecutor(threads) as pool:
        whole = [pool.submit(_finish, work(group)) for group in range(groups - shared)]
        begun = {group: work(group) for group in range(groups - shared, groups)}
        before: dict[int, Future | None] = dict.fromkeys(begun)
        for _ in range(threads - 1):
            before = {group: pool.submit(_take_up, begun[group], before[group]) for group in begun}
        last = [pool.submit(_finish, begun[group], before[group]) for group in begun]
        try:
            for future in (*whole, *last):
                future.result()
        except BaseException:
            pool.shutdown(cancel_futures=True)
            raise


def each_part(work: Callable[[slice], None], count: int) -> None:
    """Run work(slice) on as many parts of `count` segments as there are cores."""
    bounds = parts(count)

    def run(i: int) -> Iterator:
        work(slice(*bounds[i]))
        yield

    each_group(run, len(bounds))


def _finish(work: Iterator, before: Future | None = None) -> None:
    if before:
        before.result()
    for _ in work:
        pass


def _take_up(work: Iterator, before: Future | None) -> None:
    """One part, once the part before it is done: that was begun earlier, so threads that wait are never all that there are."""
    if before:
        before.result()
    next(work, None)
