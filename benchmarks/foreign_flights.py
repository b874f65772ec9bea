"""One case of the foreign campaign -> a flight folder as a user has it: kite.csv, wind.csv, kite.yaml; and what truly flew, beside it.

    folder = flight_folder(Case("actuator_lag", "full", family=0), cache)

All is drawn from the case: the pattern, the weather, the winch, the trims that the operator sets, the sensors, and what he declares.
"""

import hashlib
import json
import zlib
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from foreign_kinds import Kind, read_kinds
from foreign_log import STATION, written
from foreign_names import Scene
from foreign_sensors import Sensors
from foreign_world import Foreign, ForeignFlight, fly
from wrong_bounds import with_wrong_bounds

from awescli.artifacts import write_text
from awescli.control.path_following import PathFollowing
from awescli.control.pattern import Pattern
from awescli.notation.errors import NumericalFailure
from awescli.notation.quantities import STATES
from awescli.physics.declaration import KiteDeclaration, read_kite
from awescli.physics.kite import Kite
from awescli.simulation.campaign_flights import perturbed
from awescli.simulation.made_wind import wind_record
from awescli.simulation.synthetic import ReelOut, simulate_flight

HERE = Path(__file__).parent
KITE = HERE.parent / "data" / "kites" / "km1_identified.yaml"
DEG = np.pi / 180
LEAD = 24.0
"""s flown before the log: the start swings for some of them, and sensors that wander reach their level."""
HEIGHTS = np.array([10.0, 50.0, 100.0, 150.0, 200.0, 250.0, 300.0, 350.0, 400.0, 500.0])
"""[m] stations of the wind record."""
CLOSE = np.arange(10.0, 500.0, 10.0)
"""[m] the same, so close that the wind between them is a power law to 1 mm/s: where the kite file declares one."""
GUSTS = 0.6
"""[m/s] sigma_w of flights in gusty air."""
LONGEST_REEL = 180.0
"""[m] paid out in a flight at most: long flights reel out slowly."""
NO_WORLD = ("foreign_campaign.py", "foreign_agreement.py")
"""Files of ours on which no flight depends."""
TRIES = 5
"""Draws of the flight's conditions before a case is given up: an effect may not fly in all of them."""
FIELD = "clean_field"
"""The kind whose conditions are those of logs from the field."""
MISSED = ("CL_alfa", "Cmq", "Clp", "Cn_rud", "CtD")
"""Parameters of which two are declared with bounds that do not hold the truth, where a kind asks for it."""


@dataclass(frozen=True)
class Case:
    """kind: a name of the registry; size: full, half, quarter; family of seeds; repeat: further flights of the same; air: calm, gusts, or
    field: another rate and length, other noise, wandering attitude, turbulence, faults, every other time no pitot."""

    kind: str
    size: str
    family: int
    repeat: int = 0
    air: str = "calm"

    @property
    def name(self) -> str:
        return f"{self.kind}-{self.size}-{self.air}-{self.repeat}"

    @property
    def seed(self) -> int:
        """The same at all sizes, so that they are flown under the same conditions."""
        return zlib.crc32(f"{self.kind}/{self.family}/{self.repeat}".encode())

    def registered(self) -> Kind:
        """The kind, under the conditions of the case."""
        kind = read_kinds()[self.kind]
        if self.air != "field":
            return kind
        own = kind.conditions
        pitot = own.vanes or "V_a" in kind.world.sensors or bool(np.random.default_rng([self.seed, 4]).random() < 0.5)
        field = read_kinds()[FIELD].conditions.model_copy(update={"vanes": own.vanes, "bounds": own.bounds, "pitot": pitot})
        return kind.model_copy(update={"conditions": field})


