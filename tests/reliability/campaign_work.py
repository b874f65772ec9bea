"""Cases for the campaign driver that die, fail or compute, importable by the worker processes."""

import os
import signal
from pathlib import Path


def computes(name: str, case: dict) -> dict:
    """A result that depends on the case only."""
    import numpy as np

    return {"case": name, "mean": float(np.random.default_rng(case["seed"]).standard_normal(1000).mean()), "third": 1 / 3}


def kills_its_worker_once(name: str, case: dict) -> dict:
    """As `computes`, but the first try of a case with a `mark` takes the worker's process with it, as the kernel's OOM killer would."""
    mark = case.get("mark")
    if mark and not Path(mark).exists():
        Path(mark).touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return computes(name, {"seed": case["seed"]})


def kills_every_worker(name: str, case: dict) -> dict:
    os.kill(os.getpid(), signal.SIGKILL)
    return {}


def fails(name: str, case: dict) -> dict:
    if case["seed"] == 2:
        raise ValueError("case 2 is broken")
    return computes(name, case)


def identifies(name: str, case: dict) -> dict:
    """A real piece of work, made short: fly, then fit; compiled code, BLAS and threads take part."""
    from awescli.estimation.problem import build, simulator_of
    from awescli.estimation.staged_fit import fit_in_stages
    from awescli.flightlog.loops import find_loops
    from awescli.flightlog.split import split
    from awescli.physics.declaration import read_kite
    from awescli.simulation.campaign_flights import dev_like

    truth = read_kite(Path(__file__).parents[2] / "data" / "kites" / "development.yaml")
    flight = dev_like(truth, case["seed"], {}, duration=32.0)
    parts = split(find_loops(flight.log), log=flight.log)
    problem = build(simulator_of(flight.declared, flight.log), flight.log, parts, 2.0, tuple(flight.log.measured))
    fit, _ = fit_in_stages(problem, (1.0,))
    return {"case": name, "values": fit.solution.x.tolist(), "covariance": fit.covariance.tolist(), "chi2": fit.chi2}


def fills_memory_again(name: str, case: dict) -> dict:
    """How many pages are filled with zeros while 4 MB are taken and given back fifty times."""
    import resource

    import numpy as np

    def pages() -> int:
        return resource.getrusage(resource.RUSAGE_SELF).ru_minflt

    np.ones(2**19)
    before = pages()
    for _ in range(50):
        np.ones(2**19)
    return {"pages": pages() - before}
