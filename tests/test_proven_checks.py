"""Certificates say which of their numbers are proven, and which are checked in doubles."""

import json

import numpy as np
import pytest

import workbench as wb
from workbench.certificate import Certificate, Check, distinct_texts
from workbench.geometry import SmallestCircle
from workbench.mu import peak
from workbench.structure import Complex, Structure
from workbench.systems.realisation import realisation

LAG = realisation((-np.eye(1), np.eye(1), np.eye(1), np.zeros((1, 1))), 0.0)


def test_a_peak_is_proven_and_a_circle_is_checked():
    proven = {
        check.name: check.proven for check in peak(LAG, Structure([Complex(1)])).certificate.checks
    }
    assert proven["peak"] and proven["lower"] and not proven["nearly singular"]
    circle = wb.solve(SmallestCircle([0.0, 1.0, 1j])).certificate
    assert not any(check.proven for check in circle.checks)


@pytest.mark.parametrize(
    ("check", "said"),
    [
        (Check("a", "", 0.0, 1.0), "checked  a"),
        (Check("a", "", 0.0, 1.0, proven=True), "proven   a"),
        (Check("a", "", 2.0, 1.0, proven=True), "FAILS    a"),
    ],
)
def test_it_is_printed_and_stored(check, said):
    certificate = Certificate((check,))
    assert said in repr(certificate)
    stored = json.loads(json.dumps(certificate.to_json()))
    assert stored["checks"][0].get("proven", False) is check.proven
    assert Certificate.from_json(stored) == certificate


@pytest.mark.parametrize(
    ("value", "limit", "texts"),
    [
        (0.99982, 1.0, ("0.9998", "1")),
        (1.0 + 1e-15, 1.0, ("1.000000000000001", "1")),
        (0.5, 1.0, ("0.5", "1")),
        (1.0, 1.0, ("1", "1")),
        (float("nan"), 1.0, ("nan", "1")),
        (float("inf"), float("inf"), ("inf", "inf")),
    ],
)
def test_a_value_and_its_limit_are_told_apart(value, limit, texts):
    assert distinct_texts(value, limit, digits=3) == texts


def test_a_check_that_fails_by_little_says_by_how_little():
    check = Check("small", "a number", 1.0 + 1e-9, 1.0)
    assert check.failure == "small: 1.000000001 exceeds 1"
    assert "1.000000001 <= 1" in check.line
