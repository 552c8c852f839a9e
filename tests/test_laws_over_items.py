"""A law over many items tells all that break it, in one failure."""

import pytest
from tables import each, hold

SQUARES = {"two": (2, 4), "three": (3, 9), "five": (5, 24), "six": (6, 35)}


def squared(root, square):
    assert root**2 == square


def test_all_that_break_a_law_are_told_and_the_first_is_the_cause():
    with pytest.raises(AssertionError) as told:
        hold(squared, {k: {"root": a, "square": b} for k, (a, b) in SQUARES.items()})
    first, *rows = str(told.value).splitlines()
    assert first == "2 of 4 break it"
    assert [row.split()[:2] for row in rows] == [
        ["five", "AssertionError:"],
        ["six", "AssertionError:"],
    ]
    assert "(5 ** 2) == 24" in str(told.value.__cause__)


def test_what_should_have_been_refused_is_told_too():
    def refused(value):
        with pytest.raises(ValueError):
            float(value)

    hold(refused, {"word": {"value": "a"}})
    with pytest.raises(AssertionError, match=r"1 of 2 break it\nnumber +Failed: DID NOT RAISE"):
        hold(refused, {"word": {"value": "a"}, "number": {"value": "1"}})


def test_a_law_over_nothing_is_no_law():
    with pytest.raises(AssertionError, match="nothing"):
        hold(squared, {})


@pytest.fixture
def two():
    return 2


@each(("root", "square"), [(2, 4), (3, 9)])
@each("sign", [1, -1], ids=str)
def test_items_share_the_fixtures_of_their_test(root, square, sign, two):
    """The signature that pytest sees has the fixtures alone."""
    assert (sign * root) ** two == square


def test_every_value_is_tried_by_name():
    law = each("root", [2, 3, 4], ids=["two", "three", "four"])(lambda root: squared(root, 9))
    with pytest.raises(AssertionError, match=r"2 of 3 break it\n0 two .*\n2 four"):
        law()
