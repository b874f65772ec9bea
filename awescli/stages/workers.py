"""Independent pieces of work on several processes: of this machine, or of a Dask cluster that somebody else has started.

Dask (extra `cluster`) because schedulers, restarts of workers and lost connections are its trade: the work of a process that dies is
given to another one. It pickles between our own processes only; nothing that is kept.
"""

import os
import signal
from collections.abc import Callable, Generator, Iterator, Mapping
from contextlib import contextmanager, suppress
from queue import SimpleQueue
from typing import Any
from uuid import uuid4

from awescli.notation.errors import BadInput

DEATHS = 3
"""Workers that one piece of work may take with it before it is called failed: a killed worker is bad luck, three are the work itself."""
PATIENCE = 15
"""Seconds in which a scheduler must answer."""

Work = Callable[[str, Any], Any]


@contextmanager
def connected(workers: int, scheduler: str | None = None) -> Iterator[Any]:
    """A connection to the scheduler at the address, or to `workers` processes of our own; None where no process is asked for, for all to be
    done in this one. Raises BadInput where Dask is not installed or the scheduler does not answer."""
    if scheduler is None and workers < 1:
        yield None
        return
    try:
        from dask import config
        from distributed import Client, LocalCluster
    except ImportError:
        what = "several processes need Dask, which is not installed"
        raise BadInput(what, do="pip install distributed; or --workers 0: one after the other, in this process.") from None
    if scheduler is not None:
        try:
            client = Client(scheduler, timeout=PATIENCE)
        except (OSError, ValueError) as e:
            raise BadInput(f"no Dask scheduler answers there ({e or type(e).__name__})", f"--scheduler {scheduler}",
                           "Start one (`dask scheduler`), or leave it out: processes of this machine.") from None  # fmt: skip
        with client:
            yield client
        return
    settings = {
        "distributed.scheduler.allowed-failures": DEATHS,
        # one piece of work per core: threads inside it would only wait for each other. A user's own choice stands.
        "distributed.nanny.pre-spawn-environ.OMP_NUM_THREADS": os.environ.get("OMP_NUM_THREADS", "1"),
        # Dask has the C library give free memory back at once, and a fit in gusts needs it again: a third of its time went into clean pages
        "distributed.nanny.pre-spawn-environ.MALLOC_TRIM_THRESHOLD_": None,
        "distributed.worker.preload": [__name__],
    }
    with (
        config.set(settings),
        # a flight takes the memory that it takes: a share of the machine's each is no limit of ours
        LocalCluster(n_workers=workers, threads_per_worker=1, memory_limit=0, dashboard_address="127.0.0.1:0", silence_logs=50) as cluster,
        Client(cluster) as client,
    ):
        yield client
        # a process that is just being started anew, after a death, makes Dask stumble over it as it closes
        with suppress(TimeoutError):
            client.wait_for_workers(workers, timeout=PATIENCE)


def dask_setup(worker: Any) -> None:
    """Called by Dask in each of our processes as it starts. A terminal sends Ctrl-C to them too; they end when this process tells them to,
    and would be started again where they ended before."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)


def outcomes(
    client: Any, work: Work, todo: Mapping[str, Any], hear: Callable[[str, Any], None] | None = None
) -> Generator[tuple[str, Any | Exception], None, None]:
    """(name, what `work(name, case)` gave back or raised), as they end. client: of `connected`; hear(name, message): called, in the thread
    that asks for outcomes, with what the work has reported by `tell`. Left early, what still runs is asked to stop.
    """
    if client is None:
        for name, case in todo.items():
            try:
                yield name, work(name, case)
            except Exception as e:
                yield name, e
        return
    events: SimpleQueue[tuple[str, Any, Any]] = SimpleQueue()
    run = f"awes-{uuid4().hex}"
    if hear is not None:
        client.subscribe_topic(run, lambda event: events.put((event[1]["name"], event[1]["message"], None)))
    # keys of its own: a piece of this run is never answered by what another client of the same scheduler left behind
    futures = {name: client.submit(work, name, case, key=f"{i}:{run}", retries=0) for i, (name, case) in enumerate(todo.items())}
    for name, future in futures.items():
        future.add_done_callback(lambda done, name=name: events.put((name, None, done)))
    try:
        left = len(futures)
        while left:
            name, message, done = events.get()
            if done is None:
                if hear is not None:
                    hear(name, message)
                continue
            left -= 1
            error = done.exception()
            yield name, done.result() if error is None else error
            futures.pop(name).release()
    finally:
        if futures:
            client.cancel(list(futures.values()), force=True)


def tell(name: str, message: Any) -> None:
    """From inside `work`, on a worker: a message (plain data) for whoever waits. Raises KeyboardInterrupt where nobody waits any more."""
    from distributed import get_worker

    worker = get_worker()
    key = worker.get_current_task()
    state = worker.state.tasks.get(key)
    if state is None or state.state not in ("executing", "long-running"):
        raise KeyboardInterrupt
    worker.log_event(str(key).partition(":")[2], {"name": name, "message": message})
