"""Records of options: checks convert and refuse, documentation and order follow from the records' bases."""

from __future__ import annotations

from dataclasses import FrozenInstanceError, dataclass, field
from typing import Any

import pytest

from sarcl.base.options import Options, described, option, or_none

CHECKED = []  # (name, value) in the order of the checks


def doubled(name: str, value: Any) -> float:
    CHECKED.append((name, value))
    if value < 0:
        raise ValueError(f"{name} is {value}; wanted 0 or more")
    return 2.0 * value


def upper(name: str, value: Any) -> str:
    return str(value).upper()


@dataclass(frozen=True, eq=False, kw_only=True)
class Base(Options):
    """Two options with checks, and one without."""

    height: float = option(1, "height, m", doubled)
    width: float | None = option(None, "width, m", or_none(doubled))
    device: str | None = option(
        None,
        """where it runs;
        None: anywhere""",
        in_files=False,
    )


@dataclass(frozen=True, eq=False, kw_only=True)
class Derived(Base):
    """Options of its own, another default of an inherited one, and other words for another."""

    colour: str = option("red", "its colour")
    height: float = option(3)
    device: str | None = option("here", "where it runs, by name", upper)
    depth: float = option(4, "depth, m", doubled)


@pytest.fixture(autouse=True)
def nothing_checked():
    CHECKED.clear()


def test_checks_convert_values_and_defaults_and_know_their_names():
    assert (Base().height, Base(height=5).height) == (2.0, 10.0)
    assert CHECKED == [("height", 1), ("height", 5)]
    with pytest.raises(ValueError, match="width is -1; wanted 0 or more"):
        Base(width=-1)


def test_none_is_what_it_is_where_it_may_be_given():
    assert Base().width is None and Base(width=2).width == 4.0
    with pytest.raises(TypeError):
        Base(height=None)


def test_every_option_is_checked_once_in_the_order_of_the_signature():
    Derived(width=7)
    assert CHECKED == [("depth", 4), ("height", 3), ("width", 7)]


def test_own_options_come_first_and_another_default_leaves_an_option_in_its_place():
    assert list(described(Base)) == ["height", "width", "device"]
    assert list(described(Derived)) == ["colour", "device", "depth", "height", "width"]


def test_documentation_and_check_are_inherited_with_a_default_alone_and_replaced_with_words():
    derived, base = described(Derived), described(Base)
    own, told = derived["height"]
    assert own.default == 3 and own.type == "float" and told is base["height"][1]
    assert derived["width"][1] is base["width"][1]
    assert derived["device"][1].doc == "where it runs, by name" and derived["device"][1].check is upper
    assert base["device"][1].doc == "where it runs;\nNone: anywhere" and base["device"][1].check is None


def test_other_words_keep_the_check_of_the_inherited_option():
    @dataclass(frozen=True, eq=False, kw_only=True)
    class Reworded(Base):
        """Other words for an inherited option."""

        height: float = option(2, "height of a wall, m")

    assert described(Reworded)["height"][1].doc == "height of a wall, m" and Reworded(height=5).height == 10.0
    with pytest.raises(ValueError, match="height is -1"):
        Reworded(height=-1)


def test_what_is_for_files_is_said_with_the_words():
    assert [name for name, (_, told) in described(Base).items() if not told.in_files] == ["device"]
    assert described(Derived)["device"][1].in_files


def test_an_option_without_documentation_is_refused():
    @dataclass(frozen=True, eq=False, kw_only=True)
    class Silent(Base):
        mute: int = option(0)

    @dataclass(frozen=True, eq=False, kw_only=True)
    class Plain(Base):
        bare: int = field(default=0)

    for record, name in ((Silent, "mute"), (Plain, "bare")):
        with pytest.raises(TypeError, match=f"{record.__name__}.{name} has no documentation"):
            described(record)


def test_options_are_given_by_name_and_do_not_change():
    with pytest.raises(TypeError):
        Base(1.0)
    with pytest.raises(FrozenInstanceError):
        Base().height = 3.0
