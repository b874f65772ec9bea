"""The measured flight of Thor: what examples/umn_thor/README.md says of it, computed. Skipped where the log is not."""

from pathlib import Path

import numpy as np
import pytest
from scipy.signal import savgol_filter

from awescli.estimation.linear_baseline import linear_baseline
from awescli.flightlog.loops import find_loops
from awescli.flightlog.quality import data_quality
from awescli.flightlog.read import read_flight
from awescli.flightlog.split import split
from awescli.flightlog.wind_triangle import wind_triangle
from awescli.learning.normalisation import instants
from awescli.physics.declaration import read_kite
from awescli.physics.effects.thrust import polynomial
from awescli.physics.kite import Kite, needed_by

ROOT = Path(__file__).parents[2]
FLIGHT = ROOT.parent / "shared" / "flights" / "umn-thor"

pytestmark = pytest.mark.skipif(not list(FLIGHT.glob("*.mat")), reason="the flight (../shared/flights/umn-thor) is not here")


@pytest.fixture(scope="module")
def log():
    return read_flight(FLIGHT)


@pytest.fixture(scope="module")
def thor():
    return read_kite(ROOT / "examples" / "umn_thor" / "kite.yaml")


def by_hand(log) -> np.ndarray:
    """Take-off, climb and landing: before and after the autopilot's 298 s."""
    hand = np.ones(len(log), bool)
    start = np.searchsorted(log.time + log.start, 234.6)
    hand[start : np.searchsorted(log.time + log.start, 533.0)] = False
    return hand


def test_the_flight_is_read_whole(log, thor):
    """Guards the reader on the real file: minutes in the air, blocks, nothing missing, every check good."""
    quality = data_quality(log, needed_by(thor))
    assert quality.ok and quality.missing == () and quality.loops == "no tether: 17 blocks of 20 s"
    assert len(log) * log.dt == pytest.approx(362, abs=3) and (~log.valid).sum() * log.dt == pytest.approx(2.0, abs=0.1)
    seen = wind_triangle(log)
    assert (seen.north, seen.east) == pytest.approx((-0.7, 6.2), abs=0.2) and seen.scale == pytest.approx(0.97, abs=0.01)
    assert any("recorder runs -7.7 s late" in note for note in log.notes)
    assert find_loops(log).kind == "blocks"


def test_a_linear_model_of_the_same_inputs_predicts_as_the_readme_says(log, thor):
    """Guards the README's row of the linear baseline, and what it reaches where the surfaces are not told it either."""
    kite, parts = Kite(thor, log.wind.height), split(find_loops(log), order="interleaved", log=log)
    found = linear_baseline(log, parts, kite, 3.0)
    reached = [found.predict(log, thor.noise, parts.test, h).nrmse()["mean"] for h in (1.0, 2.0, 3.0)]
    assert found.outcome == "fitted" and reached == pytest.approx([0.039, 0.052, 0.062], abs=0.001)
    blind = linear_baseline(log, parts, kite, 3.0, closed=True)
    reached = [blind.predict(log, thor.noise, parts.test, h).nrmse()["mean"] for h in (1.0, 2.0, 3.0)]
    assert "aileron" in blind.signals.outputs and reached == pytest.approx([0.050, 0.075, 0.085], abs=0.001)


def answers(log, where: np.ndarray, late: int):
    """(roll acceleration coefficient per aileron, pitch per elevator, share of the roll's variance explained), commands `late` samples
    earlier: equation error, biased under feedback."""
    V = np.maximum(log["V_a"], 8.0)
    q = 0.5 * 1.19 * V**2 * 0.3097
    roll, pitch = (savgol_filter(log[n], 15, 2, deriv=1, delta=log.dt) for n in "pq")
    found = []
    for y, columns in (
        (roll * 0.07151 / (q * 1.27), (np.roll(log["aileron"], late), log["p"] * 1.27 / (2 * V), log["r"] * 1.27 / (2 * V), log["beta"])),
        (pitch * 0.08636 / (q * 0.25), (np.roll(log["elevator"], late), log["q"] * 0.25 / (2 * V), log["alpha"])),
    ):
        A = np.column_stack([*(c[where] for c in columns), np.ones(where.sum())])
        x, *_ = np.linalg.lstsq(A, y[where], rcond=None)
        found.append((x[0], 1 - (y[where] - A @ x).var() / y[where].var()))
    (Cl_da, share), (Cm_de, _) = found
    return Cl_da, Cm_de, share


def test_surfaces_act_with_the_published_signs_and_by_hand_sooner(log):
    """Guards the choice between sticks and commands, and the README's hint of a delay: the sticks' best lag is none, the commands' 80 ms"""
    flying = log.valid & (log.time > 3)
    for where, best in ((flying & by_hand(log), (0, 1)), (flying & ~by_hand(log), (3, 4, 5))):
        shares = [answers(log, where, late)[2] for late in range(9)]
        assert int(np.argmax(shares)) in best
        Cl_da, Cm_de, _ = answers(log, where, best[0])
        assert Cl_da < -0.02 and Cm_de < -0.05


def test_the_logged_revolutions_are_not_the_propellers(log, thor):
    """Guards the kite file's choice of the throttle: at the logged speed the published propeller would be turned by the air, at twice that
    it takes about the declared shaft power."""
    (propeller,), good = thor.propellers, log.is_new("motor_speed") & (log["motor_speed"] > 50) & ~by_hand(log)
    n, V = log["motor_speed"][good], log["V_a"][good] / 0.97
    J = V / (n * propeller.diameter)
    assert np.median(J) > propeller.free_advance
    power = polynomial(propeller.power_polynomial, J / 2) * 1.19 * (2 * n) ** 3 * propeller.diameter**5
    declared = polynomial(propeller.speed.shaft_power, log["throttle"][good])
    assert 0.5 < np.median(power / declared) < 1.1


def test_vanes_and_lift_agree_on_the_angle_of_attack(log, thor):
    """Guards the published offset of the probe and its sign: the vane less 3.5 deg, and the lift over the published slope, say the same."""
    at, *_ = instants(log, Kite(thor, log.wind.height))
    cruise = log.valid & ~by_hand(log)
    vane = np.rad2deg(np.median((log["alpha"] - 0.0611)[cruise]))
    lift = -(log["a_z"] - 9.80665 * np.array(at.R[2][2])) * 1.959 / (0.5 * 1.19 * (log["V_a"] / 0.97) ** 2 * 0.3097)
    from_lift = np.rad2deg((np.median(lift[cruise]) - 0.1086) / 4.58)
    from_velocity = np.rad2deg(np.median(np.asarray(at.alpha)[cruise]))
    assert vane == pytest.approx(3.4, abs=0.3) and from_lift == pytest.approx(3.1, abs=0.3) and from_velocity > vane + 1.0
