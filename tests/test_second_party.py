"""Every Program and every function that certifies has a second way, apart from the first.

A new one has it at once. What had none when the list was made is an exception with its reason; once
it has one, the test says so, and the list shrinks.
"""

from __future__ import annotations

import importlib
import inspect
import json
import pkgutil
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any

import control
import cvxpy as cp
import numpy as np
import pytest
from perturbed_control import perturbed
from test_answers import ANSWERS

import workbench
import workbench as wb
from workbench.answer import Answer, PartsChecker
from workbench.bench.project import registry
from workbench.certificate import Certificate, Checker, OriginalAnswerChecker, deep_checks
from workbench.conic import ConeFactor, ConeKind, ConicForm, ConicProgram
from workbench.executor import Context
from workbench.geometry import SmallestCircle
from workbench.program import Task
from workbench.solvers import Options
from workbench.study import Study
from workbench.synthesis import (
    BandwidthLimits,
    DemandConflict,
    Demands,
    H2HinfSynthesis,
    Implementation,
    KeptDemands,
    LoopShaping,
    MixedSensitivity,
    WorkingLoop,
    WorkingPoint,
    lqg,
)
from workbench.synthesis.no_controller.interlacing import NoStableController
from workbench.synthesis.no_controller.no_gain import NoStabilisingGain
from workbench.uncertainty import Responses, UncertaintyModel
from workbench.uncertainty.matrix_covers.sets.program import MatrixSets

REFERENCE = Path(__file__).parents[1] / "results" / "reference"
LAG = control.tf([1.0], [1.0, 1.0])
TWO_ROWS = (ConeFactor(ConeKind.NONNEGATIVE, 2),)


def conic(A: list[list[float]], b: list[float], c: float = 1.0) -> wb.solution.Solution:
    return wb.solve(ConicProgram(ConicForm([c], A, b, TWO_ROWS)), method="clarabel")


def no_stable_controller() -> Certificate:
    """Between the zeros 1 and infinity of this plant lies one pole, 2."""
    plant = control.ss(control.tf([1.0, -1.0], [1.0, -1.0, -2.0]))
    task = NoStableController(plant)
    return task.certify(task.respond(None, Context(options=Options()))[0], 1e-6)


def no_stabilising_gain() -> Certificate:
    """Of a double integrator every gain leaves a pole on the axis or right of it."""
    task = NoStabilisingGain(control.ss(control.tf([1.0], [1.0, 0.0, 0.0])))
    return task.certify(task.respond(None, Context(options=Options()))[0], 1e-6)


def test_a_zero_that_is_none_is_found_by_a_deep_opinion():
    plant = control.ss(control.tf([1.0, -4.0, 3.0], [1.0, -2.0, -3.0, 1.0]))
    task = NoStableController(plant)
    answer = task.respond(None, Context(options=Options()))[0]
    assert all(check.holds for check in deep_checks(task, answer))
    moved = deep_checks(task, answer.assign(zeros=answer["zeros"] + 0.05))
    assert [check.holds for check in moved] == [True, False, False]


def matrix_sets() -> Certificate:
    rng = np.random.default_rng(0)
    deviations = rng.normal(size=(1, 6, 2, 2)) + 1j * rng.normal(size=(1, 6, 2, 2))
    return wb.solve(MatrixSets(deviations)).certificate


def cvxpy_problem() -> Certificate:
    x = cp.Variable(2)
    return wb.solve(cp.Problem(cp.Minimize(cp.norm(x)), [x[0] + 2 * x[1] == 5])).certificate


def working_loop() -> Certificate:
    omega = np.geomspace(0.01, 10, 40)
    plants = Responses(
        omega=omega, values=np.array([gain / (1j * omega + 1) for gain in (0.9, 1.1)]).T
    )
    K, point = control.tf([2.0, 1.0], [1.0, 0.0]), WorkingPoint(50.0, 20.0)
    board = wb.solve(Implementation(LAG, K, dt=0.1, working_point=point))
    return wb.solve(WorkingLoop(plants, board)).certificate


