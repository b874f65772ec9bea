"""What many tests share: the development kite, a point of its flight, segments on which every surface moves, plausible sizes of effects."""

from functools import cache
from pathlib import Path

import numpy as np

from awescli.flightlog.log import FlightLog
from awescli.notation.parameters import ParameterTable
from awescli.notation.quantities import MEASURED, STATES, SURFACES
from awescli.physics.declaration import KiteDeclaration, read_kite
from awescli.physics.effects import EFFECTS
from awescli.physics.effects.past import BEHIND, past_of
from awescli.physics.kite import Kite, with_new
from awescli.physics.propeller import Propeller, SpeedLaw
from awescli.simulation.campaign_flights import CampaignFlight, dev_like
from awescli.simulation.gusts import dryden, roll_gust
from awescli.simulation.segments import Observed, observe

ROOT = Path(__file__).parents[1]
DEVELOPMENT: KiteDeclaration = read_kite(ROOT / "data" / "kites" / "development.yaml")

PROPELLER = Propeller(
    diameter=0.9, hub=(0.8, 0.1, -0.05), axis=(1.0, 0.02, -0.03), CT=(0.11, 0.03, -0.12, -0.03), CP=(0.055, 0.03, -0.05, -0.025),
    speed=SpeedLaw(law="power", shaft_power=(-500.0, 10000.0, 15000.0)), inertia=0.02,
)  # fmt: skip
"""A strong one for a wing of the development kite's size: 24 kW, so that what a throttle does stands out of the rounding."""
POWERED: KiteDeclaration = DEVELOPMENT.model_copy(
    update={"propellers": (PROPELLER,), "effects": with_new(DEVELOPMENT.effects, ("thrust",))}
)
"""The development kite with a motor: what acts on the throttle shows on it alone."""


def home(key: str) -> KiteDeclaration:
    """The kite on which an effect can act."""
    return POWERED if key.endswith(":throttle") or key == "thrust" else DEVELOPMENT


PLAUSIBLE: dict[str, dict[str, float]] = {
    "wind_shear": {"a": 0.1},
    "wind_veer": {"k": 4.4e-4},  # 2.5 deg per 100 m
    "wind_offset": {"dN": 1.5, "dE": -1.0, "dD": 0.5},
    "air_density": {"c": 1.037},
    "turbulence": {"sigma": 0.9, "roll": 0.1},
    "tether_drag": {"dC": 0.3, "lateral": 1.0},
    "tether_weight": {"mu": 0.0074},
    "tether_elasticity": {"EA": 6e5, "zeta": 120.0},
    "tether_sag": {"w": 0.3},
    "tether_attachment": {"dx": 0.02, "dy": 0.01, "dz": 0.03},
    "winch_length": {"s": 0.003, "b": 1.5},
    "clock_offset": {"tau": 0.3},
    "mass_offset": {"dm": 1.0, "dx": 0.03, "dz": 0.03},
    "added_mass": {"m_a": 2.0},
    "parasitic_drag": {"dCD": 0.09, "k": 0.2},
    "sideslip_drag": {"k": 2.0},
    "lift_stall": {"k": 20.0, "alpha_0": 0.09},
    "pitch_curvature": {"k": -0.7},
    "unsteady_lift": {"tau": 0.1},
    "aeroelastic_twist": {"k": 5e-5},
    "surface_bias": {"b": 0.002},
    "rate_feedback": {"k": 0.06, "tau": 1.5},
    "surface_effectiveness": {"s": 0.5, "threshold": 0.03},
    "surface_dead_band": {"d": 0.01},
    "actuator_lag": {"tau": 0.1, "rate": 0.5, "inertia": 0.2},
    "actuator_delay": {"tau": 0.12},
    "probe_arm": {"x": 0.4, "y": 0.36, "z": -0.1},
    "vane_bias": {"b": 0.026, "k": 0.1},
    "airspeed_scale": {"s": 0.95, "b": 0.5},
    "load_cell_scale": {"s": 1.07, "b": 60.0},
    "load_cell_lag": {"tau": 0.2},
    "position_latency": {"tau": 0.15},
    "heading_bias": {"b": 0.035},
    "compass_deviation": {"b": 0.04, "c": -0.03},
    "attitude_bias": {"b": 0.05},
    "imu_arm": {"x": 0.35, "y": -0.1, "z": 0.05},
    "imu_misalignment": {"x": -0.02, "y": 0.035, "z": 0.015},
    "imu_bias": {"bx": 0.02, "by": -0.03, "bz": 0.3},
    "hinge_blowback": {"k": 1.5e-4},
    "airspeed_lag": {"tau": 0.2},
    "pitot_position_error": {"k_a": 0.3, "k_b": 0.1, "k_bb": 1.0},
    "attitude_latency": {"tau": 0.06},
    "antenna_arm": {"x": 0.4, "z": -0.3},
    "reynolds_drag": {"n": 0.17},
    "downwash_lag": {"Cm_adot": -20.0, "arm": 5.0},
    "lift_drift": {"rate": -4e-4, "step": -0.05, "at": 20.0},
    "surface_backlash": {"width": 0.03},
    "winch_tracking": {"tau": 0.5},
    "winch_control": {"v": 0.1, "kv": 0.004, "k": 2e-4, "f_low": 2000.0, "f_high": 4000.0},
    "custom_term": {"k": 0.02},
}
"""effect -> its parameters by short name, at a size that effects.md lists as typical."""


