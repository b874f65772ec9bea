"""A pydantic model as Markdown: one table of keys, and one more for every model inside it."""

import json
from typing import Any

from pydantic import BaseModel

HEAD = "| key | what it may be | default | meaning |\n| --- | --- | --- | --- |"


def sections(model: type[BaseModel], level: int, about: bool = True) -> list[str]:
    """The model's own table, then those of the models it holds; about: its docstring first. level: of the headings."""
    schema = model.model_json_schema(by_alias=True)
    pieces = [schema.get("description", "")] if about else []
    pieces.append(_table(schema))
    for name, inner in schema.get("$defs", {}).items():
        pieces += [f"{'#' * level} {name}", inner.get("description", ""), _table(inner)]
    return [piece for piece in pieces if piece]


def _table(schema: dict[str, Any]) -> str:
    required = schema.get("required", [])
    rows = [
        f"| `{name}` | {kind(field)} | {'required' if name in required else _default(field)} | {_cell(field.get('description', ''))} |"
        for name, field in schema.get("properties", {}).items()
    ]
    return "\n".join((HEAD, *rows)) if rows else ""


def _default(field: dict[str, Any]) -> str:
    value = field.get("default")
    if "default" not in field or (isinstance(value, dict) and value):
        return "see below" if "$ref" in field or "allOf" in field else "-"
    if value is None or value in ("", [], {}):
        return "-"
    return f"`{json.dumps(value, ensure_ascii=False)}`" if not isinstance(value, str) else f"`{value}`"


def _cell(text: str) -> str:
    return " ".join(text.split()).replace("|", "\\|")


def kind(field: dict[str, Any]) -> str:
    """What a value may be, in words: `number, more than 0.2, at most 60`."""
    if "$ref" in field:
        return field["$ref"].rsplit("/", 1)[1]
    for several in ("anyOf", "oneOf", "allOf"):
        if several in field:
            return " or ".join(dict.fromkeys(kind(one) for one in field[several]))
    if "const" in field:
        return f"`{field['const']}`"
    if "enum" in field:
        return ", ".join(f"`{value}`" for value in field["enum"])
    return _of_type(field)


def _of_type(field: dict[str, Any]) -> str:
    of = field.get("type", "anything")
    if of == "array":
        fixed = field.get("prefixItems")
        return f"{len(fixed)} of {kind(fixed[0])}" if fixed else f"list of {kind(field.get('items', {}))}"
    if of == "object":
        inner = field.get("additionalProperties")
        return f"name: {kind(inner)}" if isinstance(inner, dict) else "mapping"
    if of == "null":
        return "nothing"
    limits = (("exclusiveMinimum", "more than"), ("minimum", "at least"), ("exclusiveMaximum", "less than"), ("maximum", "at most"))
    words = [f"{word} {field[limit]:g}" for limit, word in limits if limit in field]
    return ", ".join([{"string": "text", "integer": "whole number", "boolean": "true, false"}.get(of, of), *words])
