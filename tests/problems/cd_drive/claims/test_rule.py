"""The rule by which verdicts follow, on items and numbers made for it."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st
from workbench.plants.cd_drive.claims.assignments import assignments, natural, variables
from workbench.plants.cd_drive.claims.items import Found, Item, Number, Quantity
from workbench.plants.cd_drive.claims.readings import together
from workbench.plants.cd_drive.claims.verdicts import Verdict, all_of, depends_on, verdict


def exactly(value):
    """A number without chance."""
    return Found(value, value, value)


def of_sets(**values):
    """An item that depends on `sets` alone, and what is found under its two values."""
    number = Number("it", "mass-spring/analysis", Quantity("f", {"sets": "$sets"}), high=1.0)
    return (number,), lambda number, reading: values.get(reading["sets"])


def item(numbers, **told):
    return Item("Section 1", "it is so", numbers, **told)


@pytest.mark.parametrize(
    ("fitted", "raw", "expected"),
    [
        (0.5, 0.5, Verdict.ALL),
        (0.5, 2.0, Verdict.NATURAL),
        (2.0, 0.5, Verdict.STATED),
        (2.0, 2.0, Verdict.REFUTED),
        (0.5, None, Verdict.NATURAL),
        (None, 0.5, Verdict.STATED),
        (2.0, None, Verdict.OPEN),
        (None, None, Verdict.OPEN),
    ],
)
def test_the_verdict_follows_from_the_numbers(fitted, raw, expected):
    told = {"fitted": fitted, "raw": raw}
    numbers, found = of_sets(**{n: None if v is None else exactly(v) for n, v in told.items()})
    assert verdict(item(numbers), found) is expected


def test_the_order_of_the_rule():
    numbers, found = of_sets(fitted=exactly(2.0), raw=exactly(2.0))
    assert verdict(item(numbers, measured=True), found) is Verdict.NOT_EXPLAINED
    assert verdict(item(numbers, measured=True, tried="it"), found) is Verdict.NOT_COMPUTABLE
    told = item(numbers, measured=True, tried="it", built_in="so")
    assert verdict(told, found) is Verdict.BUILT_IN


def test_words_that_are_taken_in_a_stated_way_bound_the_verdict():
    numbers, found = of_sets(fitted=exactly(0.5), raw=exactly(0.5))
    assert verdict(item(numbers, reading="so"), found) is Verdict.STATED
    numbers, found = of_sets(fitted=exactly(2.0), raw=exactly(2.0))
    assert verdict(item(numbers, reading="so"), found) is Verdict.OPEN


def test_what_is_simulated_is_refuted_outside_its_interval_only():
    number = Number("it", "run", Quantity("f"), low=1.0, high=2.0)
    assert number.judge(Found(1.5, 0.0, 3.0)) is True
    assert number.judge(Found(2.5, 1.9, 3.1)) is None
    assert number.judge(Found(2.5, 2.1, 2.9)) is False
    assert number.judge(Found(2.5, -math.inf, math.inf)) is None
    told = Number("it", "run", Quantity("f"), low=1.0, high=2.0, exact=True)
    assert told.judge(Found(2.5, -math.inf, math.inf)) is False


@given(st.lists(st.sampled_from([True, False, None])))
def test_one_false_number_makes_an_item_false(judged):
    told = all_of(judged)
    assert (told is False) == (False in judged)
    assert (told is True) == (bool(judged) and set(judged) == {True})


def test_a_number_without_limits_decides_nothing():
    aside = Number("beside", "mass-spring/analysis", Quantity("f", {"gain": "$gain"}))
    numbers, found = of_sets(fitted=exactly(0.5), raw=exactly(0.5))
    told = item((*numbers, aside))
    assert depends_on(told) == ("sets",)
    assert verdict(told, found) is Verdict.ALL


def test_the_reading_that_makes_most_items_true():
    numbers, found = of_sets(fitted=exactly(2.0), raw=exactly(0.5))
    best = together([item(numbers)], found)[0]
    assert best.reading == natural() | {"sets": "raw"}
    assert (best.true, best.false) == (1, 0)


def test_the_natural_reading_stands_first():
    assert next(assignments(variables())) == natural()