def mixed_norms() -> Certificate:
    """The energy of a lag whose control is perturbed."""
    return wb.solve(H2HinfSynthesis(perturbed(LAG), 0.3)).certificate


def kept_demands() -> Certificate:
    omega = np.geomspace(0.01, 10, 40)
    plants = Responses(
        omega=omega, values=np.array([gain / (1j * omega + 1) for gain in (0.9, 1.1)]).T
    )
    K, point = control.tf([2.0, 1.0], [1.0, 0.0]), WorkingPoint(50.0, 20.0)
    model = UncertaintyModel(LAG, control.tf([0.1], [1.0]))
    board = wb.solve(Implementation(model, K, dt=0.1, working_point=point))
    return wb.solve(KeptDemands(plants, board, Demands(bandwidth=1.0))).certificate


def demand_conflict() -> Certificate:
    model = UncertaintyModel(LAG, control.tf([0.1], [1.0]))
    return wb.solve(DemandConflict(model, Demands(bandwidth=1.0), 0.1)).certificate


def bandwidth_limits() -> Certificate:
    model = UncertaintyModel(LAG, control.tf([0.1], [1.0]))
    demands = Demands(bandwidth=0.5, effort=0.05)
    return wb.solve(BandwidthLimits(model, demands, 0.1, states=1)).certificate


PROGRAMS = {
    "KeptDemands": kept_demands,
    "DemandConflict": demand_conflict,
    "BandwidthLimits": bandwidth_limits,
    "ConicProgram": lambda: conic([[-1.0], [1.0]], [-2.0, 5.0]).certificate,
    "CvxpyProgram": cvxpy_problem,
    "NoSolution": lambda: conic([[-1.0], [1.0]], [-2.0, 1.0]).certificate,
    "NoLeastValue": lambda: conic([[-1.0], [0.0]], [0.0, 1.0], -1.0).certificate,
    "NoStableController": no_stable_controller,
    "NoStabilisingGain": no_stabilising_gain,
    "MatrixSets": matrix_sets,
    "LoopShaping": lambda: wb.solve(LoopShaping(LAG)).certificate,
    "MixedSensitivity": lambda: wb.solve(MixedSensitivity(LAG, W_S=0.5, W_KS=0.5)).certificate,
    "H2Synthesis": lambda: lqg(control.ss(LAG), 1.0, 1.0, 1.0, 1.0).certificate,
    "H2HinfSynthesis": mixed_norms,
    "WorkingLoop": working_loop,
    "ParameterFit": lambda: ANSWERS["fit_parameters"]().certificate,
}
"""Small instances of Programs of which no answer is stored."""
EXCEPTIONS = {
    "Comparison": "`verify` certifies its stored cells again, each with its second opinion",
    "ParameterSweep": "`verify` certifies its stored points again, each with its second opinion",
    "DemandCost": "its second way is dear: `verify --deep` tries the loop of each controller",
}
"""Tasks without a check of a second opinion in their certificate, and why."""
FIRST_EXCEPTIONS = frozenset({"Comparison", "ParameterSweep", "DemandCost"})
"""Those that were there when the list was made: no other may be added."""
BASES = {"EnclosingShape", "EnclosingStadium", "Study"}
BASES |= {"RepeatedChecker", "CheckedAs", "CrossingChecker"}
"""Bases of others, which nobody answers; and checkers that have the opinion of another one."""


@cache
def library() -> None:
    """Import every module of the library, so that all checkers are known."""
    for module in pkgutil.walk_packages(workbench.__path__, "workbench."):
        if not module.name.startswith(("workbench.plants", "workbench.__main__")):
            importlib.import_module(module.name)


def checkers(kind: type[Any] = Checker) -> Iterator[type[Any]]:
    """The concrete classes of the library that check answers."""
    for one in kind.__subclasses__():
        yield from checkers(one)
        ours = one.__module__.startswith("workbench.") and ".plants." not in one.__module__
        if ours and not inspect.isabstract(one) and one.__name__ not in BASES:
            yield one


