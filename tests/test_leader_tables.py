"""Published tables: their scores return from their own numbers, and a flight of ours in their layouts gets a row beside theirs."""

import csv
import json
from pathlib import Path

import leader_tables
import numpy as np
import pytest
from free_flight import free_flight
from leader_layouts import COLUMNS, STICKS, THROWS, onset, read_table
from leader_scores import SCALES, SCORES, flown, mean_root, of_ranges, of_scales, root_mean

from awescli.flightlog.log import FlightLog
from awescli.notation.errors import BadInput
from awescli.notation.quantities import STATES
from awescli.physics.declaration import read_kite
from awescli.physics.kite import Kite

SPORT_CUB = Path(__file__).parents[1] / "benchmarks" / "sport_cub.yaml"
KITE = Path(__file__).parents[1] / "examples" / "umn_thor" / "kite.yaml"

REGIMES = (
    (17642, (2.294606790244638, 3.7688904853095897, 10.687576664190521, 10.59932548622019, 6.835693294585332, 0.2319463326717587,
             3.5550946302756397, 1.2038596675240663, 1.8866277255704154)),
    (162, (11.376552764718147, 8.865547226510763, 15.989286553050718, 20.737176934843728, 21.88589695993072, 0.5394277343434462,
           8.145793879454175, 2.37818588487013, 2.547013378205783)),
    (76, (12.467309342941306, 8.38780697465306, 53.30263254622923, 39.19512437616249, 30.959936847618412, 0.45598540427528717,
          10.066642142689819, 5.0196385931355945, 3.6633486339076495)),
)  # fmt: skip
"""fixedwing-ude, results.json, by_regime of ARX at 2 s: samples, and RMSE of the nine outputs [deg, deg/s, m/s]."""


def test_the_published_score_returns_from_the_published_errors():
    """Guards the definition of fixedwing-ude's score, which no text gives: root mean square over windows, samples and outputs of errors
    over scales, the start of each window counted, without error. From the errors by regime the published 0.2655145641577288 returns."""
    units = np.where([n == "V" for n in SCALES], 1.0, np.pi / 180)
    samples, errors = np.array([n for n, _ in REGIMES]), np.array([e for _, e in REGIMES]) * units
    assert samples.sum() == 149 * 120
    squares = (samples[:, None] * (errors / list(SCALES.values())) ** 2).sum(axis=0) / samples.sum()
    with_start = np.concatenate([np.zeros((1, 1, 9)), np.tile(squares, (1, 120, 1))], axis=1)
    assert root_mean([with_start]) == pytest.approx(0.2655145641577288, abs=1e-12)


def states(**values) -> dict:
    return {n: np.array([[values.get(n, 0.0)]]) for n in STATES}


def test_outputs_and_scores_of_a_single_sample():
    """Guards the outputs' meaning: a glide of 10 m/s at 5 deg of incidence with 3 deg nose up goes down by 2 deg; and both scores."""
    z = states(u=10 * np.cos(np.deg2rad(5)), w=10 * np.sin(np.deg2rad(5)), theta=np.deg2rad(3))
    out = flown(z)
    assert out["V"][0, 0] == pytest.approx(10) and np.rad2deg([out["gamma"][0, 0], out["alpha"][0, 0]]) == pytest.approx([-2, 5])
    other = {**z, "p": z["p"] + np.deg2rad(35)}
    assert root_mean([of_scales(z, other)]) == pytest.approx(np.sqrt(1 / 9)) and root_mean([of_scales(z, z)]) == 0
    turned = {**z, "psi": z["psi"] + 2 * np.pi, "p_n": z["p_n"] + 3.0}
    assert mean_root([of_ranges(z, turned)]) == pytest.approx(3.0 / 13)


def z_of(log: FlightLog) -> np.ndarray:
    return np.column_stack([log[n] for n in STATES])


def sticks_of(log: FlightLog, order) -> np.ndarray:
    return np.column_stack([log[n] / THROWS[n] for n in order])


@pytest.fixture(scope="module")
def flight():
    return free_flight(seconds=60.0, seed=3, breeze=0.0)


@pytest.fixture(scope="module")
def fixedwing(flight, tmp_path_factory):
    """The flight in fixedwing-ude's layout: 30 s to fit, 10 s to choose, 18 s to predict, a hole in the middle."""
    folder = tmp_path_factory.mktemp("fixedwing")
    (folder / "flights").mkdir()
    rows = np.column_stack([z_of(flight), sticks_of(flight, COLUMNS[12:16]), np.ones(len(flight)), np.zeros(len(flight))])
    rows[700:720, :12] = np.nan
    (folder / "flights" / "one.f32").write_bytes(rows.astype("<f4").tobytes())
    arcs = [("fit", 0, 690), ("fit", 730, 1500), ("development", 1500, 2000), ("test", 2000, 2900)]
    flights = [{"name": "one", "file": "flights/one.f32", "arcs": [{"group": "A", "role": r, "start": a, "stop": b} for r, a, b in arcs]}]
    window = {"segment": "one", "kind": "test", "group": "A"}
    windows = [{**window, "start": 2100 + 100 * k, "horizon": h} for h in ("1", "2") for k in range(6)]
    pooled = {h: {"all_output_score": {"arx": 0.3, "temporal": 0.25}} for h in ("1.0", "2.0")}
    for name, content in (
        ("flights", {"rate_hz": 50.0, "history_samples": 64, "flights": flights}),
        ("forecasts", {"windows": windows}),
        ("results", {"pooled": pooled}),
    ):
        (folder / f"{name}.json").write_text(json.dumps(content))
    return folder