@dataclass(frozen=True)
class Draw:
    """The conditions of one flight. law: who steers; trims: (K, 4) time [s], aileron, elevator, flaps [rad] from then on."""

    scene: Scene
    law: PathFollowing
    trims: np.ndarray
    sensors: Sensors
    rate: int
    turbulence: float

    def steering(self, time: float, z) -> dict[str, float]:
        """Set-points [rad] at a state: the law's rudder, the operator's trims."""
        _, aileron, elevator, flaps = self.trims[np.searchsorted(self.trims[:, 0], time, side="right") - 1]
        return {**self.law.deflections(z), "aileron": float(aileron), "elevator": float(elevator), "flaps": float(flaps)}


def flight_folder(case: Case, cache: Path) -> Path:
    """The case's folder in the cache, flown first where it is not there. It is named by what it is made from, our sources included."""
    kind = case.registered()
    folder = cache / f"{case.family}-{case.name}-{_digest(case, kind)}"
    if not (folder / "passport.json").is_file():
        kite = read_kite(KITE)
        draw, flight = flown(case, kind, kite)
        for name, text in written(flight, draw.scene, kind, case.seed, kind.values(case.size)).items():
            write_text(folder / name, text)
        write_text(folder / "kite.yaml", declared_text(kite, kind, case.seed))
        # last: a folder without it is made again
        write_text(folder / "passport.json", json.dumps(_passport(case, draw, flight), indent=1) + "\n")
    return folder


def flown(case: Case, kind: Kind, kite: KiteDeclaration) -> tuple[Draw, ForeignFlight]:
    """(conditions, flight): of the first of TRIES draws in which the kite stays on its pattern. Raises NumericalFailure."""
    for attempt in range(TRIES):
        draw = drawn(case, kind, attempt)
        foreign = Foreign(kite, kind.world, kind.values(case.size), draw.scene, draw.sensors, draw.turbulence)
        try:
            return draw, fly(foreign, draw.steering, start_of(kite, draw), rate=draw.rate, seed=case.seed + attempt)
        except NumericalFailure as e:
            departed = e
    raise departed


def drawn(case: Case, kind: Kind, attempt: int = 0) -> Draw:
    """The conditions of a case's flight. Near KM1's published flight (operating_box of its parameters), a little lighter in load."""
    random, wants = np.random.default_rng([case.seed, attempt]), kind.conditions
    rate, duration = int(random.choice(wants.rates)), round(float(random.uniform(*wants.duration)), 1)
    azimuth, turn = random.uniform(-np.pi, np.pi), float(random.choice((-1.0, 1.0)))
    trim = {"aileron": -turn * random.uniform(0.8, 1.2) * DEG, "elevator": random.uniform(*wants.elevator) * DEG,
            "flaps": random.uniform(10.0, 12.0) * DEG}  # fmt: skip
    law = PathFollowing(
        Pattern(random.uniform(27.0, 31.0) * DEG, azimuth, random.uniform(58.0, 68.0), turn),
        k_radius=1.0, k_course=2.0, k_feedforward=1.4, k_rate=3.0, limit=30 * DEG, trims=trim,
    )  # fmt: skip
    speed, heights = random.uniform(8.8, 10.2), CLOSE if wants.vanes else HEIGHTS
    wind = wind_record(
        heights, speed * (heights / 100) ** _exponent(case.seed), azimuth + np.pi, duration + LEAD,
        density=random.uniform(1.19, 1.24), drift=0.015, turn=0.01, seed=case.seed + attempt,
    )  # fmt: skip
    reel = min(random.uniform(0.5, 0.8), LONGEST_REEL / duration)
    reel_out = ReelOut(random.uniform(330.0, 480.0), reel, random.uniform(0.25, 0.4), random.uniform(8.0, 11.0))
    drift = random.uniform(*wants.attitude_drift) * DEG
    sensors = Sensors(read_kite(KITE).noise, random.uniform(*wants.noise), drift, random.uniform(*wants.attitude_memory))
    turbulence = GUSTS if case.air == "gusts" else random.uniform(*wants.turbulence)
    return Draw(Scene(wind, reel_out, law.pattern, LEAD, duration), law, _trims(random, trim, duration), sensors, rate, turbulence)


