"""Truth put into a measured flight: the record, or its kite file, as it would be had an effect been there. No simulator.

A real flight answered to what its surfaces did and its sensors felt. Commands logged earlier by tau are those of the same flight with
actuators that are late by tau; a channel times 0.95 is what a bad sensor would have reported. So the effect to be found is known, with
its size, in real air, with real noise and all that the declared model lacks besides. The library's own effect at the injected size undoes
each kind, which is how the table is tested (tests/test_injection.py).

| what stands between flight and log | how it is put in |
|---|---|
| actuator delay, lag | commands logged earlier; the command whose lagged answer is the logged one |
| dead band, effectiveness | the inverse applied to the logged command |
| late position, attitude; lagging airspeed | the channel delayed, filtered |
| scale and bias of sensors; scale and clock of the winch | applied |
| mass, air density | the kite file, the recorded density, changed |
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from scipy.signal import lfilter
from scipy.spatial.transform import Rotation

from awescli.flightlog.log import FlightLog
from awescli.notation.angles import wrap
from awescli.notation.quantities import ANGLES, INPUTS
from awescli.physics.declaration import KiteDeclaration

Injected = tuple[FlightLog, KiteDeclaration]
Inject = Callable[[FlightLog, KiteDeclaration, float], Injected]


@dataclass(frozen=True)
class Kind:
    """parameter: of the effect, whose value the injection is of; null: where it is nothing; typical: a value to begin from; least, most:
    values between which it may be put in; shape: further parameters of the effect that the log decides."""

    inject: Inject
    parameter: str
    null: float
    typical: float
    least: float
    most: float
    shape: Callable[[FlightLog], Mapping[str, float]] = lambda log: {}

    def at(self, strength: float) -> float:
        """The value at `strength` times the distance of the typical one from null, kept within what may be put in."""
        return float(np.clip(self.null + strength * (self.typical - self.null), self.least, self.most))

    def strength(self, value: float) -> float:
        """The strength of a value."""
        return (value - self.null) / (self.typical - self.null)


def with_signals(log: FlightLog, signals: Mapping[str, np.ndarray]) -> FlightLog:
    """The log with some channels replaced."""
    inputs = {n: s for n, s in signals.items() if n in INPUTS}
    measured = {n: s for n, s in signals.items() if n not in INPUTS}
    return replace(log, measured={**log.measured, **measured}, inputs={**log.inputs, **inputs})


def shifted(signal: np.ndarray, dt: float, by: float, angle: bool = False) -> np.ndarray:
    """The signal as it was `by` seconds before (after, where negative), linear between samples, held at the ends."""
    time = np.arange(len(signal)) * dt
    found = np.interp(time - by, time, np.unwrap(signal) if angle else signal)
    return wrap(found) if angle else found


def answering(signal: np.ndarray) -> np.ndarray:
    """What a surface that is commanded in steps does on average around each sample: half the step before and half the one behind it."""
    return np.concatenate([signal[:1], (signal[1:] + signal[:-1]) / 2])


def moved(channels: tuple[str, ...], log: FlightLog, by: float) -> FlightLog:
    """The log with channels as they were `by` seconds before; what would be of before or after the record is not to be used: held, it would
    be an error of its own, of a winch's length as large as what the winch reels out meanwhile."""
    ago = np.arange(len(log)) * log.dt - by
    known = (ago >= 0) & (ago <= (len(log) - 1) * log.dt)
    return replace(with_signals(log, {n: shifted(log[n], log.dt, by, n in ANGLES) for n in channels}), valid=log.valid & known)


def delayed_surface(surface: str, log, kite, tau) -> Injected:
    return moved((surface,), log, -tau), kite


def lagging_surface(surface: str, log, kite, tau) -> Injected:
    """The held command u_k with which tau d(delta)/dt + delta = u goes from one value of what the surface did to the next, exactly:
    delta_(k+1) = a delta_k + (1 - a) u_k, a = exp(-dt / tau)."""
    a = np.exp(-log.dt / tau)
    did = answering(log[surface])
    return with_signals(log, {surface: np.concatenate([(did[1:] - a * did[:-1]) / (1 - a), did[-1:]])}), kite


def dead_surface(surface: str, log, kite, d) -> Injected:
    delta = log[surface]
    return with_signals(log, {surface: delta + d * np.sign(delta)}), kite


def onset_of(surface: str, log: FlightLog) -> dict[str, float]:
    """The deflection that a surface exceeds two fifths of the time: beyond it a loss of effectiveness shows."""
    return {"threshold": float(np.clip(np.quantile(np.abs(log[surface][log.valid]), 0.6), 0.02, 0.5))}


def weak_surface(surface: str, log, kite, s) -> Injected:
    delta, threshold = log[surface], onset_of(surface, log)["threshold"]
    beyond = np.maximum(np.abs(delta) - threshold, 0.0)
    return with_signals(log, {surface: delta + np.sign(delta) * beyond * (1 / s - 1)}), kite


def delayed(channels: tuple[str, ...], log, kite, tau) -> Injected:
    return moved(channels, log, tau), kite


