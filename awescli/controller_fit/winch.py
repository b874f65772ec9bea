"""The law of the winch from the log: how fast it paid out, phase by phase, for the load that it measured.

    v_ref = v + kv sqrt(f) + k (max(f - f_high, 0) - max(f_low - f, 0)),    tau df/dt = T - f,    tau_d ds/dt = v_ref - s

docs/equations.md (34), the law of the effect `winch_control` behind a filter of the load, and the drum that follows with a lag
(`winch_tracking`). s is linear in v, kv, k: for given lags and limits these are a linear least-squares problem (variable projection,
Golub & Pereyra, SIAM J. Numer. Anal. 10, 1973). Which of the terms a phase has is chosen on loops that nothing was fitted to.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product

import numpy as np
from scipy.optimize import least_squares, lsq_linear
from scipy.signal import lfilter

from awescli.flightlog.log import FlightLog, runs_of
from awescli.flightlog.phases import apart_from_changes, phases
from awescli.flightlog.split import PARTS, Split
from awescli.notation.phases import WORKING
from awescli.physics.effects.winch_control import asked_speed

SETTLING = 2.0
"""[s] after which a run has forgotten how it began: lags are tenths of a second."""
ENDING = 2.5
"""[s] at the end of a run: a winch changes its law before the kite's motion shows that the phase has changed."""
SHORTEST = 6.0
"""[s] shorter runs of a phase tell nothing."""
LAGS = (0.02, 3.0)
"""[s] between which both lags lie."""
QUANTILES = (0.1, 0.3, 0.5, 0.7, 0.9)
"""Of the load, at which limits are first looked for."""
NO_WORSE, SMALLEST = 1.05, 1e-3
"""A law with fewer terms is taken where its error on validation loops is within this factor of the best one's, and [m/s] beside."""
TERMS = (
    ("v",), ("kv",), ("v", "kv"), ("v", "f_high"), ("v", "f_low"), ("kv", "f_high"), ("kv", "f_low"), ("v", "f_low", "f_high"),
    ("kv", "f_low", "f_high"),
)  # fmt: skip
"""What a law may consist of: a speed, a share of the root of the load, limits of the load beyond which it gives way by k."""
UNITS = {"v": "m/s", "kv": "m/s/sqrt(N)", "k": "m/s/N", "f_low": "N", "f_high": "N", "tau": "s", "tau_d": "s"}
BOUNDS = {"v": (-20.0, 20.0), "kv": (0.0, 1.0), "k": (0.0, 0.1)}
"""As of the effect `winch_control`."""


@dataclass(frozen=True)
class Run:
    """A stretch of one phase without a change near: load [N], speed [m/s], (N,) each, dt [s]; part: of the split; scored: (N,) bool."""

    load: np.ndarray
    speed: np.ndarray
    dt: float
    part: str
    scored: np.ndarray


@dataclass(frozen=True)
class PhaseLaw:
    """Of one phase. values, std (None: the flight does not show it): of what its terms name, and tau, tau_d; rmse [m/s], nrmse [-]: part ->
    error of the speed; seconds: scored of each part."""

    terms: tuple[str, ...]
    values: Mapping[str, float]
    std: Mapping[str, float | None]
    rmse: Mapping[str, float]
    nrmse: Mapping[str, float]
    seconds: Mapping[str, float]

    def described(self) -> dict:
        """Plain data."""
        rows = {n: {"value": v, "std": self.std[n], "unit": UNITS[n]} for n, v in self.values.items()}
        errors = {"rmse_m_s": dict(self.rmse), "nrmse": dict(self.nrmse), "seconds": dict(self.seconds)}
        return {"terms": list(self.terms), "parameters": rows, **errors}


def fit_winch(log: FlightLog, parts: Split) -> dict[str, PhaseLaw]:
    """Phase -> the law of the winch in it, of the phases that last in the train and in the validation part."""
    found = {}
    for phase in WORKING:
        runs = runs_in(log, parts, phase)
        if {"train", "validation"} <= {run.part for run in runs}:
            found[phase] = _chosen(runs)
    return found


def runs_in(log: FlightLog, parts: Split, phase: str) -> list[Run]:
    """The stretches of a phase in the parts of a split, changes of phase left out."""
    labels, runs = phases(log), []
    usable = (labels == phase) & apart_from_changes(labels, log.dt) & log.valid
    for part in PARTS:
        for first, last in getattr(parts, part):
            for a, b in runs_of(usable[first:last]):
                here = slice(first + a, first + b)
                if (b - a) * log.dt >= SHORTEST:
                    since = np.arange(b - a) * log.dt
                    scored = (since >= SETTLING) & (since < since[-1] - ENDING)
                    runs.append(Run(np.maximum(log["tension"][here], 0.0), log["reel_out_speed"][here], log.dt, part, scored))
    return runs


def predicted(run: Run, values: Mapping[str, float]) -> np.ndarray:
    """(N,) [m/s] the speed that a law makes of the load, from the measured one on."""
    return _drum(run, asked_speed(lag(run.load, run.dt, values["tau"], run.load[0]), **_law(values)), values["tau_d"])


def lag(signal: np.ndarray, dt: float, tau: float, begins: float) -> np.ndarray:
    """(N,) a first-order lag of a signal (N,) that is straight between samples: exact."""
    a = np.exp(-dt / tau)
    share = (1 - a) * tau / dt
    return lfilter([1 - share, share - a], [1.0, -a], signal, zi=[begins - (1 - share) * signal[0]])[0]


def _law(values: Mapping[str, float]) -> dict[str, float]:
    return {"v": 0.0, "kv": 0.0, "k": 0.0, "f_low": 0.0, "f_high": np.inf} | {n: v for n, v in values.items() if n not in ("tau", "tau_d")}


