"""Kill awes at random moments and look at what it leaves: python benchmarks/interruptions.py [--kills 120] [--seed 0]

A small run of all stages (small_run.py) goes to and fro between two plans whose settings, and so all numbers, differ. Every start is
ended by SIGINT, SIGTERM or SIGKILL after a random CPU time; after each, every stage's folder must hold exactly the artifacts of the one
plan or of the other, as undisturbed runs left them. The next start goes on where the last one was killed, until a plan is whole: then
all artifacts must be byte-identical to the undisturbed run's. Then the disk fills, the folder is read-only, and two runs want one folder.
Writes results/interruptions.md.
"""

import argparse
import ctypes
import os
import random
import resource
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path

from small_run import make_small_run

from awescli.artifacts import PROVENANCE, artifact_hashes, read_json, write_text
from awescli.stages import STAGES

HERE = Path(__file__).parent
AWES = [sys.executable, "-c", "from awescli.cli import main; main()"]
NAMES = tuple(stage.name for stage in STAGES)
WITH_TIMES = ("report.html",)
"""Artifacts that show when they were made."""

OTHER = (
    "fit-controller.prove=4.0", "identify.horizon=0.9", "trace-residual.horizon=0.9", "train-hybrid.horizons=[0.4]",
    "simulate.duration=5.0", "evaluate.horizon=0.9",
)  # fmt: skip
"""Settings of the second plan: they change the numbers of every stage."""

PLANS = {"first": (), "second": tuple(x for setting in OTHER for x in ("--set", setting))}
SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGKILL)

def cpu_seconds(pid: int) -> float:
    """CPU time that a process has used: a moment by this clock is the same stretch of work on a busy machine and on an idle one."""
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(") ")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


Artifacts = dict[str, dict[str, str]]
"""Stage -> file -> hash."""


def awes(folder: Path, *arguments: str, **options) -> subprocess.Popen:
    """Start the command line in a folder."""
    return subprocess.Popen([*AWES, *arguments], cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, **options)


def ended(process: subprocess.Popen, seconds: float = 600.0) -> tuple[int, str, str]:
    """(exit code, stdout, stderr); a process that hangs is killed and told by its exit code."""
    try:
        out, err = process.communicate(timeout=seconds)
    except subprocess.TimeoutExpired:
        process.kill()
        out, err = process.communicate()
        return 124, out, err + "\nhung"
    return process.returncode, out, err


def artifacts(out: Path) -> Artifacts:
    """What lies in the folder of results."""
    return {
        name: {file: digest for file, digest in artifact_hashes(out / name).items() if file not in WITH_TIMES}
        for name in NAMES
        if (out / name).is_dir()
    }


def undisturbed(folder: Path) -> dict[str, Artifacts]:
    """Plan -> the artifacts of a run that nobody kills; and leaves the second plan's in `folder`/out."""
    made = {}
    for plan, settings in PLANS.items():
        code, _, err = ended(awes(folder, "run", "--quiet", *settings))
        if code:
            raise SystemExit(f"the undisturbed run failed: {err}")
        made[plan] = artifacts(folder / "out")
    alike = [name for name in NAMES if made["first"][name] == made["second"][name]]
    if alike:
        raise SystemExit(f"the two plans must differ in all stages, they do not in {', '.join(alike)}")
    return made


def wrong_with(out: Path, references: dict[str, Artifacts]) -> list[str]:
    """What is neither old and valid nor new and valid; empty if all is well."""
    found = []
    for name, files in artifacts(out).items():
        if not any(files == reference[name] for reference in references.values()):
            found.append(f"{name} is neither plan's")
        kept = read_json(out / name / PROVENANCE)["artifacts"]
        if kept != artifact_hashes(out / name):
            found.append(f"{name} is not what its provenance says")
    return found + [f"{name} is gone" for name in NAMES if not (out / name).is_dir()]


@dataclass
class Tally:
    """What the campaign counted."""

    kills: Counter = field(default_factory=Counter)
    moments: Counter = field(default_factory=Counter)
    codes: Counter = field(default_factory=Counter)
    whole: int = 0
    wrong: list[str] = field(default_factory=list)
    seconds: float = 0.0

    @property
    def killed(self) -> int:
        return sum(self.kills.values())


def campaign(folder: Path, references: dict[str, Artifacts], kills: int, seed: int, longest: float = 7.0, say=lambda text: None) -> Tally:
    """Kill runs in `folder` until `kills` have been killed, then let the last plan end."""
    rng, tally, began = random.Random(seed), Tally(), time.monotonic()
    out, goal = folder / "out", "first"
    while tally.killed < kills:
        number = SIGNALS[tally.killed % len(SIGNALS)]
        process = awes(folder, "run", *PLANS[goal])
        moment = rng.uniform(0.0, longest)
        while process.poll() is None and cpu_seconds(process.pid) < moment:
            time.sleep(0.01)
        if process.poll() is None:
            process.send_signal(number)
        code, said, err = ended(process)
        tally.wrong += [f"{goal}, {number.name}, after {tally.killed} kills: {what}" for what in _complaints(out, references, code, err)]
        if code == 0:
            tally.whole += 1
            if artifacts(out) != references[goal]:
                tally.wrong.append(f"{goal} ended with other numbers")
            goal = "second" if goal == "first" else "first"
        else:
            tally.kills[number.name] += 1
            tally.codes[f"{number.name} -> {code}"] += 1
            running = [line.partition(":")[0] for line in said.splitlines() if ": runs (" in line]
            done = [line.partition(":")[0] for line in said.splitlines() if ": done in" in line]
            tally.moments["before the first stage" if not running else "between stages" if running[-1:] == done[-1:] else running[-1]] += 1
            say(f"{tally.killed}/{kills} {number.name} {running[-1:] or ''}")
    code, _, err = ended(awes(folder, "run", "--quiet", *PLANS[goal]))
    tally.whole += 1
    if code or artifacts(out) != references[goal]:
        tally.wrong.append(f"the last run of {goal} ended with code {code} or other numbers: {err}")
    left = sorted(p.name for p in out.iterdir() if p.name not in (*NAMES, ".lock"))
    tally.wrong += [f"left over: {name}" for name in left]
    code, said, err = ended(awes(folder, "verify"))
    tally.wrong += [f"awes verify: {err}"] if code else []
    tally.seconds = time.monotonic() - began
    return tally


