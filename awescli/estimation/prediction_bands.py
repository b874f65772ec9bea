"""Bands around predictions: where a measured channel should lie, with what is known of the model, and how often it does.

A prediction begins at the start z0 that fits its warm-up (`prediction.warmed_up`: weighted least squares, the noise taken for white). With
S, P, G, D the exact sensitivities of the outputs to start, parameters p, disturbances w and drifts d, the errors of that start and of the
prediction are linear in what is not known:

    dz0 = H^-1 (K o - S'W (P dp + G dw + D dd + v))            over the warm-up; H = S'W S + K, W the weights that were used
    dy  = P dp + G dw + D dd + v + S dz0                       over the prediction

K, o: prior precision and true values of the effects' own states at the start. So a drift of the attitude shifts the start too, and what the
start has taken up of it is taken off again. Where a prediction begins in the air that a filter over the warm-up sees
(`filtered_start`), what is fitted is (z0, w, d) together: S has a column for each unit step that the processes take up to there, K is 1 for
it, and what they do later counts as it comes. dp is as the fit left it (the common factor of the moment equation with its prior, and the
record's error), dw and dd are processes at their levels, v is white. Nothing else is approximated than linearity:
variances are those of the dense covariance (tests/estimation/test_prediction_bands.py).
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import ndtri

from awescli.estimation.filtered_start import filtered
from awescli.estimation.known import Known
from awescli.estimation.links import Links
from awescli.estimation.misfit import Misfit, NuisanceValues
from awescli.estimation.power_interval import LEVEL
from awescli.estimation.prediction import Prediction, warmed_up
from awescli.estimation.processes.base import active
from awescli.flightlog.log import FlightLog
from awescli.flightlog.split import WARM_UP
from awescli.notation.angles import wrap
from awescli.notation.frames import rotation_body_to_ned
from awescli.notation.quantities import ANGLES, MEASURED
from awescli.simulation.rollout import BODY_VELOCITY, Simulator
from awescli.simulation.segments import noise_std, observe

SPACING = 0.05
"""[s] between nodes at least: what processes do between them changes no band."""
ROOM = 2**28
"""Bytes that the sensitivities of a few segments may fill at once."""
NO_BANDS = {
    "network": {"outcome": "none: nothing says how well a network is known"},
    "regression": {"outcome": "none: its errors ahead are no process that a fit one step ahead knows"},
    "measured_starts": {"outcome": "none: it begins at measured states, whose smoothing is not modelled"},
}
"""What is said of models and settings without bands."""
ROUNDING = 1e-9
"""Share of a variance that keeps a slow process's covariance positive."""
SOURCES = ("parameters", "processes", "start", "noise")
VELOCITY, ATTITUDE = ("v_n", "v_e", "v_d"), ("phi", "theta", "psi")


@dataclass(frozen=True)
class Bands:
    """Of the K predictions of a `Prediction`.

    centre: channel -> (K, N+1) the prediction with what is believed of the record's error; std: source -> channel -> (K, N+1), of SOURCES;
    whole: (K,) which predictions have a band: they did not diverge, nor do their sensitivities; new: channel -> (K, N+1) samples with a new
    measured value.
    """

    centre: dict[str, np.ndarray]
    std: dict[str, dict[str, np.ndarray]]
    whole: np.ndarray
    new: dict[str, np.ndarray]

    def half(self, name: str) -> np.ndarray:
        """(K, N+1) half the width of a channel's band."""
        return float(ndtri((1 + LEVEL) / 2)) * np.sqrt(sum(self.std[source][name] ** 2 for source in SOURCES))

    def edges(self, name: str) -> tuple[np.ndarray, np.ndarray]:
        """(low, high), each (K, N+1); an angle may pass a half turn, as its centre's neighbourhood does."""
        half = self.half(name)
        return self.centre[name] - half, self.centre[name] + half

    def hits(self, prediction: Prediction, name: str) -> tuple[int, int]:
        """(samples inside the band, samples that count) of a channel."""
        error = prediction.measured[name] - self.centre[name]
        counted = self.new[name] & self.whole[:, None]
        within = np.abs(wrap(error) if name in ANGLES else error) <= self.half(name)
        return int((within & counted).sum()), int(counted.sum())

    def coverage(self, prediction: Prediction) -> dict:
        """metrics.json's `bands`: `inside`, channel -> share of samples, `all` of them together; `half_width`, its mean, and `std`, what
        makes it, SI. Where no prediction has a band, an outcome alone."""
        lost, count = int((~self.whole).sum()), len(self.whole)
        found = {"level": LEVEL, "predictions": count, "outcome": f"{lost} of {count} predictions diverged" if lost else "computed"}
        hits = {name: self.hits(prediction, name) for name in self.centre}
        hits = {name: (inside, of) for name, (inside, of) in hits.items() if of}
        if not hits:
            return found
        inside, of = (sum(h[i] for h in hits.values()) for i in (0, 1))
        return found | {
            "inside": {name: a / b for name, (a, b) in hits.items()} | {"all": inside / of},
            "half_width": {name: float(self.half(name)[self.whole].mean()) for name in hits},
            "std": {s: {name: float(np.sqrt((self.std[s][name][self.whole] ** 2).mean())) for name in hits} for s in SOURCES},
        }


