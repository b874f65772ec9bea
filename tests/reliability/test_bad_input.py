"""Damaged input of every kind gives a good answer or one clear error; the campaign with many more inputs is benchmarks/fuzz.py."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from fuzz import TARGETS, guard
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from small_run import make_small_run

from awescli.notation.errors import AwesError

DAMAGE = st.lists(st.tuples(st.integers(0, 2**20), st.integers(0, 12), st.binary(max_size=12)), min_size=1, max_size=5)


@pytest.fixture(scope="module")
def prepared(small_run, tmp_path_factory):
    """name -> (folder, seeds), each laid out once; the run whose artifacts are damaged has been made."""
    made = {}

    def of(name):
        if name not in made:
            folder = tmp_path_factory.mktemp("target")
            if name == "artifact":
                shutil.copytree(small_run, folder / "run")
            made[name] = folder, TARGETS[name].prepare(folder)
        return made[name]

    return of


@pytest.mark.parametrize("name", TARGETS)
@settings(max_examples=20, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.data())
def test_damaged_input_is_read_or_refused(prepared, name, data):
    """Bytes replaced, removed, put in; words of the format put in; ends cut off."""
    folder, seeds = prepared(name)
    raw = bytearray(data.draw(st.sampled_from(seeds)))
    words = st.sampled_from([w.encode() for w in TARGETS[name].words])
    for at, gone, new in data.draw(DAMAGE):
        at %= len(raw) + 1
        raw[at : at + gone] = data.draw(st.one_of(st.just(new), words))
    try:
        TARGETS[name].read(folder, bytes(raw[: data.draw(st.integers(len(raw) // 2, len(raw)))]))
    except AwesError as e:
        assert str(e).strip()


@pytest.mark.parametrize(
    "deed, seen",
    [
        ("open(sys.argv[1] + '/../outside', 'w')", True),
        ("open(sys.argv[1] + '/inside', 'w')", False),
        ("__import__('os').system('true')", True),
        ("__import__('pickle').loads(b'cos\\nsystem\\n.')", True),
        ("__import__('socket').socket().connect(('127.0.0.1', 9))", True),
    ],
)
def test_the_guard_of_the_campaign_sees_what_must_not_happen(tmp_path, deed, seen):
    """In a process of its own: an audit hook cannot be taken off again."""
    assert callable(guard)
    (tmp_path / "in").mkdir()
    program = f"import sys; from pathlib import Path; from fuzz import guard; guard(Path(sys.argv[1])); {deed}"
    benchmarks = str(Path(__file__).parents[2] / "benchmarks")
    path = [benchmarks, *sys.path]
    done = subprocess.run([sys.executable, "-c", f"import sys; sys.path[:0] = {path!r}; {program}", str(tmp_path / "in")],
                          capture_output=True, text=True)  # fmt: skip
    assert ("forbidden: " in done.stderr) == seen and (done.returncode != 0) == seen


def test_paths_of_a_plan_cannot_make_a_stage_write_elsewhere(tmp_path):
    """Results go to `out` and nowhere else: not over the flight, not over a file, and a stage's name is never a path."""
    folder, seeds = tmp_path, TARGETS["plan"].prepare(tmp_path)
    for setting in (b"out: flight\n", b"out: kite.yaml\n"):
        with pytest.raises(AwesError):
            TARGETS["plan"].read(folder, seeds[0].replace(b"out: out\n", setting))
    with pytest.raises(AwesError, match="unknown key"):
        TARGETS["plan"].read(folder, seeds[0] + b"  ../../elsewhere: {}\n")


def test_alias_bombs_and_deep_nesting_are_refused(tmp_path):
    """Work that would grow without bound is refused before it is begun: unfolded, the first would be 9^10 words."""
    TARGETS["plan"].prepare(tmp_path)
    levels = [b"%c: &%c [%s]\n" % (98 + i, 98 + i, b", ".join([b"*%c" % (97 + i)] * 9)) for i in range(9)]
    bomb = b"a: &a [x, x, x, x, x, x, x, x, x]\n" + b"".join(levels)
    for data in (bomb, b"[" * 100_000, b"{a: " * 20_000, b"- " * 50_000):
        with pytest.raises(AwesError):
            TARGETS["plan"].read(tmp_path, data)


