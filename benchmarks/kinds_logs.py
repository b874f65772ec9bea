"""Plausible but wrong logs: python benchmarks/kinds_logs.py FLIGHT [FLIGHT ...] [--kite KITE.yaml] [--write]

A change of meaning in a good log: units, signs, frames, clocks, repeated blocks, gaps. Each is read and checked as `awes check` does,
nothing is fitted. Noticed: refused by a reader, stopped or warned of by a check that the good log passes, or told in a note; named: what is
said holds the words of what was done. With --write the table goes to results/kinds_logs.md.

FLIGHT: folders in Kitemill's format; with a nominal.yaml in them that is the kite, declared by examples/dev_kite/declare.py.
"""

import argparse
import re
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import polars as pl

import awescli  # noqa: F401  (thread settings before numpy's work)

HERE = Path(__file__).parent
ROOT = HERE.parent
DEMO = ROOT / "data" / "km1_demo"
Change = Callable[["Log", np.random.Generator], None]


@dataclass
class Log:
    """The two tables of a flight, to be changed in place."""

    kite: pl.DataFrame
    wind: pl.DataFrame

    def scaled(self, factor: float, *columns: str, table: str = "kite") -> None:
        self.set(**{c: factor * getattr(self, table)[c].to_numpy().astype(float) for c in columns}, table=table)

    def set(self, table: str = "kite", **columns) -> None:
        setattr(self, table, getattr(self, table).with_columns(**{n: pl.Series(v) for n, v in columns.items()}))

    def swapped(self, *pairs: tuple[str, str]) -> None:
        self.set(**{a: self.kite[b] for a, b in pairs}, **{b: self.kite[a] for a, b in pairs})

    def rows(self, keep) -> None:
        """Some rows, by index or mask."""
        self.kite = self.kite[np.arange(len(self.kite))[keep]]

    def stamps(self, change) -> None:
        t = self.kite["epoch_ms"].to_numpy().astype(float)
        self.set(epoch_ms=np.rint(t[0] + change(t - t[0])).astype(np.int64))


N, E, D = ((f"r_eb_e{a}", f"v_eb_e{a}") for a in "NED")


def _scale(factor: float, *columns: str, table: str = "kite") -> Change:
    return lambda log, rng: log.scaled(factor, *columns, table=table)


def _set(value: float, column: str, table: str = "kite") -> Change:
    return lambda log, rng: log.set(**{column: np.full(len(getattr(log, table)), value)}, table=table)


def _swap(*pairs: tuple[str, str]) -> Change:
    return lambda log, rng: log.swapped(*pairs)


def _clock(change) -> Change:
    return lambda log, rng: log.stamps(change)


def _wind_later(seconds: float) -> Change:
    return lambda log, rng: log.set(_time=log.wind["_time"].to_numpy() + int(1e9 * seconds), table="wind")


def _direction(change) -> Change:
    return lambda log, rng: log.set(direction=np.mod(change(log.wind["direction"].to_numpy()), 360.0), table="wind")


def _kept(choose) -> Change:
    return lambda log, rng: log.rows(choose(len(log.kite), rng))


def _heading(change) -> Change:
    return lambda log, rng: log.set(psi=np.mod(change(log.kite["psi"].to_numpy()), 360.0))


def _exchanged(log: Log, rng: np.random.Generator) -> None:
    """North and east exchanged everywhere: position, velocity, and the heading counted from east, counter-clockwise."""
    log.swapped((N[0], E[0]), (N[1], E[1]))
    log.set(psi=np.mod(90.0 - log.kite["psi"].to_numpy(), 360.0))


def _pasted(log: Log, rng: np.random.Generator) -> None:
    """The whole log once more behind itself, its clock going on."""
    t = log.kite["epoch_ms"].to_numpy()
    again = log.kite.with_columns(epoch_ms=pl.Series(t + (t[-1] - t[0]) + 20))
    log.kite = pl.concat([log.kite, again])


def _pasted_same_clock(log: Log, rng: np.random.Generator) -> None:
    log.kite = pl.concat([log.kite, log.kite])


def _block_twice(log: Log, rng: np.random.Generator) -> None:
    """20 s in the place of 20 others."""
    first, from_, n = len(log.kite) // 2, int(rng.integers(0, len(log.kite) // 4)), 1000
    t = log.kite["epoch_ms"]
    block = log.kite[from_ : from_ + n].with_columns(epoch_ms=t[first : first + n])
    log.kite = pl.concat([log.kite[:first], block, log.kite[first + n :]])


