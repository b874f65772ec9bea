"""The kite as a wind sensor: wind against height that a fitted model needs to fly the measured flight, beside station and pitot.

Between nodes the processes of the fit (gusts, errors of the record) are smoothed with parameters held: their best values, and draws of
what they might be as well, each with parameters and the record's errors drawn from what the fit left of them, give the wind at every
sample.
"""

from collections.abc import Mapping, Sequence

import numpy as np

from awescli.estimation.fit import fit
from awescli.estimation.known import Known
from awescli.estimation.misfit import Misfit, NuisanceValues
from awescli.estimation.processes import PROCESSES
from awescli.estimation.processes.base import Process
from awescli.flightlog.log import FlightLog
from awescli.flightlog.reconstruction.wind import wind_of_airspeed
from awescli.flightlog.split import segments as segment_starts
from awescli.flightlog.wind_at import wind_ned
from awescli.notation.angles import wrap
from awescli.notation.errors import BadInput
from awescli.notation.quantities import MEASURED
from awescli.physics.airflow import declared_wind, wind_vector
from awescli.physics.declaration import KiteDeclaration
from awescli.physics.flight_model import FlightModel
from awescli.simulation.rollout import Simulator, wind_inputs
from awescli.simulation.segments import observe

DRAWS = 24
BINS, FEWEST = 12, 2.0
"""Heights at most, and seconds [s] that are flown at one for it to be shown."""
MOST = 100
"""Segments that are smoothed of a long flight, evenly spread."""


def processes_at(declaration: KiteDeclaration, log: FlightLog, levels: Mapping[str, Mapping]) -> tuple[Process, ...]:
    """The processes of a fit as its metrics.json tells them: group -> {level, memory_s}; what is always there as it is."""
    made = []
    for kind in PROCESSES.values():
        p = kind.of(declaration, log)
        level = {g.name: levels[g.name]["level"] if g.name in levels else g.level if p.certain else 0.0 for g in p.groups}
        memory = {g.name: levels[g.name]["memory_s"] for g in p.groups if levels.get(g.name, {}).get("memory_s")}
        made.append(p.at(level, memory))
    return tuple(made)


def wind_profile(
    simulator: Simulator, log: FlightLog, ranges: Sequence[tuple[int, int]], processes: Sequence[Process], known: Known,
    factors: Mapping[str, float], horizon: float = 5.0, seed: int = 0,
) -> list[dict]:  # fmt: skip
    """A row for each height [m] that is flown for long enough: seconds; speed_m_s and direction_deg (where it comes from) of the wind that
    the kite needs and of the station's at the same samples, means of their vectors; speed_std, direction_std of the first; what the pitot
    says where the log has one, with its own.

    simulator: of the fitted kite; processes, factors: levels and noise of its fit; known: of its parameters and of the record. Raises
    BadInput where no segment of `horizon` [s] fits into the ranges.
    """
    steps = int(round(horizon / log.dt))
    first = segment_starts(ranges, steps, valid=log.valid)
    first = first[np.unique(np.linspace(0, len(first) - 1, min(len(first), MOST)).astype(int))]
    if not len(first):
        raise BadInput(f"no {horizon:g} s in a row of flight '{log.name}' can be smoothed", do="Use a shorter horizon.")
    found = {n: float(v) for n, v, is_record in zip(known.names, known.found, known.record, strict=True) if is_record}
    table = simulator.kite.parameters.with_values(found)
    observed = observe(log, simulator.kite, first, steps, MEASURED).scaled(factors)
    misfit = Misfit(simulator.holding(table), observed, (), tuple(processes))
    smoothed = fit(misfit, table, prior=False, iterations=8, tolerance=1.0)
    flies = smoothed.flies
    rows = first[flies][:, None] + np.arange(steps + 1)
    best = _wind(misfit, smoothed.own, {}, flies)
    around = smoothed.information.samples(DRAWS, seed)
    errors = known.draws(simulator.kite, DRAWS, seed, of=np.ones(len(known.names), bool))
    drawn = np.stack([_wind(misfit, smoothed.own.moved(around, 1.0, flies, k), e, flies) for k, e in enumerate(errors)])
    return _by_height(log, rows, best, drawn, _station(log, simulator.kite, rows))


