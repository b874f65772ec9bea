"""The scores of the published tables. Predictions and measurements: dicts of the 12 states, (K, N+1) each."""

from collections.abc import Callable, Mapping

import numpy as np

from awescli.notation.angles import wrap
from awescli.notation.frames import rotate, rotation_body_to_ned

States = Mapping[str, np.ndarray]

DEG = np.pi / 180
SCALES = {
    "phi": 20 * DEG, "theta": 12 * DEG, "p": 35 * DEG, "q": 35 * DEG, "r": 35 * DEG, "V": 1.0, "gamma": 12 * DEG, "alpha": 5 * DEG,
    "beta": 8 * DEG,
}  # fmt: skip
"""Of fixedwing-ude's nine outputs (its results.json, output_scale)."""


def flown(z: States) -> dict[str, np.ndarray]:
    """fixedwing-ude's nine outputs: speed, flight-path angle, angle of attack and sideslip of the motion, for indoors the air is still."""
    *_, down = rotate(rotation_body_to_ned(z["phi"], z["theta"], z["psi"]), (z["u"], z["v"], z["w"]))
    V = np.maximum(np.sqrt(z["u"] ** 2 + z["v"] ** 2 + z["w"] ** 2), 1e-6)
    own = {"V": V, "gamma": np.arcsin(np.clip(-down / V, -1, 1)), "alpha": np.arctan2(z["w"], z["u"]), "beta": np.arcsin(z["v"] / V)}
    return {n: own[n] if n in own else z[n] for n in SCALES}


def of_scales(measured: States, predicted: States) -> np.ndarray:
    """Squared errors over squared scales, (K, N+1, 9). The score is the root of their mean over windows, samples (the start among them) and
    outputs: so, from the errors by regime in results.json, the published `all_output_score` of ARX at 2 s returns to all its digits
    (tests/test_leader_tables.py)."""
    own, its = flown(measured), flown(predicted)
    errors = {n: own[n] - its[n] if n == "V" else wrap(own[n] - its[n]) for n in SCALES}
    return np.stack([(errors[n] / scale) ** 2 for n, scale in SCALES.items()], axis=-1)


def root_mean(squares: list[np.ndarray]) -> float:
    """Score of all windows of all groups together."""
    return float(np.sqrt(sum(s.sum() for s in squares) / sum(s.size for s in squares)))


def of_ranges(measured: States, predicted: States) -> np.ndarray:
    """Squared errors over squared ranges of all windows, (K, N+1, 13): position, body velocity, quaternion with the measured sign, rates
    (mocap_sysid, comparison_suite.score_state_method and nrmse_score)."""
    own, its = _with_quaternions(measured), _with_quaternions(predicted)
    its[..., 6:10] *= np.where(np.sum(own[..., 6:10] * its[..., 6:10], axis=-1) < 0, -1.0, 1.0)[..., None]
    ranges = np.ptp(own.reshape(-1, 13), axis=0)
    return ((own - its) / np.where(ranges > 1e-10, ranges, 1.0)) ** 2


def mean_root(squares: list[np.ndarray]) -> float:
    """Mean over the channels of the root of the mean over windows and samples."""
    (of_group,) = squares
    return float(np.sqrt(of_group.mean(axis=(0, 1))).mean())


def _with_quaternions(z: States) -> np.ndarray:
    """(K, N+1, 13): position, body velocity, quaternion, rates."""
    (c1, s1), (c2, s2), (c3, s3) = ((np.cos(z[n] / 2), np.sin(z[n] / 2)) for n in ("phi", "theta", "psi"))
    q = (
        c1 * c2 * c3 + s1 * s2 * s3, s1 * c2 * c3 - c1 * s2 * s3,
        c1 * s2 * c3 + s1 * c2 * s3, c1 * c2 * s3 - s1 * s2 * c3,
    )  # fmt: skip
    return np.stack([*(z[n] for n in ("p_n", "p_e", "p_d", "u", "v", "w")), *q, *(z[n] for n in "pqr")], axis=-1)


SCORES: dict[str, tuple[Callable[[States, States], np.ndarray], Callable[[list[np.ndarray]], float]]] = {
    "of scales": (of_scales, root_mean),
    "of ranges": (of_ranges, mean_root),
}
"""Name -> (squares of a group's windows, score of all groups' squares)."""
