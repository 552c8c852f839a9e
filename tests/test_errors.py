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


PROBLEMS = ["cd/focus/stadiums", "cd/focus/stadium-cover", "cd/focus/strategies", "cd/optics"]
PROBLEMS += ["cd/radial/stadiums", "bench/mu"]


@pytest.mark.parametrize(
    ("name", "hint"),
    [
        ("cd/focus/stadium", "did you mean cd/focus/stadiums?"),
        ("focus/stadiums", "did you mean cd/focus/stadiums?"),
        ("stadiums", "did you mean cd/focus/stadiums or cd/radial/stadiums?"),
        ("xyz", f"known: {', '.join(sorted(PROBLEMS))}"),
    ],
)
def test_only_similar_names_are_suggested(name, hint):
    said = str(errors.UnknownNameError("problem", name, PROBLEMS))
    assert said == f"no problem is called {name!r}; {hint}"


def test_long_lists_of_names_are_cut():
    said = str(errors.UnknownNameError("problem", "q", [f"toy/{k:02d}" for k in range(30)]))
    assert said.endswith("toy/18, toy/19, and 10 more")
