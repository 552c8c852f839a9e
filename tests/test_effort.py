"""Second opinions try more within `deeper`, and as much as before after it, whatever happens."""

import pytest

from workbench.certificate import deep_checks
from workbench.executor.effort import DEEPER, deeper, tries
from workbench.mu import peak
from workbench.structure import Complex, Structure
from workbench.systems.realisation import realisation


def test_tries_are_multiplied_within():
    assert tries(7) == 7
    with deeper():
        assert tries(7) == 7 * DEEPER
    assert tries(7) == 7


def test_an_error_ends_it_too():
    with pytest.raises(ArithmeticError), deeper():
        raise ArithmeticError
    assert tries(1) == 1


def test_checks_say_how_much_was_tried():
    answer = peak(realisation(([[-1.0]], [[1.0]], [[1.0]], [[0.0]]), 0.0), Structure([Complex(1)]))
    checker = answer._checked_by[0]
    usual = {check.name: check.over for check in answer.certificate.checks if check.opinion}
    deep = {check.name: check.over for check in deep_checks(checker, answer)}
    assert usual.keys() == deep.keys()
    assert usual["sampled loops are stable"] == "for 6 loops"
    assert deep["sampled loops are stable"] == "for 60 loops"
