"""What a model leaves of a flight, seen in five ways: forces and moments, short and long predictions, loops, spectra, clocks."""

import numpy as np
from scipy.signal import welch

from awescli.estimation.prediction import Prediction, predict
from awescli.flightlog.clocks import clock_offset
from awescli.flightlog.log import FlightLog
from awescli.flightlog.loops import Loops
from awescli.flightlog.phases import range_rate
from awescli.flightlog.smoothing import local_quadratic
from awescli.flightlog.split import Split
from awescli.notation.frames import dot, rotate_back
from awescli.notation.quantities import SURFACES
from awescli.physics.rigid_body import force_for, moment_for
from awescli.simulation.rollout import Simulator, inputs_of
from awescli.simulation.segments import smooth_states

SHORT = 0.5
"""[s] lead of the innovation: long enough to leave the sensors' noise behind, short enough that errors have not mixed."""
BINS = 12
"""Phase bins of a loop."""
RATE_WINDOW = 0.3
"""[s] window of the local quadratic that gives angular accelerations."""


def residual_study(
    simulator: Simulator, log: FlightLog, parts: Split, loops: Loops, ahead: Prediction, horizon: float
) -> tuple[dict, dict]:  # fmt: skip
    """(summary for effects.json, arrays for residuals.npz) of one model on the whole flight. ahead: its prediction of the test loops,
    `horizon` seconds long.

    summary: equation_error (RMS of force [N] and moment [N m] left, and of the tension model against the load cell [N]), innovation
    (NRMSE at 0.5 s and at `horizon`, test loops), loop_averaged_share (channel -> share of the innovation's variance that repeats from
    loop to loop), clock (winch against onboard).
    """
    forces, arrays = equation_error(simulator, log)
    everything = [(int(loops.bounds[0][0]), int(loops.bounds[-1][1]))]
    short = predict(simulator, log, everything, SHORT)
    share, averaged = loop_averaged(short, loops)
    frequency, power = spectra(short)
    arrays |= {f"innovation_{n}": short.errors(n)[:, -1] for n in short.simulated}
    arrays |= {"innovation_first": short.first + len(short.time) - 1, "frequency": frequency}
    arrays |= {f"averaged_{n}": a for n, a in averaged.items()} | {f"spectrum_{n}": p for n, p in power.items()}
    on_test = {f"{SHORT:g}": predict(simulator, log, parts.test, SHORT).nrmse()["mean"], f"{horizon:g}": ahead.nrmse()["mean"]}
    return {"equation_error": forces, "innovation": on_test, "loop_averaged_share": share, "clock": _clock(log)}, arrays


