"""No gate closes before a good log: measured and development flights, thinned, cut, drifting, in gusts. Skipped where they are not."""

import importlib.util
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import yaml
from scipy.signal import lfilter

from awescli.flightlog.read import read_flight
from awescli.notation.angles import wrap
from awescli.stages.base import Inputs, Split
from awescli.stages.data_checks import quality_of

ROOT = Path(__file__).parents[2]
FLIGHTS = ROOT.parent / "shared" / "flights"
FOLDERS = {f"d{i:02d}": FLIGHTS / "dev" / f"d{i:02d}" for i in range(1, 11)}
FOLDERS |= {"km1_demo": ROOT / "data" / "km1_demo", "ampyx_ap2": FLIGHTS / "ampyx-ap2", "umn_thor": FLIGHTS / "umn-thor"}


def kite_of(name: str, folder: Path) -> Path:
    if name.startswith("d"):
        spec = importlib.util.spec_from_file_location("declare", ROOT / "examples" / "dev_kite" / "declare.py")
        declare = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(declare)
        file = folder / "kite.yaml"
        file.write_text(yaml.safe_dump(declare.kite_of(yaml.safe_load((FOLDERS[name] / "nominal.yaml").read_text()))))
        return file
    return ROOT / "data" / "kites" / "km1_initial.yaml" if name == "km1_demo" else ROOT / "examples" / name / "kite.yaml"


def thinned(every):
    cut = slice(None, None, every)

    def change(log):
        fresh, counters = {n: s[cut] for n, s in log.fresh.items()}, {}
        measured, inputs = ({n: s[cut] for n, s in table.items()} for table in (log.measured, log.inputs))
        return replace(
            log, dt=every * log.dt, time=log.time[cut], valid=log.valid[cut], causes={}, fresh=fresh, counters=counters,
            measured=measured, inputs=inputs,
        )  # fmt: skip

    return change


def forty_seconds(log):
    first = int(0.2 * len(log))
    return log.between(first, min(first + int(40 / log.dt), len(log)))


def drifting(log):
    """The attitude wanders by a degree."""
    off = {n: np.deg2rad(1.0) * np.sin(2 * np.pi * log.time / s + s) for n, s in (("phi", 70.0), ("theta", 60.0), ("psi", 45.0))}
    return replace(log, measured={**log.measured, **{n: wrap(log[n] + x) for n, x in off.items()}})


def gusty(log):
    """The pitot meets gusts of 0.9 m/s and 4 s."""
    keep = np.exp(-log.dt / 4.0)
    gust = lfilter([0.9 * np.sqrt(1 - keep**2)], [1, -keep], np.random.default_rng(0).standard_normal(len(log)))
    return replace(log, measured={**log.measured, "V_a": log["V_a"] + gust}) if "V_a" in log else log


CHANGES = {
    "as it is": lambda log: log, "25 Hz": thinned(2), "10 Hz": thinned(5), "40 s": forty_seconds, "drift": drifting, "gusts": gusty,
}  # fmt: skip


@pytest.mark.parametrize("name", FOLDERS)
def test_a_good_log_is_never_stopped(name, tmp_path):
    """Guards false alarms, undeclared effects included: a check may warn of them, and no more."""
    if not FOLDERS[name].is_dir():
        pytest.skip(f"{FOLDERS[name]} is not here")
    log, kite = read_flight(FOLDERS[name]), kite_of(name, tmp_path)
    for said, change in CHANGES.items():
        quality = quality_of(Inputs(FOLDERS[name], kite, Split()), changed := change(log), tmp_path)
        assert not quality.stopping, (said, [(c.name, c.value, c.sentence) for c in quality.stopping])
        assert len(changed) and "nose against airflow" in {c.name for c in quality.checks}
