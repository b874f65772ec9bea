"""Phases of a pumping cycle, and parameters that have a value of their own in one of them: `CD0:retraction`.

`CD0` alone is its value in traction, and wherever no phase is known.
"""

WORKING = ("traction", "transition", "retraction")
"""Phases of a pumping cycle, in its order (names of `flightlog.phases.PHASES`)."""
OWN = WORKING[1:]
"""Those in which a parameter may differ from its value in traction."""


def own_name(parameter: str, phase: str) -> str:
    """What the value of a parameter in a phase of OWN is called."""
    return f"{parameter}:{phase}"


def parted(name: str) -> tuple[str, str]:
    """(parameter, phase) of the name of a value of its own; (name, "") of any other."""
    parameter, _, phase = name.rpartition(":")
    return (parameter, phase) if phase in OWN else (name, "")


def input_of(phase: str) -> str:
    """The exogenous input that is 1 while a phase lasts, else 0."""
    return f"phase_{phase}"
