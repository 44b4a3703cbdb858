"""Strict configuration: refused values, and the one line of the error."""

import dataclasses
from typing import Any, Literal

import pytest

from sidm.config import ConfigError, config, from_mapping, to_mapping, unknown_name


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


def test_values_and_defaults():
    cart = Cart(length=2)
    assert cart.length == 2.0 and isinstance(cart.length, float)
    assert cart.wheel.spokes == 3


def test_frozen_and_keyword_only():
    cart = Cart(length=1.0)
    with pytest.raises(dataclasses.FrozenInstanceError):
        cart.length = 2.0
    with pytest.raises(TypeError):
        Cart(1.0)


def test_unknown_name_gives_the_nearest():
    with pytest.raises(
        ConfigError, match="unknown name 'lenght' in Cart; did you mean 'length'?"
    ):
        Cart(lenght=1.0)


def test_the_message_is_one_line_whatever_was_typed():
    assert "\n" not in str(unknown_name("a\nb", ["radius"], "Wheel"))


def test_unknown_name_without_a_near_one_lists_the_known():
    assert "known: radius, spokes" in str(
        unknown_name("qqq", ["radius", "spokes"], "Wheel")
    )


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("length", "2"),
        ("length", True),
        ("wheels", (1, 2.5)),
        ("wheels", 3),
        ("pair", (1,)),
        ("pair", ("a", 1.0)),
        ("name", 4),
        ("covered", 1),
        ("wheel", {"radius": 1.0}),
    ],
)
def test_wrong_type_names_the_field(field, value):
    with pytest.raises(ConfigError, match=f"Cart.{field}") as caught:
        Cart(**({"length": 1.0} | {field: value}))
    assert "\n" not in str(caught.value)


def test_wrong_choice_gives_the_nearest():
    with pytest.raises(ConfigError, match="did you mean 'green'?"):
        Cart(length=1.0, colour="gren")


def test_an_integer_serves_as_float_and_a_list_as_tuple():
    cart = Cart(length=1, wheels=[4, 5, 6], pair=[1, 2])
    assert cart.wheels == (4, 5, 6) and cart.pair == (1, 2.0)
    with pytest.raises(ConfigError):
        Wheel(spokes=3.0)


def test_equal_values_are_equal_and_hash_alike():
    assert Cart(length=1) == Cart(length=1.0)
    assert hash(Cart(length=1)) == hash(Cart(length=1.0))


def test_from_mapping_nests():
    cart = from_mapping(Cart, {"length": 2, "wheel": {"spokes": 5}, "wheels": [7]})
    assert cart == Cart(length=2.0, wheel=Wheel(spokes=5), wheels=(7,))
    assert from_mapping(Cart, to_mapping(cart)) == cart


@pytest.mark.parametrize("spare", [None, Wheel(spokes=4)])
def test_to_mapping_is_asdict(spare):
    cart = Cart(length=2.0, wheels=(7, 8), pair=(1, 2.0), extra=("a", 1.0), spare=spare)
    assert repr(to_mapping(cart)) == repr(dataclasses.asdict(cart))
    assert from_mapping(Cart, to_mapping(cart)) == cart


def test_from_mapping_names_the_inner_class():
    with pytest.raises(ConfigError, match="in Wheel; did you mean 'spokes'"):
        from_mapping(Cart, {"length": 1, "wheel": {"spoke": 5}})