def _exponent(seed: int) -> float:
    """Of the wind's power law over height: the record has it in its heights, a kite file with a single station declares it."""
    return round(float(np.random.default_rng([seed, 3]).uniform(0.06, 0.14)), 3)


def _trims(random: np.random.Generator, trim: dict[str, float], duration: float) -> np.ndarray:
    """The operator trims in flight, every 12 to 25 s, within KM1's published ranges."""
    rows, time = [(-np.inf, *trim.values())], 5.0
    while time < duration:
        steps = random.uniform(-1.0, 1.0, 3) * np.array([0.3, 1.2, 1.2]) * DEG
        rows.append((round(time / 0.02) * 0.02, *(np.array(list(trim.values())) + steps)))
        time += random.uniform(12.0, 25.0)
    return np.array(rows)


def start_of(kite: KiteDeclaration, draw: Draw) -> dict[str, float]:
    """12 states on the pattern, the line as long as it is then: where our own simulator of the clean kite settles."""
    scene = draw.scene
    ours, length = Kite(kite, scene.wind.height), scene.reel_out.at(np.array([-scene.lead]))[0]
    reel_out = replace(scene.reel_out, length=float(length[0]))
    settled = simulate_flight(ours, draw.law.setpoints, scene.wind, reel_out, pattern=scene.pattern, duration=0.1)
    return {name: float(settled.outputs[name][0]) for name in STATES}


def declared(kite: KiteDeclaration, kind: Kind, seed: int) -> KiteDeclaration:
    """What the operator declares: guesses 5 to 30 % off, and bounds around them, which hold the truth unless the kind says otherwise."""
    guess = perturbed(kite, seed)
    if kind.conditions.vanes:
        law = {"law": "power", "exponent": _exponent(seed), "reference_height": STATION}
        guess = guess.model_copy(update={"wind": guess.wind.model_copy(update=law)})
    return with_wrong_bounds(guess, kite, MISSED, seed) if kind.conditions.bounds == "miss" else guess


def declared_text(kite: KiteDeclaration, kind: Kind, seed: int) -> str:
    """`declared` as a kite file: the truth's file with other numbers, so that it says no more than a user would."""
    guess, content = declared(kite, kind, seed), yaml.safe_load(KITE.read_text())
    for row in guess.table().rows:
        if row.free:
            numbers = {"value": float(row.value), "lower": float(row.lower), "upper": float(row.upper), "source": row.source}
            content["parameters"][row.name] |= numbers
    content["name"], content["description"] = "declared kite", "what the operator knows"
    content["wind"] |= {key: getattr(guess.wind, key) for key in ("law", "exponent", "reference_height")}
    return yaml.safe_dump(content, sort_keys=False, width=140)


def _passport(case: Case, draw: Draw, flight: ForeignFlight) -> dict[str, Any]:
    """What flew, in numbers: for whoever wants to know, not for a tracer."""
    ranges = {name: [float(flight.truth[name].min()), float(flight.truth[name].max())] for name in ("V_a", "alpha", "beta", "tension")}
    return {
        **asdict(case), "values": read_kinds()[case.kind].values(case.size), "rate_hz": draw.rate, "duration_s": draw.scene.duration,
        "noise_factor": draw.sensors.factor, "attitude_drift_rad": draw.sensors.drift, "attitude_memory_s": draw.sensors.memory,
        "turbulence_m_s": draw.turbulence, "ranges": ranges,
    }  # fmt: skip


def _digest(case: Case, kind: Kind) -> str:
    """Eight digits of all that a flight is made from."""
    parts = [json.dumps(asdict(case)), kind.model_dump_json(), KITE.read_text()]
    parts += [file.read_text() for file in (*sorted(HERE.glob("foreign_*.py")), HERE / "wrong_bounds.py") if file.name not in NO_WORLD]
    return hashlib.sha256("\n".join(parts).encode()).hexdigest()[:8]
