"""Kill awes at random moments and look at what it leaves: python benchmarks/interruptions.py [--kills 300] [--each 20] [--seed 0]

Two plans of a small run of all stages (small_run.py) whose settings, and so all numbers, differ are run undisturbed. Then, for every
kill, the stages before one are laid out as the one plan left them, that stage and those after it as the other did, and `awes run` of the
first plan is ended by SIGINT, SIGTERM or SIGKILL at a random moment of that stage; the stage is the one in which the fewest kills fell so
far, until `--kills` fell and `--each` in every stage. Every folder must then hold exactly what the one or the other plan left. BLAS is
given 1, 2 and 3 threads in turn, which must change nothing. Every fourth time the stage is run again, goes on where it was killed, and
must end with the bytes of the undisturbed run; every twentieth time the whole plan. Then the disk fills, the folder is read-only, and two
runs want one folder. Writes results/interruptions.md.
"""

import argparse
import ctypes
import importlib
import os
import random
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import traceback
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path

from small_run import make_small_run

import awescli
from awescli.artifacts import PROVENANCE, artifact_hashes, read_json, write_json, write_text
from awescli.stages import STAGES

HERE = Path(__file__).parent
AWES = [sys.executable, "-c", "from awescli.cli import main; main()"]
NAMES = tuple(stage.name for stage in STAGES)
WITH_TIMES = ("report.html",)
"""Artifacts that show when they were made."""

OTHER = (
    "fit-controller.closed_loop_time=4.0", "identify.horizon=0.9", "trace-residual.horizon=0.9", "train-hybrid.horizons=[0.4]",
    "simulate.duration=5.0", "evaluate.horizon=0.9",
)  # fmt: skip
"""Settings of the second plan: they change the numbers of every stage."""

