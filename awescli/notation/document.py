"""read_document: a YAML file -> a checked pydantic model, every mistake reported at once with its place and its cure.

    config = read_document(Path("stages.yaml"), Plan, overrides={"identify.horizon": "4.0"}, omit=("stages",))

Validators inside models raise ValueError(text), or ValueError(BadInput(what, do=...)) to give the cure as well; the place is
added here. Paths stay as they are written; whoever knows the file's folder resolves them (stages/plan.py).
"""

import re
import types
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, TypeVar, Union, get_args, get_origin

from pydantic import BaseModel, ValidationError
from pydantic.fields import FieldInfo
from pydantic_core import PydanticUndefined

from awescli.notation.errors import BadInput, BadInputs, did_you_mean
from awescli.notation.former_names import KEYS
from awescli.notation.regular_files import open_regular
from awescli.notation.yaml_text import MAX_CHARACTERS, MAX_DEPTH, Loc, parse_yaml

Model = TypeVar("Model", bound=BaseModel)


def read_document(
    path: Path, model: type[Model], text: str | None = None, overrides: Mapping[str, str] | None = None, omit: tuple[str, ...] = ()
) -> Model:
    """The file at `path` (or `text`, where it is at hand) as a `model`; raises BadInput, or BadInputs for several mistakes.

    overrides: dotted key -> YAML text, applied before checking; errors about one say `--set KEY`.
    omit: top-level mappings that names leave out: with ("stages",), `stages.identify.horizon` is called `identify.horizon`
    in messages and may be called so in overrides.
    """
    return open_document(path, text, omit).with_overrides(overrides or {}, model).check(model)


def open_document(path: Path, text: str | None = None, omit: tuple[str, ...] = ()) -> "Document":
    """The file at `path` as plain data that knows its places."""
    placed = parse_yaml(_read_text(path) if text is None else text, str(path))
    return Document(str(path), placed.data, placed.places, omit)