def _complaints(out: Path, references: dict[str, Artifacts], code: int, err: str) -> list[str]:
    """What is wrong after a run was ended."""
    found = wrong_with(out, references)
    if "Traceback" in err:
        found.append(f"a traceback: {err.strip().splitlines()[-1]}")
    if code not in (0, 130, -signal.SIGKILL):
        found.append(f"exit code {code}: {err.strip()[-200:]}")
    return found


# --- the disk, the folder, the other run ----------------------------------------------------------------------------------


def full_disk(folder: Path, references: dict[str, Artifacts], size: int = 40_000) -> list[str]:
    """No file may grow beyond `size` bytes (the kernel says so as it says that the disk is full): one error, the old results stay."""
    limit = lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (size, size))  # noqa: E731
    code, _, err = ended(awes(folder, "run", "--force", preexec_fn=limit))
    return _refused(folder, references, code, err, "cannot be written")


def read_only(folder: Path, references: dict[str, Artifacts]) -> list[str]:
    """A folder that may not be written: one error, nothing changed."""
    out = folder / "out"
    out.chmod(0o555)
    (out / ".lock").unlink()
    try:
        code, _, err = ended(awes(folder, "run", "--force", preexec_fn=_like_any_user))
    finally:
        out.chmod(0o755)
    return _refused(folder, references, code, err, "cannot be written")


def _like_any_user() -> None:
    """Give up root's right to write everywhere (CAP_DAC_OVERRIDE); of no effect for others."""
    drop_from_bounding_set, dac_override = 24, 1
    ctypes.CDLL(None).prctl(drop_from_bounding_set, dac_override, 0, 0, 0)


def two_at_once(folder: Path, references: dict[str, Artifacts]) -> list[str]:
    """The second of two runs stops with the number of the first, which ends as if alone."""
    first = awes(folder, "run", "--force", *PLANS["first"])
    line = first.stdout.readline()  # it holds the folder from before its first line
    code, _, err = ended(awes(folder, "run", "--force"))
    found = [] if line else ["the first run said nothing"]
    if code != 2 or f"another awes (process {first.pid}) is running in this folder" not in err:
        found.append(f"the second run ended with code {code}: {err}")
    code, _, err = ended(first)
    if code or artifacts(folder / "out") != references["first"]:
        found.append(f"the first run ended with code {code} or other numbers: {err}")
    return found


def _refused(folder: Path, references: dict[str, Artifacts], code: int, err: str, words: str) -> list[str]:
    found = [] if code == 2 and words in err and "Traceback" not in err else [f"exit code {code}: {err}"]
    return found + wrong_with(folder / "out", references)


def main(arguments=None) -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--kills", type=int, default=120)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--longest", type=float, default=7.0, help="CPU seconds until a run is killed, at most")
    options = parser.parse_args(arguments)
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(temporary)
        folder.chmod(0o755)
        make_small_run(folder)
        references = undisturbed(folder)
        tally = campaign(folder, references, options.kills, options.seed, options.longest, lambda text: print(text, flush=True))
        places = {"disk full": full_disk, "folder read-only": read_only, "two runs at once": two_at_once}
        found = {name: test(folder, references) for name, test in places.items()}
    lines = [
        "# Interruptions", "", f"`python benchmarks/interruptions.py --kills {options.kills} --seed {options.seed}`", "",
        f"{tally.killed} runs killed ({', '.join(f'{n} {k}' for k, n in sorted(tally.kills.items()))}), {tally.whole} plans brought to "
        f"their end in between, byte-identical to undisturbed ones; {tally.seconds:.0f} s.", "",
        "| killed | times |", "|---|---|",
        *(f"| {name} | {tally.moments[name]} |" for name in ("before the first stage", *NAMES, "between stages")),
        "", "| signal -> exit code | times |", "|---|---|", *(f"| {key} | {n} |" for key, n in sorted(tally.codes.items())), "",
        f"Wrong: {'; '.join(tally.wrong) or 'nothing'}.", "",
        *(f"{name.capitalize()}: {'; '.join(wrong) or 'one clear error, exit code 2, nothing lost'}." for name, wrong in found.items()), "",
    ]  # fmt: skip
    write_text(HERE / "results" / "interruptions.md", "\n".join(lines))
    print("\n".join(lines))
    return 1 if tally.wrong or any(found.values()) else 0


if __name__ == "__main__":
    sys.exit(main())