def quaternions(log: FlightLog) -> np.ndarray:
    from scipy.spatial.transform import Rotation

    q = Rotation.from_euler("ZYX", np.column_stack([log["psi"], log["theta"], log["phi"]])).as_quat()
    return q[:, [3, 0, 1, 2]] * np.where(q[:, 3:] < 0, -1, 1)


@pytest.fixture(scope="module")
def mocap(flight, tmp_path_factory):
    """The flight in mocap_sysid's layout: eight segments to fit, three to predict, of unequal length."""
    folder = tmp_path_factory.mktemp("mocap")
    for name in ("data", "results"):
        (folder / name).mkdir()
    state = np.column_stack([z_of(flight)[:, :6], quaternions(flight), z_of(flight)[:, 9:]])
    sticks = sticks_of(flight, STICKS)
    edges = {"train": [(250 * k, 250 * k + 240) for k in range(8)], "validation": [(2000, 2240), (2300, 2600), (2700, 2900)]}
    for part, pieces in edges.items():
        longest = max(b - a for a, b in pieces)
        states, controls = (np.full((len(pieces), longest, width), np.nan) for width in (13, 4))
        mask = np.zeros((len(pieces), longest), bool)
        for i, (a, b) in enumerate(pieces):
            states[i, : b - a], controls[i, : b - a], mask[i, : b - a] = state[a:b], sticks[a:b], True
        arrays = {"direct_state_meas": states, "control_meas": controls, "valid_mask": mask}
        np.savez_compressed(folder / "data" / f"cub_{part}.npz", sample_period_s=flight.dt, **arrays)
    with (folder / "results" / "aircraft6dof_method_comparison.csv").open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(["method", "state_source", "validation_scenario", "validation_score"])
        writer.writerows([["OEM", "mocap", "cub", 0.158], ["OEM", "direct", "cub", 0.1], ["OEM", "mocap", "other", 0.9]])
    return folder


def test_a_flight_returns_from_fixedwing_udes_layout(flight, fixedwing):
    """Guards reader, split and windows: states and deflections come back (to float32), a hole is not valid, arcs are the parts."""
    (table,) = read_table(fixedwing)
    (group,) = table.groups
    n = len(flight)
    assert group.split.train == ((0, 690), (730, 1500)) and group.split.test == ((2000, 2900),)
    assert list(group.windows) == ["1", "2"] and group.windows["2"][0] == 2100 and group.history == 64
    assert not group.log.valid[700:720].any() and group.log.valid[:700].all() and not group.log.valid[n:].any()
    for name in (*STATES, "aileron", "throttle", "v_d"):
        assert group.log[name][720:n] == pytest.approx(flight[name][720:], abs=2e-4), name
    assert table.published == {"arx": {"1": 0.3, "2": 0.3}, "temporal": {"1": 0.25, "2": 0.25}}


def test_a_flight_returns_from_mocap_sysids_layout(flight, mocap):
    """Guards reader and windows: quaternions become Euler angles, segments parts, windows begin where a stick first moves."""
    (table,) = read_table(mocap)
    (group,) = table.groups
    assert len(group.split.train) == 7 and len(group.split.validation) == 1 and len(group.split.test) == 3
    first = group.split.test[0][0]
    for name in ("phi", "theta", "psi", "v_n", "elevator"):
        assert group.log[name][first : first + 240] == pytest.approx(flight[name][2000:2240], abs=1e-9), name
    (ahead,) = group.windows
    began = onset(sticks_of(flight, STICKS)[2000:2240])
    assert (
        group.windows[ahead][0] == first + began and 0.6 <= float(ahead) + flight.dt <= 1.2 and table.published == {"OEM": {ahead: 0.158}}
    )


def test_onset_is_the_first_move_of_a_stick():
    sticks = np.zeros((100, 4))
    sticks[40:, 2] = 0.5
    sticks[20:, 1] = 0.01
    assert onset(sticks) == 40 and onset(np.zeros((10, 4))) == 0


