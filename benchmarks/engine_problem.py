"""What `engine_speed.py` simulates: segments of a flight of the development kite, a law of Gaussians fitted to its rudder in the loop."""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from awescli.artifacts import read_arrays, read_json, write_arrays, write_json, write_text
from awescli.control.features import evaluate
from awescli.control.gaussian_law import GaussianLaw, design
from awescli.control.law import state_mapping
from awescli.notation.quantities import STATES
from awescli.physics.declaration import KiteDeclaration, kite_text, read_kite
from awescli.physics.kite import Kite
from awescli.simulation.closed_loop import loop
from awescli.simulation.rollout import Columns, Segments, Simulator, inputs_of, setpoints_of
from awescli.stages.controller_artifact import read_controller, write_controller

KITE = Path(__file__).parent.parent / "data" / "kites" / "development.yaml"
SEGMENTS, STEPS, PARAMETERS, GAUSSIANS = 36, 250, 20, 50
FEATURES = ("radius_error", "sin_course_error", "r", "p", "speed", "wing_along_line")
COMPARED = ("p_n", "p_e", "p_d", "v_n", "v_e", "v_d", "phi", "theta", "psi", "p", "q", "r")
"""Outputs that are differentiated: positions, attitude, rates, and the velocity in NED axes, which as a state is in body axes."""
SAVED = ("first", "starts", "setpoints", "inputs", "dt")


@dataclass
class Problem:
    """What is simulated. base: segments of 500 steps, of which others are made."""

    declaration: KiteDeclaration
    heights: tuple[float, ...]
    law: GaussianLaw
    base: Segments

    def __post_init__(self):
        self.kite = Kite(self.declaration, self.heights)
        self.free = tuple(self.kite.parameters.free)[:PARAMETERS]
        self.c = [float(v) for v in self.kite.parameters.vector()]

    def segments(self, count: int, steps: int = STEPS) -> Segments:
        """`count` segments; beyond the flight's 36 they are repeated with slightly other starts."""
        which = np.arange(count) % SEGMENTS
        noise = 1e-3 * np.random.default_rng(0).normal(size=(count, 12)) * (np.arange(count) >= SEGMENTS)[:, None]
        s = self.base.pick(which)
        return replace(s, starts=s.starts + noise, setpoints=s.setpoints[:, : steps + 1], inputs=s.inputs[:, : steps + 1])

    def simulator(self, parameters: int = PARAMETERS) -> tuple[Simulator, Columns]:
        free = tuple(self.kite.parameters.free)[:parameters]
        return Simulator(self.kite, free, law=loop(self.law, self.kite, 0.0)), Columns(parameters=free)

    def write(self, folder: Path) -> None:
        """For another process."""
        write_text(folder / "kite.yaml", kite_text(self.declaration))
        write_json(folder / "heights.json", list(self.heights))
        write_controller(folder, self.law)
        write_arrays(folder / "base.npz", {n: getattr(self.base, n) for n in SAVED})

    @classmethod
    def read(cls, folder: Path) -> "Problem":
        arrays = read_arrays(folder / "base.npz")
        base = Segments(**{n: arrays[n] for n in SAVED[:-1]}, dt=float(arrays["dt"]))
        return cls(read_kite(folder / "kite.yaml"), tuple(read_json(folder / "heights.json")), read_controller(folder), base)


def make_problem() -> Problem:
    """A flight of the development kite, a Gaussian law fitted to its rudder, and segments that start in its states."""
    from awescli.simulation.campaign_flights import dev_like

    flight = dev_like(read_kite(KITE), 1, noise=False, duration=60.0)
    log, pattern = flight.log, flight.law.pattern
    z = state_mapping(log)
    F = np.stack([np.broadcast_to(f, len(log)) for f in evaluate(FEATURES, z, pattern)], axis=1)
    centre, scale = F.mean(0), F.std(0)
    X = (F - centre) / scale
    centres, width = X[np.linspace(0, len(log) - 1, GAUSSIANS).astype(int)], 1.5
    D = design(X, centres, width)
    w = np.linalg.solve(D.T @ D + 1e-3 * len(log) * np.eye(D.shape[1]), D.T @ log["rudder"])[None]
    law = GaussianLaw(
        surfaces=("rudder",), features=FEATURES, centre=tuple(centre), scale=tuple(scale), limits={"rudder": (-0.44, 0.44)},
        pattern=pattern, centres=centres, width=width, coefficients=w[:, :GAUSSIANS], affine=w[:, GAUSSIANS:],
    )  # fmt: skip
    kite = Kite(flight.flown, log.wind.height)
    first = np.linspace(0, len(log) - 502, SEGMENTS).astype(int)
    rows = first[:, None] + np.arange(501)
    Z = np.stack([z[name] for name in STATES], axis=1)
    base = Segments(first, Z[first], setpoints_of(log)[rows], inputs_of(log, kite)[rows], log.dt)
    return Problem(flight.flown, tuple(log.wind.height), law, base)