def equation_error(simulator: Simulator, log: FlightLog) -> tuple[dict, dict]:
    """Force and moment that the log shows and the model does not, at the (smoothed) measured states: (RMS by component, series).

    Force: M a - f, with the measured acceleration where the log has one, else from the velocity, and what moves with the kite in M
    (`rigid_body.force_for`); moment: J omega_dot + omega x J omega - M, with the whole J (Klein & Morelli, ch. 5). tension: load cell less
    the model's constraint force. Regressing on these is biased in closed loop: they are looked at, not fitted to.
    """
    kite = simulator.kite
    z = smooth_states(log)
    rates = local_quadratic(z[:, 9:12], log.dt, RATE_WINDOW, derivative=1).T
    states = [*z.T, *(np.zeros(len(log)) for _ in kite.state_names[12:])]
    setpoints = [log.inputs.get(s, np.zeros(len(log))) for s in SURFACES]
    c, u = list(kite.parameters.vector()), list(inputs_of(log, kite).T)
    initial = kite.initial([*states, *setpoints], u, c)
    states[12:] = [np.broadcast_to(s, len(log)) for s in initial]
    at = kite.instant([*states, *setpoints], u, c)
    if "a_x" in log:
        acceleration = log["a_x"], log["a_y"], log["a_z"]
    else:
        d = local_quadratic(z[:, 3:6], log.dt, RATE_WINDOW, derivative=1).T
        w = z[:, 9:12].T
        v = z[:, 3:6].T
        acceleration = d[0] + w[1] * v[2] - w[2] * v[1], d[1] + w[2] * v[0] - w[0] * v[2], d[2] + w[0] * v[1] - w[1] * v[0]
    needed = force_for(at.body, at.applied, acceleration, rotate_back(at.R, at.p_hat))
    p, q, r = (rate - model for rate, model in zip(rates, at.derivative[9:12], strict=True))
    lacking = moment_for(at.body, (p, q, r))
    series = {f"force_{axis}": needed[i] - at.applied.force[i] for i, axis in enumerate("xyz")}
    series |= {f"moment_{axis}": moment for axis, moment in zip("xyz", lacking, strict=True)}
    if "tension" in log:
        series["tension"] = log["tension"] - at.tension
        # along the line, with the load cell instead of the model's tension: what the aerodynamic model alone gets wrong
        pull = dot(at.p_hat, [sum(at.R[i][j] * series[f"force_{'xyz'[j]}"] for j in range(3)) for i in range(3)])
        series["along_line_with_load_cell"] = pull + series["tension"]
    good = log.valid
    return {n: float(np.sqrt(np.mean(s[good] ** 2))) for n, s in series.items()}, {f"equation_{n}": s for n, s in series.items()}


def loop_averaged(short: Prediction, loops: Loops) -> tuple[dict, dict]:
    """(channel -> share of the innovation's variance that repeats from loop to loop, channel -> mean over loops by phase bin).

    What repeats is physics or a sensor; what does not is turbulence or noise. The share is freed of what averaging leaves of noise.
    """
    sample = short.first + len(short.time) - 1
    loop = np.searchsorted(loops.bounds[:, 0], sample, side="right") - 1
    inside = (loop >= 0) & (sample < loops.bounds[np.clip(loop, 0, None), 1])
    begin, end = loops.bounds[np.clip(loop, 0, None)].T
    phase = np.clip((sample - begin) / np.maximum(end - begin, 1), 0, 0.999)
    bin_of = np.where(inside, (phase * BINS).astype(int), -1)
    share, averaged = {}, {}
    for name in short.simulated:
        e = short.errors(name)[:, -1]
        mean, expected = np.zeros(BINS), 0.0
        counts = np.array([np.sum(bin_of == b) for b in range(BINS)])
        for b in np.flatnonzero(counts):
            values = e[bin_of == b]
            mean[b] = values.mean()
            expected += values.var(ddof=1) if counts[b] > 1 else 0.0
        used = counts > 1
        total = float(np.mean(e[inside] ** 2)) or 1.0
        noise = expected / max(used.sum(), 1) / max(counts[used].mean() if used.any() else 1.0, 1.0)
        share[name] = float(np.clip((np.mean(mean[used] ** 2) - noise) / total, 0, 1)) if used.any() else 0.0
        averaged[name] = mean
    return share, averaged


def spectra(short: Prediction) -> tuple[np.ndarray, dict]:
    """Welch spectra of the innovation at the short lead, one value per prediction: (frequency [Hz], channel -> power)."""
    step = float(np.median(np.diff(short.first))) * (short.time[1] - short.time[0]) if len(short.first) > 1 else 1.0
    segment = min(64, len(short.first))
    frequency, power = np.zeros(0), {}
    for name in short.simulated:
        frequency, power[name] = welch(short.errors(name)[:, -1], fs=1 / step, nperseg=segment)
    return frequency, power


def _clock(log: FlightLog) -> dict | None:
    """Winch clock against the onboard one, from range rate and reel-out speed; None where it cannot be seen."""
    if "reel_out_speed" not in log:
        return None
    offset = clock_offset(range_rate(log), log["reel_out_speed"], log.dt)
    return None if offset is None else {"winch_late_s": offset.late, "correlation": offset.correlation, "clear": bool(offset.clear)}
