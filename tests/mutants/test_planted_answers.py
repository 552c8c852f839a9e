"""Every planted wrong answer is refused by two checks at least: one of them may lie."""

import numpy as np
import pytest
from lanes import thinned
from planted_answers import PLANTED
from tight_problems import solved

ANSWERS = [(name, label) for name, wrong in PLANTED.items() for label in wrong]
EVERY = 4
"""One wrong answer in so many is planted with the quick tests; `make mutants` plants all."""


def refusals(program, answer):
    """Names of the checks that refuse an answer; a part that cannot be computed refuses it too."""
    found = []
    for part in ("checks", "second_opinion"):
        try:
            with np.errstate(all="ignore"):
                given = (answer, 1e-6) if part == "checks" else (answer,)
                found += [check.name for check in getattr(program, part)(*given) if not check.holds]
        except Exception as error:
            found.append(f"{part}: {type(error).__name__}")
    return found


@pytest.mark.parametrize("name", PLANTED)
def test_the_right_answer_is_accepted(name):
    program, answer = solved(name)
    assert refusals(program, answer) == []


@pytest.mark.parametrize("planted", thinned(ANSWERS, EVERY), ids=":".join)
def test_a_wrong_answer_is_refused_though_one_check_lies(planted):
    name, label = planted
    program, answer = solved(name)
    refused = refusals(program, PLANTED[name][label](answer))
    assert len(refused) >= 2, refused
