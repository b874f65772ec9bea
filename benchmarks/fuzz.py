"""Coverage-guided fuzzing of everything awes reads: python benchmarks/fuzz.py [--runs N] [--only TARGET] [--minutes M]

Every target is a reader and seeds for it. libFuzzer (atheris, extra `campaign`) mutates them, guided by the branches of awes' own code that
an input reaches. Allowed are a good answer or an AwesError; anything else ends the target: another exception, more than TIMEOUT s, more
than MEMORY MB, a process or a socket opened, a file written outside the target's folder (all seen by an audit hook). Inputs that ended a
target are kept in results/fuzz/. Writes results/fuzz.md.
"""

import argparse
import json
import os
import re
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import awescli  # noqa: F401  (thread settings before numpy)

HERE = Path(__file__).parent
ROOT = HERE.parent
RESULTS = HERE / "results" / "fuzz"
TIMEOUT, MEMORY = 20, 2048
"""s and MB for one input."""


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
    return [(kites / "development.yaml").read_bytes(), (kites / "km1_initial.yaml").read_bytes()]


def _read_kite(folder: Path, data: bytes) -> None:
    from awescli.physics.declaration import read_kite

    (folder / "kite.yaml").write_bytes(data)
    read_kite(folder / "kite.yaml")


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

    plan = read_plan(make_small_run(folder / "small"), STAGES, {"fit-controller.prove": "1.0"})
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
    "plan": Target(_plan_seeds, _read_plan, 25_000, (*YAML_WORDS, *SETTINGS)),
    "set": Target(_setting_seeds, _read_setting, 20_000, (*YAML_WORDS, "identify.", "stages.", "=", "..")),
    "kite": Target(_kite_seeds, _read_kite, 4_000, (*YAML_WORDS, *KITE_WORDS)),
    "flight.yaml": Target(_flight_file_seeds, _read_flight_file, 12_000, (*YAML_WORDS, *FLIGHT_WORDS)),
    "csv": Target(_csv_seeds, _read_csv, 2_000, COLUMNS),
    "weather": Target(_weather_seeds, _read_weather, 1_500, ("_time", "direction", "speed", "rho", "height", *COLUMNS[8:])),
    "draft": Target(_draft_seeds, _read_draft, 1_500, ("time", "lat", "roll", "[deg]", "(m/s)", "wind_dir", *COLUMNS[8:])),
    "mat": Target(_mat_seeds, _read_mat, 12_000, ("validationData", "response", "controls", "times")),
    "arrays": Target(_array_seeds, _read_arrays, 25_000, ("PK\x03\x04", "NUMPY", "descr", "'O'", '{"', "dtype", "F64", "data_offsets")),
    "network": Target(_network_seeds, _read_network, 6_000, ('"', "inputs", "hidden", "NaN", "1e999")),
    "controller": Target(_controller_seeds, _read_controller, 4_000, ('"', "kind", "features", "NaN", "1e999")),
    "provenance": Target(_provenance_seeds, _read_provenance, 2_000, ('"', "stamp", "artifacts", "upstream", "paths", "null", "..")),
}

FORBIDDEN = (
    "os.system", "os.exec", "os.posix_spawn", "os.spawn", "subprocess.Popen", "socket.connect", "socket.bind", "pickle.find_class",
    "pty.spawn",
)  # fmt: skip
"""Audit events that reading a file never causes."""


def guard(folder: Path) -> None:
    """From now on, starting a process, opening a socket, unpickling, or writing outside the folder ends this process."""
    inside = str(folder.resolve())

    def hook(event: str, details: tuple) -> None:
        if event in FORBIDDEN:
            raise AssertionError(f"forbidden: {event} {details}")
        if event == "open" and isinstance(details[2], int) and details[2] & (os.O_WRONLY | os.O_RDWR | os.O_CREAT):
            path = os.path.realpath(os.fspath(details[0])) if isinstance(details[0], (str, bytes, os.PathLike)) else ""
            if path and not path.startswith((inside, "/dev/")):
                raise AssertionError(f"forbidden: writing {path}")

    sys.addaudithook(hook)


