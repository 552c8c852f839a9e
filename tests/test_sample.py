"""`make test` takes a few cases of a test with parameters; another turn takes others."""

import pytest
from lanes import keep_sample, sample

MANY = range(11)


@pytest.mark.parametrize("most", [1, 2, 4])
def test_in_turn_each_case_is_taken(most):
    turns = [sample(MANY, turn, most) for turn in range(40, 40 + len(MANY))]
    assert {case for cases in turns for case in cases} == {*MANY}
    assert {len(cases) for cases in turns} == {most}
    assert most == 1 or all(cases[0] == 0 for cases in turns)
    assert all(cases == sorted(cases) for cases in turns)


def test_few_cases_are_all_taken():
    assert sample(range(4), 7, 4) == [0, 1, 2, 3]


class Case:
    """An item of pytest, as far as a sample asks it."""

    def __init__(self, test, case, *marks):
        self.name, self.marks = f"{test}[{case}]", marks
        self.nodeid = f"test_file.py::{self.name}"

    def get_closest_marker(self, name):
        return next((mark.mark for mark in self.marks if mark.name == name), None)


def test_a_mark_says_how_many_cases_are_taken():
    every, one, none = map(pytest.mark.cases, (None, 1, 0))
    items = [Case("test_many", f"a[{k}]") for k in range(9)]
    items += [Case("test_every", k, every) for k in range(6)]
    items += [Case("test_one", k, one) for k in range(3)]
    items += [Case("test_none", k, none) for k in range(2)]
    whole = list(items)
    left_out = keep_sample(items, turn=1)
    assert [item.name for item in items if "many" in item.name] == [
        f"test_many[a[{k}]]" for k in (0, 3, 4)
    ]
    assert [item.name for item in items[3:]] == [
        *(f"test_every[{k}]" for k in range(6)),
        "test_one[1]",
    ]
    assert sorted(map(id, items + left_out)) == sorted(map(id, whole))
