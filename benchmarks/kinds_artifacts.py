"""JSON artifacts that somebody edited, and hashes in the provenance that were forged to fit."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from believed import READ, Believed
from fuzz_kinds import Judged

from awescli.artifacts.form_check import VERSION
from awescli.notation.errors import AwesError


def _ways(content: Any, way: tuple = ()) -> list[tuple]:
    """The way to every value."""
    items = content.items() if isinstance(content, dict) else enumerate(content) if isinstance(content, list) else ()
    return [found for key, value in items for found in ((*way, key), *_ways(value, (*way, key)))]


def _parent(content: Any, way: tuple) -> Any:
    for key in way[:-1]:
        content = content[key]
    return content


def _pick(content: Any, rng: np.random.Generator, wanted: Callable[[Any], bool] = lambda value: True) -> tuple:
    """The way to a value: each level is as likely as the next, or the numbers of a matrix would be all that is ever picked."""
    ways = [w for w in _ways(content) if wanted(_parent(content, w)[w[-1]]) and w[0] != VERSION]
    if not ways:
        return ()
    first = [w[0] for w in ways]
    key = list(dict.fromkeys(first))[rng.integers(len(set(first)))]
    ways = [w for w in ways if w[0] == key]
    depth = rng.choice(sorted({len(w) for w in ways}))
    ways = [w for w in ways if len(w) == depth]
    return ways[rng.integers(len(ways))]


def _is_number(value: Any) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool)


def _instead(*contents: bytes) -> Callable[[Any, np.random.Generator], tuple[bytes, str]]:
    return lambda content, rng: ((c := contents[rng.integers(len(contents))]), c.decode("latin-1")[:20])


def _edited(change: Callable[[Any, tuple, np.random.Generator], None], wanted: Callable[[Any], bool] = lambda value: True):
    def edit(content: Any, rng: np.random.Generator) -> tuple[bytes, str]:
        way = _pick(content, rng, wanted)
        if way:
            change(_parent(content, way), way[-1], rng)
        return json.dumps(content).encode(), ".".join(map(str, way))[:80]

    return edit


def _gone(parent: Any, key: Any, rng: np.random.Generator) -> None:
    del parent[key]


def _other_type(parent: Any, key: Any, rng: np.random.Generator) -> None:
    others = [v for v in (None, True, 3.5, "text", [], {}, [1], {"a": 1}) if type(v) is not type(parent[key])]
    parent[key] = others[rng.integers(len(others))]


def _renamed(parent: Any, key: Any, rng: np.random.Generator) -> None:
    if isinstance(parent, dict):
        parent[f"{key}_"] = parent.pop(key)
    else:
        parent.pop(key)


def _huge(parent: Any, key: Any, rng: np.random.Generator) -> None:
    parent[key] = float(rng.choice([1e308, -1e308, 1e-308, 0.0, -1.0]))


def _version(content: Any, rng: np.random.Generator) -> tuple[bytes, str]:
    how = [None, 1, 3, "2", 2.5][rng.integers(5)]
    content = {k: v for k, v in content.items() if k != VERSION} | ({} if how is None else {VERSION: how})
    return json.dumps(content).encode(), f"version {how}"


def _cut(content: Any, rng: np.random.Generator) -> tuple[bytes, str]:
    text = json.dumps(content, indent=1).encode()
    end = int(rng.integers(len(text)))
    return text[:end], f"{end} of {len(text)} bytes"


def _not_a_number(content: Any, rng: np.random.Generator) -> tuple[bytes, str]:
    way = _pick(content, rng, _is_number)
    if way:
        _parent(content, way)[way[-1]] = float(rng.choice([np.nan, np.inf, -np.inf]))
    return json.dumps(content).encode(), ".".join(map(str, way))[:80]


def _nested(content: Any, rng: np.random.Generator) -> tuple[bytes, str]:
    depth = int(rng.choice([50, 500, 5000, 100_000]))
    return b"[" * depth + b"]" * depth, f"{depth} deep"


def _nudged(parent: Any, key: Any, rng: np.random.Generator) -> None:
    parent[key] = parent[key] * 1.1 + 1 if not isinstance(parent[key], int) else parent[key] + 1


EDITS: dict[str, Callable[[Any, np.random.Generator], tuple[bytes, str]]] = {
    "something else altogether": _instead(b"[]", b"true", b"null", b"3", b'"text"', b"{}"),
    "empty, or no JSON": _instead(b"", b"\n", b"\x00\xff", b"{'a': 1}", b"version: 2"),
    "cut off": _cut,
    "the version of another awes": _version,
    "nested without end": _nested,
    "NaN or infinity": _not_a_number,
    "an entry that is gone": _edited(_gone),
    "an entry of another type": _edited(_other_type),
    "a key that is misspelt": _edited(_renamed, lambda value: True),
    "a number beyond all sense": _edited(_huge, _is_number),
    "a number that was changed, hash not forged": _edited(_nudged, _is_number),
}

KINDS = dict.fromkeys(EDITS, 30)


def prepare(folder: Path):
    """A judge of a small run with an edited artifact."""
    made = Believed(folder)
    usual = made.read()

    def judge(kind: str, rng: np.random.Generator) -> Judged:
        artifact = READ[rng.integers(len(READ))]
        forge = "not forged" not in kind
        if not forge and artifact.endswith("provenance.json"):
            artifact = READ[0]
        content, what = EDITS[kind](json.loads(made.original(artifact)), rng)
        what = f"{artifact}: {what}"
        try:
            made.put(artifact, content, forge)
            if not forge:
                again = [r.reason for r in made.decide() if r.status == "would run"]
                return Judged("noticed" if any("changed since it was written" in reason for reason in again) else "unnoticed", what)
            page = made.read()
        except AwesError as e:
            told = Path(artifact).stem in str(e) and bool(e.do)  # network.json and network.safetensors are read together
            return Judged("refused", what) if told else Judged("fault", f"{what}: '{str(e)[:100]}' does not name the file")
        finally:
            made.restore(artifact)
        # a provenance that cannot be read makes its stage run again
        if artifact.endswith("provenance.json") or page == usual:
            return Judged("repaired", what)
        return Judged("unnoticed", what)

    return judge