def filtered(channel: str, log, kite, tau) -> Injected:
    """tau dy/dt = x - y, exactly for an x that is constant between the middles of samples."""
    a = np.exp(-log.dt / tau)
    x = answering(log[channel])
    return with_signals(log, {channel: lfilter([1 - a], [1, -a], x, zi=[a * x[0]])[0]}), kite


def scaled(channel: str, log, kite, s) -> Injected:
    return with_signals(log, {channel: s * log[channel]}), kite


def biased(channel: str, log, kite, b) -> Injected:
    return with_signals(log, {channel: wrap(log[channel] + b) if channel in ANGLES else log[channel] + b}), kite


def with_iron(log, kite, b) -> Injected:
    """A heading with an error of a period of one turn, of b at most, as iron beside a compass makes."""
    return with_signals(log, {"psi": wrap(log["psi"] + b * np.sin(log["psi"]))}), kite


def turned(channels: tuple[str, str, str], axis: str, log, kite, by) -> Injected:
    """What a box of three sensors shows that is turned about an axis of the body."""
    box = Rotation.from_rotvec(by * np.eye(3)["xyz".index(axis)])
    shown = box.inv().apply(np.stack([log[n] for n in channels], axis=1))
    return with_signals(log, dict(zip(channels, shown.T, strict=True))), kite


def winch_scaled(log, kite, s) -> Injected:
    """What a counter shows whose reading must be taken (1 + s) times."""
    return with_signals(log, {n: log[n] / (1 + s) for n in ("tether_length", "reel_out_speed")}), kite


def lighter_declared(log, kite, dm) -> Injected:
    table = kite.table()
    return log, kite.with_parameters(table.with_values({"m": table["m"].value - dm}))


def thinner_recorded(log, kite, c) -> Injected:
    """A record of the density that must be taken c times."""
    density = np.full(len(log.wind.time), 1.225) if log.wind.density is None else log.wind.density
    return replace(log, wind=replace(log.wind, density=density / c)), kite


def _of_surfaces(*surfaces: str) -> dict[str, Kind]:
    kinds: dict[str, Kind] = {}
    for s in surfaces:
        kinds[f"actuator_delay:{s}"] = Kind(partial(delayed_surface, s), "tau", 0.0, 0.1, 0.002, 0.5)
        # a lag shorter than a sample is no exact inverse of held commands any more
        kinds[f"actuator_lag:{s}"] = Kind(partial(lagging_surface, s), "tau", 0.0, 0.1, 0.02, 0.5)
        kinds[f"surface_dead_band:{s}"] = Kind(partial(dead_surface, s), "d", 0.0, 0.02, 0.0002, 0.1)
        kinds[f"surface_effectiveness:{s}"] = Kind(partial(weak_surface, s), "s", 1.0, 0.6, 0.2, 0.98, partial(onset_of, s))
    return kinds


FREE: dict[str, Kind] = {
    **_of_surfaces("aileron", "elevator"),
    "position_latency": Kind(partial(delayed, ("p_n", "p_e", "p_d")), "tau", 0.0, 0.1, 0.005, 0.5),
    "attitude_latency": Kind(partial(delayed, ("phi", "theta", "psi")), "tau", 0.0, 0.05, 0.002, 0.3),
    "airspeed_scale": Kind(partial(scaled, "V_a"), "s", 1.0, 0.95, 0.7, 1.3),
    "airspeed_lag": Kind(partial(filtered, "V_a"), "tau", 0.0, 0.3, 0.02, 1.5),
    "heading_bias": Kind(partial(biased, "psi"), "b", 0.0, 0.04, -0.3, 0.3),
    "compass_deviation": Kind(with_iron, "b", 0.0, 0.04, -0.4, 0.4),
    "attitude_bias:phi": Kind(partial(biased, "phi"), "b", 0.0, 0.04, -0.3, 0.3),
    "attitude_bias:theta": Kind(partial(biased, "theta"), "b", 0.0, 0.04, -0.3, 0.3),
    "imu_bias:rates": Kind(partial(biased, "q"), "by", 0.0, 0.02, -1.0, 1.0),
    "mass_offset": Kind(lighter_declared, "dm", 0.0, 0.1, -10.0, 10.0),
    "air_density": Kind(thinner_recorded, "c", 1.0, 1.05, 0.8, 1.2),
}  # fmt: skip
"""Effect of the library -> how it is put into the log of a flight without a line."""

FLOWN_BY_RUDDER: dict[str, Kind] = {
    **_of_surfaces("rudder"), "imu_bias:accelerations": Kind(partial(biased, "a_z"), "bz", 0.0, 0.5, -3.0, 3.0),
}  # fmt: skip
"""The same of a kite whose rudder alone steers, and that logs accelerations."""

TETHERED: dict[str, Kind] = {
    **FREE,
    "vane_bias:alpha": Kind(partial(biased, "alpha"), "b", 0.0, 0.02, -0.2, 0.2),
    "load_cell_scale": Kind(partial(scaled, "tension"), "s", 1.0, 0.9, 0.5, 1.5),
    "clock_offset:winch": Kind(partial(delayed, ("tether_length", "reel_out_speed")), "tau", 0.0, 0.2, -10.0, 10.0),
    "winch_length": Kind(winch_scaled, "s", 0.0, 0.005, -0.05, 0.05),
}  # fmt: skip
"""The same with a line, and with vanes that the kite file takes as they are."""
