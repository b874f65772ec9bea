"""What grows with a kite: the same flight of a similar kite, and what is plausible of an effect on it."""

import numpy as np
import pytest
from kites import DEVELOPMENT, ROOT, at_point

from awescli.notation.errors import BadInput
from awescli.notation.parameters import ParameterTable
from awescli.notation.quantities import STATES, UNITS
from awescli.physics.declaration import KiteDeclaration, read_kite
from awescli.physics.effects import EFFECTS
from awescli.physics.kite import Kite, make_effect
from awescli.simulation.campaign_flights import lengthened, similar

EACH = [
    f"{name}:{effect.targets[0]}" if effect.targets else name
    for name, effect in EFFECTS.items()
    if not effect.always and name not in ("custom_term", "thrust")
]


def weighing(mass: float, area: float) -> KiteDeclaration:
    """The development kite with another mass [kg] and wing area [m2]."""
    return DEVELOPMENT.with_parameters(DEVELOPMENT.table().with_values({"m": mass, "S": area}))


@pytest.mark.parametrize("length", [0.25, 4.0])
def test_a_similar_kite_flies_the_same_way_by_the_root_of_its_length_as_fast(length):
    # Froude: positions by L, speeds by sqrt(L), times by sqrt(L); so accelerations of the centre stay, angular ones go by 1 / L
    own, longer = Kite(DEVELOPMENT), Kite(similar(DEVELOPMENT, length))
    x, u, c = at_point(own)
    slope = own.derivative(x, u, c)
    of_state = {"m": length, "m/s": length**0.5, "rad": 1.0, "rad/s": length**-0.5}
    by = np.array([of_state[UNITS[s]] for s in STATES])
    there = {name: value * factor for name, value, factor in zip(STATES, x, by, strict=False)}
    inputs = dict(zip(own.input_names, u, strict=True))
    there |= {"tether_length": inputs["tether_length"] * length, "rudder_rate": inputs["rudder_rate"] * length**-0.5}
    there |= {n: v * length**0.5 for n, v in inputs.items() if n.startswith("wind_speed") or n == "reel_out_speed"}
    found = longer.derivative(*at_point(longer, **there))
    expected = np.array(slope[: len(STATES)]) * by / length**0.5
    assert found[: len(STATES)] == pytest.approx(expected, rel=1e-9, abs=1e-9)


@pytest.mark.parametrize("key", EACH)
def test_what_is_plausible_of_the_listed_kites_is_as_listed(key):
    listed = {p.name: p for p in EFFECTS[key.partition(":")[0]].parameters}
    for file in ("km1_initial", "km1_identified", "ap2", "development"):
        effect = make_effect(key, read_kite(ROOT / "data" / "kites" / f"{file}.yaml"))
        for p in effect.parameters:
            # a light kite may bear more of what its lower pressure divides, never less of anything
            assert p.lower <= listed[p.name].lower and p.upper >= listed[p.name].upper
            if p.unit in ("kg", "N", "m"):
                assert p == listed[p.name]
        for name, sizes in EFFECTS[effect.name].probes.items():
            assert file == "ap2" or effect.probes[name] == pytest.approx(sizes, rel=0.01)


def test_the_line_of_a_multi_megawatt_kite_is_plausible_of_it():
    # MegAWES: 6885.2 kg on 150.45 m2, a line of 29.7 mm, 0.6729 kg/m and 116 GPa (Eijkelhof & Schmehl, Renewable Energy 196, 2022)
    kite, stiffness = weighing(6885.2, 150.45), 1.16e11 * np.pi / 4 * 0.0297**2
    assert make_effect("tether_weight", DEVELOPMENT).parameters[0].upper < 0.6729 < make_effect("tether_weight", kite).parameters[0].upper
    stretch, listed = make_effect("tether_elasticity", kite), EFFECTS["tether_elasticity"]
    assert listed.parameters[0].upper < stiffness < stretch.parameters[0].upper
    assert stretch.probes["EA"][0] == pytest.approx(listed.probes["EA"][0] * 6885.2 / 54.0)
    dm = make_effect("mass_offset", kite).parameters[0]
    assert (dm.lower, dm.upper) == (pytest.approx(-20 * 127.5, rel=1e-3), pytest.approx(20 * 127.5, rel=1e-3)) and dm.value == 0.0


@pytest.mark.parametrize("key", EACH)
@pytest.mark.parametrize("length", [0.25, 4.0])
def test_bounds_hold_what_they_held_on_a_similar_kite_and_ends_at_null_stay(key, length):
    # not those of the air, which does not know what flies in it
    listed = {p.name: p for p in EFFECTS[key.partition(":")[0]].parameters}
    for p in make_effect(key, similar(weighing(54.0, 3.0), length)).parameters:
        was, by = listed[p.name], 1.0 if p.unit in ("m/s", "rad/m") else lengthened(p.unit, length)
        assert p.value == was.value
        for end in ("lower", "upper"):
            null, old, new = was.value, getattr(was, end), getattr(p, end)
            assert (new == null) if old == null else abs(new - null) == pytest.approx(max(by, 1.0) * abs(old - null))


def test_a_file_without_mass_or_area_has_the_listed_bounds():
    rows = {n: row for n, row in weighing(5000.0, 100.0).parameters.items() if n != "m"}
    for kite in (DEVELOPMENT.model_copy(update={"parameters": rows}), weighing(5000.0, 0.0), weighing(-50.0, 3.0), weighing(0.0, -3.0)):
        for key in ("mass_offset", "tether_weight", "wind_offset"):
            assert make_effect(key, kite).parameters == EFFECTS[key].parameters


@pytest.mark.parametrize("row", ["m: {value: -50, unit: kg}", "S: {value: 0, unit: m2}", "S: {value: -3, unit: m2}"])
def test_a_mass_or_area_that_cannot_be_is_one_clear_error(row, tmp_path):
    """Guards a crash: the bounds of effects are made before the numbers of the file are judged."""
    name = row[0]
    lines = (ROOT / "data" / "kites" / "development.yaml").read_text().splitlines()
    lines = [f"  {row}" if line.startswith(f"  {name}:") else line for line in lines]
    lines = [f"{line[:-1]}, tether_weight, wind_offset]" if line.startswith("effects:") else line for line in lines]
    (tmp_path / "kite.yaml").write_text("\n".join(lines) + "\n")
    with pytest.raises(BadInput, match=f"parameters.{name}.value"):
        read_kite(tmp_path / "kite.yaml")


def test_a_similar_kite_keeps_its_numbers_without_units():
    longer = similar(DEVELOPMENT, 4.0)
    assert isinstance(longer.table(), ParameterTable)
    for name, row in DEVELOPMENT.parameters.items():
        new = longer.parameters[name]
        assert new.free == row.free and new.unit == row.unit
        if row.unit == "-":
            assert new == row
    assert (longer.parameters["m"].value, longer.parameters["S"].value, longer.parameters["Jx"].value) == (3200.0, 48.0, 43.4 * 1024)
