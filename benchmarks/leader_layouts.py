"""Published flights of small aeroplanes in their own layouts, with their split and their windows: a folder that a user downloaded.

| data | layout | split | where predictions begin |
|---|---|---|---|
| github.com/CogniPilot/fixedwing-ude, `site/public/data` | `flights.json`, `flights/*.f32` (60 Hz, 18 float32 a row), `forecasts.json`, `results.json` | arcs: fit, development, test | the windows of `forecasts.json` |
| github.com/CogniPilot/mocap_sysid, the repository | `data/<dataset>_train.npz`, `_validation.npz` (segments with `valid_mask`), `results/aircraft6dof_method_comparison.csv` | files; every fifth train segment is ours to choose on | windows of 0.6 to 1.2 s behind the first move of a stick |

Sticks (-1 to 1) are read as deflections of the Sport Cub's throws, 25, 23 and 30 deg (fixedwing-ude, modelica/SportCubCommanded.mo); throttle
as it is. Both halls are indoors: the wind is none, and what they call airspeed is the speed. Several flights become one log, with nothing
valid between them.
"""  # noqa: E501

import csv
import json
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from awescli.flightlog.log import FlightLog, WindRecord
from awescli.flightlog.split import Split
from awescli.notation.errors import BadInput
from awescli.notation.frames import rotate, rotation_body_to_ned
from awescli.notation.quantities import STATES

THROWS = {"aileron": np.deg2rad(25.0), "elevator": np.deg2rad(23.0), "rudder": np.deg2rad(30.0), "throttle": 1.0}
BETWEEN = 64
"""Samples between two flights in one log, none of them valid."""
ROLES = {"fit": "train", "development": "validation", "test": "test"}
COLUMNS = (*STATES, "aileron", "elevator", "throttle", "rudder", "good", "safe")
"""Of a row of fixedwing-ude: states in NED and FRD, sticks roll, pitch, throttle, yaw, and two flags."""
STICKS = ("throttle", "aileron", "elevator", "rudder")
"""Of mocap_sysid's control_meas, in the order of its contract."""
ONSET_SHARE, ONSET_LEAST, ONSET_SAMPLES = 0.15, 0.02, 10
"""A stick has moved once it is farther from its median over the first samples than this share of its range, and than this (mocap_sysid,
comparison_suite.detect_input_onset)."""
SHORTEST, LONGEST = 0.6, 1.2
"""[s] of a window (mocap_sysid, comparison_suite.trim_to_input_onset)."""
CHOSEN = 5
"""Every so manieth train segment of mocap_sysid chooses instead of fitting: its contract has two parts, ours three."""


@dataclass(frozen=True)
class Group:
    """Flights of one airframe as one log. windows: seconds ahead -> (K,) samples where predictions begin; history: samples before each that
    may be looked at."""

    name: str
    log: FlightLog
    split: Split
    windows: dict[str, np.ndarray]
    history: int


@dataclass(frozen=True)
class Table:
    """score: name in leader_scores.SCORES; published: method -> seconds ahead -> score."""

    name: str
    groups: tuple[Group, ...]
    score: str
    published: dict[str, dict[str, float]]


def read_table(folder: Path) -> list[Table]:
    """The tables that a folder holds: fixedwing-ude, or one for each dataset of mocap_sysid. Raises BadInput for another folder."""
    if (folder / "flights.json").is_file():
        return [read_fixedwing(folder)]
    found = sorted((folder / "data").glob("*_validation.npz"))
    if not found:
        do = "Name fixedwing-ude's site/public/data (with flights.json), or mocap_sysid's repository (with data/*_validation.npz)."
        raise BadInput("no published flights are here", str(folder), do)
    return [read_mocap(folder, file.name.removesuffix("_validation.npz")) for file in found]


