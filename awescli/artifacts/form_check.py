"""The version of a file's form, written and checked: a file of an older awes, or one that somebody edited, is named as such instead of
failing somewhere inside a reader."""

from collections.abc import Iterator, Mapping
from difflib import get_close_matches
from typing import Any

from pydantic import BaseModel, ValidationError

from awescli.artifacts.forms import ARRAYS, FORMS

VERSION = "version"
"""Key of the form's version in the file; readers never see it."""
MISSPELT = 0.8
"""Likeness (difflib) from which an unknown key is taken for one that is missing."""
MOST_TOLD = 3
"""Mistakes of one file that are named."""


def versioned(name: str, obj: Any) -> Any:
    """What is written as the file `name`: with the version of its form, where it has one."""
    return {VERSION: FORMS[name].version, **obj} if name in FORMS and isinstance(obj, Mapping) else obj


def wrong_with(stage: str, name: str, content: Any) -> str:
    """What is wrong with the content of the file `name` of a stage; empty where it is of today's form, or no form is known."""
    form = FORMS.get(f"{stage}/{name}") or FORMS.get(name)
    if form is None:
        return ""
    if not isinstance(content, dict):
        return f"not as awes writes it: {_kind(content)} instead of a mapping"
    version = content.get(VERSION)
    if version != form.version and not (version is None and form.unversioned):
        if version is None:
            return f"written by an older awes (0.1; this one reads version {form.version} of this file)"
        age = "an older" if isinstance(version, int) and version < form.version else "a newer or another"
        return f"written by {age} awes (version {str(version)[:20]} of this file; this one reads version {form.version})"
    try:
        found = form.model.model_validate(content)
    except ValidationError as e:
        mistakes = [_say(error) for error in e.errors(include_url=False, include_context=False)]
        more = f"; and {len(mistakes) - MOST_TOLD} more" if len(mistakes) > MOST_TOLD else ""
        return f"not as awes writes it: {'; '.join(mistakes[:MOST_TOLD])}{more}"
    return f"not as awes writes it: {'; '.join(misspelt[:MOST_TOLD])}" if (misspelt := [*_misspelt(found)]) else ""


def _misspelt(value: Any, at: str = "") -> Iterator[str]:
    """Keys of no form, each where one that is very like it is missing: the default would take the place of what stands there."""
    if isinstance(value, BaseModel):
        fields = type(value).model_fields
        missing = [field.alias or name for name, field in fields.items() if name not in value.model_fields_set]
        for key in value.model_extra or ():
            if meant := get_close_matches(key, missing, 1, MISSPELT):
                yield f"{at}{key} is no key of it (did you mean '{meant[0]}'?)"
        for name, field in fields.items():
            yield from _misspelt(getattr(value, name), f"{at}{field.alias or name}.")
    elif isinstance(value, Mapping):
        for key, inside in value.items():
            yield from _misspelt(inside, f"{at}{key}.")
    elif isinstance(value, list):
        for i, inside in enumerate(value):
            yield from _misspelt(inside, f"{at}{i}.")


def undescribed(value: Any, at: str = "") -> Iterator[str]:
    """Place of every key of an artifact, read by its form (a model of `forms`), that the form does not describe."""
    if isinstance(value, BaseModel):
        yield from (f"{at}{key}" for key in value.model_extra or ())
        for name, field in type(value).model_fields.items():
            yield from undescribed(getattr(value, name), f"{at}{field.alias or name}.")
    elif isinstance(value, Mapping):
        for key, inside in value.items():
            yield from undescribed(inside, f"{at}{key}.")
    elif isinstance(value, list):
        for i, inside in enumerate(value):
            yield from undescribed(inside, f"{at}{i}.")


def wrong_arrays(name: str, arrays: Mapping[str, Any]) -> str:
    """What is wrong with the arrays of the file `name`; empty where they are of the sizes that their readers need, or no form is known."""
    for array, known in ARRAYS.get(name, {}).items():
        form = known.axes
        found = {n: a for n, a in arrays.items() if n == array or (array.endswith("*") and n.startswith(array[:-1]))}
        if not found and not array.endswith("*"):
            return f"not as awes writes it: '{array}' is missing"
        for n, a in found.items():
            if a.dtype.kind not in "fiu" or a.ndim != len(form):
                return f"not as awes writes it: '{n}' has {a.ndim} axes of type {a.dtype}, expected {len(form)} of numbers"
            for have, (other, most) in zip(a.shape, form, strict=True):
                size = other if isinstance(other, int) else len(arrays[other])
                if have > size or (have < size and not most):
                    return f"not as awes writes it: '{n}' has the shape {a.shape}"
    return ""


def without_version(content: Any) -> Any:
    """What readers see."""
    return {k: v for k, v in content.items() if k != VERSION} if isinstance(content, dict) else content


def _say(error: Mapping[str, Any]) -> str:
    place = ".".join(str(part) for part in error["loc"])[:80]
    if error["type"] == "missing":
        return f"{place} is missing"
    return f"{place} {error['msg'].replace('Input should be', 'should be')}, is {_kind(error['input'])}"


def _kind(value: Any) -> str:
    names = {dict: "a mapping", list: "a list", str: "text", bool: "a truth value", int: "a number", float: "a number"}
    return "nothing" if value is None else names.get(type(value), type(value).__name__)