def _station(log: FlightLog, kite: FlightModel, rows: np.ndarray) -> np.ndarray:
    """(2, K, N+1) wind north, east [m/s] that the kite file makes of the record at the kite's heights."""
    inputs = {name: series[rows] for name, series in wind_inputs(log).items()}
    wind = wind_vector(*declared_wind(kite.declaration.wind, kite.heights, -log["p_d"][rows], inputs), inputs["density"])
    return np.stack([wind.n, wind.e])


def _wind(misfit: Misfit, own: NuisanceValues, values: Mapping[str, float], flies: np.ndarray) -> np.ndarray:
    """(2, K, N+1) wind north, east [m/s] at the samples of the segments that fly."""
    kite = misfit.simulator.kite
    segments = misfit.segments(own)
    states = misfit.simulator.rollout(segments).states[flies]
    c = [float(v) for v in kite.with_values(dict(values)).parameters.vector()]
    wind = kite.instant(list(np.moveaxis(states, 2, 0)), list(np.moveaxis(segments.inputs[flies], 2, 0)), c).wind
    return np.stack([np.broadcast_to(w, states.shape[:2]) for w in (wind.n, wind.e)])


def _by_height(log: FlightLog, rows: np.ndarray, best: np.ndarray, drawn: np.ndarray, station: np.ndarray) -> list[dict]:
    """rows: (K, N+1) samples of the log; best, station: (2, K, N+1), drawn: (D, 2, K, N+1) [m/s]."""
    height = -log["p_d"][rows]
    edges = np.linspace(height.min(), height.max(), BINS + 1)
    of = np.clip(np.searchsorted(edges, height, side="right") - 1, 0, BINS - 1)
    flown = [b for b in range(BINS) if (of == b).sum() * log.dt >= FEWEST]
    # what the pitot's reconstruction is linear about
    recorded = np.stack(wind_ned(log.recorded_wind, log.time[rows.ravel()], height.ravel()))[:2].reshape(2, *rows.shape)
    mean = recorded.mean(axis=(1, 2))
    along = mean / max(float(np.hypot(*mean)), 1e-9)
    heights = np.array([height[of == b].mean() for b in flown])
    pitot = wind_of_airspeed(log, heights, along) if flown else None
    by_height = []
    for i, b in enumerate(flown):
        here = of == b
        kite, record = best[:, here].mean(axis=1), station[:, here].mean(axis=1)
        # the filter's own mean is the best; draws say how it might be otherwise
        speed, direction = _polar(kite)
        speeds, directions = np.array([_polar(d[:, here].mean(axis=1)) for d in drawn]).T
        row = {
            "height_m": float(heights[i]), "seconds": float(here.sum() * log.dt), "speed_m_s": speed,
            "direction_deg": np.degrees(direction),
            "speed_std": float(np.sqrt(np.mean((speeds - speed) ** 2))),
            "direction_std": float(np.degrees(np.sqrt(np.mean(wrap(directions - direction) ** 2)))),
            "station_speed_m_s": _polar(record)[0], "station_direction_deg": float(np.degrees(_polar(record)[1])),
        }  # fmt: skip
        if pitot is not None:
            change, covariance = pitot[0][i], pitot[1][i]
            across = np.array([-along[1], along[0]])
            v, d = _polar(recorded[:, here].mean(axis=1) + change[0] * along + change[1] * across)
            row |= {"pitot_speed_m_s": v, "pitot_direction_deg": float(np.degrees(d)), "pitot_speed_std": float(np.sqrt(covariance[0, 0]))}
            row["pitot_direction_std"] = float(np.degrees(np.sqrt(covariance[1, 1]) / max(v, 0.1)))
        by_height.append({key: float(value) for key, value in row.items()})
    return by_height


def _polar(wind: np.ndarray) -> tuple[float, float]:
    """(speed [m/s], direction it comes from [rad, 0..2 pi))."""
    return float(np.hypot(*wind)), float(np.arctan2(-wind[1], -wind[0]) % (2 * np.pi))
