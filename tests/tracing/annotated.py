"""Do dataclasses hold what their annotations say? No type checker is part of the tests; a whole trace is looked through instead."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import fields, is_dataclass
from numbers import Integral, Real
from types import NoneType, UnionType
from typing import Any, Union, get_args, get_origin, get_type_hints


def holds(value, hint) -> bool:
    """Is `value` what `hint` says, down to the entries of tuples, sequences and mappings? A number of numpy is a number."""
    origin, inner = get_origin(hint), get_args(hint)
    if hint is Any:
        return True
    if hint is None or hint is NoneType:
        return value is None
    if origin in (Union, UnionType):
        return any(holds(value, one) for one in inner)
    if origin is tuple:
        if not isinstance(value, tuple):
            return False
        many = inner[:1] * len(value) if inner[-1:] == (Ellipsis,) else inner
        return len(many) == len(value) and all(map(holds, value, many))
    if origin is not None and issubclass(origin, Mapping):
        return isinstance(value, origin) and all(holds(k, inner[0]) and holds(v, inner[1]) for k, v in value.items())
    if origin is not None and issubclass(origin, Sequence):
        return isinstance(value, origin) and all(holds(v, inner[0]) for v in value)
    if hint is float:
        return isinstance(value, Real)
    return isinstance(value, Integral if hint is int else origin or hint)


def wrongly_annotated(value, room: str = "awescli.tracing") -> Iterator[str]:
    """`Class.field` of every field, of `value` and of what it holds, that holds something else than it says."""
    if is_dataclass(value) and type(value).__module__.startswith(room):
        hints = get_type_hints(type(value))
        for field in fields(value):
            inside = getattr(value, field.name)
            if not holds(inside, hints[field.name]):
                yield f"{type(value).__name__}.{field.name}: {hints[field.name]}"
            yield from wrongly_annotated(inside, room)
    elif isinstance(value, Mapping | Sequence) and not isinstance(value, str):
        for entry in value.values() if isinstance(value, Mapping) else value:
            yield from wrongly_annotated(entry, room)
