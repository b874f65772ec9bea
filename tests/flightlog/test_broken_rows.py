"""Rows that came twice, in another order, with rounded stamps, with a cell too few, or with cells that no sensor reports: each is repaired
or marked, none makes the flight look like one in other units, and no sample that is called valid is wrong."""

import csv

import numpy as np
import pytest
from kites import ROOT

from awescli.flightlog.clocks import moving_average
from awescli.flightlog.loops import find_loops
from awescli.flightlog.quality import data_quality
from awescli.flightlog.read import read_flight
from awescli.flightlog.table import read_header, read_table
from awescli.notation.errors import BadInput

DEMO = ROOT / "data" / "km1_demo"
ROWS = 6000
"""120 s at 50 Hz."""


@pytest.fixture(scope="module")
def demo():
    """(header, rows of texts) of the bundled flight."""
    with open(DEMO / "kite.csv", newline="") as file:
        header, *rows = csv.reader(file)
    return header, rows[:ROWS]


@pytest.fixture(scope="module")
def clean(demo, tmp_path_factory):
    return read(tmp_path_factory.mktemp("clean"), *demo)


def write(folder, header, rows):
    with open(folder / "kite.csv", "w", newline="") as file:
        csv.writer(file, lineterminator="\n").writerows([header, *rows])
    (folder / "wind.csv").write_bytes((DEMO / "wind.csv").read_bytes())


def read(folder, header, rows):
    write(folder, header, rows)
    return read_flight(folder)


BRIDGED = 0.1
"""Difference, in ranges of a signal, up to which a short stretch may be interpolated or held; a shifted cell is off by one and more."""


def agree(log, clean) -> float:
    """Largest difference of a valid sample from the clean flight at the same moment, in sizes of each signal's own range."""
    at = np.rint((log.start + log.time - clean.start) / clean.dt).astype(int)
    near = (np.abs(log.start + log.time - clean.start - at * clean.dt) < 1e-3) & (at >= 0) & (at < len(clean)) & log.valid
    worst = 0.0
    for name in (*clean.measured, *clean.inputs):
        off = np.abs(log[name][near] - clean[name][at[near]])
        off = np.minimum(off, np.abs(2 * np.pi - off)) if name in ("phi", "theta", "psi") else off
        worst = max(worst, float(off.max()) / max(float(np.ptp(clean[name])), 1e-9))
    assert near.sum() > 0.3 * len(clean)
    return worst


def test_rows_that_came_twice(demo, clean, tmp_path):
    """Between two rows of one stamp nothing moves: "the velocity is 1.9 times the change of position, it looks like knots"."""
    header, rows = demo
    log = read(tmp_path, header, [row for row in rows for _ in range(2)])
    assert len(log) == len(clean) and agree(log, clean) == 0.0 and log.counters["repeated"] == ROWS