def read_fixedwing(folder: Path) -> Table:
    """fixedwing-ude: a group an airframe and kind of flying."""
    manifest, forecasts = (_json(folder / name) for name in ("flights.json", "forecasts.json"))
    dt = 1.0 / manifest["rate_hz"]
    flights = {flight["name"]: flight for flight in manifest["flights"]}
    names = dict.fromkeys(arc["group"] for flight in flights.values() for arc in flight["arcs"])
    groups = []
    for name in names:
        own = [f for f in flights.values() if any(arc["group"] == name for arc in f["arcs"])]
        pieces, at, ranges = [], {}, {part: [] for part in ROLES.values()}
        for flight in own:
            rows = np.fromfile(folder / flight["file"], "<f4").reshape(-1, len(COLUMNS)).astype(float)
            at[flight["name"]] = sum(len(p) + BETWEEN for p in pieces)
            pieces.append(rows)
            for arc in flight["arcs"]:
                if arc["group"] == name:
                    ranges[ROLES[arc["role"]]].append((at[flight["name"]] + arc["start"], at[flight["name"]] + arc["stop"]))
        windows = {}
        for w in forecasts["windows"]:
            if w["kind"] == "test" and w["group"] == name:
                windows.setdefault(f"{float(w['horizon']):g}", []).append(at[w["segment"]] + w["start"])
        columns = [dict(zip(COLUMNS, rows.T, strict=True)) for rows in pieces]
        log = joined(name, dt, columns, [np.isfinite(rows).all(axis=1) & (rows[:, COLUMNS.index("good")] > 0) for rows in pieces])
        parts = {part: tuple(sorted(found)) for part, found in ranges.items()}
        split = Split(**parts, counts=tuple(len(parts[p]) for p in ("train", "validation", "test")), of="arcs")
        windows = {h: np.array(sorted(first)) for h, first in windows.items()}
        groups.append(Group(name, log, split, windows, int(manifest["history_samples"])))
    pooled = _json(folder / "results.json")["pooled"]
    published = {
        method: {f"{float(h):g}": at["all_output_score"][method] for h, at in pooled.items()}
        for method in next(iter(pooled.values()))["all_output_score"]
    }
    return Table("CogniPilot/fixedwing-ude", tuple(groups), "of scales", published)


