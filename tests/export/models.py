"""Models of every kind, as they are exported, and 10 s of flight of each by the simulator: what every exporter is compared with."""

from dataclasses import dataclass, replace
from functools import cache

import numpy as np
from export.flying import Ride, relative
from free_flight import THOR, free_flight
from kites import DEVELOPMENT, PLAUSIBLE, ROOT, flight, home

from awescli.control.features import evaluate
from awescli.control.gaussian_law import GaussianLaw, design
from awescli.control.law import state_mapping
from awescli.export.json_tables import tables
from awescli.export.model import ExportedModel, Start
from awescli.learning.correction import CORRECTED, Correction, HybridKite
from awescli.learning.network_inputs import inputs_for, inputs_of_instant
from awescli.notation.quantities import MEASURED, OUTPUTS, STATES, SURFACES
from awescli.physics.declaration import read_kite
from awescli.physics.kite import Kite
from awescli.simulation.closed_loop import loop, with_setpoint_dynamics
from awescli.simulation.rollout import Segments, Simulator
from awescli.simulation.segments import observe
from awescli.simulation.synthetic import with_effects

SECONDS = 10.0
WIND_FROM = 3.3
"""[rad] what the laws are told of the wind."""
EFFECTS = {
    "wind_shear": {"a": 0.1}, "actuator_lag:rudder": {"tau": 0.1, "rate": 0.5, "inertia": 0.2}, "actuator_delay:elevator": {"tau": 0.12},
    "unsteady_lift": {"tau": 0.1}, "load_cell_lag": {"tau": 0.2}, "tether_sag": {"w": 0.3}, "tether_drag": {"dC": 0.3, "lateral": 1.0},
    "mass_offset": {"dm": 1.0, "dx": 0.03, "dz": 0.03}, "lift_stall": {"k": 20.0, "alpha_0": 0.09}, "vane_bias:alpha": {"b": 0.026},
}  # fmt: skip


@dataclass(frozen=True)
class Flown:
    """A model, one segment of samples, and what the simulator makes of it: states (N+1, n_x), outputs (N+1, 24)."""

    model: ExportedModel
    segments: Segments
    states: np.ndarray
    outputs: np.ndarray

    @property
    def columns(self) -> list[int]:
        """Where the model's inputs stand among those of the kite."""
        return [self.model.kite.input_names.index(name) for name in self.model.programs.inputs]

    @property
    def inputs(self) -> np.ndarray:
        """(N+1, n) of the model's own inputs."""
        return self.segments.inputs[0][:, self.columns]

    @property
    def set_points(self) -> np.ndarray:
        return self.segments.setpoints[0]

    @property
    def tables(self) -> dict:
        """What the model's JSON says."""
        return tables(self.model)

    @property
    def ride(self) -> Ride:
        """The same for those who read exported files."""
        return Ride(self.segments.starts[0], self.inputs, self.set_points, self.segments.dt)

    @property
    def range(self) -> np.ndarray:
        """(24,) largest value less the smallest, or the largest value where it is larger: what relative errors are of."""
        return np.maximum(np.ptp(self.outputs, axis=0), np.abs(self.outputs).max(axis=0)) + 1e-30


def compared(flown: Flown, outputs: np.ndarray) -> float:
    """Largest difference of outputs (N+1, 24) from the simulator's, relative to each channel."""
    return float(relative(outputs, flown.outputs, flown.range).max())


def _flown(kite, segments: Segments, law=None, controller=None, longest: float = 0.01) -> Flown:
    named = lambda names, row: dict(zip(names, map(float, row), strict=True))  # noqa: E731
    states, points, inputs = segments.starts[0], segments.setpoints[0, 0], segments.inputs[0, 0]
    told = "the first sample of a synthetic flight"
    start = Start(named(STATES, states), named(SURFACES, points), named(kite.input_names, inputs), told)
    model = ExportedModel("initial", kite, start, segments.dt, longest, law, controller, provenance={"awes": "test"})
    found = Simulator(kite, wrt=(), law=law, step=longest).rollout(segments)
    assert not found.diverged.any()
    return Flown(model, segments, found.states[0], found.outputs[0])


