"""Every error in the code that judges is noticed by the test that is named beside it."""

import pytest
from edited import edits, noticed

ROOMS = edits()
ALL = [edit for room in ROOMS.values() for edit in room]
QUICK = {room[0] for room in ROOMS.values()}
"""The first of each room runs with the quick tests; `make mutants` runs all."""


@pytest.mark.cases(1)
@pytest.mark.parametrize(
    "edit",
    [pytest.param(one, marks=() if one in QUICK else pytest.mark.slow) for one in ALL],
    ids=str,
)
def test_an_error_is_noticed(edit):
    killed, said = noticed(edit)
    assert killed, said


def test_there_are_enough_errors_and_each_has_a_name_and_a_place_of_its_own():
    names = [str(edit) for edit in ALL]
    assert len(set(names)) == len(names) >= 80
    lost = [str(edit) for edit in ALL if edit.text.count(edit.old) != 1]
    assert not lost, f"the old text stands there no more, or several times: {lost}"


@pytest.mark.cases(0)
def test_an_error_that_changes_nothing_is_not_noticed():
    edit = ALL[0]
    same = type(edit)(edit.name, edit.module, edit.old, edit.old, edit.test)
    killed, said = noticed(same)
    assert not killed and "passed" in said