def every_key() -> list[str]:
    """Keys of every effect at every target that a kite file may name (one term stands for all custom ones)."""
    keys = ["custom_term:m_y*alpha"]
    for name, effect in EFFECTS.items():
        if not effect.always and name != "custom_term":
            keys += [f"{name}:{t}" if t else name for t in effect.targets or ("",)]
    return keys


def sizes(key: str) -> dict[str, float]:
    """Plausible values of an effect's parameters under their full names: `actuator_lag:rudder.tau`."""
    return {f"{key}.{n}": v for n, v in PLAUSIBLE[key.partition(":")[0]].items()}


def declared(**changes) -> KiteDeclaration:
    """The development kite with other parameter values (`Jx=40.0`) or other blocks (`wind={"law": "uniform"}`)."""
    blocks = {k: DEVELOPMENT.__class__.model_fields[k].annotation(**v) for k, v in changes.items() if isinstance(v, dict)}
    values = {k: v for k, v in changes.items() if not isinstance(v, dict)}
    rows = {n: r.model_copy(update={"value": values[n], "lower": None, "upper": None}) if n in values else r
            for n, r in DEVELOPMENT.parameters.items()}  # fmt: skip
    return DEVELOPMENT.model_copy(update={"parameters": rows, **blocks})


def at_point(kite: Kite, **changes) -> tuple[list[float], list[float], list[float]]:
    """(x, u, c) of a kite crosswind at 300 m, taut, all rates and surfaces alive. changes: states, surfaces or inputs by name."""
    state = dict(zip(STATES, (210.0, 40.0, -160.0, 38.0, 1.5, 4.0, -0.5, 0.15, 1.4, 0.1, 0.25, -0.5), strict=True))
    surface = {"aileron": 0.01, "elevator": -0.03, "rudder": 0.12, "flaps": 0.06, "throttle": 0.6}
    inputs = dict.fromkeys(kite.input_names, 0.0)
    inputs |= {"density": 1.22, "tension": 3000.0, "reel_out_speed": 0.8, "reel_out_acceleration": 0.3, "rudder_rate": 0.4}
    inputs |= {f"wind_speed_{i}": 9.0 + 0.02 * h for i, h in enumerate(kite.heights)}
    inputs |= {f"wind_direction_{i}": np.pi + 0.2 for i in range(len(kite.heights))}
    state |= {k: v for k, v in changes.items() if k in state}
    surface |= {k: v for k, v in changes.items() if k in surface}
    distance = float(np.sqrt(state["p_n"] ** 2 + state["p_e"] ** 2 + state["p_d"] ** 2))
    inputs["tether_length"] = distance - kite.parameters["dl"].value - 0.02
    inputs |= {k: v for k, v in changes.items() if k in inputs}
    own = [0.0] * (len(kite.state_names) - 12)
    u, c = [float(inputs[n]) for n in kite.input_names], [float(v) for v in kite.parameters.vector()]
    x = [*state.values(), *own, *surface.values()]
    if own:
        x[12 : 12 + len(own)] = [float(v) for v in kite.initial(x, u, c)]
    return x, u, c


def inputs_of_one_for(other: Kite, kite: Kite, u) -> list:
    """Inputs u of `kite` as `other` takes them: a kite without a line takes none of the line's."""
    return [u[kite.input_names.index(name)] for name in other.input_names]


