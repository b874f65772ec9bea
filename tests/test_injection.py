"""Truth put into a log: the library's own effect takes it out again, its size is what was asked, copies stay what they were."""

import numpy as np
import pytest
from free_flight import THOR, free_flight
from injected_size import change, residual, sized, starts_in
from injection import FREE, TETHERED, Kind, lagging_surface, shifted, with_signals
from kites import DEVELOPMENT
from untouched_copies import COPIES

from awescli.flightlog.log import FlightLog
from awescli.notation.errors import NumericalFailure
from awescli.physics.declaration import KiteDeclaration
from awescli.physics.effects import EFFECTS

BARE: KiteDeclaration = THOR.model_copy(update={"effects": ("gravity", "aerodynamics", "thrust")})
"""Vanes without a bias of their own. The airspeed is lagged on the development kite, for the library lags that at the centre of mass, and
Thor's probe is on the wing."""
ON_DEVELOPMENT = ("airspeed_lag", "load_cell_scale", "clock_offset:winch", "winch_length")


def case(key: str, calm) -> tuple[FlightLog, KiteDeclaration]:
    """A flight without noise on which a kind shows, and the kite that flew it."""
    return (calm.log, DEVELOPMENT) if key in ON_DEVELOPMENT else (free_flight(seconds=40.0, noise=False), BARE)


def left(kind: Kind, key: str, log, kite, value: float, with_effect: bool) -> dict[str, float]:
    """What an injection changes of the residual, channel by channel, without or with the library's effect in the model."""
    injected, declared = kind.inject(log, kite, value)
    first = quiet(log, injected)
    before = residual(log, kite, first)
    values = {f"{key}.{n}": v for n, v in {kind.parameter: value, **kind.shape(log)}.items()} if with_effect else {}
    after = residual(injected, declared, first, before.observed.segments.starts, (key,) if with_effect else (), values)
    return change(before, after)


def quiet(log: FlightLog, injected: FlightLog) -> np.ndarray:
    """Six samples before which what was put into the commands was least for 0.3 s: where a lagging surface is there, is no question."""
    late = np.arange(100, len(log) - 200, 10)
    put_in = np.sum([np.abs(injected.inputs[n] - s) for n, s in log.inputs.items()], axis=0)
    return np.sort(late[np.argsort([put_in[k - 15 : k + 1].max() for k in late], kind="stable")[:6]])


@pytest.mark.parametrize("key", TETHERED)
def test_the_librarys_effect_undoes_what_is_put_in(key, calm):
    """Guards every kind, its sign and its parameter, against the effect that is to be found: what the injection changes of 3 s
    predictions, the effect at the same value takes back, but for a small part: commands are held between samples, channels interpolated,
    the library's delay is a Pade form, which steps show. (Half the size would leave 0.5, the other sign 2.)"""
    kind, (log, kite) = TETHERED[key], case(key, calm)
    value = kind.at(1.0)
    changed, undone = (max(left(kind, key, log, kite, value, with_effect).values()) for with_effect in (False, True))
    assert changed > 0.05 and undone < 0.25 * changed, (changed, undone)


def test_every_kind_is_an_effect_with_that_parameter_and_there_are_enough():
    for key, kind in TETHERED.items():
        (row,) = [p for p in EFFECTS[key.partition(":")[0]].parameters if p.name == kind.parameter]
        assert row.lower <= kind.least < kind.most <= row.upper and row.value == kind.null, key
    assert len(FREE) >= 12 and set(FREE) < set(TETHERED)


def test_an_injected_lag_gives_the_original_back():
    """Guards the inverse by the lag's own solution between two held commands, sample after sample."""
    log = free_flight(seconds=40.0, noise=False)
    tau, (injected, _) = 0.12, lagging_surface("aileron", log, BARE, 0.12)
    a, delta = np.exp(-log.dt / tau), [log["aileron"][0]]
    for u in injected["aileron"][:-1]:
        delta.append(a * delta[-1] + (1 - a) * u)
    assert np.array(delta)[1:] == pytest.approx((log["aileron"][1:] + log["aileron"][:-1]) / 2, abs=1e-12)
    assert np.abs(injected["aileron"] - log["aileron"]).max() > 0.01


def test_a_delay_is_a_delay_and_angles_go_round():
    t = np.arange(0, 20, 0.02)
    psi = np.angle(np.exp(1j * (0.9 * t)))
    late = shifted(psi, 0.02, 0.13, angle=True)
    assert np.abs(np.angle(np.exp(1j * (late - 0.9 * (t - 0.13)))))[10:].max() < 1e-9 and np.abs(late).max() <= np.pi
    log = free_flight(seconds=40.0, noise=False)
    tried, _ = FREE["actuator_delay:elevator"].inject(log, BARE, 0.1)
    assert tried["elevator"][:-5] == pytest.approx(log["elevator"][5:]) and np.array_equal(tried["aileron"], log["aileron"])


@pytest.mark.parametrize("key", ["actuator_delay:aileron", "airspeed_scale", "mass_offset", "surface_effectiveness:aileron"])
def test_sizes_change_predictions_by_what_is_asked(key):
    """Guards the rule of sizes: 3 s predictions change by 4, 2 and 1 times their floor, a larger one by a larger effect."""
    log, kind = free_flight(seconds=40.0), FREE[key]
    found = {floors: sized(kind, log, BARE, [(100, 1900)], floors) for floors in (4.0, 2.0, 1.0)}
    for floors, (value, reached) in found.items():
        assert reached == pytest.approx(floors, rel=0.05) or value in (kind.least, kind.most), (floors, value, reached)
        assert max(left_of(kind, log, value).values()) == pytest.approx(reached)
    far = [abs(value - kind.null) for value, _ in found.values()]
    assert far[0] > far[1] > far[2] > 0


def left_of(kind: Kind, log: FlightLog, value: float) -> dict[str, float]:
    first = starts_in(log, [(100, 1900)])
    before = residual(log, BARE, first)
    return change(before, residual(*kind.inject(log, BARE, value), first, before.observed.segments.starts))


def test_an_effect_on_what_does_not_move_is_a_named_outcome():
    log = free_flight(seconds=40.0, noise=False)
    still = with_signals(log, {"aileron": np.zeros(len(log))})
    with pytest.raises(NumericalFailure, match="changes no prediction"):
        sized(FREE["actuator_delay:aileron"], still, BARE, [(100, 1900)], 1.0)


@pytest.mark.parametrize("name", COPIES)
def test_copies_hold_nothing_that_was_not_flown(name):
    """Guards copies: every sample of a cut or a slower logger is one of the flight, on a uniform clock; noise is white and of its size."""
    log = free_flight(seconds=40.0)
    copy = COPIES[name](log, BARE)
    assert np.diff(copy.time) == pytest.approx(copy.dt) and copy.valid.all() and len(copy) <= len(log)
    rows = np.searchsorted(log.time, copy.time - 1e-9)
    for channel in ("p", "V_a", "psi", "aileron"):
        if "noise" not in name or channel == "aileron":
            assert np.array_equal(copy[channel], log[channel][rows]), channel
    if "noise" in name:
        added = (copy["V_a"] - log["V_a"]) / BARE.noise.airspeed
        assert added.std() == pytest.approx(0.5 if "half" in name else 1.0, rel=0.1) and abs(np.corrcoef(added[1:], added[:-1])[0, 1]) < 0.1
