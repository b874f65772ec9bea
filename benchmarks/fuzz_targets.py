"""What benchmarks/fuzz.py gives to libFuzzer: everything awes reads, each with seeds."""

import json
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parent.parent


@dataclass(frozen=True)
class Target:
    """One thing that awes reads. prepare(folder): lays out what stands around the input, gives back the seeds; read(folder, data): reads
    it as awes would; runs: inputs in a full campaign; words: what a mutation may put in."""

    prepare: Callable[[Path], list[bytes]]
    read: Callable[[Path, bytes], None]
    runs: int
    words: tuple[str, ...] = ()


def _plan_seeds(folder: Path) -> list[bytes]:
    (folder / "flight").mkdir()
    (folder / "kite.yaml").write_text("name: x\n")
    own = (ROOT / "stages.yaml").read_bytes().replace(b"data/km1_demo", b"flight").replace(b"data/kites/km1_initial.yaml", b"kite.yaml")
    return [own, b"flight: flight\nkite: kite.yaml\nstages: {identify: {horizon: 2.0, curriculum: [1.0]}, evaluate: {report: false}}\n",
            b"a: &a [1, 2]\nb: *a\nflight: !!python/object/apply:os.system [ls]\n"]  # fmt: skip


def _read_plan(folder: Path, data: bytes) -> None:
    from awescli.stages import STAGES
    from awescli.stages.plan import read_plan

    (folder / "stages.yaml").write_bytes(data)
    read_plan(folder / "stages.yaml", STAGES)


def _read_setting(folder: Path, data: bytes) -> None:
    """`--set KEY=VALUE`, one a line."""
    from awescli.cli.commands import _overrides
    from awescli.stages import STAGES
    from awescli.stages.plan import read_plan

    lines = data.decode("utf-8", "surrogateescape").split("\n")
    read_plan(folder / "stages.yaml", STAGES, _overrides(lines))


def _setting_seeds(folder: Path) -> list[bytes]:
    (folder / "stages.yaml").write_bytes(_plan_seeds(folder)[0])
    several = b"split.train=0.6\nsplit.test=0.2"
    return [b"identify.horizon=5.0\nseed=3", b"simulate.effects={actuator_lag:rudder: {tau: 0.2}}", several, b"out=x"]


def _kite_seeds(folder: Path) -> list[bytes]:
    kites = ROOT / "data" / "kites"
    constraints = b'\nconstraints: ["Jx + Jy >= Jz", "2*CYb + 0.1 <= CYp", "CLa >= 4"]\n'
    return [(kites / "development.yaml").read_bytes() + constraints, (kites / "km1_initial.yaml").read_bytes()]


def _read_kite(folder: Path, data: bytes) -> None:
    """As `check` reads it: with what is doubted, and as the kite that would fly."""
    from awescli.physics.declaration import kite_text, read_kite
    from awescli.physics.doubts import doubts
    from awescli.physics.kite import Kite

    (folder / "kite.yaml").write_bytes(data)
    declaration = read_kite(folder / "kite.yaml")
    doubts(declaration)
    Kite(declaration)
    (folder / "kite.yaml").write_text(kite_text(declaration))
    assert read_kite(folder / "kite.yaml") == declaration, "what is written is not what is read back"


def _rows(count: int) -> bytes:
    lines = (ROOT / "data" / "km1_demo" / "kite.csv").read_bytes().splitlines(keepends=True)
    return b"".join([lines[0], *lines[1 : 1 + count]])


def _flight_file_seeds(folder: Path) -> list[bytes]:
    (folder / "kite.csv").write_bytes(_rows(80))
    (folder / "wind.csv").write_bytes((ROOT / "data" / "km1_demo" / "wind.csv").read_bytes())
    mapped = b"""format: csv
file: kite.csv
time: {column: epoch_ms, unit: ms}
position: {columns: [r_eb_eN, r_eb_eE, r_eb_eD], unit: m}
velocity: {columns: [v_eb_eE, v_eb_eN, v_eb_eD], unit: m/s, frame: ENU}
signals: {phi: {column: phi, unit: deg}, rudder: {column: rudder_sp, unit: deg, sign: -1, offset: 1.0}}
wind: {direction: {column: psi, unit: deg}, speed: {column: V_a, unit: m/s}, height: 5.0}
clocks: {winch: auto}
"""
    return [mapped, b"format: kitemill\nunits: {LoadFiltered: N}\nstation_height: 20.0\nclocks: {winch: 1.0}\n"]


