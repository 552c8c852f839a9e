"""Rules of the ledger's tables. No run is needed."""

from collections import Counter

import pytest
from workbench.plants.cd_drive.claims.assignments import variables
from workbench.plants.cd_drive.claims.chapters import items
from workbench.plants.cd_drive.claims.values import VALUES

EVERY = list(items())
LONGEST_SAYING, LONGEST_FINDING = 140, 260


def test_every_item_can_be_judged():
    """By a number that decides, or by what stands in its way."""
    for _, item in EVERY:
        decided = any(number.decides for number in item.numbers)
        said = [item.built_in, item.tried, item.needs]
        assert decided or any(said), item.says
        assert sum(map(bool, said)) <= 1, item.says
        assert not (item.needs and decided), item.says


def test_texts_are_short():
    for _, item in EVERY:
        assert 0 < len(item.says) <= LONGEST_SAYING, item.says
        for text in (item.found, item.reading, item.built_in, item.tried, item.needs):
            assert len(text) <= LONGEST_FINDING, text


def test_texts_fit_into_a_table():
    """No bar, which would end a cell; no full stop, as more follows."""
    for _, item in EVERY:
        texts = [item.place, item.says, item.found, item.reading, item.built_in, item.tried]
        texts += [item.needs, item.shown, *(number.what for number in item.numbers)]
        assert not any("|" in text or text.endswith(".") for text in texts), item.says


def test_limits_are_in_order():
    for _, item in EVERY:
        for number in item.numbers:
            assert number.low <= number.high, number.what


def test_no_statement_stands_twice():
    twice = [key for key, n in Counter((i.place, i.says) for _, i in EVERY).items() if n > 1]
    assert twice == []


def test_numbers_of_an_item_have_names_of_their_own():
    for _, item in EVERY:
        names = [(number.what, number.run) for number in item.numbers]
        assert len(set(names)) == len(names), item.says


def test_what_is_printed_lies_within_the_limits():
    """The limits are those of the statement: what it prints is true of itself."""
    for _, item in EVERY:
        for number in item.numbers:
            if number.printed is not None and number.decides and not item.reading:
                assert number.low <= number.printed * (1 + 1e-12), number.what
                assert number.printed * (1 - 1e-12) <= number.high, number.what


@pytest.mark.parametrize("name", sorted(VALUES))
def test_every_way_to_compute_a_number_is_used(name):
    used = {number.quantity.name for _, item in EVERY for number in item.numbers}
    assert name in used or name in {"derived", "arm", "lost_light", "tracks_in_reach"}


def test_variables_of_arguments_are_known():
    for _, item in EVERY:
        for number in item.numbers:
            assert set(number.quantity.variables) <= set(variables()), number.what


def test_every_variable_decides_something():
    used = {
        name
        for _, item in EVERY
        for number in item.numbers
        for name, one in variables().items()
        if one.touching(number.run) or name in number.quantity.variables
    }
    assert used == set(variables())
    assert all(len(one.values) > 1 for one in variables().values())
