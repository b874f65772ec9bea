"""Multi-step prediction of unseen flight: starts estimated from the second before, then simulated freely, and scored.

The start of a prediction is fitted to the measurements of a warm-up window that ends where the prediction begins; nothing measured after
that moment is used (but the replayed set-points, the winch and the wind, where the model is driven by them). What acts beside the model
(gusts, a longer line, model error) is left out, or begins as the warm-up shows it and fades (`filtered_start`).
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from awescli.estimation.filtered_start import as_reported, filtered
from awescli.estimation.fit import fit
from awescli.estimation.known import Known
from awescli.estimation.misfit import Misfit
from awescli.flightlog.log import FlightLog
from awescli.flightlog.split import WARM_UP, prediction_starts
from awescli.notation.errors import BadInput
from awescli.notation.frames import rotate_back, rotation_body_to_ned
from awescli.notation.quantities import MEASURED, STATES
from awescli.physics.declaration import Noise
from awescli.simulation import scores
from awescli.simulation.rollout import Segments, Simulator, Trajectories
from awescli.simulation.segments import Observed, noise_std, observe

SCORED = (*STATES, "V_a", "alpha", "beta", "tension")


@dataclass(frozen=True)
class Prediction:
    """Predicted segments beside what was measured.

    time: (N+1,) s from the start of a prediction; first: (K,) sample where each begins; measured, simulated: name -> (K, N+1);
    alive: (K,) samples before divergence; spans: name -> y_max - y_min of the whole measured flight part; floor: name -> NRMSE
    that the sensor noise alone causes.
    """

    time: np.ndarray
    first: np.ndarray
    measured: dict[str, np.ndarray]
    simulated: dict[str, np.ndarray]
    alive: np.ndarray
    spans: dict[str, float]
    floor: dict[str, float]

    def errors(self, name: str) -> np.ndarray:
        """(K, N+1) error; a diverged segment keeps the last error before it diverged."""
        e = scores.error(self.measured[name], self.simulated[name], name)
        for k in np.flatnonzero(self.alive <= e.shape[1] - 1):
            e[k, self.alive[k] :] = e[k, max(self.alive[k] - 1, 0)]
        return e

    def nrmse(self) -> dict[str, float]:
        """NRMSE per channel, and `mean` over the 12 states (docs/equations.md (30))."""
        result = {name: scores.nrmse(self.errors(name), self.spans[name]) for name in self.simulated}
        result["mean"] = float(np.mean([result[n] for n in STATES]))
        return result

    def noise_floor(self) -> dict[str, float]:
        """What a perfect model would score."""
        return {**self.floor, "mean": float(np.mean([self.floor[n] for n in STATES]))}

    @property
    def diverged(self) -> int:
        """How many predictions left the numbers."""
        return int(np.sum(self.alive < len(self.time)))


def predict(
    simulator: Simulator, log: FlightLog, ranges: Sequence[tuple[int, int]], horizon: float,
    values: Mapping[str, float] | None = None, warm_up: float = WARM_UP, every: float | None = None, known_starts: bool = False,
    known: Known | None = None,
) -> Prediction:  # fmt: skip
    """Predict `horizon` seconds ahead, again and again through the sample `ranges`, and compare.

    values: parameter name -> value where it differs from the simulator's kite; every: [s] between predictions, default one after the
    other; known_starts: begin at the measured states, smoothed, instead of those that the warm-up says (Rositani eq. 11c); known: begin in
    the air, line and model error as well that a filter over the warm-up sees, with the processes and the noise of that (`filtered_start`).
    Divergence is counted, never raised. Raises BadInput where no range is long enough.
    """
    before, ahead = int(round(warm_up / log.dt)), int(round(horizon / log.dt))
    begin = prediction_starts(log, ranges, horizon, warm_up, every)
    if not begin.size:
        what = f"no prediction of {horizon:g} s fits into the loops of flight '{log.name}' that it is to be scored on"
        raise BadInput(what, do="Use a shorter horizon, or a longer flight; `awes check` lists what was left out and why.")
    trajectories, skip = forecast(simulator, log, begin + before, ahead, 0 if known_starts else before, values, known)
    return compare(log, trajectories, begin + before, skip, ranges, simulator.kite.declaration.noise)


def forecast(
    simulator: Simulator, log: FlightLog, first: np.ndarray, ahead: int, before: int, values: Mapping[str, float] | None = None,
    known: Known | None = None,
) -> tuple[Trajectories, int]:  # fmt: skip
    """(trajectories, which of their samples stands at `first`): `ahead` samples from each of the samples `first` (K,) of the log; before:
    samples of the warm-up that a start is fitted to, or 0: it is the measured state, smoothed; known: as in `predict`."""
    observed = observe(log, simulator.kite, first - before, before + ahead, MEASURED)
    if before and known is not None:
        held = simulator.holding(simulator.kite.parameters.with_values(values or {}))
        return as_reported(*filtered(held, observed, before, known)), before
    segments = warmed_up(simulator, observed, before, values) if before else observed.segments
    return simulator.rollout(segments, values), before


def warmed_up(simulator: Simulator, observed: Observed, before: int, values: Mapping[str, float] | None = None) -> Segments:
    """Segments whose starts fit their first `before` samples."""
    table = simulator.kite.parameters.with_values(values or {})
    warm = fit(Misfit(simulator.holding(table), observed.head(before), ()), table, prior=False, iterations=8, tolerance=1.0)
    return observed.segments.starting_at(warm.own.starts)


def compare(
    log: FlightLog, trajectories: Trajectories, first: np.ndarray, skip: int, ranges: Sequence[tuple[int, int]], noise: Noise
) -> Prediction:
    """A Prediction from simulated segments whose sample `skip` stands at sample `first` of the log."""
    simulated = {n: trajectories[n][:, skip:] for n in SCORED if n in STATES or n in log}
    return beside(log, simulated, trajectories.alive - skip, first, ranges, noise)


def beside(
    log: FlightLog, simulated: dict[str, np.ndarray], alive: np.ndarray, first: np.ndarray, ranges: Sequence[tuple[int, int]], noise: Noise
) -> Prediction:
    """A Prediction from simulated channels (K, N+1) that begin at the samples `first` of the log, beside what it measured; alive: (K,)
    samples before divergence."""
    count = simulated["p_n"].shape[1]
    rows = first[:, None] + np.arange(count)[None]
    measured = {n: log[n][rows] for n in simulated}
    part = np.concatenate([np.arange(a, b) for a, b in ranges])
    spans = {n: scores.span(log[n][part]) for n in simulated}
    return Prediction(np.arange(count) * log.dt, first, measured, simulated, alive, spans, noise_floor(log, spans, part, noise))


def noise_floor(log: FlightLog, spans: dict[str, float], part: np.ndarray, noise: Noise) -> dict[str, float]:
    """NRMSE of the measurement noise alone, per channel: what no model can undercut on these samples.

    (u, v, w) are derived from noisy velocities and Euler angles, so their noise is propagated (one seeded draw per sample).
    """
    rng = np.random.default_rng(0)
    sigma = {n: noise_std(noise, n, log[n][part]) for n in MEASURED if n in log}
    noisy = {n: log[n][part] + sigma[n] * rng.standard_normal(len(part)) for n in ("phi", "theta", "psi", "v_n", "v_e", "v_d")}
    R = rotation_body_to_ned(noisy["phi"], noisy["theta"], noisy["psi"])
    body = rotate_back(R, (noisy["v_n"], noisy["v_e"], noisy["v_d"]))
    derived = {n: float(np.sqrt(np.mean((body[i] - log[n][part]) ** 2))) for i, n in enumerate("uvw")}
    return {n: (derived[n] if n in derived else float(np.sqrt(np.mean(sigma[n] ** 2)))) / spans[n] for n in spans}
