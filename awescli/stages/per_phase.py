"""Parameters that have a value of their own in each phase of a cycle: which those of a fit are."""

from collections.abc import Collection, Iterable, Iterator, Sequence
from fnmatch import fnmatchcase
from typing import TYPE_CHECKING

from awescli.notation.errors import BadInput, did_you_mean
from awescli.notation.phases import OWN, WORKING, own_name, parted

if TYPE_CHECKING:
    from awescli.flightlog.log import FlightLog
    from awescli.flightlog.split import Split
    from awescli.physics.declaration import KiteDeclaration

LEAST = 5.0
"""[s] that a phase must last, changes left out, in the loops that are fitted: less tells nothing of it."""


def by_phase(declared: "KiteDeclaration", patterns: Sequence[str], phases: Iterable[str]) -> "KiteDeclaration":
    """The declaration with a value of its own, declared like that in traction, for each free parameter that a pattern names, in each of
    these phases but traction. Values of a phase that the kite file declares stay as they are."""
    named = {n: row for n, row in declared.parameters.items() if row.free and any(fnmatchcase(n, p) for p in patterns) and not parted(n)[1]}
    own = {own_name(name, phase): row for name, row in named.items() for phase in phases if phase in OWN}
    return declared.model_copy(update={"parameters": {**own, **declared.parameters}})


def by_phase_as(declared: "KiteDeclaration", identified: "KiteDeclaration") -> "KiteDeclaration":
    """The declaration with the values of their own in a phase that `identified` has, each with the prior of its parameter."""
    own = {n: declared.parameters[parted(n)[0]] for n in identified.parameters if parted(n)[1] and n not in declared.parameters}
    return declared.model_copy(update={"parameters": {**declared.parameters, **own}})


def phases_fitted(log: "FlightLog", parts: "Split") -> tuple[str, ...]:
    """Phases of a cycle that last in the loops that are fitted."""
    import numpy as np

    from awescli.flightlog.phases import apart_from_changes, phases

    labels, fitted = phases(log), np.zeros(len(log), bool)
    for first, last in parts.train:
        fitted[first:last] = True
    fitted &= apart_from_changes(labels, log.dt) & log.valid
    return tuple(phase for phase in WORKING if (fitted & (labels == phase)).sum() * log.dt >= LEAST)


def phases_of(names: Collection[str]) -> dict[str, str]:
    """Name -> the phase that it is the value of, where a parameter has several."""
    several = {parted(name)[0] for name in names if parted(name)[1]}
    return {name: parted(name)[1] or WORKING[0] for name in names if parted(name)[0] in several}


def refused_phases(
    declared: "KiteDeclaration", patterns: Sequence[str], log: "FlightLog", parts: "Split"
) -> Iterator[tuple[str, BadInput]]:
    """(key, mistake) of `per_phase`: patterns of no free parameter, or one phase alone."""
    if not patterns:
        return
    free = [name for name, row in declared.parameters.items() if row.free]
    for pattern in patterns:
        if not any(fnmatchcase(name, pattern) for name in free):
            yield "per_phase", BadInput(f"no free parameter is called '{pattern}'", do=did_you_mean(pattern, free))
    found = phases_fitted(log, parts)
    if not set(found) & set(OWN):
        what = f"what is fitted of the flight '{log.name}' is {' and '.join(found) or 'no phase of a cycle'} alone"
        yield "per_phase", BadInput(what, do="Set split.of to cycles: whole pumping cycles are dealt then. Or drop this key.")
