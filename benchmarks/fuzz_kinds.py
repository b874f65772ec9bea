"""Mistakes by kind: python benchmarks/fuzz_kinds.py [--only SUBJECT] [--share X] [--seed S]

Where fuzz.py asks whether any input ends awes, this asks what becomes of mistakes that a person makes, kind by kind. A subject makes
damaged cases of a kind at random, gives each to awes, and says which of these it was: `refused` (one clear error), `repaired` (the
answer of the undamaged case), `noticed` (an answer with a sentence about it), `unnoticed` (an answer as if all were well), `fault` (an
error that awes did not mean, a crash, more than TIMEOUT s). Asked for: no fault, and nothing unnoticed but what nobody could tell.
Writes results/fuzz_kinds.md.

To add a subject: a file with KINDS and `prepare(folder) -> judge`, and a line in SUBJECTS. Of logs the table by flight, with what is named
rightly, is made by kinds_logs.py.
"""

import argparse
import signal
import sys
import tempfile
import time
import zlib
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path

import numpy as np

HERE = Path(__file__).parent
OUTCOMES = ("refused", "repaired", "noticed", "unnoticed", "fault")
TIMEOUT = 20
"""s for one case."""
TOLD = 3
"""Examples of what was unnoticed or a fault, for each kind."""

SUBJECTS = {
    "declared": "kinds_declared",
    "artifacts": "kinds_artifacts",
    "cache": "kinds_cache",
    "logs": "kinds_logs",
}
"""What is damaged -> the module with KINDS (name -> number of cases) and `prepare(folder) -> judge(kind, rng) -> Judged`."""


@dataclass(frozen=True)
class Judged:
    """What became of a case: one of OUTCOMES, and what it was in a few words."""

    outcome: str
    what: str = ""


Judge = Callable[[str, np.random.Generator], Judged]


@contextmanager
def time_limit(seconds: int = TIMEOUT) -> Iterator[None]:
    """A case that takes longer raises TimeoutError."""

    def late(number, frame):
        raise TimeoutError(f"more than {seconds} s")

    before = signal.signal(signal.SIGALRM, late)
    signal.alarm(seconds)
    try:
        yield
    finally:
        signal.alarm(0)
        signal.signal(signal.SIGALRM, before)


def run_subject(name: str, share: float, seed: int, folder: Path, say: Callable[[str], None]) -> dict[str, list[Judged]]:
    """Kind -> what became of its cases. share: of the cases that KINDS asks for."""
    module = import_module(SUBJECTS[name])
    judge: Judge = module.prepare(folder)
    found: dict[str, list[Judged]] = {}
    for kind, count in module.KINDS.items():
        found[kind] = []
        for i in range(max(1, round(share * count))):
            # a case is the same whatever was run before it
            rng = np.random.default_rng([seed, i, zlib.crc32(f"{name}/{kind}".encode())])
            try:
                with time_limit():
                    found[kind].append(judge(kind, rng))
            except Exception as e:
                found[kind].append(Judged("fault", f"{type(e).__name__}: {str(e).splitlines()[0] if str(e) else ''}"[:200]))
        say(f"{name}: {kind}: {dict(Counter(j.outcome for j in found[kind]))}")
    return found


def table(command: str, found: Mapping[str, Mapping[str, list[Judged]]], seconds: float) -> str:
    """Shares by kind, and examples of what went wrong."""
    lines = ["# Mistakes by kind", "", f"`{command}`, {seconds:.0f} s.", ""]
    for subject, kinds in found.items():
        cases = [j for judged in kinds.values() for j in judged]
        total = Counter(j.outcome for j in cases)
        said = ", ".join(f"{total[o]} {o}" for o in OUTCOMES if total[o])
        lines += [f"## {subject}: {len(cases)} cases, {said}", "", f"| kind | cases | {' | '.join(OUTCOMES)} |", "|---|---|" + "---|" * 5]
        for kind, judged in kinds.items():
            share = Counter(j.outcome for j in judged)
            cells = (f"{100 * share[o] / len(judged):.0f} %" if share[o] else "" for o in OUTCOMES)
            lines.append(f"| {kind} | {len(judged)} | {' | '.join(cells)} |")
        bad = [(kind, j) for kind, judged in kinds.items() for j in dict.fromkeys(judged) if j.outcome in ("unnoticed", "fault")]
        told: Counter = Counter()
        lines.append("")
        for kind, j in bad:
            told[kind, j.outcome] += 1
            if told[kind, j.outcome] <= TOLD:
                lines.append(f"- {j.outcome}, {kind}: {j.what}")
        lines.append("" if bad else "Nothing was unnoticed.\n")
    return "\n".join(lines).rstrip() + "\n"


def main(arguments=None) -> int:
    from awescli.artifacts import write_text

    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--only", default="", choices=["", *SUBJECTS], help="only this subject")
    parser.add_argument("--share", type=float, default=1.0, help="of the cases of a full campaign")
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args(arguments)
    given = ((" --only ", options.only, ""), (" --share ", options.share, 1.0), (" --seed ", options.seed, 1))
    command = "python benchmarks/fuzz_kinds.py" + "".join(f"{key}{value}" for key, value, usual in given if value != usual)
    found: dict[str, dict[str, list[Judged]]] = {}
    began = time.monotonic()
    for name in SUBJECTS:
        if options.only in ("", name):
            with tempfile.TemporaryDirectory(prefix="kinds-") as folder:
                found[name] = run_subject(name, options.share, options.seed, Path(folder), lambda line: print(line, flush=True))
    text = table(command, found, time.monotonic() - began)
    if not options.only:
        write_text(HERE / "results" / "fuzz_kinds.md", text)
    print(text)
    return 1 if any(j.outcome == "fault" for kinds in found.values() for judged in kinds.values() for j in judged) else 0


if __name__ == "__main__":
    sys.exit(main())
