"""What `awescli.__all__` names is documented whole: purpose, every argument and field, the errors, the equations behind it."""

import inspect
from dataclasses import fields, is_dataclass

import pytest

import awescli

PUBLIC = {name: getattr(awescli, name) for name in awescli.__all__}
FUNCTIONS = [n for n, thing in PUBLIC.items() if inspect.isfunction(thing)]
CLASSES = [n for n, thing in PUBLIC.items() if inspect.isclass(thing)]


@pytest.mark.parametrize("name", FUNCTIONS)
def test_a_function_says_what_it_takes_gives_and_raises(name):
    function, said = PUBLIC[name], inspect.getdoc(PUBLIC[name])
    signature = inspect.signature(function)
    assert "Raises BadInput" in said and signature.return_annotation is not inspect.Signature.empty
    for p in signature.parameters.values():
        assert p.annotation is not inspect.Parameter.empty, p.name
        assert f"{p.name}:" in said or f"{p.name}, " in said or name.startswith("read_"), p.name


@pytest.mark.parametrize("name", CLASSES)
def test_a_class_names_its_fields_and_every_member_is_documented(name):
    cls = PUBLIC[name]
    said = " ".join(inspect.getdoc(base) or "" for base in cls.__mro__ if base.__module__.startswith("awescli"))
    if is_dataclass(cls):
        for f in fields(cls):
            assert not f.repr or f"{f.name}:" in said or f"{f.name}," in said, f.name
    for base in cls.__mro__:
        for member, value in vars(base).items():
            if base.__module__.startswith("awescli") and not member.startswith("_"):
                function = getattr(value, "fget", None) or getattr(value, "func", None) or getattr(value, "__func__", value)
                assert not callable(function) or inspect.getdoc(function), f"{base.__name__}.{member}"
                if inspect.isfunction(function):
                    assert inspect.signature(function).return_annotation is not inspect.Signature.empty, f"{base.__name__}.{member}"
