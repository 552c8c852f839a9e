"""Checks say what they quantify over: frequencies, plants, sets, records, samples."""

import json
from pathlib import Path

import control
import numpy as np
import pytest
from tables import each

import workbench as wb
from workbench.certificate import Check, quantified_checks
from workbench.fitting import MagnitudeFit, ResponseFit
from workbench.geometry import NarrowestStadium, SmallestCircle
from workbench.mu import MuLowerBound, MuUpperBound
from workbench.program import Task
from workbench.structure import Full, Structure
from workbench.synthesis import MixedSensitivity
from workbench.uncertainty import CircleCover, Responses

REFERENCE = Path(__file__).parents[1] / "results" / "reference"
COUNTS = ("dimensions", "order", "zeros of", "zeros", "period")
"""First words of checks that speak of nothing but the answer itself: how large it is."""
OMEGA = np.geomspace(1, 100, 12)
POINTS = np.random.default_rng(0).normal(size=(3, 5, 2)).view(complex)[..., 0]


def silent(checks):
    """Names of checks that do not say over what they hold, though they speak of more than sizes."""
    names = {check["name"]: check["over"] for check in checks}
    return [
        name
        for name, over in names.items()
        if not over and not name.rpartition(": ")[2].startswith(COUNTS)
    ]


def response_set():
    s = 1j * OMEGA[:, None]
    return Responses(
        omega=OMEGA, values=np.array([0.9, 1.0, 1.1]) * 30 / (s + np.array([20, 30, 40]))
    )


PROGRAMS = {
    "circles": lambda: SmallestCircle(POINTS),
    "stadiums": lambda: NarrowestStadium(POINTS),
    "cover": lambda: CircleCover(response_set(), 1, zeros=0, complex_order=2),
    "magnitude": lambda: MagnitudeFit(OMEGA, 1 / OMEGA, 2, cover=True),
    "response": lambda: ResponseFit(OMEGA, 1 / (1j * OMEGA + 5), 1, stable=True),
    "upper": lambda: MuUpperBound(POINTS[0, :4].reshape(2, 2), Structure([Full(2, 2)])),
    "lower": lambda: MuLowerBound(POINTS[0, :4].reshape(2, 2), Structure([Full(2, 2)])),
    "H-infinity": lambda: MixedSensitivity(
        control.tf([1.0], [1.0, 1.0]),
        W_S=control.tf([0.1, 1.0], [1.0, 0.01]),
        W_KS=control.tf(0.1, 1),
    ),
}


@pytest.mark.parametrize("name", PROGRAMS)
def test_checks_of_the_programs_say_over_what(name):
    solution = wb.solve(PROGRAMS[name]())
    assert solution.certificate is not None, solution.message
    checks = solution.certificate.to_json()["checks"]
    assert checks
    assert silent(checks) == []


def test_a_check_keeps_its_own_words():
    own, bare = Check("a", "", 0.0, 0.0, over="at 3 frequencies"), Check("b", "", 0.0, 0.0)
    assert [each.over for each in quantified_checks("for this set", [own, bare])] == [
        "at 3 frequencies",
        "for this set",
    ]
    assert Task.quantifier.__doc__


@each("path", sorted(REFERENCE.rglob("certificate.json")), ids=lambda p: p.parent.name)
def test_reference_certificates_say_over_what(path):
    checks = json.loads(path.read_text())["checks"]
    assert all("over" in check for check in checks), "made before checks said so: make reference"
    assert silent(checks) == []
