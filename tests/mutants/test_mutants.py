"""Every mutant of what computes makes the certificate of a small, tight problem fail."""

import numpy as np
import pytest
from lanes import thinned
from mutants import MUTANTS, applied
from tight_problems import PROGRAMS, QUICK_METHODS, solved

import workbench as wb
from workbench.certify import norms

EVERY = 5
"""One mutant in so many runs with the quick tests; `make mutants` runs all."""


@pytest.mark.parametrize("mutant", thinned(MUTANTS, EVERY), ids=lambda mutant: mutant.name)
def test_a_mutant_is_killed(mutant, monkeypatch):
    solved(mutant.problem)  # which the original solves
    applied(mutant, monkeypatch)
    monkeypatch.setattr(norms, "_norms", {})  # those that are kept are the original's
    with np.errstate(all="ignore"):
        try:
            solution = wb.solve(
                PROGRAMS[mutant.problem](), method=QUICK_METHODS.get(mutant.problem)
            )
        except Exception:
            return  # refused with an error
    found = solution.certificate
    assert found is None or not (found.holds if mutant.optimum else found.valid), found


def test_there_are_enough_mutants_and_each_has_a_name_of_its_own():
    names = [mutant.name for mutant in MUTANTS]
    assert len(set(names)) == len(names) >= 60