def thinned(segments: Segments, every: int) -> Segments:
    """Each `every`th sample."""
    return Segments(segments.first, segments.starts, segments.setpoints[:, ::every], segments.inputs[:, ::every], every * segments.dt)


def moving(kite: Kite, log, first: int = 300, seconds: float = SECONDS) -> Segments:
    """Some seconds of a log, on which aileron, elevator and flaps move a little too."""
    segments = observe(log, kite, np.array([first]), int(seconds / log.dt), MEASURED).segments
    time = segments.dt * np.arange(segments.steps + 1)
    setpoints = segments.setpoints.copy()
    for name, size, rate in (("aileron", 0.004, 0.9), ("elevator", 0.004, 0.7), ("flaps", 0.01, 0.3)):
        setpoints[0, :, SURFACES.index(name)] += size * np.sin(2 * np.pi * rate * time)
    return Segments(segments.first, segments.starts, setpoints, segments.inputs, segments.dt)


@cache
def with_states() -> Flown:
    """The development kite with ten effects, four of them with states of their own; every surface moves."""
    log = flight(effects=tuple((key, tuple(values.items())) for key, values in EFFECTS.items())).log
    kite = Kite(with_effects(DEVELOPMENT, EFFECTS), log.wind.height)
    return _flown(kite, moving(kite, log))


@cache
def with_slow_samples() -> Flown:
    """The same from samples 0.1 s apart: set-points are taken on the line between them."""
    flown = with_states()
    return _flown(flown.model.kite, thinned(flown.segments, 5))


def gaussian_law() -> GaussianLaw:
    """A rudder of 40 Gaussians that come near what was flown (ridge regression), so that it keeps moving."""
    log, names = flight().log, ("radius_error", "sin_phase", "cos_phase", "speed", "p", "q", "r", "crab_angle", "downwind_azimuth")
    pattern, random = flight().law.pattern, np.random.default_rng(0)
    seen = np.column_stack(evaluate(names, state_mapping(log, WIND_FROM), pattern))
    X = (seen - seen.mean(axis=0)) / seen.std(axis=0)
    centres = X[random.choice(len(X), 40, replace=False)]
    D = design(X, centres, 1.5)
    found = np.linalg.solve(D.T @ D + 0.1 * np.eye(D.shape[1]), D.T @ log["rudder"])
    return GaussianLaw(
        surfaces=("rudder",), features=names, centre=tuple(seen.mean(axis=0)), scale=tuple(seen.std(axis=0)),
        limits={"rudder": (-0.3, 0.3)}, constants={"flaps": 0.1}, pattern=pattern, delay_s=0.08, rate_limits={"rudder": 0.8},
        centres=centres, width=1.5, coefficients=found[None, :40], affine=found[None, 40:],
    )  # fmt: skip


@cache
def with_controller() -> Flown:
    """The development kite, its rudder by a law with a delay and a rate limit."""
    return _driven(gaussian_law(), SECONDS)


@cache
def with_restless_controller() -> Flown:
    """Two seconds with a law of twice the size, without delay and limit: the rudder jumps at every sample."""
    law = gaussian_law()
    return _driven(replace(law, coefficients=2 * law.coefficients, affine=2 * law.affine, delay_s=0.0, rate_limits={}), 2.0)


def _driven(law: GaussianLaw, seconds: float) -> Flown:
    log = flight().log
    kite = Kite(with_setpoint_dynamics(DEVELOPMENT, law), log.wind.height)
    segments = observe(log, kite, np.array([300]), int(seconds / log.dt), MEASURED).segments
    flown = _flown(kite, segments, loop(law, kite, WIND_FROM), law)
    assert np.ptp(flown.outputs[:, OUTPUTS.index("rudder")]) > 0.05
    return flown


@cache
def with_slow_controller() -> Flown:
    """The same from samples 40 ms apart: the law is asked between them too."""
    flown = with_controller()
    return _flown(flown.model.kite, thinned(flown.segments, 2), flown.model.law, flown.model.controller)


@cache
def with_network() -> Flown:
    """The development kite with an actuator lag and a network of two layers, of random weights."""
    log = flight().log
    kite = Kite(with_effects(DEVELOPMENT, {"actuator_lag:rudder": {"tau": 0.1}}), log.wind.height)
    segments = moving(kite, log)
    return _flown(HybridKite(kite, correction_for(kite, segments)), segments)


