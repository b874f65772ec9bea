"""A world that is not ours: a KM1-like kite on its line, flown by JSBSim and steered from Python at 50 Hz.

    flown = fly(Foreign(kite, world, values, scene, sensors), law.deflections, start, rate=50, seed=1)

JSBSim (jsbsim.org, LGPL) integrates, filters, senses and blows; our code writes the XML (foreign_aircraft.py) and holds the stick. A
"clean" flight of it is one of our model only because of what stands here:

- the planet neither turns nor curves, gravity is constant, density is the record's;
- Adams-Bashforth of third order everywhere: JSBSim's own choice mixes orders and is 7 cm off in 5 s;
- a multistep rule takes a step of its input half a time step early. A set-point is therefore taken back by half of its step for one frame,
  one frame after it was given, where the surfaces follow without lag (`plain`);
- a set-point acts on the frame that the log's row shows: it is computed from the states one frame, 2.5 ms, before.

`foreign_agreement.py` shows what is left: below 2 mm and 0.003 deg in 5 s.
"""

import os
import tempfile
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from foreign_aircraft import aircraft_xml, planet_xml
from foreign_formula import number
from foreign_kinds import World
from foreign_names import FT, RADIUS, SLUG, STEP, Scene
from foreign_sensors import LOADS, STATES, Sensors

from awescli.control.pattern import Pattern, arc
from awescli.notation.errors import NumericalFailure
from awescli.notation.quantities import STATES as RIGID
from awescli.notation.quantities import SURFACES
from awescli.physics.declaration import KiteDeclaration

HOLD = 8
"""Frames of STEP between set-points: 50 Hz."""
INTEGRATORS = ("rate/rotational", "rate/translational", "position/rotational", "position/translational")
ADAMS_BASHFORTH_3 = 4
MIL_F_8785C, NO_TURBULENCE = 3, 0
SEVERITY = 4
"""Any but 0 lets JSBSim's turbulence blow; its level below 2000 ft is that of the wind at 20 ft, of which sigma_w is a tenth."""
FARTHEST, SLACK, LOWEST = 3.0, 1.0, 10.0
"""A kite has departed farther than so many radii from the pattern's centre, with a slack line for so many s, or below so many m."""

_TRUTH = {
    **{name: f"si/{name}" for name in ("p_n", "p_e", "p_d", "u", "v", "w", "v_n", "v_e", "v_d")},
    **{name: f"attitude/{name}-rad" for name in ("phi", "theta", "psi")},
    **{name: f"velocities/{name}-rad_sec" for name in ("p", "q", "r")}, **{name: f"true/{name}" for name in ("a_x", "a_y", "a_z")},
    "V_a": "now/V_a", "alpha": "aero/alpha-rad", "beta": "aero/beta-rad", "tension": "line/tension",
    "tether_length": "si/winch_length", "reel_out_speed": "si/winch_speed", "line_length": "si/length", "distance": "si/distance",
    **{f"acting_{surface}": f"surface/{surface}" for surface in SURFACES},
    **{name: f"si/{name}" for name in ("wind_n", "wind_e", "wind_d")},
}  # fmt: skip
"""What is read beside the sensors, as it is in the frame."""


@dataclass(frozen=True)
class Foreign:
    """A kite in its world. values: the kind's numbers; turbulence: sigma_w of MIL-F-8785C [m/s]."""

    kite: KiteDeclaration
    world: World
    values: Mapping[str, float]
    scene: Scene
    sensors: Sensors = field(default_factory=Sensors)
    turbulence: float = 0.0

    @property
    def plain(self) -> bool:
        """Do surfaces follow their set-points at once?"""
        return all(set(actuator.model_dump(exclude_none=True)) <= {"bias"} for actuator in self.world.actuators.values())


@dataclass(frozen=True)
class ForeignFlight:
    """rate [Hz]; time (N,) s from 0; sensed, truth, setpoints: name -> (N,), SI and rad."""

    rate: int
    time: np.ndarray
    sensed: Mapping[str, np.ndarray]
    truth: Mapping[str, np.ndarray]
    setpoints: Mapping[str, np.ndarray]


