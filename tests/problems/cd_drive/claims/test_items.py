"""Rules of the ledger: what its items say, print and limit goes together. No run is needed."""

import math
from collections import Counter

from tables import each
from workbench.plants.cd_drive.claims.items import Number, Verdict, at_least, at_most, near
from workbench.plants.cd_drive.claims.problem import items

EVERY = list(items())
LONGEST_SAYING, LONGEST_FINDING = 140, 220


def of(*verdicts):
    """One test of all items of some verdicts."""
    chosen = [(chapter, item) for chapter, item in EVERY if item.verdict in verdicts]
    said = [f"{chapter}: {item.place}: {item.says}" for chapter, item in chosen]
    return each("item", [item for _, item in chosen], ids=said)


@of(Verdict.REPRODUCED, Verdict.READING)
def test_what_is_reproduced_agrees_with_what_is_printed(item):
    assert item.numbers
    assert all(number.beyond(number.printed) <= 0 for number in item.numbers if _prints(number))
    assert all(_is_limited(number) for number in item.numbers)


@of(Verdict.REFUTED)
def test_what_is_refuted_excludes_what_is_printed(item):
    assert all(_is_limited(number) for number in item.numbers)
    printed = [number for number in item.numbers if _prints(number)]
    assert item.numbers
    assert not printed or any(number.beyond(number.printed) > 0 for number in printed)


@of(Verdict.READING)
def test_a_reading_is_stated(item):
    assert item.found


@of(Verdict.NOT_COMPUTABLE, Verdict.OPEN)
def test_without_numbers_there_are_words(item):
    assert not item.numbers and item.found and not item.shown


@of(*Verdict)
def test_texts_are_short(item):
    assert 0 < len(item.says) <= LONGEST_SAYING
    assert len(item.found) <= LONGEST_FINDING


@of(*Verdict)
def test_texts_fit_into_a_table(item):
    """No bar, which would end a cell; no full stop, as more follows."""
    texts = [item.place, item.says, item.found, item.shown, *(n.what for n in item.numbers)]
    assert not any("|" in text or text.endswith(".") for text in texts)


@of(*Verdict)
def test_limits_are_in_order(item):
    assert all(number.low <= number.high for number in item.numbers)


def test_no_statement_stands_twice():
    twice = [key for key, n in Counter((i.place, i.says) for _, i in EVERY).items() if n > 1]
    assert twice == []


def test_numbers_of_an_item_have_names_of_their_own():
    for _, item in EVERY:
        names = [(number.what, number.run) for number in item.numbers]
        assert len(set(names)) == len(names), item.says


def test_how_far_a_number_is_beyond_its_limits():
    number = near("it", "a/run", "metric", 10.0, 0.1)
    assert (number.low, number.high, number.printed) == (9.0, 11.0, 10.0)
    assert number.beyond(10.9) < 0 < number.beyond(11.1)
    assert number.beyond(8.9) > 0 and number.beyond(math.nan) == math.inf
    assert at_most("it", "a/run", "metric", 2.0).beyond(1.9) < 0
    assert at_least("it", "a/run", "metric", 2.0).beyond(1.9) > 0


def _prints(number: Number) -> bool:
    return number.printed is not None


def _is_limited(number: Number) -> bool:
    return math.isfinite(number.low) or math.isfinite(number.high)