def correction_for(kite: Kite, segments: Segments, hidden=(16, 16)) -> Correction:
    """A network that is alive along these segments, and outside its box for some of the time."""
    random = np.random.default_rng(1)
    names = inputs_for(kite, None)
    states = Simulator(kite, wrt=()).rollout(segments).states[0]
    c = [float(v) for v in kite.parameters.vector()]
    of_instant = inputs_of_instant(names)
    instants = [kite.instant(list(x), list(u), c) for x, u in zip(states, segments.inputs[0], strict=True)]
    seen = np.array([[float(s) for s in of_instant(at)] for at in instants])
    deviation = seen.std(axis=0) + 1e-3
    z = (seen - seen.mean(axis=0)) / deviation
    sizes = (len(names), *hidden, len(CORRECTED))
    weights = random.normal(0, 0.4, sum((a + 1) * b for a, b in zip(sizes, sizes[1:], strict=False)))
    middle, half = (z.max(0) + z.min(0)) / 2, 0.8 * np.ptp(z, axis=0) / 2 + 0.1
    scale = np.array([0.2, 0.2, 0.4, 0.05, 0.05, 0.05])
    return Correction(names, tuple(hidden), weights, seen.mean(axis=0), deviation, middle, half, scale)


@cache
def free() -> Flown:
    """Thor, which flies without a line, under power; its own autopilot's commands are replayed."""
    log = free_flight(seconds=30.0, seed=4, noise=False)
    kite = Kite(with_effects(THOR, {"actuator_lag:throttle": {"tau": 0.3}}), log.wind.height)
    segments = observe(log, kite, np.array([400]), int(SECONDS / log.dt), tuple(n for n in MEASURED if n in log.measured)).segments
    return _flown(kite, segments, longest=0.01)


def with_one(key: str, seconds: float = 1.0) -> Flown:
    """The kite on which an effect can act, with this effect at a plausible size; every surface moves, and the air."""
    # a line that is suddenly 3 m shorter snaps: at steps of 10 and of 1 ms the simulator itself differs by a hundredth
    sizes = {**PLAUSIBLE, "winch_length": {"b": 0.1}}[key.partition(":")[0]]
    kite = Kite(with_effects(home(key), {key: sizes}), flight().log.wind.height)
    segments = moving(kite, flight().log, seconds=seconds)
    names = kite.input_names
    for gust in (n for n in names if n.startswith("turbulence_")):
        segments.inputs[..., names.index(gust)] = np.sin(np.arange(segments.steps + 1) / 7 + names.index(gust))
    throttle = segments.setpoints[..., SURFACES.index("throttle")]
    throttle[:] = 0.5 + 0.1 * np.sin(np.arange(throttle.shape[-1]) / 10)
    return _flown(kite, segments)


def with_heavy_line() -> Flown:
    """A second with all that moves with the kite and is no part of its mass, the centre of mass off the reference point."""
    effects = {"tether_weight": {"mu": 0.05}, "added_mass": {"m_a": 8.0}, "mass_offset": {"dm": 1.0, "dx": 0.15, "dz": 0.1}}
    kite = Kite(with_effects(DEVELOPMENT, effects), flight().log.wind.height)
    return _flown(kite, moving(kite, flight().log, seconds=1.0))


def on_file(name: str, **held: float) -> ExportedModel:
    """A kite file of data/kites, surfaces held at the start."""
    kite = Kite(read_kite(ROOT / "data" / "kites" / f"{name}.yaml"), (10.0,))
    states = dict.fromkeys(STATES, 0.0) | {"p_n": 150.0, "p_d": -100.0, "u": 20.0}
    inputs = dict.fromkeys(kite.input_names, 0.0) | {"density": 1.2, "tether_length": 180.0}
    return ExportedModel("initial", kite, Start(states, dict.fromkeys(SURFACES, 0.0) | held, inputs, "in the air"), 0.02, 0.01)


CASES = {f.__name__: f for f in (with_states, with_slow_samples, with_controller, with_slow_controller, with_network, free)}
assert len(OUTPUTS) == 24