def test_stamps_of_40_ms_at_50_hz(demo, clean, tmp_path):
    header, rows = demo
    at = header.index("epoch_ms")
    log = read(tmp_path, header, [[*row[:at], str(int(row[at]) // 40 * 40), *row[at + 1 :]] for row in rows])
    assert log.dt == pytest.approx(0.04) and log.counters["repeated"] == pytest.approx(ROWS / 2, abs=2)


def test_rows_in_another_order(demo, clean, tmp_path):
    """Neighbours swapped throughout: "it looks like ft/s"."""
    header, rows = demo
    swapped = [row for a, b in zip(rows[::2], rows[1::2], strict=True) for row in (b, a)]
    log = read(tmp_path, header, swapped)
    assert log.counters["backward"] == ROWS // 2 and agree(log, clean) < BRIDGED


@pytest.mark.parametrize(
    "column, value", [("psi", "1e6"), ("rudder_sp", "1e6"), ("r_eb_eN", "1e18"), ("v_eb_eE", "-1e18"), ("LoadFiltered", "1e15")]
)
def test_five_broken_cells_are_five_missing_cells(demo, clean, tmp_path, column, value):
    """In a row, so that no running median sees them. 1e6 used to make degrees of the whole flight, 1e18 to remove 7 of 16 loops."""
    header, rows = demo
    at = header.index(column)
    broken = [[*row[:at], value, *row[at + 1 :]] if 3000 <= i < 3005 else row for i, row in enumerate(rows)]
    log = read(tmp_path, header, broken)
    assert log.counters["spikes"] >= 5 and agree(log, clean) < BRIDGED
    assert np.array_equal(find_loops(log).bounds, find_loops(clean).bounds)


def test_rows_that_lack_a_cell_are_left_out(demo, clean, tmp_path):
    """1 % of the rows lost a cell, so that all behind it stood in the wrong column: up to 40 such samples used to be called valid."""
    header, rows = demo
    random = np.random.default_rng(1)
    short = set(random.choice(ROWS, ROWS // 100, replace=False).tolist()) | {0}
    ragged = []
    for i, row in enumerate(rows):
        lost = int(random.integers(0, len(row)))
        ragged.append([*row[:lost], *row[lost + 1 :]] if i in short else row)
    log = read(tmp_path, header, ragged)
    assert agree(log, clean) < BRIDGED
    assert any(f"{len(short)} rows do not have {len(header)} cells" in note and "kite.csv:2:" in note for note in log.notes)
    assert log.counters["unreadable"] == len(short)


@pytest.mark.parametrize("shape", ["three rows", "shuffled", "reversed", "one row twice"])
def test_rows_that_make_no_flight_are_read_or_refused(demo, tmp_path, shape):
    """Three rows, or shuffled ones, used to be a fault of awes (quality.py:145)."""
    header, rows = demo
    random = np.random.default_rng(0)
    some = {"three rows": rows[:3], "shuffled": [rows[i] for i in random.permutation(300)], "reversed": rows[300::-1],
            "one row twice": [rows[0], rows[0]]}[shape]  # fmt: skip
    write(tmp_path, header, some)
    try:
        data_quality(read_flight(tmp_path))
    except BadInput as e:
        assert str(tmp_path) in str(e) and e.do


def table(tmp_path, content: bytes):
    (tmp_path / "a.csv").write_bytes(content)
    return read_table(tmp_path / "a.csv", ("a", "b", "c"))


ROW = b"1,2,3\n" * 9


@pytest.mark.parametrize(
    "content, rows, says",
    [
        (b"a,b,c\n\n" + ROW, 9, "a.csv:2: 1 blank lines"),
        (b"a,b,c\r\n\r\n" + ROW.replace(b"\n", b"\r\n"), 9, "a.csv:2: 1 blank lines"),
        (b"a,b,c\n# by hand\n" + ROW, 9, "a.csv:2: 1 rows do not have 3 cells"),
        (b"a,b,c\n" + ROW + b"\n\n", 9, ""),
        (b"a,b,c\n1,2,3,4\n" + ROW, 9, "a.csv:2: 1 rows do not have 3 cells"),
        (b"a,b,c\n" + ROW.replace(b"\n", b",\n"), 9, ""),
        (b'a,b,c\n"1","2","3"\n' + b'"1","2,5","3"\n' * 2 + ROW * 9, 82, "unreadable"),
    ],
)  # fmt: skip
def test_lines_that_are_no_rows(tmp_path, content, rows, says):
    """A blank first row used to be answered in the words of the CSV library."""
    found = table(tmp_path, content)
    assert int((found.columns["a"] == 1).sum()) >= rows and (not says or any(says in note for note in found.notes)), found.notes
    good = found.columns["a"] == 1
    assert (found.columns["c"][good] == 3).all()


@pytest.mark.parametrize("content", [b"a,b,c\n" + b"1,2\n" * 9, b"a,b,c\n" + ROW + b"1,2\n" * 5, b"a,b,c\n" + b"1,2,3,4\n" * 9])
def test_rows_that_do_not_fit_the_header_are_refused(tmp_path, content):
    with pytest.raises(BadInput, match=r"a.csv:\d+: .*(cells|columns)"):
        table(tmp_path, content)


@pytest.mark.parametrize(
    "content",
    [
        b"root:x:0:0:root:/root:/bin/bash\nuser:x:1\n",
        b"[default]\nkey = secret, more\n",
        b"key,two\nthree,four\n",
        b"secret\n",
        b"se,cret\n",
    ],
)
def test_what_is_no_log_is_not_quoted(tmp_path, content):
    """`file: /etc/passwd` in somebody else's flight.yaml used to print its first line."""
    (tmp_path / "a.csv").write_bytes(content)
    with pytest.raises(BadInput) as caught:
        read_header(tmp_path / "a.csv")
    for word in (b"root", b"default", b"secret", b"se", b"key"):
        if word in content:
            assert word.decode() not in caught.value.what.split() and word.decode() not in caught.value.do.split()


@pytest.mark.parametrize("width", [1, 2, 3, 10, 57, 400])
@pytest.mark.parametrize("size", [1, 2, 9, 10, 11, 300])
def test_a_moving_average_is_the_mean_of_its_window(width, size):
    """Against the definition; and a huge sample is felt where it is in the window, nowhere else."""
    x = np.random.default_rng(0).standard_normal(size)
    lows, highs = (np.clip(np.arange(size) + d, 0, size) for d in (-((width - 1) // 2), width // 2 + 1))
    expected = [x[a:b].mean() for a, b in zip(lows, highs, strict=True)]
    assert moving_average(x, width) == pytest.approx(expected, rel=1e-12, abs=1e-13)
    at = size // 2
    spiked = np.where(np.arange(size) == at, 1e18, x)
    away = (at < lows) | (at >= highs)
    assert np.array_equal(moving_average(spiked, width)[away], moving_average(x, width)[away])