def _read_flight_file(folder: Path, data: bytes) -> None:
    (folder / "flight.yaml").write_bytes(data)
    _read_flight(folder)


def _csv_seeds(folder: Path) -> list[bytes]:
    rows = _rows(60)
    return [rows, rows.replace(b",", b";"), b"\xef\xbb\xbf" + rows.replace(b"\n", b"\r\n")]


def _read_csv(folder: Path, data: bytes) -> None:
    (folder / "kite.csv").write_bytes(data)
    _read_flight(folder)


def _draft_seeds(folder: Path) -> list[bytes]:
    """The rows of the bundled flight under headers that awes has to guess."""
    (folder / "met.csv").write_bytes(b"t,wind_dir,wind_kt\n1650000000,305,22\n1650000002,306,23\n")
    header, rest = _rows(120).split(b"\n", 1)
    guessed = {b"epoch_ms": b"time_ms", b"r_eb_eN": b"north [m]", b"r_eb_eE": b"east [m]", b"r_eb_eD": b"down", b"v_eb_eN": b"vx",
               b"v_eb_eE": b"vy", b"v_eb_eD": b"vz", b"phi": b"roll_deg", b"psi": b"hdg", b"LoadFiltered": b"load_kgf"}  # fmt: skip
    for old, new in guessed.items():
        header = header.replace(old, new)
    globe = header.replace(b"north [m]", b"lat").replace(b"east [m]", b"lon").replace(b"down", b"alt")
    return [header + b"\n" + rest, globe + b"\n" + rest]


def _read_draft(folder: Path, data: bytes) -> None:
    """`awes init --flight log.csv`, and what its flight.yaml gives."""
    from awescli.flightlog.drafting.draft import draft
    from awescli.flightlog.drafting.text import draft_text
    from awescli.flightlog.drafting.weather import weather_files
    from awescli.flightlog.read import read_flight

    log = folder / "log.csv"
    log.write_bytes(data)
    (folder / "flight.yaml").write_text(draft_text(draft(log, weather_files(folder, log)), folder))
    read_flight(folder / "flight.yaml")


def _weather_seeds(folder: Path) -> list[bytes]:
    (folder / "kite.csv").write_bytes(_rows(60))
    return [(ROOT / "data" / "km1_demo" / "wind.csv").read_bytes(), b"_time,direction,rho,speed\n1650000000000000000,80,1.2,8\n"]


def _read_weather(folder: Path, data: bytes) -> None:
    (folder / "wind.csv").write_bytes(data)
    _read_flight(folder)


def _read_flight(folder: Path) -> None:
    from awescli.flightlog.quality import data_quality
    from awescli.flightlog.read import read_flight

    json.dumps(data_quality(read_flight(folder)).as_dict(), allow_nan=False)


def _mat_seeds(folder: Path) -> list[bytes]:
    import io

    import numpy as np
    from scipy.io import savemat

    n = 20
    response = {"p": np.ones((3, n)), "v": np.ones((3, n)), "R": np.repeat(np.eye(3)[:, :, None], n, axis=2), "w": np.zeros((3, n))}
    response |= {k: np.ones(n) for k in ("airspeed", "angleOfAttack", "sideSlip", "tetherTension", "tetherSpeed")}
    controls = {"times": np.arange(n) * 0.02, "wind": np.ones((3, n)), **{k: np.zeros(n) for k in ("aileron", "elevator", "rudder")}}
    seeds = []
    for compress in (False, True):
        buffer = io.BytesIO()
        whole = {"times": np.arange(n) * 0.02, "response": response, "controls": controls}
        savemat(buffer, {"validationData": whole}, do_compression=compress)
        seeds.append(buffer.getvalue())
    return seeds


def _read_mat(folder: Path, data: bytes) -> None:
    (folder / "a.mat").write_bytes(data)
    _read_flight(folder)


