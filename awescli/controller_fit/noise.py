"""What sensor noise alone does to a fitted law: the floor under any score that uses measured states."""

from collections.abc import Mapping

import numpy as np

from awescli.control.law import Law, deflections_of_states
from awescli.notation.frames import rotate, rotate_back, rotation_body_to_ned

NOISE = {"p_n": 0.1, "p_e": 0.1, "p_d": 0.15, "v_n": 0.05, "v_e": 0.05, "v_d": 0.05,
         "phi": 0.2 * np.pi / 180, "theta": 0.2 * np.pi / 180, "psi": 0.2 * np.pi / 180,
         "p": 0.3 * np.pi / 180, "q": 0.3 * np.pi / 180, "r": 0.3 * np.pi / 180}  # fmt: skip
"""Standard deviations in SI of the development flights' sensors (their nominal.yaml: sensor_noise_std)."""


def with_noise(z: Mapping[str, np.ndarray], noise: dict[str, float], seed: int) -> dict[str, np.ndarray]:
    """z, mapping of arrays (N,), as sensors of these standard deviations would report it: velocities are measured in NED."""
    random = np.random.default_rng(seed)
    n = z["p_n"].shape[0]

    def shaken(name, signal):
        return signal + noise.get(name, 0.0) * random.normal(size=n)

    v = rotate(rotation_body_to_ned(z["phi"], z["theta"], z["psi"]), (z["u"], z["v"], z["w"]))
    v = tuple(shaken(name, s) for name, s in zip(("v_n", "v_e", "v_d"), v, strict=True))
    out = dict(z) | {name: shaken(name, z[name]) for name in ("p_n", "p_e", "p_d", "phi", "theta", "psi", "p", "q", "r")}
    out["u"], out["v"], out["w"] = rotate_back(rotation_body_to_ned(out["phi"], out["theta"], out["psi"]), v)
    return out


def noise_through_law(
    law: Law, z: Mapping[str, np.ndarray], noise: dict[str, float], span: dict[str, float], seed: int = 0
) -> dict[str, float]:
    """surface -> NRMSE that the noise alone causes: law(z + noise) against law(z), over `span` [rad]."""
    clean, shaken = deflections_of_states(law, z), deflections_of_states(law, with_noise(z, noise, seed))
    return {s: float(np.sqrt(np.mean((shaken[s] - clean[s]) ** 2)) / span[s]) for s in law.surfaces}