def fuzz_one(name: str, folder: Path, libfuzzer: list[str]) -> None:
    """Run libFuzzer on one target, in this process; it exits the process at its end."""
    import atheris

    with atheris.instrument_imports(include=["awescli"]):
        from awescli.notation.errors import AwesError

        target = TARGETS[name]
        inside = folder / "inside"
        inside.mkdir()
        seeds = target.prepare(inside)
        for seed in seeds:  # imports are over, and the seeds must be readable or refused
            try:
                target.read(inside, seed)
            except AwesError:
                pass
    (folder / "corpus").mkdir()
    for i, seed in enumerate(seeds):
        (folder / "corpus" / str(i)).write_bytes(seed)
    words = (word.encode() for word in target.words)
    (folder / "words").write_text("".join('"' + "".join(f"\\x{b:02x}" for b in word) + '"\n' for word in words))
    guard(inside)

    def one(data: bytes) -> None:
        try:
            target.read(inside, data)
        except AwesError as e:
            assert str(e).strip(), "an error without words"

    atheris.Setup([sys.argv[0], *libfuzzer, f"-dict={folder / 'words'}", str(folder / "corpus")], one)
    atheris.Fuzz()


def run_target(name: str, runs: int, seed: int, minutes: float) -> dict:
    """Fuzz one target in a process of its own, in several sittings if an input ends it; what was tried, and what ended it."""
    RESULTS.mkdir(parents=True, exist_ok=True)
    began = time.monotonic()
    with tempfile.TemporaryDirectory(prefix="fuzz-") as folder:
        options = [
            f"-runs={runs}", f"-seed={seed}", f"-timeout={TIMEOUT}", f"-rss_limit_mb={MEMORY}", "-max_len=20000", "-len_control=0",
            f"-artifact_prefix={RESULTS}/{name}-", f"-max_total_time={int(60 * minutes)}", "-print_final_stats=1",
        ]  # fmt: skip
        command = [sys.executable, str(Path(__file__).resolve()), "--inside", name, folder, *options]
        done = subprocess.run(command, capture_output=True, text=True, errors="replace", cwd=ROOT)
    tried = [int(n) for n in re.findall(r"stat::number_of_executed_units:\s*(\d+)", done.stderr)]
    tried += [int(n) for n in re.findall(r"^#(\d+)", done.stderr, re.M)]
    coverage = re.findall(r"cov: (\d+)", done.stderr)
    peak = re.findall(r"stat::peak_rss_mb:\s*(\d+)", done.stderr)
    ended = "" if done.returncode == 0 else _why(done.stdout + done.stderr)
    return {
        "target": name, "inputs": max(tried, default=0), "branches": int(coverage[-1]) if coverage else 0,
        "first_branches": int(coverage[0]) if coverage else 0, "peak_mb": int(peak[-1]) if peak else 0,
        "seconds": time.monotonic() - began, "ended": ended,
    }  # fmt: skip


def _why(text: str) -> str:
    """What ended a target, from the output of atheris and libFuzzer."""
    telling = re.compile(r"^\S*(Error|Exception|Interrupt|Panic)\S*|.*ERROR: ")
    lines = [line.strip() for line in text.splitlines() if telling.match(line.strip())]
    return " / ".join(line[:300] for line in lines[:3]) or text.strip()[-300:]


def main(arguments=None) -> int:
    arguments = list(sys.argv[1:] if arguments is None else arguments)
    # here and below, not on top: what is imported before a target is not watched by libFuzzer
    if arguments[:1] == ["--inside"]:
        fuzz_one(arguments[1], Path(arguments[2]), arguments[3:])
        return 0
    from awescli.artifacts import write_json, write_text

    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--runs", type=int, help="inputs for each target (default: as in TARGETS)")
    parser.add_argument("--only", default="", choices=["", *TARGETS], help="only this target")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--minutes", type=float, default=60.0, help="time limit of a target")
    options = parser.parse_args(arguments)
    failed = False
    for name, target in TARGETS.items():
        if options.only in ("", name):
            result = run_target(name, options.runs or target.runs, options.seed, options.minutes)
            write_json(RESULTS / f"{name}.json", result)
            print(json.dumps(result), flush=True)
            write_text(HERE / "results" / "fuzz.md", table())
            failed = failed or bool(result["ended"])
    return 1 if failed else 0


def table() -> str:
    """The newest result of every target."""
    from awescli.artifacts import read_json

    results = [read_json(file) for name in TARGETS if (file := RESULTS / f"{name}.json").is_file()]
    lines = [
        "# Fuzzing", "", f"`python benchmarks/fuzz.py`: {sum(r['inputs'] for r in results)} inputs.", "",
        "| target | inputs | branches reached: by the seeds -> at the end | peak memory [MB] | ended by |", "|---|---|---|---|---|",
    ]  # fmt: skip
    for r in results:
        cells = (r["target"], r["inputs"], f"{r['first_branches']} -> {r['branches']}", r["peak_mb"], r["ended"] or "nothing")
        lines.append("| " + " | ".join(map(str, cells)) + " |")
    return "\n".join([*lines, ""])


if __name__ == "__main__":
    sys.exit(main())
