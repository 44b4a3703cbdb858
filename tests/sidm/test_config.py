"""Strict configuration: refused values, and the one line of the error."""

import dataclasses
from typing import Any, Literal

import pytest

from sidm.config import (
    ConfigError,
    completed,
    config,
    from_mapping,
    to_mapping,
    unknown_name,
)


@config
class Wheel:
    """A part."""

    radius: float = 0.1
    spokes: int = 3


@config
class Cart:
    """All kinds of fields."""

    length: float
    wheels: tuple[int, ...] = (1, 2)
    pair: tuple[int, float] = (1, 2.0)
    colour: Literal["red", "green"] = "red"
    name: str | None = None
    covered: bool = False
    wheel: Wheel = Wheel()
    extra: Any = None
    spare: Wheel | None = None


def test_stored_values_are_completed_as_an_object_would_be():
    spare = {"length": 2.0, "spare": {"spokes": 5}}
    for values in (spare, {"length": 2.0, "wheel": {"radius": 0.2}}):
        assert completed(Cart, values) == to_mapping(from_mapping(Cart, values))
    with pytest.raises(ConfigError, match="Cart.length is missing"):
        completed(Cart, {})
    with pytest.raises(ConfigError, match="'spoke' in Wheel; did you mean 'spokes'?"):
        completed(Cart, {"length": 2.0, "wheel": {"spoke": 5}})


def test_an_unknown_name_gives_the_nearest_in_one_line():
    with pytest.raises(ConfigError, match="'lenght' in Cart; did you mean 'length'?"):
        Cart(lenght=1.0)
    with pytest.raises(ConfigError, match="in Wheel; did you mean 'spokes'"):
        from_mapping(Cart, {"length": 1, "wheel": {"spoke": 5}})
    unlike = str(unknown_name("a\nb", ["radius", "spokes"], "Wheel"))
    assert "known: radius, spokes" in unlike and "\n" not in unlike


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("length", "2"),
        ("length", True),
        ("wheels", (1, 2.5)),
        ("wheels", 3),
        ("pair", (1,)),
        ("colour", "gren"),
        ("name", 4),
        ("covered", 1),
        ("wheel", {"radius": 1.0}),
    ],
)
def test_a_wrong_value_names_the_field(field, value):
    with pytest.raises(ConfigError, match=f"Cart.{field}") as caught:
        Cart(**({"length": 1.0} | {field: value}))
    assert "\n" not in str(caught.value)


def test_an_integer_serves_as_float_and_a_list_as_tuple():
    cart = Cart(length=1, wheels=[4, 5, 6], pair=[1, 2])
    assert cart == Cart(length=1.0, wheels=(4, 5, 6), pair=(1, 2.0))
    assert hash(cart) == hash(Cart(length=1.0, wheels=(4, 5, 6), pair=(1, 2.0)))
    assert isinstance(cart.length, float)
    with pytest.raises(ConfigError):
        Wheel(spokes=3.0)


@pytest.mark.parametrize("spare", [None, Wheel(spokes=4)])
def test_a_mapping_gives_the_same_configuration_back(spare):
    cart = Cart(length=2.0, wheels=(7, 8), pair=(1, 2.0), extra=("a", 1.0), spare=spare)
    assert repr(to_mapping(cart)) == repr(dataclasses.asdict(cart))
    assert from_mapping(Cart, to_mapping(cart)) == cart