def read_mocap(folder: Path, dataset: str) -> Table:
    """mocap_sysid: one group; predictions of the validation file, everything else of the train file."""
    pieces, valid, parts, lengths = [], [], [], []
    for file in ("train", "validation"):
        with np.load(folder / "data" / f"{dataset}_{file}.npz", allow_pickle=False) as data:
            dt = float(np.ravel(data["sample_period_s"])[0])
            for i, mask in enumerate(np.asarray(data["valid_mask"], bool)):
                state, sticks = (np.asarray(data[key][i][mask], float) for key in ("direct_state_meas", "control_meas"))
                pieces.append(_from_quaternions(state) | dict(zip(STICKS, sticks.T, strict=True)))
                tracked = np.asarray(data["mocap_tracked"][i][mask]) != 0 if "mocap_tracked" in data else np.ones(len(state), bool)
                valid.append(tracked & np.isfinite(state).all(axis=1))
                parts.append("test" if file == "validation" else "validation" if i % CHOSEN == CHOSEN - 1 else "train")
                lengths.append(len(state))
    starts = np.cumsum([0, *(n + BETWEEN for n in lengths[:-1])])
    ranges = {p: tuple((int(a), int(a) + n) for a, n, of in zip(starts, lengths, parts, strict=True) if of == p) for p in ROLES.values()}
    onsets = [onset(np.column_stack([p[s] for s in STICKS])) for p in pieces]
    log = joined(dataset, dt, pieces, valid)
    usable = {i: lengths[i] - onsets[i] for i in range(len(pieces)) if parts[i] == "test"}
    long = [n for n in usable.values() if n >= round(SHORTEST / dt)]
    if not long:
        where = str(folder / "data" / f"{dataset}_validation.npz")
        raise BadInput(f"no segment moves a stick {SHORTEST} s before its end", where, "Use the file as it is published.")
    window = int(np.clip(min(long), round(SHORTEST / dt), round(LONGEST / dt)))
    first = [starts[i] + onsets[i] + k * window for i, n in usable.items() if n >= round(SHORTEST / dt) for k in range(n // window)]
    first = np.array([f for f in first if log.valid[f : f + window].all()], int)
    split = Split(**ranges, counts=tuple(len(ranges[p]) for p in ("train", "validation", "test")), of="segments")
    ahead = f"{(window - 1) * dt:g}"
    rows = _rows(folder / "results" / "aircraft6dof_method_comparison.csv", dataset)
    published = {row["method"]: {ahead: float(row["validation_score"])} for row in rows if row["state_source"] == "mocap"}
    return Table(f"CogniPilot/mocap_sysid {dataset}", (Group(dataset, log, split, {ahead: first}, 0),), "of ranges", published)


def joined(name: str, dt: float, pieces: Sequence[dict[str, np.ndarray]], valid: Iterable[np.ndarray]) -> FlightLog:
    """One log of several records, each a dict of the 12 states and the sticks; what is not finite is filled and not valid."""
    tables = []
    for piece in pieces:
        table = np.column_stack([piece[n] for n in (*STATES, *THROWS)])
        tables.append(np.vstack([_filled(table), np.repeat(_filled(table)[-1:], BETWEEN, axis=0)]))
    good = np.concatenate([np.concatenate([v, np.zeros(BETWEEN, bool)]) for v in valid])
    z = dict(zip((*STATES, *THROWS), np.concatenate(tables).T, strict=True))
    velocity = rotate(rotation_body_to_ned(z["phi"], z["theta"], z["psi"]), (z["u"], z["v"], z["w"]))
    measured = {n: z[n].copy() for n in STATES if n not in ("u", "v", "w")} | dict(zip(("v_n", "v_e", "v_d"), velocity, strict=True))
    inputs = {n: z[n] * throw for n, throw in THROWS.items()} | {"throttle": np.clip(z["throttle"], 0.0, 1.0)}
    time, still = np.arange(len(good)) * dt, np.zeros((2, 1))
    return FlightLog(name, 0.0, dt, time, measured, inputs, good, WindRecord(time[[0, -1]], np.array([10.0]), still, still, still))


def onset(sticks: np.ndarray) -> int:
    """The first sample at which a stick has moved; 0 where none does. sticks: (N, 4)."""
    rest = np.median(sticks[:ONSET_SAMPLES], axis=0)
    moved = np.abs(sticks - rest) > np.maximum(ONSET_SHARE * np.ptp(sticks, axis=0), ONSET_LEAST)
    found = np.flatnonzero(moved.any(axis=1))
    return int(found[0]) if found.size else 0


def _from_quaternions(state: np.ndarray) -> dict[str, np.ndarray]:
    """The 12 states of [x_n, y_e, z_d, u, v, w, q_w, q_x, q_y, q_z, p, q, r]."""
    q = state[:, 6:10] / np.linalg.norm(state[:, 6:10], axis=1, keepdims=True)
    a, b, c, d = q.T
    phi, theta = np.arctan2(2 * (a * b + c * d), 1 - 2 * (b * b + c * c)), np.arcsin(np.clip(2 * (a * c - d * b), -1, 1))
    psi = np.arctan2(2 * (a * d + b * c), 1 - 2 * (c * c + d * d))
    return dict(zip(STATES, (*state[:, :6].T, phi, theta, psi, *state[:, 10:13].T), strict=True))


def _filled(table: np.ndarray) -> np.ndarray:
    """The nearest finite row before a row that is not finite, the first finite one at the beginning."""
    good = np.isfinite(table).all(axis=1)
    if not good.any():
        raise BadInput("a flight has no sample that is whole")
    last = np.maximum.accumulate(np.where(good, np.arange(len(table)), -1))
    return table[np.where(last < 0, int(np.argmax(good)), last)]


def _json(file: Path) -> dict:
    if not file.is_file():
        raise BadInput(f"'{file.name}' is missing", str(file.parent), "Download the folder as it is published.")
    return json.loads(file.read_text())


def _rows(file: Path, dataset: str) -> list[dict]:
    """Published scores on a dataset; none where the file was not downloaded."""
    if not file.is_file():
        return []
    with file.open(newline="") as rows:
        return [row for row in csv.DictReader(rows) if row["validation_scenario"] == dataset]
