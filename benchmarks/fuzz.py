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
from pathlib import Path

from fuzz_targets import TARGETS

import awescli  # noqa: F401  (thread settings before numpy)

HERE = Path(__file__).parent
ROOT = HERE.parent
RESULTS = HERE / "results" / "fuzz"
TIMEOUT, MEMORY = 20, 2048
"""s and MB for one input."""


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
        "seconds": time.monotonic() - began, "ended": ended, "options": f"--seed {seed} --minutes {minutes:g}",
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

    results = [read_json(file, any_form=True) for name in TARGETS if (file := RESULTS / f"{name}.json").is_file()]
    options = " and ".join(f"`python benchmarks/fuzz.py {o}`" for o in sorted({r["options"] for r in results}))
    lines = [
        "# Fuzzing", "", f"{options}: {sum(r['inputs'] for r in results)} inputs.", "",
        "| target | inputs | branches reached: by the seeds -> at the end | peak memory [MB] | ended by |", "|---|---|---|---|---|",
    ]  # fmt: skip
    for r in results:
        cells = (r["target"], r["inputs"], f"{r['first_branches']} -> {r['branches']}", r["peak_mb"], r["ended"] or "nothing")
        lines.append("| " + " | ".join(map(str, cells)) + " |")
    return "\n".join([*lines, ""])


if __name__ == "__main__":
    sys.exit(main())