def bands(simulator: Simulator, log: FlightLog, prediction: Prediction, known: Known, filters: bool = False) -> Bands:
    """Of predictions that `prediction.predict` made with this simulator from starts that a warm-up said; filters: it had `known` too."""
    kite, dt = simulator.kite, float(prediction.time[1])
    before, ahead = int(round(WARM_UP / dt)), len(prediction.time) - 1
    kept = [i for i, n in enumerate(known.names) if n in simulator.wrt]
    names = tuple(known.names[i] for i in kept)
    observed = observe(log, kite, prediction.first - before, before + ahead, MEASURED)
    processes = tuple(replace(p, spacing=max(p.spacing, SPACING)) for p in known.processes)
    if filters:
        begun, own = filtered(simulator, observed, before, known)
        observed = begun.observed
    else:
        observed = replace(observed, segments=warmed_up(simulator, observed, before))
        begun = Misfit(simulator, observed, ())
        own = begun.own()
    misfit = Misfit(simulator, observed, names, processes)
    own = misfit.carried(own, begun)
    rows = observed.segments.first[:, None] + np.arange(before + ahead + 1)
    noise = np.stack([known.factors.get(n, 1.0) * noise_std(kite.declaration.noise, n, log[n]) for n in observed.outputs], axis=1)[rows]
    whole = simulator.rollout(misfit.segments(own)).alive > before + ahead
    channels = [n for n in prediction.simulated if n in observed.outputs or (n in BODY_VELOCITY and {*VELOCITY} <= {*observed.outputs})]
    shape = prediction.measured[channels[0]].shape
    shift = {n: np.zeros(shape) for n in channels}
    std = {source: {n: np.zeros(shape) for n in channels} for source in SOURCES}
    cases = len(misfit.axes) * len(misfit.nodes) + 2 * (len(names) + misfit.simulator.n_s)
    at_once = max(int(ROOM / (8 * cases * rows.shape[1] * len(observed.outputs))), 1)
    factor, found = _root(known.covariance[np.ix_(kept, kept)]), known.found[kept]
    every = np.flatnonzero(whole)
    for part in np.split(every, range(at_once, len(every), at_once)) if len(every) else ():
        some = replace(misfit, observed=observed.pick(part))
        links, trajectories = some.links(kite.parameters.vector(names), NuisanceValues(own.starts[part], own.path[part]))
        shifts, variances = spread(some, links, before, factor, found, noise[part], node_covariances(some), filters)
        of = {n: trajectories[n][:, before:] for n in ATTITUDE} | {n: prediction.simulated[n][part] for n in BODY_VELOCITY}
        for name in channels:
            M = _of_outputs(name, observed.outputs, of)
            shift[name][part] = (M * shifts).sum(axis=-1)
            for source, V in variances.items():
                std[source][name][part] = np.sqrt(np.maximum(np.einsum("knab,kna,knb->kn", V, M, M), 0.0))
        whole[part] &= np.all([np.isfinite(s[n][part]).all(axis=1) for s in std.values() for n in channels], axis=0)
    centre = {n: prediction.measured[n] - prediction.errors(n) + np.where(whole[:, None], shift[n], 0.0) for n in channels}
    std = {source: {n: np.where(whole[:, None], v, 0.0) for n, v in of.items()} for source, of in std.items()}
    fresh = {n: np.all([log.is_new(o) for o in ((*VELOCITY, *ATTITUDE) if n in BODY_VELOCITY else (n,))], axis=0) for n in channels}
    ahead_rows = rows[:, before:]
    return Bands(centre, std, whole, {n: (fresh[n] & log.valid)[ahead_rows] for n in channels})