def _with_gravity(log: Log, rng: np.random.Generator) -> None:
    """Specific force in the place of acceleration."""
    phi, theta = (np.deg2rad(log.kite[n].to_numpy()) for n in ("phi", "theta"))
    g = 9.80665 * np.array([-np.sin(theta), np.sin(phi) * np.cos(theta), np.cos(phi) * np.cos(theta)])
    log.set(**{c: log.kite[c].to_numpy() - g[i] for i, c in enumerate(("a_eb_bX", "a_eb_bY", "a_eb_bZ"))})


def _late(seconds: float, *columns: str) -> Change:
    def change(log: Log, rng: np.random.Generator) -> None:
        n = int(round(seconds / 0.02))
        log.set(**{c: np.concatenate([np.repeat(log.kite[c].to_numpy()[:1], n), log.kite[c].to_numpy()[:-n]]) for c in columns})

    return change


LOAD, RUDDER, RAD = "LoadFiltered", "rudder_sp", np.pi / 180
KINDS_OF: dict[str, tuple[Change, str]] = {
    "density 0": (_set(0.0, "rho", "wind"), "density"),
    "density -1": (_set(-1.0, "rho", "wind"), "density"),
    "density 0.5": (_set(0.5, "rho", "wind"), "density"),
    "density in g/m3": (_scale(1000.0, "rho", table="wind"), "density"),
    "density 1e9": (_set(1e9, "rho", "wind"), "density"),
    "weather 1.9 h late": (_wind_later(6840.0), "weather|coverage"),
    "weather 40 min late": (_wind_later(2400.0), "weather|coverage"),
    "weather 5 h early": (_wind_later(-18000.0), "weather"),
    "wind heights in km": (_scale(1e-3, "height", table="wind"), "height"),
    "wind direction in rad": (_direction(np.deg2rad), "in rad"),
    "wind direction where it blows to": (_direction(lambda d: d + 180.0), "to which it blows"),
    "wind direction counter-clockwise": (_direction(lambda d: -d), "counter-clockwise"),
    "wind speed in km/h": (_scale(3.6, "speed", table="wind"), "km/h"),
    "wind speed in kt": (_scale(1.944, "speed", table="wind"), "kt"),
    "height in km": (_scale(1e-3, D[0]), "r_eb_eD|position"),
    "height in ft": (_scale(3.2808, D[0]), "r_eb_eD|position"),
    "height counted upwards": (_scale(-1.0, D[0]), "below its winch|up"),
    "position in ft": (_scale(3.2808, N[0], E[0], D[0]), "ft"),
    "velocity in kt": (_scale(1.944, N[1], E[1], D[1]), "kt"),
    "velocity counted upwards": (_scale(-1.0, D[1]), "up|velocity"),
    "north and east exchanged in position": (_swap((N[0], E[0])), "north|position against velocity"),
    "north and east exchanged in velocity": (_swap((N[1], E[1])), "east, north|north and east"),
    "north and east exchanged in both": (_swap((N[0], E[0]), (N[1], E[1])), "north and east"),
    "north and east exchanged, heading too": (_exchanged, "north and east|counted from east|heading|axes of the rates"),
    "load in lbf": (_scale(2.2046, LOAD), "lbf"),
    "load in N": (_scale(9.80665, LOAD), "It looks like N|N taken for kgf"),
    "load in daN": (_scale(0.980665, LOAD), "daN"),
    "load in kN": (_scale(9.80665e-3, LOAD), "kN"),
    "load negative": (_scale(-1.0, LOAD), "pushes|negative"),
    "rudder of the other sign": (_scale(-1.0, RUDDER), "rudder of the other sign"),
    "rudder x 4": (_scale(4.0, RUDDER), "rudder"),
    "rudder in rad": (_scale(RAD, RUDDER), "rad|excitation"),
    "rudder times 57": (_scale(1 / RAD, RUDDER), "rudder"),
    "rudder constant": (_set(3.0, RUDDER), "no excitation|surface"),
    "5 rows": (_kept(lambda n, rng: np.arange(5)), "split|samples"),
    "200 rows": (_kept(lambda n, rng: np.arange(200)), "split|loops"),
    "half of the rows lost": (_kept(lambda n, rng: rng.random(n) < 0.5), "missing|interpolated"),
    "a third lost in the middle": (_kept(lambda n, rng: abs(np.arange(n) / n - 0.5) > 1 / 6), "gap|invalid"),
    "every other row": (_kept(lambda n, rng: np.arange(n) % 2 == 0), ""),
    "pasted twice": (_pasted, "twice|repeated blocks"),
    "pasted twice with one clock": (_pasted_same_clock, "backward"),
    "20 s pasted over 20 others": (_block_twice, "twice|repeated blocks"),
    "clock 1 % long": (_clock(lambda t: 1.01 * t), "clock"),
    "clock 3 % short": (_clock(lambda t: 0.97 * t), "clock"),
    "clock twice as long": (_clock(lambda t: 2.0 * t), "clock|40 ms|position"),
    "p and q exchanged": (_swap(("p", "q")), "q, p, r"),
    "q and r exchanged": (_swap(("q", "r")), "p, r, q"),
    "p of the other sign": (_scale(-1.0, "p"), "-p, q, r"),
    "r of the other sign": (_scale(-1.0, "r"), "p, q, -r"),
    "rates in rad/s": (_scale(RAD, "p", "q", "r"), "rad/s"),
    "pitch of the other sign": (_scale(-1.0, "theta"), "pitch angle"),
    "roll of the other sign": (_scale(-1.0, "phi"), "roll angle"),
    "heading counter-clockwise": (_heading(lambda psi: -psi), "counter-clockwise|heading"),
    "heading 90 deg off": (_heading(lambda psi: psi + 90.0), "90 deg"),
    "heading of the tail": (_heading(lambda psi: psi + 180.0), "tail"),
    "angles in rad": (_scale(RAD, "phi", "theta", "psi"), "rad"),
    "airspeed in kt": (_scale(1.944, "V_a"), "kt"),
    "airspeed in km/h": (_scale(3.6, "V_a"), "km/h"),
    "airspeed constant": (_set(30.0, "V_a"), "V_a"),
    "acceleration with gravity": (_with_gravity, "gravity"),
    "acceleration in g": (_scale(1 / 9.80665, "a_eb_bX", "a_eb_bY", "a_eb_bZ"), "acceleration"),
    "acceleration, y and z exchanged": (_swap(("a_eb_bY", "a_eb_bZ")), "acceleration"),
    "tether length in ft": (_scale(3.2808, "tether_length"), "ft"),
    "reel-out speed of the other sign": (_scale(-1.0, "reel_out_speed"), "reel-out speed"),
    "winch 5 s late": (_late(5.0, "tether_length", "reel_out_speed"), "winch|tether length"),
    "position 0.5 s late": (_late(0.5, N[0], E[0], D[0]), "position lag"),
}  # fmt: skip
"""Kind -> (change, words of which one must be said for it to be named: a regular expression)."""
KINDS = dict.fromkeys(KINDS_OF, 1)
REPAIRED = {"every other row"}
"""Kinds that are not wrong at all but thinner: right is that nothing is said."""