@dataclass(frozen=True)
class Document:
    """Plain data of one YAML file, and the place of every part of it."""

    source: str
    data: Any
    places: Mapping[Loc, str]
    omit: tuple[str, ...] = ()

    def where(self, *loc: str | int) -> str:
        """`stages.yaml:12: identify.horizon`, or `--set identify.horizon`, for the value at `loc` or its nearest parent."""
        name = self.name(loc)
        for n in range(len(loc), -1, -1):
            if (place := self.places.get(loc[:n])) is not None:
                return place if not name or place == f"--set {name}" else f"{place}: {name}"
        return f"{self.source}: {name}" if name else self.source

    def name(self, loc: Loc) -> str:
        """Dotted name of a place, without the mappings that names leave out."""
        short = loc[1:] if len(loc) > 1 and loc[0] in self.omit else loc
        return ".".join(str(part) for part in short)

    def with_overrides(self, overrides: Mapping[str, str], model: type[BaseModel]) -> "Document":
        """The same document with some values replaced; `model` tells where keys that contain dots end."""
        if not overrides:
            return self
        data, places = _copy(self.data if self.data is not None else {}), dict(self.places)
        errors = []
        for key, value in overrides.items():
            try:
                _override(data, places, model, key, value, self.omit)
            except BadInput as e:
                errors.append(e)
        _raise(errors)
        return Document(self.source, data, places, self.omit)

    def check(self, model: type[Model]) -> Model:
        """The data as a `model`."""
        if not isinstance(self.data, dict):
            found = "nothing" if self.data is None else f"a {_kind(self.data)}"
            raise BadInput(f"expected a mapping (key: value), found {found}", self.where(), f"Keys: {', '.join(_keys(model))}.")
        try:
            return model.model_validate(self.data)
        except ValidationError as e:
            _raise(self._translate(e, model))
            raise AssertionError("a ValidationError without errors") from e
        except BadInput as e:  # raised by a class below that knows what is wrong but not where it stands
            if e.where or isinstance(e, BadInputs):
                raise
            raise BadInput(e.what, self.where(), e.do) from None

    def check_part(self, model: type[Model]) -> tuple[Model | None, list[BadInput]]:
        """(a `model` of what is right, or None where nothing is left; all that is wrong): wrong entries are left out, so that whoever
        knows more can go on checking the others, and all mistakes of a file are reported in one go."""
        data, found = _copy(self.data), {}
        for _ in range(MAX_DEPTH):
            rest = Document(self.source, data, self.places, self.omit)
            try:
                return rest.check(model), list(found.values())
            except BadInput as e:
                mistakes = e.errors if isinstance(e, BadInputs) else [e]
            wrong = rest._wrong(model)
            # a key that is missing because its value was left out above is no news
            found.update({str(e): e for e in mistakes if not found or not e.what.startswith("missing key")})
            if not wrong or not all(wrong):
                break
            for loc in wrong:
                _leave_out(data, loc)
        return None, list(found.values())

    def _wrong(self, model: type[BaseModel]) -> list[Loc]:
        """Where the mistakes stand that a `model` sees."""
        try:
            model.model_validate(self.data)
        except ValidationError as e:
            return [self._real(error["loc"], False) for error in e.errors(include_url=False)]
        except BadInput:
            pass
        return []

    def _translate(self, error: ValidationError, model: type[BaseModel]) -> list[BadInput]:
        """One BadInput per place; the branches of a union complain together ("must be a number or must be 'auto'")."""
        found: dict[str, BadInput] = {}
        raw = error.errors(include_url=False)
        for e in raw:
            # a list with a wrong entry is reported as too short as well
            if e["type"] == "too_short" and any(o["loc"][: len(e["loc"])] == e["loc"] != o["loc"] for o in raw):
                continue
            loc = self._real(e["loc"], e["type"] == "missing")
            where = self.where(*loc)
            what, do = _say(e, loc, model, self.omit)
            if where in found:
                what, do = f"{found[where].what} or {what}", found[where].do or do
            found[where] = BadInput(what, where, do)
        return list(found.values())

    def _real(self, loc: Loc, missing: bool) -> Loc:
        """pydantic's loc without the parts that are not in the data (names of union branches, "[key]")."""
        real, data = [], self.data
        for i, part in enumerate(loc):
            if isinstance(data, dict) and str(part) in data:
                data, part = data[str(part)], str(part)
            elif isinstance(data, list) and isinstance(part, int) and part < len(data):
                data = data[part]
            elif not (missing and i == len(loc) - 1):
                continue
            real.append(part)
        return tuple(real)


def _read_text(path: Path) -> str:
    """The file's text, or what is wrong with the file."""
    raw = b""
    try:
        with open_regular(path) as file:
            raw = file.read(4 * MAX_CHARACTERS + 1)
        return raw.decode("utf-8")
    except FileNotFoundError:
        raise BadInput("there is no such file", str(path), "Check the path; `awes init DIR` writes a plan to start from.") from None
    except UnicodeDecodeError as e:
        if len(raw) > 4 * MAX_CHARACTERS:
            raise BadInput("this is too large for a settings file", str(path), "Is this the file you meant?") from None
        line = raw.count(b"\n", 0, e.start) + 1
        raise BadInput("not UTF-8 text", f"{path}:{line}", "Save the file as UTF-8.") from None
    except (OSError, ValueError) as e:
        reason = getattr(e, "strerror", None) or str(e)
        raise BadInput(f"cannot be read ({reason})", str(path), "Check the path and its permissions.") from None


def _raise(errors: list[BadInput]) -> None:
    if len(errors) == 1:
        raise errors[0]
    if errors:
        raise BadInputs(errors)


# --- overrides ----------------------------------------------------------------------------------------------------------


