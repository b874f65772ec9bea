"""Keys and values of settings that were called otherwise before: refused by the old name, with the new one."""

from collections.abc import Mapping

from pydantic import BeforeValidator

from awescli.notation.errors import BadInput

KEYS: Mapping[str, str] = {"prove": "closed_loop_time", "believe": "unchecked"}
"""Key before 0.2 -> key now, of fit-controller and of flight.yaml."""


def formerly(**names: str) -> BeforeValidator:
    """What a field's value was called before -> what it is called now: `Annotated[Literal["range"], formerly(seed="range")]`."""

    def refuse(value):
        if isinstance(value, str) and value in names:
            raise ValueError(BadInput(f"'{value}' is called '{names[value]}' now", do=f"Write {names[value]}."))
        return value

    return BeforeValidator(refuse)