Steering = Callable[[float, Mapping[str, float]], Mapping[str, float]]
"""(time [s], states by name) -> set-point [rad] by surface."""


def fly(foreign: Foreign, steering: Steering, start: Mapping[str, float], *, rate: int, seed: int) -> ForeignFlight:
    """Fly `lead` seconds to settle and `duration` seconds that are logged. start: the 12 states at the beginning; rate: of the log [Hz], a
    divisor of 400; seed: of noise and turbulence. Raises NumericalFailure("departed") where the kite leaves its pattern."""
    scene = foreign.scene
    every, lead = round(1 / STEP / rate), round(scene.lead / STEP)
    if every * rate * STEP != 1.0 or lead % HOLD:
        raise ValueError(f"{rate} Hz and a lead of {scene.lead} s do not fit frames of {STEP} s and set-points of 50 Hz")
    with tempfile.TemporaryDirectory() as folder:
        machine = _loaded(foreign, Path(folder))
        stick = _Stick(machine, steering, foreign.plain)
        _begin(machine, foreign, start, seed, stick)
        rows = _Rows(machine, lead, every)
        watch = _Watch(scene.pattern)
        for frame in _frames(machine, stick, rows, lead + round(scene.duration / STEP) + 1):
            if frame % HOLD == 0:
                watch.sees(frame * STEP - scene.lead, stick.states, machine["line/tension"])
    return rows.flight(rate)


def _loaded(foreign: Foreign, folder: Path):
    """JSBSim with the aircraft on its planet, before its initial conditions."""
    os.environ.setdefault("JSBSIM_DEBUG", "0")  # read when it is made: it greets otherwise
    import jsbsim

    (folder / "kite").mkdir()
    text = aircraft_xml(foreign.kite, foreign.world, foreign.values, foreign.scene, foreign.sensors)
    (folder / "kite" / "kite.xml").write_text(text)
    (folder / "planet.xml").write_text(planet_xml(foreign.kite.parameters["g"].value))
    machine = jsbsim.FGFDMExec(str(folder))
    machine.set_debug_level(0)
    machine.set_aircraft_path(".")
    machine.set_dt(STEP)
    if not (machine.load_planet(str(folder / "planet.xml"), False) and machine.load_model("kite")):
        raise ValueError("JSBSim does not read the aircraft")
    machine["simulation/gravity-model"] = 0
    for integrator in INTEGRATORS:
        machine[f"simulation/integrator/{integrator}"] = ADAMS_BASHFORTH_3
    return machine


def _begin(machine, foreign: Foreign, start: Mapping[str, float], seed: int, stick: "_Stick") -> None:
    """Initial conditions. The first frames know no wind yet and swing for a second or two: the lead is there for it."""
    density = foreign.scene.wind.density
    if density is None or np.ptp(density) > 0:
        raise ValueError("a foreign flight has one density")
    machine["atmosphere/override/density"] = float(density[0]) * number(foreign.world.air.density, foreign.values) / (SLUG * FT**3)
    machine["atmosphere/turb-type"] = MIL_F_8785C if foreign.turbulence else NO_TURBULENCE
    machine["atmosphere/turbulence/milspec/windspeed_at_20ft_AGL-fps"] = 10 * foreign.turbulence * FT
    machine["atmosphere/turbulence/milspec/severity"] = SEVERITY if foreign.turbulence else 0
    seeds = np.random.default_rng([seed, 7]).integers(1, 2**30, 64)
    for name, own in zip(("simulation/randomseed", "atmosphere/randomseed", *foreign.sensors.seeded()), seeds, strict=False):
        machine[name] = int(own)
    machine["ic/lat-gc-rad"] = np.arcsin(start["p_n"] * FT / RADIUS)
    machine["ic/long-gc-rad"] = np.arcsin(start["p_e"] * FT / RADIUS)
    machine["ic/h-sl-ft"] = -start["p_d"] * FT
    for name, there in (("phi", "phi-rad"), ("theta", "theta-rad"), ("psi", "psi-true-rad")):
        machine[f"ic/{there}"] = start[name]
    for name in "uvw":
        machine[f"ic/{name}-fps"] = start[name] * FT
    for name in "pqr":
        machine[f"ic/{name}-rad_sec"] = start[name]
    stick.take(-foreign.scene.lead, start)
    stick.give(stick.wanted)
    machine.run_ic()