def _override(whole: Any, places: dict[Loc, str], model: type[BaseModel], key: str, value: str, omit: tuple[str, ...]) -> None:
    """Set `key` in `whole`, in place, making the mappings on the way where they are missing."""
    source = f"--set {key}"
    if not all(key.split(".")) or key.count(".") >= MAX_DEPTH:
        raise BadInput("not a dotted key", source, "Write --set KEY=VALUE, for example --set identify.horizon=5.0.")
    placed = parse_yaml(value, source)
    loc, data = _loc_of(key, whole, model, omit), whole
    for n in range(len(loc)):
        if n:
            data = _step(data, loc[n - 1], places, loc[:n], source)
        if isinstance(data, list):
            if not (isinstance(loc[n], str) and loc[n].isdecimal() and int(loc[n]) < len(data)):
                raise BadInput(f"'{loc[n]}' is not an index of a list of {len(data)}", source, "Give the whole list: KEY='[1, 2]'.")
        elif not isinstance(data, dict):
            parent = ".".join(map(str, loc[:n])) or "the file"
            raise BadInput(f"'{parent}' holds a {_kind(data)}, not a mapping", source, "Set the whole value instead.")
    last = int(loc[-1]) if isinstance(data, list) else loc[-1]
    holder: Any = data
    holder[last] = placed.data
    loc = (*loc[:-1], last)
    for old in [p for p in places if p[: len(loc)] == loc]:
        del places[old]
    places.update({(*loc, *below): source for below in placed.places})


def _step(data: Any, part: str, places: dict[Loc, str], loc: Loc, source: str) -> Any:
    """One step down, into a new mapping where there is none."""
    if isinstance(data, list):
        return data[int(part)]
    if data.get(part) is None:
        data[part] = {}
        places.setdefault(loc, source)
    return data[part]


def _loc_of(key: str, data: Any, model: type[BaseModel], omit: tuple[str, ...]) -> tuple[str, ...]:
    """The parts of a dotted key. A table of plain values (`start: {tether.stiffness: 200}`) takes all that is left as one key."""
    parts = key.split(".")
    if parts[0] not in _keys(model):
        for name in omit:
            if parts[0] in set(_keys_at(model, (name,))):
                parts.insert(0, name)
    loc: list[str] = []
    while parts:
        rest = ".".join(parts)
        if _is_plain_table(model, tuple(loc)) or (isinstance(data, dict) and rest in data):
            return (*loc, rest)
        loc.append(parts.pop(0))
        data = data.get(loc[-1]) if isinstance(data, dict) else None
    return tuple(loc)


def _leave_out(data: Any, loc: Loc) -> None:
    """Remove the entry at `loc`, in place; an item of a list takes the whole list with it."""
    for part in loc[:-1]:
        below = data.get(part) if isinstance(data, dict) else None
        if not isinstance(below, dict):
            data.pop(part, None) if isinstance(data, dict) else None
            return
        data = below
    data.pop(loc[-1], None)


def _copy(data: Any) -> Any:
    """Copy of the containers."""
    if isinstance(data, dict):
        return {k: _copy(v) for k, v in data.items()}
    return [_copy(v) for v in data] if isinstance(data, list) else data


# --- what the model expects at a place -----------------------------------------------------------------------------------


def _types_at(model: Any, loc: Loc) -> Iterator[Any]:
    """The types a model allows at `loc` (several where there is a union), stripped of Annotated and Optional."""
    if get_origin(model) is Annotated:
        yield from _types_at(get_args(model)[0], loc)
    elif get_origin(model) in (Union, types.UnionType):
        for branch in get_args(model):
            yield from _types_at(branch, loc)
    elif not loc:
        yield model
    elif isinstance(model, type) and issubclass(model, BaseModel):
        if (field := _fields(model).get(str(loc[0]))) is not None:
            yield from _types_at(field.annotation, loc[1:])
    elif arguments := get_args(model):
        origin = get_origin(model)
        if isinstance(origin, type) and issubclass(origin, Mapping):
            yield from _types_at(arguments[-1], loc[1:])
        elif origin is tuple and arguments[-1] is not Ellipsis and isinstance(loc[0], int):
            yield from _types_at(arguments[min(loc[0], len(arguments) - 1)], loc[1:])
        else:
            yield from _types_at(arguments[0], loc[1:])


def _fields(model: type[BaseModel]) -> dict[str, FieldInfo]:
    """Key as written in the file -> field."""
    return {field.alias or name: field for name, field in model.model_fields.items()}


def _keys(model: type[BaseModel]) -> list[str]:
    return list(_fields(model))


def _keys_at(model: type[BaseModel], loc: Loc) -> list[str]:
    """Keys a model knows at `loc`."""
    return [key for t in _types_at(model, loc) if isinstance(t, type) and issubclass(t, BaseModel) for key in _fields(t)]