@dataclass(frozen=True)
class Told:
    """What became of a case: refused, stopped, warned, noted, silent; named; the words."""

    how: str
    named: bool
    words: str

    @property
    def noticed(self) -> bool:
        return self.how != "silent"


def kite_of(flight: Path, folder: Path, kite: Path | None) -> Path:
    if kite is not None:
        return kite
    if (flight / "nominal.yaml").is_file():
        file = folder / f"{flight.name}.yaml"
        subprocess.run([sys.executable, ROOT / "examples/dev_kite/declare.py", flight / "nominal.yaml", file], check=True)
        return file
    return ROOT / "data" / "kites" / "km1_initial.yaml"


def told(folder: Path, kite: Path) -> dict[str, list[str]]:
    """How it was told -> sentences: what `awes check` says of a folder that is not good."""
    from awescli.notation.errors import BadInput
    from awescli.stages.base import Inputs, Split

    inputs = Inputs(folder, kite, Split())
    try:
        quality = inputs.quality
    except BadInput as e:
        return {"refused": [str(e)]}
    found = {"stopped": [f"{c.name}: {c.sentence}" for c in quality.stopping]}
    try:
        assert inputs.parts
    except BadInput as e:
        found["refused"] = [str(e)]
    found["warned"] = [f"{c.name}: {c.sentence}" for c in quality.checks if not c.ok and not c.stops]
    found["noted"] = list(quality.notes)
    return found