@cache
def flight(seed: int = 1, duration: float = 40.0, noise: bool = False, effects: tuple = (), air: str = "table", **how) -> CampaignFlight:
    """A short flight of the development kite; effects: ((key, ((short name, value), ...)), ...), hashable."""
    return dev_like(DEVELOPMENT, seed, {k: dict(v) for k, v in effects}, duration=duration, noise=noise, air=air, **how)


def lively(kite: Kite, log: FlightLog, count: int = 8, seconds: float = 5.0, seed: int = 0) -> Observed:
    """`count` segments of a log on which aileron, elevator and flaps move too, in gusts of unit variance for the effect `turbulence`.

    `measured` is the log's and no longer belongs to what would be flown: use `truly` to fill it.
    """
    random = np.random.default_rng(seed)
    steps = int(round(seconds / log.dt))
    first = np.linspace(50, len(log) - steps - 2, count).astype(int)
    observed = _with_vanes(observe(log, kite, first, steps, MEASURED), kite.declaration.noise.flow_angles)
    segments, time = observed.segments, log.dt * np.arange(steps + 1)
    setpoints, inputs = segments.setpoints.copy(), segments.inputs.copy()
    setpoints[:, :, SURFACES.index("throttle")] += 0.5
    for name, size in {"aileron": 0.05, "elevator": 0.04, "rudder": 0.03, "flaps": 0.05, "throttle": 0.05}.items():
        often, begun = random.uniform(0.4, 1.5, (count, 1)), random.uniform(0, 1, (count, 1))
        swing = lambda t, size=size, often=often, begun=begun: size * np.sin(2 * np.pi * (often * t + begun))  # noqa: E731
        setpoints[:, :, SURFACES.index(name)] += swing(time)
        moved_before(kite, inputs, name, swing(-np.array(BEHIND)) - swing(np.zeros(1)))
        inputs[:, :, kite.input_names.index(f"{name}_rate")] = np.gradient(setpoints[:, :, SURFACES.index(name)], log.dt, axis=1)
    at = kite.input_names.index("turbulence_n")
    for k in range(count):
        inputs[k, :, at : at + 3] = dryden(steps + 1, log.dt, 40.0, seed + k)
        inputs[k, :, kite.input_names.index("turbulence_p")] = roll_gust(steps + 1, log.dt, 40.0, 5.0, seed + k)
    moved = segments.__class__(segments.first, segments.starts, setpoints, inputs, segments.dt, segments.values)
    return Observed(moved, observed.outputs, observed.measured, observed.sigma)


def moved_before(kite: Kite, inputs: np.ndarray, surface: str, change: np.ndarray) -> None:
    """Write the past of a surface into inputs (K, N+1, n_u), where the kite asks for it: `change` (K, len(BEHIND)) or (len(BEHIND),) of its
    set-point from that at the start of a segment."""
    asked = past_of(surface)
    if asked[0] in kite.input_names:
        inputs[:, :, [kite.input_names.index(n) for n in asked]] += np.broadcast_to(change, (len(inputs), len(asked)))[:, None]


def _with_vanes(observed: Observed, std: float) -> Observed:
    """All of MEASURED, also the flow angles that a log without vanes lacks (their values are to be filled by `truly`)."""
    shape = (*observed.measured.shape[:2], len(MEASURED))
    measured, sigma = np.zeros(shape), np.full(shape, std)
    for i, name in enumerate(observed.outputs):
        measured[:, :, MEASURED.index(name)], sigma[:, :, MEASURED.index(name)] = observed.measured[:, :, i], observed.sigma[:, :, i]
    return Observed(observed.segments, MEASURED, measured, sigma)


def truly(observed: Observed, simulator, values=None, noise_seed: int | None = None) -> Observed:
    """The same segments, measured on a simulated truth; noise_seed: with white noise of their sigma."""
    from awescli.notation.quantities import OUTPUTS

    flown = simulator.rollout(observed.segments, values)
    assert not flown.diverged.any()
    measured = flown.outputs[:, :, [OUTPUTS.index(n) for n in observed.outputs]].copy()
    if noise_seed is not None:
        measured += observed.sigma * np.random.default_rng(noise_seed).standard_normal(measured.shape)
    return Observed(observed.segments, observed.outputs, measured, observed.sigma)


def with_free(table: ParameterTable, names) -> ParameterTable:
    """The table with exactly `names` free."""
    from dataclasses import replace

    return ParameterTable(replace(p, free=p.name in names) for p in table.rows)
