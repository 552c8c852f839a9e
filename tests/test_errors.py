"""Errors reach whoever waits for another process whole."""

import copy
import pickle

import pytest

from workbench import errors

EACH = [
    errors.UnknownNameError("method", "dq", ["dk", "fixed"]),
    errors.ContradictionError("mu at 1 rad/s", 2.0, "it is attained", 1.0, "multipliers prove it"),
    *(
        kind("what happened")
        for kind in errors.WorkbenchError.__subclasses__()
        if kind not in (errors.UnknownNameError, errors.ContradictionError)
    ),
]


@pytest.mark.parametrize("error", EACH, ids=lambda error: type(error).__name__)
@pytest.mark.parametrize("carried", [copy.copy, lambda error: pickle.loads(pickle.dumps(error))])
def test_an_error_survives_its_way(error, carried):
    again = carried(error)
    assert type(again) is type(error)
    assert str(again) == str(error)
    assert vars(again) == vars(error)
