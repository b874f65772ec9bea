"""`awes effects`: every effect of EFFECTS and nothing else, with every parameter, in 80 columns."""

import json
import math

from typer.testing import CliRunner

from awescli.cli import build_app
from awescli.physics.effects import EFFECTS
from awescli.stages import STAGES

APP = build_app(STAGES)


def test_the_library_is_printed_whole_and_fits():
    shown = CliRunner().invoke(APP, ["effects"], env={"COLUMNS": "80"})
    assert shown.exit_code == 0, shown.stderr
    *lines, last = shown.stdout.splitlines()
    assert max(map(len, lines)) <= 80
    text = " ".join(shown.stdout.split())
    for name, effect in EFFECTS.items():
        assert f"{name} (" in text and effect.doc in text, name
        assert all(target in text for target in effect.targets)
        for p in effect.parameters:
            assert f"{p.lower:g} .. {p.upper:g}" in text and " ".join(p.source.split()) in text.replace("  ", " "), (name, p.name)


def test_json_holds_the_same():
    rows = json.loads(CliRunner().invoke(APP, ["effects", "--json"]).stdout)["effects"]
    assert [row["name"] for row in rows] == list(EFFECTS)
    for row in rows:
        effect = EFFECTS[row["name"]]
        assert [p["name"] for p in row["parameters"]] == [p.name for p in effect.parameters] and row["targets"] == list(effect.targets)
        for p, own in zip(row["parameters"], effect.parameters, strict=True):
            assert (p["unit"], p["null"], p["source"]) == (own.unit, own.value, own.source)
            assert p["lower"] == own.lower and p["upper"] == own.upper or not math.isfinite(own.upper - own.lower)