@cache
def stored_opinions() -> frozenset[str]:
    """Names of Programs of which a stored answer was checked by a second opinion."""
    found = set[str]()
    for file in REFERENCE.rglob("certificate.json"):
        checks = json.loads(file.read_text(encoding="utf-8"))["checks"]
        problem = json.loads((file.parent / "run.json").read_text(encoding="utf-8"))["problem"]
        if any(check["opinion"] for check in checks) and problem in registry().entries:
            kind = registry().find(problem).kind
            found |= {base.__name__ for base in getattr(kind, "__mro__", ())} - {"Study"}
    return frozenset(found)


def same_ways(one: type[Any]) -> set[str]:
    """The class and its bases whose checks and second opinion are the same code.

    What a Study checks it declares, each its own.
    """
    if issubclass(one, Study):
        return {one.__name__}
    return {
        base.__name__
        for base in one.__mro__
        if getattr(base, "checks", None) is one.checks
        and getattr(base, "second_opinion", None) is one.second_opinion
    }


def without_second_way(known: frozenset[str]) -> set[str]:
    """Names of Tasks of which nothing here or stored shows a second way."""
    library()
    tasks = {one for one in checkers() if issubclass(one, Task)}
    return {one.__name__ for one in tasks if not same_ways(one) & known}


def with_parts(answer: Answer) -> Iterator[Checker]:
    """What checks an answer, and the answers that it consists of."""
    assert answer._checked_by is not None
    checker = answer._checked_by[0]
    yield checker
    if isinstance(checker, OriginalAnswerChecker):
        yield checker.checker
    if isinstance(checker, PartsChecker):
        for part in checker.parts(answer).values():
            if part is not None:
                yield from with_parts(part)


def test_every_program_has_a_second_way_or_is_an_exception():
    known = stored_opinions() | PROGRAMS.keys()
    missing = without_second_way(known) - EXCEPTIONS.keys()
    assert not missing, f"without a second opinion, or a small instance here: {sorted(missing)}"


def test_the_list_of_exceptions_only_shrinks():
    assert EXCEPTIONS.keys() <= FIRST_EXCEPTIONS
    now = without_second_way(stored_opinions() | PROGRAMS.keys())
    unneeded = EXCEPTIONS.keys() - now
    assert not unneeded, f"these have a second opinion now; strike them out: {sorted(unneeded)}"


DEAR = {"BandwidthLimits"}
EVERY = [pytest.param(name, marks=[pytest.mark.slow] if name in DEAR else []) for name in PROGRAMS]


@pytest.mark.parametrize("name", EVERY)
def test_a_small_instance_is_checked_by_a_second_opinion(name):
    certificate = PROGRAMS[name]()
    assert certificate.holds, certificate
    assert any(check.opinion for check in certificate.checks), certificate


@pytest.mark.cases(0)
def test_every_checker_of_functions_is_that_of_an_answer_here():
    """`test_answers` has an answer of every function that certifies, and asks for its opinion."""
    library()
    shown = set()
    for make in ANSWERS.values():
        for one in with_parts(make()):
            shown |= same_ways(type(one))
    asked = {one.__name__ for one in checkers() if not issubclass(one, Task)}
    assert asked <= shown | SHOWN_ELSEWHERE.keys(), asked - shown


SHOWN_ELSEWHERE = {
    "ContainmentChecker": "test_what_is_contained_is_certified, in test_answers",
}
"""Checkers whose answers are not among `ANSWERS`, and the test that asks for their opinion."""


def test_a_checker_without_an_opinion_is_found():
    class Bare(SmallestCircle):
        def second_opinion(self, answer: Answer) -> list[Any]:
            return []

    assert not same_ways(Bare) & stored_opinions()


@pytest.mark.slow
@pytest.mark.parametrize("name", ANSWERS)
def test_a_deep_opinion_agrees_too(name):
    answer = ANSWERS[name]()
    checker = answer._checked_by[0]
    checks = deep_checks(checker, checker.witnessed(answer))
    assert checks and all(check.holds for check in checks), [one.line for one in checks]