PIPES = {
    "kite.csv": lambda f: f / "flight" / "kite.csv", "wind.csv": lambda f: f / "flight" / "wind.csv",
    "flight.yaml": lambda f: f / "flight" / "flight.yaml", "a.mat": lambda f: f / "flight" / "a.mat",
    "kite.yaml": lambda f: f / "kite.yaml", "stages.yaml": lambda f: f / "stages.yaml",
}  # fmt: skip


CHECK_EACH = """
import os, sys
from awescli.cli import main
for folder in sys.argv[1:]:
    os.chdir(folder)
    print("in", folder, file=sys.stderr, flush=True)
    sys.argv = ["awes", "check"]
    try:
        main()
    except SystemExit as e:
        print("exit code", e.code, file=sys.stderr, flush=True)
"""


@pytest.mark.parametrize("kind", ["pipe", "device"])
def test_what_is_no_regular_file_is_not_waited_for(tmp_path, kind):
    """A named pipe in the place of a file used to hang `check` for ever, a device to fill the memory."""
    for name, file in PIPES.items():
        make_small_run(folder := tmp_path / name)
        if name == "a.mat":
            (folder / "flight" / "kite.csv").unlink()
        place = file(folder)
        place.unlink(missing_ok=True)
        os.mkfifo(place) if kind == "pipe" else place.symlink_to("/dev/zero")
    done = subprocess.run([sys.executable, "-c", CHECK_EACH, *(str(tmp_path / name) for name in PIPES)], capture_output=True, text=True,
                          timeout=120)  # fmt: skip
    told = dict(zip(PIPES, done.stderr.split("in /")[1:], strict=True))
    for name, said in told.items():
        assert f"this is a {'named pipe' if kind == 'pipe' else 'device'}" in said and "exit code 2" in said, name
        assert name in said.split("\n", 1)[1], name


@pytest.mark.parametrize("what", ["wide", "heights", "gap", "long line", "one column"])
def test_inputs_below_10_mb_take_little_memory_and_time(tmp_path, what):
    """The worst that a small file can ask for: 1 GB and 20 s are the limits."""
    make_small_run(tmp_path)
    log, weather = tmp_path / "flight" / "kite.csv", tmp_path / "flight" / "wind.csv"
    header, *rows = log.read_text().splitlines()
    if what == "wide":
        log.write_text(",".join([header, *(f"x{i}" for i in range(9000))]) + "\n" + "\n".join(r + ",1" * 9000 for r in rows[:500]))
    elif what == "heights":
        count = 200_000
        weather.write_text("_time,direction,speed,height\n" + "\n".join(f"165000{i:07d}000000,8,9,{i}" for i in range(count)))
    elif what == "gap":
        first = int(rows[0].split(",")[0])
        stamps = (first + i // 3 * 1100 + i % 3 * 20 for i in range(15 * len(rows)))  # three samples, then a second of nothing
        log.write_text("\n".join([header, *(",".join([str(s), *r.split(",")[1:]]) for s, r in zip(stamps, rows * 15, strict=True))]))
    elif what == "long line":
        log.write_text(header + "\n" + "1" * 9_000_000)
    else:
        log.write_text("a\n" + "1\n" * 4_000_000)
    done = subprocess.run([sys.executable, "-c", MEASURED], cwd=tmp_path, capture_output=True, text=True, timeout=120)
    code, peak, seconds = done.stdout.split()[-3:]
    assert code in ("0", "2") and int(peak) < 1000 and float(seconds) < 20, (done.stdout, done.stderr[-500:])


MEASURED = """
import sys, time
began, code = time.process_time(), 0
sys.argv = ["awes", "check"]
try:
    from awescli.cli import main
    main()
except SystemExit as e:
    code = e.code or 0
peak = next(line.split()[1] for line in open("/proc/self/status") if line.startswith("VmHWM"))
print(code, int(peak) // 1024, time.process_time() - began)
"""