def _array_seeds(folder: Path) -> list[bytes]:
    import numpy as np

    from awescli.artifacts import write_arrays, write_json, write_tensors

    arrays = {"weights": np.arange(6.0), "x": np.ones((2, 3), dtype=np.float32)}
    write_arrays(folder / "a.npz", arrays)
    write_tensors(folder / "a.safetensors", arrays)
    write_json(folder / "a.json", {"a": [1.0, {"b": None}], "c": "text"})
    return [bytes([i]) + (folder / name).read_bytes() for i, name in enumerate(("a.npz", "a.safetensors", "a.json"))]


def _read_arrays(folder: Path, data: bytes) -> None:
    """The three containers; the first byte says which."""
    from awescli.artifacts import read_arrays, read_json, read_tensors

    read = (read_arrays, read_tensors, read_json)[data[0] % 3 if data else 0]
    (folder / "file").write_bytes(data[1:])
    read(folder / "file")


def _network_seeds(folder: Path) -> list[bytes]:
    import numpy as np

    from awescli.artifacts import write_json, write_tensors
    from awescli.learning.correction import Correction, initial_weights

    (folder / "kite.yaml").write_bytes((ROOT / "data" / "kites" / "development.yaml").read_bytes())
    inputs = ("u", "v", "alpha")
    weights = initial_weights((len(inputs), 3, 6), 0)
    network = Correction(inputs, (3,), weights, *(np.ones(3) for _ in range(4)), np.ones(6), 1.0)
    write_json(folder / "network.json", network.description())
    write_tensors(folder / "network.safetensors", {k: np.asarray(v) for k, v in network.to_arrays().items()})
    return [_joined(folder / "network.json", folder / "network.safetensors")]


def _joined(text: Path, weights: Path) -> bytes:
    first = text.read_bytes()
    return len(first).to_bytes(2, "big") + first + weights.read_bytes()


def _parted(folder: Path, data: bytes, text: str, weights: str) -> None:
    size = int.from_bytes(data[:2], "big")
    (folder / text).write_bytes(data[2 : 2 + size])
    (folder / weights).write_bytes(data[2 + size :])


def _read_network(folder: Path, data: bytes) -> None:
    from awescli.artifacts import read_json, read_tensors
    from awescli.learning.correction import Correction

    _parted(folder, data, "network.json", "network.safetensors")
    Correction.from_arrays(read_tensors(folder / "network.safetensors"), read_json(folder / "network.json"))


def _controller_seeds(folder: Path) -> list[bytes]:
    return [_joined(p / "controller.json", p / "controller.safetensors") for p in _small_out(folder, "fit-controller")]


def _read_controller(folder: Path, data: bytes) -> None:
    from awescli.stages.controller_artifact import read_controller

    _parted(folder, data, "controller.json", "controller.safetensors")
    read_controller(folder)


def _small_out(folder: Path, *stages: str) -> list[Path]:
    """The folders of stages of a small run."""
    from small_run import make_small_run

    from awescli.stages import STAGES
    from awescli.stages.plan import read_plan
    from awescli.stages.runner import run_plan

    plan = read_plan(make_small_run(folder / "small"), STAGES, {"fit-controller.closed_loop_time": "1.0"})
    run_plan(plan, STAGES, only=stages)
    return [plan.out / stage for stage in stages]


def _provenance_seeds(folder: Path) -> list[bytes]:
    return [(p / "provenance.json").read_bytes() for p in _small_out(folder, "fit-controller")]


def _read_provenance(folder: Path, data: bytes) -> None:
    """`awes verify`, and the decision whether a stage has to run again."""
    from awescli.stages import STAGES
    from awescli.stages.plan import read_plan
    from awescli.stages.runner import run_plan
    from awescli.stages.verify import verify

    plan = read_plan(folder / "small" / "stages.yaml", STAGES)
    (plan.out / "fit-controller" / "provenance.json").write_bytes(data)
    verify(plan.out, STAGES)
    run_plan(plan, STAGES, only=("fit-controller", "identify"), dry_run=True)


_BELIEVED: dict[str, "object"] = {}


def _artifact_seeds(folder: Path) -> list[bytes]:
    """Artifacts that are edited by hand, their hashes too; the first byte says which."""
    from believed import READ, Believed

    _BELIEVED[str(folder)] = made = Believed(folder / "run")
    return [bytes([i]) + made.original(artifact) for i, artifact in enumerate(READ)]


