"""What differs between two stamps of a stage, in words."""

from collections.abc import Mapping
from typing import Any


def changes(then: Mapping[str, Any], now: Mapping[str, Any]) -> list[str]:
    """What differs between two stamps, in words."""
    words = []
    for group, label in (("inputs", "input"), ("settings", "setting"), ("split", "split"), ("versions", "version of")):
        old, new = flat(then.get(group)), flat(now[group])
        for key in sorted({*old, *new}):
            if old.get(key) != new.get(key):
                is_hash = group == "inputs"
                words.append(f"{label} {key} changed" + ("" if is_hash else f" {_word(old.get(key))} -> {_word(new.get(key))}"))
    if then.get("seed") != now["seed"]:
        words.append(f"seed changed {then.get('seed')} -> {now['seed']}")
    for name, digest in now["upstream"].items():
        if then["upstream"].get(name) != digest:
            words.append(f"upstream {name} " + ("is no longer used" if digest is None else "changed"))
    if then.get("code") != now["code"]:
        words.append("code changed")
    return words


def flat(tree: Any, prefix: str = "") -> dict[str, Any]:
    """Nested mappings -> dotted keys."""
    if not isinstance(tree, dict):
        return {prefix.removesuffix("."): tree}
    return {k: v for key, value in tree.items() for k, v in flat(value, f"{prefix}{key}.").items()} if tree else {}


def _word(value: Any) -> str:
    text = "unset" if value is None else str(value)
    return text if len(text) <= 40 else f"{text[:37]}..."