def spread(
    misfit: Misfit, links: Links, before: int, factor: np.ndarray, found: np.ndarray, noise: np.ndarray, covariances: np.ndarray,
    filters: bool = False,
) -> tuple[np.ndarray, dict[str, np.ndarray]]:  # fmt: skip
    """((K, N_a, n_out) change of the outputs with what is `found` of the globals, source -> (K, N_a, n_out, n_out) covariances) over the
    N_a samples from `before` on, the start fitted to those up to it. factor: (n, m) root of the globals' covariance; noise: (K, N, n_out)
    standard deviations of the white noise; covariances: (W, L + 1, L + 1) of the processes at the nodes; filters: they are fitted too."""
    K, N, n_out = links.r.shape
    n_start, unknown = links.n_start, links.unknown
    bare = replace(links, weight=np.ones_like(links.weight))

    def response(start=None, path=None, change=None) -> np.ndarray:
        c = next(a.shape[-1] for a in (start, path, change) if a is not None)
        at_rest = np.zeros((n_start, c)), np.zeros((len(links.bounds), len(misfit.axes), c)), np.zeros((links.n, c))
        return responses(misfit, bare, *(rest if a is None else a for a, rest in zip((start, path, change), at_rest, strict=True)))

    S, precision = response(start=np.eye(n_start)), np.r_[np.zeros(unknown), 1 / links.spread**2]
    if filters:
        seen, later = steps_of(covariances, misfit.nodes, before)
        S, precision = np.concatenate([S, response(path=seen)], axis=-1), np.r_[precision, np.ones(seen.shape[-1])]
    head = S[:, : before + 1].reshape(K, -1, len(precision))
    weighted = head * (links.weight[:, : before + 1].reshape(K, -1, 1)) ** 2
    H = np.linalg.inv(np.matmul(weighted.swapaxes(1, 2), head) + np.diag(precision))
    A = np.matmul(H, weighted.swapaxes(1, 2))

    def ahead(Y: np.ndarray) -> np.ndarray:
        """(K, N_a, n_out, c) errors of the prediction for changes Y (K, N, n_out, c) of what is observed, the start fitted anew."""
        answer = np.matmul(A, Y[:, : before + 1].reshape(K, head.shape[1], Y.shape[-1]))
        return Y[:, before:] - np.matmul(S[:, before:], answer[:, None])

    def squared(Y: np.ndarray) -> np.ndarray:
        return np.matmul(Y, Y.swapaxes(-1, -2))

    of_globals = ahead(response(change=np.eye(links.n)))
    if filters:
        processes = squared(np.matmul(S[:, before:], H[:, None, :, n_start:])) + squared(response(path=later)[:, before:])
    else:
        processes = squared(ahead(response(path=unit_paths(covariances))))
    # what the warm-up's white noise does to the start, and what is not known of the effects' states there
    v = noise[:, : before + 1].reshape(K, 1, -1)
    started = np.concatenate([A * v, H[:, :, unknown:n_start] * np.sqrt(precision[unknown:n_start])], axis=2)
    white = np.zeros((K, N - before, n_out, n_out))
    white[..., np.arange(n_out), np.arange(n_out)] = noise[:, before:] ** 2
    start = squared(np.matmul(S[:, before:], _reduced(started)[:, None]))
    # the prediction's first sample is the warm-up's last one: its noise has moved the start towards it
    both = np.matmul(S[:, before], A[:, :, -n_out:] * noise[:, before, None] ** 2)
    white[:, 0] += start[:, 0] - both - both.swapaxes(1, 2)
    start[:, 0] = 0.0
    variances = {"parameters": squared(np.matmul(of_globals, factor)), "processes": processes, "start": start, "noise": white}
    return np.matmul(of_globals, found), variances


