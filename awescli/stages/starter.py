"""What helps to write a stages.yaml: a commented one to start from, and the JSON Schema for editor completion."""

import json
from collections.abc import Sequence
from typing import Any

from pydantic import BaseModel
from pydantic.fields import FieldInfo

from awescli.stages.base import Split, Stage
from awescli.stages.flights import FLIGHT, FLIGHTS
from awescli.stages.plan import SharedSettings, plan_model


def starter_text(stages: Sequence[Stage], flight: str, kite: str) -> str:
    """A stages.yaml that runs all stages with their defaults; every setting stands there as a comment, with what it means."""
    shared = SharedSettings.model_fields
    lines = [
        "# A plan of awes. Paths are relative to this file. `awes check` validates it, `awes run` runs it.",
        f"flight: {_yaml(flight)}    # {shared['flight'].description}",
        f"kite: {_yaml(kite)}    # {shared['kite'].description}",
        f"# out: {_yaml(str(shared['out'].default))}    # {shared['out'].description}",
        f"# seed: {_yaml(shared['seed'].default)}    # {shared['seed'].description}",
        f"# split:    # {shared['split'].description}",
        *_settings(Split, "  "),
        "",
        "# Stages that `awes run` runs. Remove the # before a setting to change it.",
        "stages:",
    ]
    for stage in stages:
        # `name:` with nothing but comments below it means: all defaults
        lines += [f"  {stage.name}:    # {stage.help}", *_settings(stage.Config, "    ")]
    return "\n".join(lines) + "\n"


def _settings(config: type[BaseModel], indent: str) -> list[str]:
    """One commented line for every setting."""
    return [_setting(field.alias or name, field, indent) for name, field in config.model_fields.items()]


def _setting(name: str, field: FieldInfo, indent: str) -> str:
    default = field.get_default(call_default_factory=True, validated_data={})
    if isinstance(default, BaseModel):
        default = default.model_dump(mode="json", by_alias=True)
    meaning = f"    # {field.description}" if field.description else ""
    return f"{indent}# {name}: {_yaml(default)}{meaning}"


def _yaml(value: Any) -> str:
    """A value as flow YAML (JSON is YAML; plain words need no quotes)."""
    if isinstance(value, str) and value and all(c.isalnum() or c in "/._-" for c in value) and value[0].isalpha():
        return value if value.lower() not in ("null", "true", "false") else json.dumps(value)
    try:
        return json.dumps(value, ensure_ascii=False)
    except TypeError:
        return json.dumps(str(value), ensure_ascii=False)


def plan_schema(stages: Sequence[Stage]) -> dict[str, Any]:
    """JSON Schema of stages.yaml."""
    schema = draft7(plan_model(tuple(stages)))
    schema["required"].remove(FLIGHT)
    schema["oneOf"] = [{"required": [FLIGHT]}, {"required": [FLIGHTS]}]
    schema["properties"][FLIGHTS].pop("default")  # no list is allowed that is as empty
    settings = schema["definitions"]["Stages"]
    for name, of_stage in settings["properties"].items():
        # `identify:` with nothing after it means defaults
        settings["properties"][name] = {"anyOf": [of_stage, {"type": "null"}]}
    return schema


def draft7(model: type[BaseModel]) -> dict[str, Any]:
    """JSON Schema of a model in draft 7, which editors know (pydantic writes 2020-12; the two differ in these words)."""

    def older(node: Any) -> Any:
        if isinstance(node, list):
            return [older(v) for v in node]
        if not isinstance(node, dict):
            return node.replace("#/$defs/", "#/definitions/") if isinstance(node, str) else node
        new = {("definitions" if k == "$defs" else k): older(v) for k, v in node.items()}
        if "prefixItems" in new:
            new["items"] = new.pop("prefixItems")
            new["additionalItems"] = False
        if "$ref" in new and len(new) > 1:  # draft 7 ignores whatever stands beside $ref
            new = {"allOf": [{"$ref": new.pop("$ref")}], **new}
        return new

    return {"$schema": "http://json-schema.org/draft-07/schema#", **older(model.model_json_schema(by_alias=True))}
