"""Every method of the library reads the tolerance if it says that this makes a difference."""

import sys

import pytest
from small_problems import OTHERS
from tight_problems import PROGRAMS, solved

from workbench.executor import Context
from workbench.program import _METHODS, methods
from workbench.solvers import ACCURACY, Options, conic_solvers


class Recorded(Options):
    """Options that tell whether anybody read the tolerance, of them or of a copy."""

    heard = False

    def __getattribute__(self, name):
        if name in ("tolerance", "accuracy") and sys._getframe(1).f_code.co_name not in COPYING:
            Recorded.heard = True
        return super().__getattribute__(name)


COPYING = {"replace", "__init__", "__post_init__"}
"""Functions that read every option of a copy that is made, as for a part of the time."""


SMALL = {
    name: PROGRAMS[name]
    for name in (
        *(
            "circle",
            "stadium",
            "small_stadium",
            "mu_upper_mixed",
            "mu_lower_mixed",
            "hinf",
            "mixed_norms",
            "fault_filter",
        ),
        *("switching", "magnitude_fit", "circle_cover", "crest_factor", "state_space_fit"),
        "parameter_fit",
        "matrix_traces",
        "matrix_cover",
        "record_hinf",
        "experiment_design",
    )
}

SMALL |= OTHERS
"""Programs on which every method of the library runs, or another of the same name."""
COVERS = ("steps", "joint", "inflation", *(solver.name for solver in conic_solvers()))
ELSEWHERE = {*(("StadiumCover", name) for name in COVERS), ("LoopShaping", "coprime")}
"""The methods of circle covers, and one that keeps the distance of the Riccati equations."""
SLOW = {"mu_synthesis", "fault_filter", "circle_cover"}


def fit_methods(program):
    """The methods of the library that can take a program, by name."""
    return {n: entry for n, entry in methods(program).items() if entry.unfit(program) is None}


def test_every_method_of_the_library_is_tried():
    made = [make() for make in SMALL.values()]
    tried = {(type(program), method) for program in made for method in fit_methods(program)}
    reached = {(base.__name__, name) for kind, name in tried for base in kind.__mro__}
    library = {
        (kind.__name__, name)
        for kind, registered in _METHODS.items()
        for name, entry in registered.items()
        if kind.__module__.startswith("workbench.")
    }
    assert library - reached <= ELSEWHERE, library - reached


def marked(name):
    return pytest.param(name, marks=[pytest.mark.slow] if name in SLOW else [])


@pytest.mark.cases(1)
@pytest.mark.parametrize("name", [marked(name) for name in SMALL])
def test_methods_read_the_tolerance_if_they_say_that_it_makes_a_difference(name):
    program, wrong = SMALL[name](), []
    for method, entry in fit_methods(program).items():
        options = Recorded()
        Recorded.heard = False
        entry.answer(program, Context(options=options))
        if Recorded.heard is entry.accuracy.none:
            wrong.append(method)
    assert wrong == []


LIMITED = [("hinf", "riccati"), ("hinf", "clarabel"), ("switching", "clarabel"),
           ("rational_fit", "ipopt"), ("rational_fit", "best")]  # fmt: skip


@pytest.mark.parametrize(("name", "method"), LIMITED)
def test_tolerances_out_of_range_give_the_same_answer(name, method):
    """The method itself hears the tolerances here; in a run they do not even reach it."""
    program = SMALL[name]()
    entry = methods(program)[method]
    finest = entry.accuracy.finest
    assert 0.0 < finest < 1.0

    def answer(tolerance):
        found, _, _ = entry.answer(program, Context(options=Options(tolerance=tolerance)))
        return program.metrics(found)

    assert answer(finest) == pytest.approx(answer(finest / 1e3), rel=1e-9)


@pytest.mark.parametrize("name", [n for n in PROGRAMS if n not in SLOW | {"stadium_cover"}])
def test_checks_are_absolute_or_say_that_they_follow_the_accuracy(name):
    program, answer = solved(name)
    limits = {
        level: [check.limit for check in program.checks(answer, tolerance)]
        for level, tolerance in ACCURACY.items()
    }
    assert (limits["low"] != limits["high"]) is program.checks_follow_accuracy


@pytest.mark.slow
def test_the_checks_of_covers_follow_the_accuracy():
    program, answer = solved("circle_cover")
    limits = [[c.limit for c in program.checks(answer, t)] for t in (1e-3, 1e-9)]
    assert limits[0] != limits[1] and program.checks_follow_accuracy