class Judge:
    """Good logs once, changed ones again and again."""

    def __init__(self, flight: Path, kite: Path, folder: Path):
        self.flight, self.kite, self.folder = flight, kite, folder / flight.name
        self.folder.mkdir(parents=True, exist_ok=True)
        self.good = {s.partition(":")[0] for sentences in self._told(Log(*self._tables())).values() for s in sentences}

    def _tables(self) -> tuple[pl.DataFrame, pl.DataFrame]:
        return pl.read_csv(self.flight / "kite.csv"), pl.read_csv(self.flight / "wind.csv")

    def _told(self, log: Log) -> dict[str, list[str]]:
        log.kite.write_csv(self.folder / "kite.csv")
        log.wind.write_csv(self.folder / "wind.csv")
        return told(self.folder, self.kite)

    def __call__(self, kind: str, rng: np.random.Generator) -> Told:
        log = Log(*self._tables())
        change, words = KINDS_OF[kind]
        change(log, rng)
        said = self._told(log)
        hows = ("refused", "stopped", "warned", "noted")
        new = {how: [s for s in said.get(how, ()) if s.partition(":")[0] not in self.good] for how in hows}
        how = next((how for how, sentences in new.items() if sentences), "silent")
        text = " / ".join(" ".join(s.split()) for sentences in new.values() for s in sentences)
        return Told(how, how != "silent" and bool(re.search(words, text)), text)


def prepare(folder: Path):
    """For fuzz_kinds.py: a judge on the bundled flight."""
    from fuzz_kinds import Judged

    judge = Judge(DEMO, kite_of(DEMO, folder, None), folder)

    def judged(kind: str, rng: np.random.Generator) -> Judged:
        t = judge(kind, rng)
        silent = "repaired" if kind in REPAIRED else "unnoticed"
        return Judged({"refused": "refused", "stopped": "refused", "silent": silent}.get(t.how, "noticed"), t.words[:120])

    return judged


def table(command: str, results: dict[str, dict[str, Told]], seconds: float) -> str:
    wrong = [k for k in KINDS_OF if k not in REPAIRED]
    cases = [results[k][f] for k in wrong for f in results[k]]
    share = [100 * sum(x) / len(cases) for x in ([t.noticed for t in cases], [t.named for t in cases])]
    hard = 100 * sum(t.how in ("refused", "stopped") for t in cases) / len(cases)
    quiet = all(not t.noticed or t.how == "noted" for k in REPAIRED for t in results[k].values())
    lines = [
        "# Plausible but wrong logs", "", f"`{command}`, {seconds:.0f} s: {len(wrong)} kinds on {len(results[wrong[0]])} flights.", "",
        f"Noticed {share[0]:.0f} % of {len(cases)} cases (refused or stopped {hard:.0f} %), named rightly {share[1]:.0f} %. "
        f"Logs that were only thinned are {'not ' if quiet else ''}complained of.", "",
        "| kind | " + " | ".join(results[wrong[0]]) + " | named | what is said first |", "|---|" + "---|" * (len(results[wrong[0]]) + 2),
    ]  # fmt: skip
    for kind, of in results.items():
        first = next((re.sub(r"/\S*/", "", t.words) for t in of.values() if t.words), "")
        cells = [kind, *(t.how for t in of.values()), f"{sum(t.named for t in of.values())} of {len(of)}", first[:110].replace("|", "/")]
        lines.append("| " + " | ".join(cells) + " |")
    return "\n".join([*lines, ""])


def main(arguments=None) -> int:
    from awescli.artifacts import write_text
    from awescli.stages.blas import one_blas_thread

    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("flights", nargs="+", type=Path)
    parser.add_argument("--kite", type=Path)
    parser.add_argument("--only", default="", help="kinds that hold these words")
    parser.add_argument("--write", action="store_true", help="keep the table in results/")
    options = parser.parse_args(arguments)
    began, results = time.monotonic(), {}
    with tempfile.TemporaryDirectory(prefix="kinds-") as folder, one_blas_thread():
        judges = {f.name: Judge(f, kite_of(f, Path(folder), options.kite), Path(folder)) for f in options.flights}
        for i, kind in enumerate(k for k in KINDS_OF if options.only in k):
            results[kind] = {name: judge(kind, np.random.default_rng([1, i])) for name, judge in judges.items()}
            said = [f"{t.how}{'' if t.named else ' (not named)'}" for t in results[kind].values()]
            print(f"{kind}: {', '.join(said)}: {next(iter(results[kind].values())).words[:160]}", flush=True)
    if not options.only:
        command = f"python benchmarks/kinds_logs.py {' '.join(f'FLIGHTS/{f.name}' for f in options.flights)}"
        text = table(command, results, time.monotonic() - began)
        print(text.split("| kind")[0])
        if options.write:
            write_text(HERE / "results" / "kinds_logs.md", text)
    return 0


if __name__ == "__main__":
    sys.exit(main())
