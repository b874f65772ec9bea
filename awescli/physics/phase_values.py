"""Parameters that have a value of their own in a phase of a pumping cycle: which a kite file may declare, and which counts now."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from awescli.notation.errors import BadInput, did_you_mean
from awescli.notation.phases import OWN, input_of, parted

PhaseValue = tuple[str, str, str]
"""Name of a value of its own, of the parameter, and of the phase."""


def own_values(names: Sequence[str]) -> tuple[PhaseValue, ...]:
    """Those among the names of a parameter table."""
    return tuple((name, *parted(name)) for name in names if parted(name)[1])


def with_those_of_now(values: Mapping[str, Any], own: Sequence[PhaseValue], inputs: Mapping[str, Any]) -> dict[str, Any]:
    """The values that count at an instant (docs/equations.md (33)): theta + sum of w (theta_phase - theta), w the phase's input."""
    now = dict(values)
    for name, base, phase in own:
        now[base] = now[base] + inputs[input_of(phase)] * (values[name] - values[base])
    return now


def wrong_phases(names: Sequence[str], effects: Sequence[str], where: Callable[..., str]) -> list[BadInput]:
    """Values of a phase that no cycle has, or of a parameter that the kite file does not have. names: of all its parameters; effects:
    keys of its effects, whose parameters it need not name; where: as in `kite.check_declaration`."""
    errors = []
    for name in names:
        base, colon, phase = name.rpartition(":")
        # `actuator_lag:rudder.tau` is no value of a phase
        if not colon or "." in phase:
            continue
        if phase not in OWN:
            do = f"{did_you_mean(phase, OWN)} '{base}' alone is its value in traction."
            errors.append(BadInput(f"'{name}': no parameter has a value of its own in '{phase}'", where("parameters", name), do))
        elif base not in names and base.rpartition(".")[0] not in effects:
            what = f"'{name}' is a value of '{base}', which this kite does not have"
            errors.append(BadInput(what, where("parameters", name), did_you_mean(base, names)))
    return errors