@pytest.mark.slow
@pytest.mark.parametrize("layout", ["fixedwing", "mocap"])
def test_our_row_stands_beside_the_published_ones(layout, request, capsys, flight):
    """Guards the whole command on a flight whose model is known: the identified kite predicts at what the sensors' noise alone scores, far
    better than what stands in the table, and the table is printed with both."""
    folder = request.getfixturevalue(layout)
    assert leader_tables.main([str(folder), "--kite", str(KITE)]) == 0
    rows = [line.split("|")[1:-1] for line in capsys.readouterr().out.splitlines() if line.startswith("|")]
    shown = {row[0].strip(): [float(cell) for cell in row[1:] if cell.strip() != "-"] for row in rows[2:]}
    truth = free_flight(seconds=60.0, seed=3, breeze=0.0, noise=False)
    noisy, clean = ({n: log[n][None, 2100:2700] for n in STATES} for log in (flight, truth))
    squares, score = SCORES["of scales" if layout == "fixedwing" else "of ranges"]
    assert list(shown)[0] == "**awes**" and max(shown["**awes**"]) < 1.3 * score([squares(noisy, clean)])
    assert shown["temporal" if layout == "fixedwing" else "OEM"] == ([0.25, 0.25] if layout == "fixedwing" else [0.158])
    if layout == "fixedwing":
        assert shown["**awes**"][0] < shown["**awes, linear**"][0] < 1.0


def test_another_folder_is_one_clear_error(tmp_path, capsys):
    with pytest.raises(BadInput, match="no published flights"):
        read_table(tmp_path)
    assert leader_tables.main([str(tmp_path), "--kite", str(KITE)]) == 2 and "Name fixedwing-ude's" in capsys.readouterr().err
    assert set(SCORES) == {"of scales", "of ranges"}


def published_accelerations(u, v, w, p, q, r, aileron, elevator, rudder) -> list[float]:
    """Of the grey box [1] of benchmarks/sport_cub.yaml, without thrust, gravity, and products of rates: body axes, written out here."""
    V = np.sqrt(u * u + v * v + w * w)
    alpha, beta, qbar, mass, S = np.arctan2(w, u), np.arcsin(v / V), 0.6125 * V * V, 0.063, 0.05553
    CL = 0.5 + 4.0 * alpha
    lift, drag, side = (qbar * S * C for C in (CL, 0.08 + 0.05 * CL**2, -0.3 * beta))
    ca, sa, cb, sb = np.cos(alpha), np.sin(alpha), np.cos(beta), np.sin(beta)
    X, Y, Z = (-drag * cb - side * sb) * ca + lift * sa, -drag * sb + side * cb, (-drag * cb - side * sb) * sa - lift * ca
    ph, qh, rh = 0.617 * p / (2 * V), 0.09 * q / (2 * V), 0.617 * r / (2 * V)
    return [
        X / mass, Y / mass, Z / mass, qbar * (-2 * beta - 50 * ph + 5 * rh + 50 * aileron + 2 * rudder),
        qbar * (-2 * alpha - 25 * qh - 0.4 * elevator), qbar * (3 * beta - ph - 8 * rh - aileron - 10 * rudder),
    ]  # fmt: skip


def test_the_sport_cubs_kite_file_accelerates_as_its_source():
    """Guards the conversion of angular accelerations per dynamic pressure to coefficients, with product of inertia, against the source's
    equations. Rates are so small that their products do not matter. Full throttle at 5 m/s pushes with the source's 2.5 m/s2."""
    declared = read_kite(SPORT_CUB)
    bare = declared.model_copy(update={"effects": ("gravity", "aerodynamics")})
    kite, powered = Kite(bare, (10.0,)), Kite(declared, (10.0,))
    inputs = [1.225 if name == "density" else 0.0 for name in kite.input_names]
    random = np.random.default_rng(0)
    for _ in range(5):
        u, v, w, p, q, r = (*(np.array([5.0, 0.3, 0.4]) + 0.3 * random.standard_normal(3)), *(1e-3 * random.standard_normal(3)))
        aileron, elevator, rudder = 0.2 * random.standard_normal(3)
        x = [0.0, 0.0, -2.0, u, v, w, 0.0, 0.0, 0.0, p, q, r, aileron, elevator, rudder, 0.0, 0.0]
        rates = kite.derivative(x, inputs, list(kite.parameters.vector()))
        own = np.array(rates[3:6] + rates[9:12]) - np.array([r * v - q * w, p * w - r * u, q * u - p * v + 9.81, 0, 0, 0])
        assert own == pytest.approx(published_accelerations(u, v, w, p, q, r, aileron, elevator, rudder), rel=1e-3, abs=2e-3)
    x = [0.0, 0.0, -2.0, 5.0, *[0.0] * 12, 1.0]
    with_power, without = (k.derivative(x, inputs, list(k.parameters.vector()))[3] for k in (powered, kite))
    assert with_power - without == pytest.approx(2.5, rel=0.05)