def _field_at(model: type[BaseModel], loc: Loc) -> FieldInfo | None:
    for parent in _types_at(model, loc[:-1]) if loc else ():
        if isinstance(parent, type) and issubclass(parent, BaseModel) and (field := _fields(parent).get(str(loc[-1]))):
            return field
    return None


def _is_plain_table(model: type[BaseModel], loc: Loc) -> bool:
    """Is the value at `loc` a mapping from names to plain values (not to models or further mappings)?"""
    for t in _types_at(model, loc):
        origin = get_origin(t)
        if isinstance(origin, type) and issubclass(origin, Mapping) and get_args(t):
            below = list(_types_at(get_args(t)[-1], ()))
            return not any(isinstance(b, type) and issubclass(b, BaseModel) or get_origin(b) is dict for b in below)
    return False


# --- words --------------------------------------------------------------------------------------------------------------


def _say(e: Mapping[str, Any], loc: Loc, model: type[BaseModel], omit: tuple[str, ...]) -> tuple[str, str]:
    """(what, do) of one pydantic error."""
    if e["type"] == "extra_forbidden":
        known = _keys_at(model, loc[:-1])
        if len(loc) == 1:  # names in the mappings that names leave out are as good as top-level ones
            known = [*known, *(key for name in omit for key in _keys_at(model, (name,)))]
        key = str(loc[-1]) if loc else ""
        if KEYS.get(key) in known:
            return f"'{key}' is called '{KEYS[key]}' now", f"Write {KEYS[key]}."
        return "unknown key", did_you_mean(key, known)
    if e["type"] == "missing":
        return f"missing key '{loc[-1]}'" if loc else "missing key", f"Add it: {_description(model, loc)}"
    inner = e.get("ctx", {}).get("error")
    if isinstance(inner, ValueError) and inner.args and isinstance(inner.args[0], BadInput):
        return inner.args[0].what, inner.args[0].do
    message = e["msg"].removeprefix("Value error, ").removeprefix("Assertion failed, ")
    message = re.sub(r"^Input should (be|have)", r"must \1", message)
    message = re.sub(r"^must be a valid (dictionary|mapping)\b.*", "must be a mapping (key: value)", message)
    message = re.sub(r"^(Tuple|List|Value) should have at (least|most) (\d+) items?.*", r"must have at \2 \3 of them", message)
    message = re.sub(r"^Input is not a valid path.*", "must be a path", message).replace(", unable to parse string as a number", "")
    if e["type"] in ("value_error", "assertion_error"):
        return message, _described(model, loc)
    return f"{message}, got {_short(e['input'])}", _nearest(e) or _described(model, loc)


def _nearest(e: Mapping[str, Any]) -> str:
    """The nearest allowed word, where only certain words are allowed."""
    allowed = re.findall(r"'([^']+)'", e.get("ctx", {}).get("expected", "")) if e["type"] in ("literal_error", "enum") else []
    return did_you_mean(e["input"], allowed) if allowed and isinstance(e["input"], str) else ""


def _described(model: type[BaseModel], loc: Loc) -> str:
    field = _field_at(model, loc)
    return f"Expected: {_description(model, loc)}" if field is not None and (field.description or not field.is_required()) else ""


def _description(model: type[BaseModel], loc: Loc) -> str:
    """`horizon: prediction horizon [s] (default 5.0)`."""
    field, name = _field_at(model, loc), str(loc[-1]) if loc else ""
    if field is None:
        return name
    text = f"{name}: {field.description}" if field.description else name
    if not field.is_required() and field.default is not None and field.default is not PydanticUndefined:
        text += f" (default {_short(field.default)})"
    return text


def _kind(value: Any) -> str:
    names = {dict: "mapping", list: "list", str: "text", bool: "truth value", int: "number", float: "number", type(None): "nothing"}
    return names.get(type(value), type(value).__name__)


def _short(value: Any) -> str:
    """The value as one would write it, at most 60 characters."""
    text = "nothing" if value is None else repr(value)
    return text if len(text) <= 60 else f"{text[:57]}..."
