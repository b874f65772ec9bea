"""Wind over height, and the flow that the kite meets."""

import numpy as np
import pytest
from kites import DEVELOPMENT, at_point, declared
from oracles import log_law, power_law

from awescli.notation.frames import rotation_body_to_ned
from awescli.physics.airflow import AIRSPEED_FLOOR, air_data, declared_wind, interpolate, wind_vector
from awescli.physics.declaration import WindLaw
from awescli.physics.instant import Wind
from awescli.physics.kite import Kite

HEIGHTS = (10.0, 50.0, 100.0, 200.0)
INPUTS = {
    **{f"wind_speed_{i}": v for i, v in enumerate((5.0, 7.0, 8.0, 8.5))},
    **{f"wind_direction_{i}": v for i, v in enumerate((3.0, 3.1, 3.3, 3.2))},
    **{f"wind_down_{i}": v for i, v in enumerate((0.0, 0.1, -0.2, 0.3))},
}


def test_a_table_is_met_at_its_knots_and_is_linear_between():
    """Guards the hinges: exact at the stations, linear between them, constant outside."""
    law = WindLaw(law="table")
    for i, h in enumerate(HEIGHTS):
        expected = tuple(INPUTS[f"wind_{kind}_{i}"] for kind in ("speed", "direction", "down"))
        assert declared_wind(law, HEIGHTS, h, INPUTS) == pytest.approx(expected, rel=1e-15, abs=1e-16)
    for h in np.linspace(-20, 400, 60):
        expected = tuple(np.interp(h, HEIGHTS, [INPUTS[f"wind_{k}_{i}"] for i in range(4)]) for k in ("speed", "direction", "down"))
        assert declared_wind(law, HEIGHTS, float(h), INPUTS) == pytest.approx(expected, rel=1e-14)
    assert interpolate(3.0, (1.0,), (7.0,)) == 7.0


def test_power_log_and_uniform_laws():
    """Guards reference height and exponent, and that a law takes the first station only."""
    one = {"wind_speed_0": 6.0, "wind_direction_0": 1.0, "wind_down_0": 0.2}
    for h in (20.0, 150.0, 300.0):
        power = declared_wind(WindLaw(law="power", exponent=0.14, reference_height=12.0), (12.0,), h, one)
        assert power == pytest.approx((power_law(6.0, 12.0, h, 0.14), 1.0, 0.2))
        log = declared_wind(WindLaw(law="log", roughness=0.03, reference_height=12.0), (12.0,), h, one)
        assert log == pytest.approx((log_law(6.0, 12.0, h, 0.03), 1.0, 0.2))
        assert declared_wind(WindLaw(law="uniform"), (12.0,), h, one) == (6.0, 1.0, 0.2)
    # below the floor the laws are held: no wind of minus infinity on the ground
    low = declared_wind(WindLaw(law="log", roughness=0.03), (12.0,), -5.0, one)[0]
    assert low == declared_wind(WindLaw(law="log", roughness=0.03), (12.0,), 1.0, one)[0] and np.isfinite(low)


@pytest.mark.parametrize("comes_from, north, east", [(0, -1, 0), (90, 0, -1), (180, 1, 0), (270, 0, 1)])
def test_wind_blows_from_its_direction(comes_from, north, east):
    """Guards the meteorological convention: wind from 270 deg (west) blows to the east."""
    wind = wind_vector(8.0, np.radians(comes_from), 0.5, 1.2)
    assert wind[:4] == pytest.approx((8 * north, 8 * east, 0.5, 1.2), abs=1e-14) and wind.roll == 0


def test_signs_of_the_flow_angles():
    """Guards alpha and beta: sinking gives positive alpha, wind from the right gives positive beta, a head wind adds to V_a."""
    level = rotation_body_to_ned(0.0, 0.0, 0.0)
    calm = Wind(0.0, 0.0, 0.0, 1.2)
    assert air_data(level, (30.0, 0.0, 3.0), calm)[2] == pytest.approx(np.arctan(0.1))
    from_the_right = wind_vector(5.0, np.radians(90), 0.0, 1.2)  # flying north, the right is east
    _, V_a, alpha, beta = air_data(level, (30.0, 0.0, 0.0), from_the_right)
    assert beta == pytest.approx(np.arcsin(5 / V_a)) and beta > 0 and alpha == pytest.approx(0)
    head = wind_vector(5.0, 0.0, 0.0, 1.2)
    assert air_data(level, (30.0, 0.0, 0.0), head)[1] == pytest.approx(35.0)
    assert air_data(level, (0.0, 0.0, 0.0), calm)[1] == AIRSPEED_FLOOR


def test_beta_is_the_arc_sine_in_every_attitude():
    """Guards the rewritten form of beta against the definition asin(v_r / V_a)."""
    random = np.random.default_rng(0)
    for _ in range(20):
        R = rotation_body_to_ned(*random.uniform(-3, 3, 3))
        (u, v, w), V_a, alpha, beta = air_data(R, tuple(20 * random.standard_normal(3)), Wind(*random.standard_normal(3), 1.2))
        assert V_a == pytest.approx(np.sqrt(u * u + v * v + w * w)) and beta == pytest.approx(np.arcsin(v / V_a))
        assert alpha == pytest.approx(np.arctan2(w, u))


def test_the_kite_meets_the_declared_wind_at_its_height():
    """Guards height = -p_d above the winch, and the order heights -> inputs."""
    kite = Kite(declared(wind={"law": "table"}), HEIGHTS)
    at = kite.instant(*at_point(kite, **INPUTS, p_d=-150.0))
    speed, direction = np.interp(150, HEIGHTS, [5, 7, 8, 8.5]), np.interp(150, HEIGHTS, [3.0, 3.1, 3.3, 3.2])
    assert at.wind[:3] == pytest.approx(
        (-speed * np.cos(direction), -speed * np.sin(direction), np.interp(150, HEIGHTS, [0, 0.1, -0.2, 0.3]))
    )


def test_the_nuisance_wind_adds_to_the_declared_one():
    """Guards both doors of the estimated wind error, the signal and the parameter."""
    kite = Kite(DEVELOPMENT)
    x, u, c = at_point(kite)
    by_signal = kite.instant(*at_point(kite, gust_e=0.7)).wind
    c_moved = list(c)
    c_moved[kite.parameter_names.index("gust_e.even")] = 0.7
    by_parameter, before = kite.instant(x, u, c_moved).wind, kite.instant(x, u, c).wind
    assert by_signal == by_parameter and by_signal.e == before.e + 0.7 and by_signal.n == before.n
