"""The errors awes raises on purpose: what is wrong, where, and what to do.

Every one of them is shown to the user as one message without a traceback; the class decides the exit code.
"""

from collections.abc import Iterable
from difflib import get_close_matches


class AwesError(Exception):
    """Base of all errors awes raises on purpose.

    Parameters: `what` is wrong, `where` it stands (`stages.yaml:12: identify.horizon`), what to `do`.
    """

    exit_code = 2

    def __init__(self, what: str, where: str = "", do: str = ""):
        self.what, self.where, self.do = what, where, do
        super().__init__(self.__str__())

    def __str__(self) -> str:
        text = f"{self.where}: {self.what}" if self.where else self.what
        return f"{text}\n  {self.do}" if self.do else text


class BadInput(AwesError):
    """A file or setting that awes cannot use (exit code 2)."""


class BadInputs(BadInput):
    """Several bad inputs, found in one go and printed together."""

    def __init__(self, errors: list[BadInput]):
        self.errors = errors
        super().__init__("\n".join(str(e) for e in errors))


class NumericalFailure(AwesError):
    """A computation that ended without a usable answer; `outcome` is its name in the artifact (exit code 3)."""

    exit_code = 3

    def __init__(self, outcome: str, what: str, where: str = "", do: str = ""):
        self.outcome = outcome
        super().__init__(what, where, do)


def did_you_mean(name: str, known: Iterable[str]) -> str:
    """The nearest known name, or the list of them: the `do` of an error about an unknown name."""
    known = sorted(str(k) for k in known)
    close = get_close_matches(str(name), known, n=1)
    return f"Did you mean '{close[0]}'?" if close else f"Known: {', '.join(known)}."
