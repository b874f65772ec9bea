"""Kite files: read back what was written, refuse what is wrong."""

import pytest
from kites import DEVELOPMENT, every_key, sizes

from awescli.notation.errors import BadInput, BadInputs
from awescli.physics.declaration import kite_text, read_kite
from awescli.physics.kite import REQUIRED, Kite, check_declaration


def WHERE(*loc):  # noqa: N802
    return "kite.yaml: " + ".".join(map(str, loc))


def test_a_kite_file_reads_back_to_what_was_written(tmp_path):
    """Guards the dump: every row, bound, source and block survives."""
    (tmp_path / "kite.yaml").write_text(kite_text(DEVELOPMENT))
    assert read_kite(tmp_path / "kite.yaml") == DEVELOPMENT


@pytest.mark.parametrize("key", every_key())
def test_a_declared_effect_survives_the_file(key, tmp_path):
    """Guards Kite.declare and the file: values, freedom and order of an added effect (targets with `:` and `*` included)."""
    kite = Kite(DEVELOPMENT, extra=(key,))
    free = tuple(sizes(key))
    declaration = kite.declare((key,), free=free, table=kite.parameters.with_values(sizes(key)))
    (tmp_path / "kite.yaml").write_text(kite_text(declaration))
    read = read_kite(tmp_path / "kite.yaml")
    assert read == declaration and read.effects == ("gravity", "aerodynamics", key, "tether")
    assert {n: read.parameters[n].value for n in free} == sizes(key) and all(read.parameters[n].free for n in free)
    again = Kite(read)
    assert [e.key for e in again.effects] == [e.key for e in kite.effects]
    assert again.parameters["Jx"] == kite.parameters["Jx"]


def test_the_tether_stands_last_among_the_loads():
    """Guards the order: the line must see every other load (docs/equations.md (12)), wherever a candidate is named."""
    kite = Kite(DEVELOPMENT, extra=("tether_weight", "custom_term:f_z*alpha"))
    assert [e.key for e in kite.effects][-1] == "tether"


def test_a_kite_is_the_same_in_whatever_order_its_effects_were_found():
    """Guards the order of added effects: one program serves a set of them, and the kite file has the kite that was traced."""
    found = ("custom_term:f_z*alpha", "actuator_lag:rudder", "wind_shear", "actuator_lag:elevator")
    one, other = (Kite(DEVELOPMENT, extra=keys) for keys in (found, found[::-1]))
    assert one.parameter_names == other.parameter_names and one.x_names == other.x_names
    again = Kite(one.declare(found))
    assert [e.key for e in again.effects] == [e.key for e in one.effects] == [e.key for e in other.effects]


def broken(**update):
    return DEVELOPMENT.model_copy(update=update)


def test_wrong_kites_are_refused_with_place_and_cure():
    """Guards what no schema can see: unknown effects, targets, coefficients, monomials and missing parameters, all at once."""
    for effects, message in (
        (("gravity", "tethr"), "unknown effect 'tethr'"), (("actuator_lag:ruder",), "cannot act on 'ruder'"),
        (("sideslip_drag:rudder",), "cannot act on"), (("custom_term:m_y*alfa",), "cannot act on"),
    ):  # fmt: skip
        with pytest.raises(BadInput, match=message):
            check_declaration(broken(effects=effects), WHERE)
    rows = {n: r for n, r in DEVELOPMENT.parameters.items() if n not in ("Jxz", "CLa")}
    with pytest.raises(BadInputs) as error:
        check_declaration(broken(parameters=rows), WHERE)
    assert "'Jxz'" in str(error.value) and "'CLa'" in str(error.value) and "kite.yaml" in str(error.value)
    for terms, message in (({"CZ": {"1": "CL0"}}, "unknown coefficient"), ({"CL": {"alfa": "CL0"}}, "cannot read")):
        wrong = DEVELOPMENT.aerodynamics.model_copy(update={"terms": terms})
        with pytest.raises(BadInput, match=message):
            check_declaration(broken(aerodynamics=wrong), WHERE)


def test_every_required_parameter_is_required():
    """Guards against a parameter that the physics reads and the check forgets."""
    for name in REQUIRED:
        rows = {n: r for n, r in DEVELOPMENT.parameters.items() if n != name}
        with pytest.raises(BadInput, match=f"'{name}'"):
            check_declaration(broken(parameters=rows), WHERE)


def test_a_value_outside_its_bounds_is_refused_on_reading(tmp_path):
    """Guards bounds in files: a swapped pair or a slipped digit must not reach an optimiser."""
    (tmp_path / "kite.yaml").write_text(kite_text(DEVELOPMENT).replace("Jx: {value: 43.4,", "Jx: {value: 434.0,"))
    with pytest.raises(BadInput, match="outside its bounds"):
        read_kite(tmp_path / "kite.yaml")


def test_declaring_the_same_kite_changes_nothing():
    """Guards idempotence: what identify writes back without effects is the same file with new values."""
    kite = Kite(DEVELOPMENT, extra=("sideslip_drag",))
    assert kite.declare(()) == DEVELOPMENT
    moved = kite.declare((), table=kite.parameters.with_values({"Jx": 50.0}))
    assert moved.parameters["Jx"].value == 50.0 and "gust_n.even" not in moved.parameters and "sideslip_drag.k" not in moved.parameters
