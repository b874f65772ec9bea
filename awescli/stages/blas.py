"""One thread for linear algebra while a stage runs: the order of its sums, and so the last bits of every number, would depend on more."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any


@contextmanager
def one_blas_thread() -> Iterator[None]:
    """Whatever OPENBLAS_NUM_THREADS (or MKL's, or BLIS') says, and whoever imported numpy before: one thread inside, as before outside.

    Segments run in parallel anyway, and their matrices are small.
    """
    # a library that is loaded later would not be limited: numpy and scipy each bring their own
    import numpy  # noqa: F401
    import scipy.linalg  # noqa: F401
    from threadpoolctl import threadpool_limits

    with threadpool_limits(limits=1, user_api="blas"):
        yield


def blas() -> list[dict[str, Any]]:
    """What computes the linear algebra of this process: library, version, kernels, threads."""
    from threadpoolctl import threadpool_info

    found = [
        {"library": i["internal_api"], "version": i.get("version"), "kernels": i.get("architecture"), "threads": i["num_threads"]}
        for i in threadpool_info()
        if i["user_api"] == "blas"
    ]
    return [one for n, one in enumerate(found) if one not in found[:n]]