class _Stick:
    """Set-points as JSBSim gets them: taken from the law one frame before they act, and taken back by half a step one frame after."""

    def __init__(self, machine, steering: Steering, plain: bool):
        self.machine, self.steering, self.plain = machine, steering, plain
        self.wanted = dict.fromkeys(SURFACES, 0.0)
        self.before = self.wanted
        self.states: Mapping[str, float] = {}

    def take(self, time: float, states: Mapping[str, float]) -> None:
        """New set-points of the law."""
        self.before, self.states = self.wanted, states
        self.wanted = dict(self.steering(time, states))

    def give(self, setpoints: Mapping[str, float]) -> None:
        for name, value in setpoints.items():
            self.machine[f"setpoint/{name}"] = value

    def halved(self) -> dict[str, float]:
        return {name: value - (value - self.before[name]) / 2 for name, value in self.wanted.items()}


class _Rows:
    """The log's rows: sensors of states as a frame ends, of loads when the next one has run."""

    def __init__(self, machine, lead: int, every: int):
        self.machine, self.lead, self.every = machine, lead, every
        self.states, self.loads, self.truth, self.setpoints = [], [], [], []

    def frame(self, frame: int, stick: _Stick) -> None:
        """What there is to read after a frame has run."""
        read = self.machine.get_property_value
        if len(self.loads) < len(self.states):
            self.loads.append([read(f"sensor/{name}") for name in LOADS])
        if frame >= self.lead and (frame - self.lead) % self.every == 0:
            self.states.append([read(f"sensor/{name}") for name in STATES])
            self.truth.append([read(place) for place in _TRUTH.values()])
            self.setpoints.append([stick.wanted[name] for name in SURFACES])

    def flight(self, rate: int) -> ForeignFlight:
        rows = len(self.loads)
        states, loads, truth, setpoints = (np.array(r[:rows]).T for r in (self.states, self.loads, self.truth, self.setpoints))
        return ForeignFlight(
            rate, np.arange(rows) / rate, {**dict(zip(STATES, states, strict=True)), **dict(zip(LOADS, loads, strict=True))},
            dict(zip(_TRUTH, truth, strict=True)), dict(zip(SURFACES, setpoints, strict=True)),
        )  # fmt: skip


def _frames(machine, stick: _Stick, rows: _Rows, last: int) -> Iterator[int]:
    """Run frames 1..last, set-points given and rows read; yields each frame's number."""
    read = machine.get_property_value
    for frame in range(1, last + 1):
        if frame % HOLD == 0:
            stick.take(frame * STEP - rows.lead * STEP, {name: read(_TRUTH[name]) for name in RIGID})
            stick.give(stick.wanted)
        elif frame % HOLD == 1 and stick.plain:
            stick.give(stick.halved())
        elif frame % HOLD == 2:
            stick.give(stick.wanted)
        machine.run()
        rows.frame(frame, stick)
        yield frame


class _Watch:
    """Raises NumericalFailure where the kite has left its pattern."""

    def __init__(self, pattern: Pattern):
        self.pattern, self.slack = pattern, 0.0

    def sees(self, time: float, z: Mapping[str, float], tension: float) -> None:
        """time [s] of the log; z: the 12 states; tension [N]; once every HOLD frames."""
        self.slack = 0.0 if tension > 0 else self.slack + HOLD * STEP
        finite = all(np.isfinite(value) for value in z.values())
        if not finite or -z["p_d"] < LOWEST or arc(z, self.pattern) > FARTHEST * self.pattern.radius or self.slack > SLACK:
            raise NumericalFailure("departed", f"the foreign kite leaves its pattern after {time:.1f} s of the log")