def _read_artifact(folder: Path, data: bytes) -> None:
    from believed import READ

    made, artifact = _BELIEVED[str(folder)], READ[data[0] % len(READ) if data else 0]
    made.put(artifact, data[1:])
    try:
        made.read()
    finally:
        made.restore(artifact)


def _object_seeds(folder: Path) -> list[bytes]:
    """What the cache of compiled code keeps."""
    import os

    from awescli.engine import object_cache

    os.environ["AWES_CACHE"] = str(folder)
    object_cache.store(_KEY, b"machine code " * 20)
    return [(object_cache.folder() / f"{_KEY}.o").read_bytes()]


_KEY = "0123456789abcdef" * 4


def _read_object(folder: Path, data: bytes) -> None:
    """Only what has its digest may come back. (The digest is no secret: libFuzzer sees what the bytes are compared with, and finds it.)"""
    import hashlib
    import os

    from awescli.engine import object_cache

    os.environ["AWES_CACHE"] = str(folder)
    (object_cache.folder() / f"{_KEY}.o").write_bytes(data)
    begin = len(object_cache.MAGIC) + 32
    right = data[:begin] == object_cache.MAGIC + hashlib.sha256(_KEY.encode() + b"\0" + data[begin:]).digest() and len(data) > begin
    assert object_cache.load(_KEY) == (data[begin:] if right else None), "an object without its digest"


YAML_WORDS = (
    "&a", "*a", "!!python/object/apply:os.system", "<<:", "{", "}", "[", "]", ": ", "- ", "|\n", "1e999", ".nan", "../..", "'", "\0",
)  # fmt: skip
SETTINGS = (
    "flight: ", "kite: ", "out: ", "seed: ", "split: ", "stages: ", "identify: ", "horizon: ", "train-hybrid: ", "simulate: ", "effects: ",
)  # fmt: skip
KITE_WORDS = (
    "parameters:", "aerodynamics:", "terms:", "effects:", "tether:", "wind:", "noise:", "value: ", "lower: ", "upper: ", "free: true",
)  # fmt: skip
FLIGHT_WORDS = ("format: ", "units: ", "column: ", "unit: ", "frame: ")
COLUMNS = (
    "epoch_ms", "r_eb_eN", "v_eb_eD", "phi", "psi", "LoadFiltered", "rudder_sp", "tether_length", "nan", "1e308", "-", ",,", "\n", '"', ";",
)  # fmt: skip

TARGETS: dict[str, Target] = {
    "plan": Target(_plan_seeds, _read_plan, 40_000, (*YAML_WORDS, *SETTINGS)),
    "set": Target(_setting_seeds, _read_setting, 30_000, (*YAML_WORDS, "identify.", "stages.", "=", "..")),
    "kite": Target(_kite_seeds, _read_kite, 4_000, (*YAML_WORDS, *KITE_WORDS)),
    "flight.yaml": Target(_flight_file_seeds, _read_flight_file, 12_000, (*YAML_WORDS, *FLIGHT_WORDS)),
    "csv": Target(_csv_seeds, _read_csv, 2_000, COLUMNS),
    "weather": Target(_weather_seeds, _read_weather, 1_500, ("_time", "direction", "speed", "rho", "height", *COLUMNS[8:])),
    "draft": Target(_draft_seeds, _read_draft, 1_500, ("time", "lat", "roll", "[deg]", "(m/s)", "wind_dir", *COLUMNS[8:])),
    "mat": Target(_mat_seeds, _read_mat, 20_000, ("validationData", "response", "controls", "times")),
    "arrays": Target(_array_seeds, _read_arrays, 50_000, ("PK\x03\x04", "NUMPY", "descr", "'O'", '{"', "dtype", "F64", "data_offsets")),
    "network": Target(_network_seeds, _read_network, 6_000, ('"', "inputs", "hidden", "NaN", "1e999")),
    "controller": Target(_controller_seeds, _read_controller, 4_000, ('"', "kind", "features", "NaN", "1e999")),
    "artifact": Target(_artifact_seeds, _read_artifact, 1_500, ('"', "version", "nrmse", "verdict", "value", "null", "1e308", "[]", "{}")),
    "cache": Target(_object_seeds, _read_object, 50_000, ("awes object 2\n", "\x7fELF")),
    "provenance": Target(_provenance_seeds, _read_provenance, 2_000, ('"', "stamp", "artifacts", "upstream", "paths", "null", "..")),
}