def _drum(run: Run, asked: np.ndarray, tau: float) -> np.ndarray:
    return lag(asked, run.dt, tau, run.speed[0])


def _chosen(runs: Sequence[Run]) -> PhaseLaw:
    laws = [law for terms in TERMS if _in_order((law := _fitted(runs, terms)).values)]
    limit = NO_WORSE * min(law.rmse["validation"] for law in laws) + SMALLEST
    best = min((law for law in laws if law.rmse["validation"] <= limit), key=lambda law: (len(law.values), law.rmse["validation"]))
    return replace(best, std=_std([run for run in runs if run.part == "train"], best.values))


def _in_order(values: Mapping[str, float]) -> bool:
    """Whether a law gives way above a higher load than it hauls in below."""
    return values.get("f_low", 0.0) <= values.get("f_high", np.inf)


def _fitted(runs: Sequence[Run], terms: tuple[str, ...]) -> PhaseLaw:
    """The law of these terms, fitted to the train part."""
    train = [run for run in runs if run.part == "train"]
    loads = np.concatenate([run.load for run in train])
    limits = [n for n in terms if n in ("f_low", "f_high")]
    size = max(float(np.median(loads)), 1.0)

    def values_at(z: np.ndarray) -> dict[str, float]:
        lags = dict(zip(("tau", "tau_d"), np.exp(z[:2]).tolist(), strict=True))
        return lags | dict(zip(limits, (size * z[2:]).tolist(), strict=True))

    def residual(z: np.ndarray) -> np.ndarray:
        return _projected(train, terms, values_at(z))[1]

    low, high = [np.log(LAGS[0])] * 2 + [0.0] * len(limits), [np.log(LAGS[1])] * 2 + [1.2 * loads.max() / size] * len(limits)
    starts = [q for q in product(np.quantile(loads, QUANTILES) / size, repeat=len(limits)) if list(q) == sorted(q)]
    first = min((np.array([np.log(0.2), np.log(0.2), *q]) for q in starts), key=lambda z: float(np.square(residual(z)).sum()))
    found = least_squares(residual, np.clip(first, low, high), bounds=(low, high), x_scale="jac", max_nfev=60)
    values = _projected(train, terms, values_at(found.x))[0] | values_at(found.x)
    scores = {part: _score([run for run in runs if run.part == part], values) for part in dict.fromkeys(run.part for run in runs)}
    rmse, nrmse, seconds = ({part: score[i] for part, score in scores.items()} for i in range(3))
    return PhaseLaw(terms, values, {}, rmse, nrmse, seconds)


def _projected(runs: Sequence[Run], terms: tuple[str, ...], values: Mapping[str, float]) -> tuple[dict[str, float], np.ndarray]:
    """(best v, kv, k for given lags and limits, residual [m/s] at the scored samples)."""
    linear = [n for n in ("v", "kv") if n in terms] + (["k"] if {"f_low", "f_high"} & set(terms) else [])
    columns, target = [], []
    for run in runs:
        none = dict.fromkeys(linear, 0.0)
        alone = predicted(run, {**values, **none})
        columns.append(np.stack([predicted(run, {**values, **none, n: 1.0}) - alone for n in linear], axis=1)[run.scored])
        target.append((run.speed - alone)[run.scored])
    A, b = np.concatenate(columns), np.concatenate(target)
    scale = np.maximum(np.abs(A).max(axis=0), 1e-12)
    bounds = np.array([BOUNDS[n] for n in linear]).T * scale
    found = lsq_linear(A / scale, b, bounds=(bounds[0], bounds[1]))
    x = found.x / scale
    return dict(zip(linear, map(float, x), strict=True)), A @ x - b


def _score(runs: Sequence[Run], values: Mapping[str, float]) -> tuple[float, float, float]:
    """(RMSE [m/s], NRMSE, seconds) over the scored samples."""
    errors = np.concatenate([(predicted(run, values) - run.speed)[run.scored] for run in runs])
    speeds = np.concatenate([run.speed[run.scored] for run in runs])
    rmse = float(np.sqrt(np.mean(errors**2)))
    return rmse, rmse / max(float(np.ptp(speeds)), 1e-9), float(len(errors) * runs[0].dt)


def _std(runs: Sequence[Run], values: Mapping[str, float]) -> dict[str, float | None]:
    """Standard deviations of the values, from the residual and its memory: its variance times the samples that it takes to be another one
    (1 + 2 sum of the autocorrelation, to its first zero)."""

    def errors(of: Mapping[str, float]) -> np.ndarray:
        return np.concatenate([(predicted(run, of) - run.speed)[run.scored] for run in runs])

    e, names = errors(values), list(values)
    steps = {n: 1e-4 * max(abs(values[n]), 1e-3) for n in names}
    moved = ((errors({**values, n: values[n] + s}), errors({**values, n: values[n] - s}), s) for n, s in steps.items())
    J = np.stack([(ahead - behind) / (2 * s) for ahead, behind, s in moved], axis=1)
    centred = e - e.mean()
    power = np.abs(np.fft.rfft(centred, 2 * len(e))) ** 2
    correlation = np.fft.irfft(power)[: len(e)] / max(float(centred @ centred), 1e-30)
    until = int(np.argmax(correlation <= 0)) or len(e)
    memory = 1.0 + 2.0 * float(correlation[1:until].sum())
    size = np.maximum(np.linalg.norm(J, axis=0), 1e-30)
    covariance = float(np.mean(e**2)) * memory * np.linalg.pinv((J / size).T @ (J / size))
    variance = np.maximum(np.diag(covariance), 0.0) / size**2
    # what the residual does not depend on is not known
    return {n: float(np.sqrt(v)) if s > 1e-30 else None for n, v, s in zip(names, variance, size, strict=True)}
