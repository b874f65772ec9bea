"""What may be missing in general and cannot be missing here."""

from typing import TypeVar

Thing = TypeVar("Thing")


def present(thing: Thing | None, what: str) -> Thing:
    """The thing itself. what: says it in words. Raises LookupError where it is missing, which is a fault of awes, never of a file: whoever
    calls has made sure before that it is there."""
    if thing is None:
        raise LookupError(f"{what} is not there")
    return thing