PLANS = {"first": (), "second": tuple(x for setting in OTHER for x in ("--set", setting))}
SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGKILL)
BLAS = ("OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "BLIS_NUM_THREADS")
THREADS = (1, 2, 3)
"""Threads that BLAS is given, in turn."""


def cpu_seconds(pid: int) -> float:
    """CPU time that a process has used: a moment by this clock is the same stretch of work on a busy machine and on an idle one."""
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(") ")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


Artifacts = dict[str, dict[str, str]]
"""Stage -> file -> hash."""


def awes(folder: Path, *arguments: str, threads: int = 1, **options) -> subprocess.Popen:
    """Start the command line in a folder. threads: what the environment says that BLAS may have."""
    own = {name: str(threads) for name in BLAS}
    return subprocess.Popen(
        [*AWES, *arguments], cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=os.environ | own, **options
    )


class Forked:
    """The command line in a fork of this process, which has imported all that awes imports: only that start-up is saved.

    threads: what BLAS has in it when the command line begins.
    """

    def __init__(self, folder: Path, *arguments: str, threads: int = 1):
        self.said = [tempfile.TemporaryFile("w+"), tempfile.TemporaryFile("w+")]
        self.pid, self.code = os.fork(), None
        if self.pid == 0:
            signal.signal(signal.SIGINT, lambda number, frame: os._exit(130))  # what comes before awes is no part of it
            os.chdir(folder)
            for stream, file in zip((1, 2), self.said, strict=True):
                os.dup2(file.fileno(), stream)
            sys.argv = ["awes", *arguments]
            code = 70
            try:
                sys.stdout, sys.stderr = os.fdopen(1, "w", buffering=1), os.fdopen(2, "w", buffering=1)
                from threadpoolctl import threadpool_limits

                from awescli.cli import main

                threadpool_limits(limits=threads, user_api="blas")
                signal.signal(signal.SIGINT, signal.default_int_handler)
                main()
            except SystemExit as e:
                code = e.code or 0
            except BaseException:
                traceback.print_exc()
            finally:
                sys.stdout.flush()
                sys.stderr.flush()
                os._exit(code)

    def poll(self) -> int | None:
        if self.code is None:
            pid, status = os.waitpid(self.pid, os.WNOHANG)
            self.code = os.waitstatus_to_exitcode(status) if pid else None
        return self.code

    def send_signal(self, number: int) -> None:
        os.kill(self.pid, number)

    def kill(self) -> None:
        self.send_signal(signal.SIGKILL)

    def communicate(self, timeout: float | None = None) -> tuple[str, str]:
        began = time.monotonic()
        while self.poll() is None:
            if timeout is not None and time.monotonic() - began > timeout:
                raise subprocess.TimeoutExpired("awes", timeout)
            time.sleep(0.01)
        texts = []
        for file in self.said:
            file.seek(0)
            texts.append(file.read())
        return texts[0], texts[1]

    @property
    def returncode(self) -> int | None:
        return self.code


def ended(process: subprocess.Popen | Forked, seconds: float = 600.0) -> tuple[int, str, str]:
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
    """Plan -> the artifacts of a run that nobody kills, kept in `folder`/PLAN, where they may be from before."""
    made = {}
    for plan, settings in PLANS.items():
        if (folder / plan).is_dir():
            made[plan] = artifacts(folder / plan)
            continue
        code, _, err = ended(awes(folder, "run", "--quiet", *settings))
        if code:
            raise SystemExit(f"the undisturbed run failed: {err}")
        made[plan] = artifacts(folder / "out")
        shutil.copytree(folder / "out", folder / plan)
    alike = [name for name in NAMES if made["first"][name] == made["second"][name]]
    if alike:
        raise SystemExit(f"the two plans must differ in all stages, they do not in {', '.join(alike)}")
    return made


def cpu_of_stages(folder: Path) -> dict[str, float]:
    """Stage -> CPU seconds that it takes, from a run of one stage after the other (or from before)."""
    if (kept := folder / "took.json").is_file():
        return read_json(kept)
    took = {}
    shutil.copytree(folder / "second", folder / "out", dirs_exist_ok=True)
    for name in NAMES:
        process = Forked(folder, name, "--force", "--quiet")
        used = 0.0
        while process.poll() is None:
            used = max(used, cpu_seconds(process.pid))
            time.sleep(0.01)
        took[name] = used
    write_json(kept, took)
    return took


def wrong_with(out: Path, references: dict[str, Artifacts]) -> list[str]:
    """What is neither old and valid nor new and valid; empty if all is well."""
    found = []
    for name, files in artifacts(out).items():
        if not any(files == reference[name] for reference in references.values()):
            found.append(f"{name} is neither plan's")
        kept = read_json(out / name / PROVENANCE, any_form=True)["artifacts"]
        if kept != artifact_hashes(out / name):
            found.append(f"{name} is not what its provenance says")
    return found + [f"{name} is gone" for name in NAMES if not (out / name).is_dir()]


@dataclass
class Tally:
    """What the campaign counted."""

    kills: Counter = field(default_factory=Counter)
    threads: Counter = field(default_factory=Counter)
    moments: Counter = field(default_factory=Counter)
    codes: Counter = field(default_factory=Counter)
    whole: int = 0
    stages: int = 0
    wrong: list[str] = field(default_factory=list)
    seconds: float = 0.0

    @property
    def killed(self) -> int:
        return sum(self.kills.values())


def campaign(folder: Path, references: dict[str, Artifacts], kills: int, seed: int, say=lambda tally: None, each: int = 0) -> Tally:
    """Kill runs in `folder`, which `undisturbed` has prepared, until `kills` have been killed, and `each` in every stage."""
    rng, tally, began = random.Random(seed), Tally(), time.monotonic()
    out, took = folder / "out", cpu_of_stages(folder)
    while tally.killed < kills or any(tally.moments[name] < each for name in NAMES):
        number, stage = SIGNALS[tally.killed % len(SIGNALS)], min(NAMES, key=lambda name: tally.moments[name])
        goal, other = rng.sample(list(PLANS), 2)
        threads = THREADS[tally.killed // 2 % len(THREADS)]
        _lay_out(folder, stage, goal, other)
        fresh = tally.killed % 10 == 0  # every tenth in a process of its own, from its first instant on
        process = (awes if fresh else Forked)(folder, "run", *PLANS[goal], threads=threads)
        moment = rng.uniform(0.0, took[stage] + (2.0 if fresh else 0.0))
        while process.poll() is None and cpu_seconds(process.pid) < moment:
            time.sleep(0.005)
        if process.poll() is None:
            process.send_signal(number)
        code, said, err = ended(process)
        if code == 0:
            continue  # the run was faster than the signal
        tally.kills[number.name] += 1
        tally.threads[threads] += 1
        tally.codes[f"{number.name} -> {code}"] += 1
        tally.moments[_moment(said)] += 1
        wrong = _complaints(out, references, code, err)
        if tally.killed % 4 == 0:
            whole = tally.killed % 20 == 0
            other_threads = THREADS[(THREADS.index(threads) + 1) % len(THREADS)]  # goes on with others than it began with
            wrong += _gone_on(folder, references[goal], "run" if whole else stage, *PLANS[goal], threads=other_threads)
            tally.whole, tally.stages = tally.whole + whole, tally.stages + (not whole)
        tally.wrong += [f"kill {tally.killed} ({number.name}, {stage}): {what}" for what in wrong]
        tally.seconds = time.monotonic() - began
        say(tally)
    return tally


def _gone_on(folder: Path, reference: Artifacts, command: str, *settings: str, threads: int = 1) -> list[str]:
    """What is wrong after a killed stage, or the whole plan, is run to its end."""
    out = folder / "out"
    code, _, err = ended(Forked(folder, command, "--quiet", *settings, threads=threads))
    checked, now = NAMES if command == "run" else (command,), artifacts(out)
    left = {p.name for p in out.iterdir()} - {*NAMES, ".awes"} | {p.name for p in (out / ".awes" / "partial").glob("*")}
    scratch = {p.name for p in (out / ".awes" / "scratch").glob("*")}
    left |= scratch if command == "run" else scratch & {command}  # checkpoints of a stage that has not gone on yet stay
    return [
        *([f"going on ended with code {code}: {err}"] if code else []),
        *(f"{name} ended with other numbers" for name in checked if now.get(name) != reference[name]),
        *(f"left over: {name}" for name in sorted(left)),
    ]


def _lay_out(folder: Path, stage: str, goal: str, other: str) -> None:
    """out: the stages before `stage` as `goal` left them, the rest as `other` did."""
    shutil.rmtree(folder / "out", ignore_errors=True)
    before = NAMES[: NAMES.index(stage)]
    for name in NAMES:
        shutil.copytree(folder / (goal if name in before else other) / name, folder / "out" / name)


def _moment(said: str) -> str:
    """The stage that was running when the output ended."""
    running = [line.partition(":")[0] for line in said.splitlines() if ": runs (" in line]
    done = [line.partition(":")[0] for line in said.splitlines() if ": done in" in line]
    return "before the first stage" if not running else "between stages" if running[-1:] == done[-1:] else running[-1]


def _complaints(out: Path, references: dict[str, Artifacts], code: int, err: str) -> list[str]:
    """What is wrong after a run was ended."""
    found = wrong_with(out, references)
    if "Traceback" in err:
        found.append(f"a traceback: {err.strip().splitlines()[-1]}")
    # SIGTERM before awes listens ends the process as it ends any other
    if code not in (0, 130, -signal.SIGKILL, -signal.SIGTERM):
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


def page(tally: Tally, command: str, places: dict[str, list[str]]) -> str:
    """The results as text."""
    lines = [
        "# Interruptions", "", f"`{command}`", "",
        f"{tally.killed} runs killed ({', '.join(f'{n} {k}' for k, n in sorted(tally.kills.items()))}; "
        f"{', '.join(f'{n} with {k}' for k, n in sorted(tally.threads.items()))} BLAS threads); after {tally.stages} the stage, "
        f"after {tally.whole} the whole plan was run to its end and compared with the undisturbed run; {tally.seconds:.0f} s.", "",
        "| killed in | times |", "|---|---|",
        *(f"| {name} | {tally.moments[name]} |" for name in ("before the first stage", *NAMES, "between stages")),
        "", "| signal -> exit code | times |", "|---|---|", *(f"| {key} | {n} |" for key, n in sorted(tally.codes.items())), "",
        f"Wrong: {'; '.join(tally.wrong) or 'nothing'}.", "",
        *(f"{name}: {'; '.join(wrong) or 'one clear error, exit code 2, nothing lost'}.\n" for name, wrong in places.items()),
    ]  # fmt: skip
    return "\n".join(lines)


def main(arguments=None) -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--kills", type=int, default=300)
    parser.add_argument("--each", type=int, default=20, help="kills in every stage at least")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--folder", type=Path, help="where to work and to find what an earlier campaign has prepared")
    options = parser.parse_args(arguments)
    command = f"python benchmarks/interruptions.py --kills {options.kills} --each {options.each} --seed {options.seed}"
    result = HERE / "results" / "interruptions.md"
    # a shell starts what runs in its background deaf to SIGINT, and children inherit that
    signal.signal(signal.SIGINT, signal.default_int_handler)
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(temporary) if options.folder is None else options.folder
        if not (folder / "stages.yaml").is_file():
            make_small_run(folder)
        references = undisturbed(folder)
        shutil.copytree(folder / "second", folder / "out", dirs_exist_ok=True)
        _import_all()
        places: dict[str, list[str]] = {}

        def say(tally: Tally) -> None:
            print(f"{tally.killed} {dict(tally.moments)} {tally.wrong[-3:]}", flush=True)
            write_text(result, page(tally, command, places))

        tally = campaign(folder, references, options.kills, options.seed, say, options.each)
        shutil.rmtree(folder / "out")
        shutil.copytree(folder / "second", folder / "out")
        tests = {"The disk is full": full_disk, "The folder is read-only": read_only, "Two runs at once": two_at_once}
        for name, test in tests.items():
            places[name] = test(folder, references)
        write_text(result, page(tally, command, places))
    print(page(tally, command, places))
    return 1 if tally.wrong or any(places.values()) else 0


def _import_all() -> None:
    """What the stages import, once for all forks; nothing of it runs threads yet."""
    for module in sorted(Path(awescli.__file__).parent.rglob("*.py")):
        name = ".".join(module.relative_to(Path(awescli.__file__).parent.parent).with_suffix("").parts)
        if not name.endswith("__main__"):
            importlib.import_module(name.removesuffix(".__init__"))


if __name__ == "__main__":
    sys.exit(main())