def responses(misfit: Misfit, links: Links, start: np.ndarray, path: np.ndarray, change: np.ndarray) -> np.ndarray:
    """(K, N, n_out, c) what c cases change of the outputs: start (n_start, c) of the states there, path (L + 1, W, c) of the processes,
    change (n, c) of the globals."""
    K, L, c = len(links), len(links.nodes), change.shape[-1]
    acting, drifting = (
        np.broadcast_to(misfit.axes.summed(path, onto, len(names)), (K, L + 1, len(names), c))
        for onto, names in ((misfit.axes.acts, misfit.disturbances), (misfit.axes.drifts, misfit.drifts))
    )
    states, E = np.zeros((K, L, links.n_s, c)), links.end_sensitivities()
    states[:, 0, : len(start)] = start
    for m in range(L - 1):
        states[:, m + 1] = np.matmul(E[:, m], np.concatenate([states[:, m], acting[:, m], acting[:, m + 1]], axis=1))
    return links.changed(states, acting, drifting, change)


def node_covariances(misfit: Misfit) -> np.ndarray:
    """(W, L + 1, L + 1) of every axis of the processes at the nodes, of the form that its group says."""
    times, groups = misfit.nodes * misfit.observed.segments.dt, {g.name: g for g in active(misfit.processes)}
    apart = np.abs(times[:, None] - times)
    return np.array([groups[name].form(groups[name], apart) for name, _ in misfit.labels]).reshape(-1, *apart.shape)


def unit_paths(covariances: np.ndarray) -> np.ndarray:
    """(L + 1, W, W (L + 1)) paths of independent axes whose products add up to their covariances (W, L + 1, L + 1)."""
    W, L1 = covariances.shape[:2]
    path = np.zeros((L1, W, W, L1))
    for w, C in enumerate(covariances):
        path[:, w, w] = _root(C)
    return path.reshape(L1, W, W * L1)


def steps_of(covariances: np.ndarray, nodes: np.ndarray, before: int) -> tuple[np.ndarray, np.ndarray]:
    """The same (L + 1, W, c), by one step at every node after the other: (those that samples up to `before` can see, later ones)."""
    W, L1 = covariances.shape[:2]
    path = np.zeros((L1, W, W, L1))
    for w, C in enumerate(covariances):
        path[:, w, w] = np.linalg.cholesky(C + ROUNDING * np.diag(np.diag(C)))
    seen = np.r_[True, nodes[:-1] < before]
    return path[..., seen].reshape(L1, W, -1), path[..., ~seen].reshape(L1, W, -1)


def _root(C: np.ndarray) -> np.ndarray:
    """F with F F' = C, a covariance."""
    values, vectors = np.linalg.eigh(C)
    return vectors * np.sqrt(np.maximum(values, 0.0))


def _reduced(X: np.ndarray) -> np.ndarray:
    """(K, a, a) R with R R' = X X', for X (K, a, b)."""
    values, vectors = np.linalg.eigh(np.matmul(X, X.swapaxes(1, 2)))
    return vectors * np.sqrt(np.maximum(values, 0.0))[:, None]


def _of_outputs(name: str, outputs: tuple[str, ...], of: Mapping[str, np.ndarray]) -> np.ndarray:
    """(K, N_a, n_out) derivative of a scored channel with respect to the outputs: one of them, or of (u, v, w) = R' v_ned as a log derives
    them; `of`: Euler angles and (u, v, w) there."""
    phi, theta, psi = (of[n] for n in ATTITUDE)
    M = np.zeros((*phi.shape, len(outputs)))
    if name in outputs:
        M[..., outputs.index(name)] = 1.0
        return M
    row, u = BODY_VELOCITY.index(name), np.stack([of[n] for n in BODY_VELOCITY], axis=-1)
    # body rates that a rate of each Euler angle is (docs/equations.md (3), inverted): a vector that stands still turns against them
    zero, one, s, c = np.zeros_like(phi), np.ones_like(phi), np.sin, np.cos
    turns = (one, zero, zero), (zero, c(phi), -s(phi)), (-s(theta), s(phi) * c(theta), c(phi) * c(theta))
    for angle, turn in zip(ATTITUDE, turns, strict=True):
        M[..., outputs.index(angle)] = -np.cross(np.stack(turn, axis=-1), u)[..., row]
    for axis, of_axis in zip(VELOCITY, rotation_body_to_ned(phi, theta, psi), strict=True):
        M[..., outputs.index(axis)] = of_axis[row]
    return M
