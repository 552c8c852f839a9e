"""Every number that leaves with an answer is checked, or said not to be."""

import importlib
import inspect
import pkgutil

import pytest
from collection import PROGRAMS, solved
from kinds import ABOVE, BELOW, PROOF, TOLD, kind_of
from page import PAGE, rows
from spoils import leaving, lost, own_variables, spoilt

import workbench
from workbench.identification.state_space.program import AS_TOLD
from workbench.program import Program

SLOW = {"fault_filter", "mu_synthesis", "implementation"}
"""Programs of which every spoil takes long."""
CLAIMS = {
    "fault_filter": ("least",),
    "mu_synthesis": ("peak",),
    "implementation": ("sensitivity", "contraction"),
}
"""Variables that are spoilt in every run of the tests, all the same."""


def breaches(name, wanted=lambda variable: True):
    """What is wrong with unnoticed spoils of a problem, in words."""
    program, answer, method = solved(name)
    numbers = leaving(program, answer)
    told = []
    for variable, found in spoilt(program, answer, method, wanted).items():
        kind = kind_of(type(program).__name__, variable)
        if not found.passed:
            continue
        passed = ", ".join(found.passed)
        if not kind:
            told.append(f"{variable} {passed}: nobody notices, and it is in no list")
        if kind == ABOVE and not found.raised:
            told.append(f"{variable} {passed}: a bound from above was lowered")
        if kind == BELOW and not found.lowered:
            told.append(f"{variable} {passed}: a bound from below was raised")
        if kind == PROOF and found.numbers - set(program.relative_metrics):
            told.append(f"{variable} {passed}: a proof changed {found.numbers}")
        unmarked = [one for one in found.numbers if AS_TOLD not in str(numbers[one])]
        if kind == TOLD and unmarked:
            told.append(f"{variable} {passed}: what is told stands unmarked in {unmarked}")
    return told


@pytest.mark.cases(2)
@pytest.mark.parametrize("name", [name for name in PROGRAMS if name not in SLOW])
def test_no_spoil_goes_unnoticed(name):
    assert breaches(name) == []


@pytest.mark.cases(1)
@pytest.mark.parametrize("name", sorted(SLOW))
def test_no_spoil_of_a_claim_goes_unnoticed(name):
    assert breaches(name, lambda variable: variable in CLAIMS[name]) == []


@pytest.mark.slow
@pytest.mark.parametrize("name", sorted(SLOW))
def test_no_spoil_goes_unnoticed_where_it_takes_long(name):
    assert breaches(name) == []


@pytest.mark.parametrize(
    "name",
    [pytest.param(name, marks=[pytest.mark.slow] * (name in SLOW)) for name in PROGRAMS],
)
def test_numbers_that_are_not_finite_fail_or_are_named(name):
    assert lost(*solved(name)) == []


@pytest.mark.parametrize("name", PROGRAMS)
def test_the_page_has_every_variable(name):
    program, answer, _ = solved(name)
    kind = type(program).__name__
    section = PAGE.read_text(encoding="utf-8").split(f"## {kind}\n")[1].split("\n## ")[0]
    missing = set(rows(kind, own_variables(program, answer))) - set(section.splitlines())
    assert not missing, "python tests/spoils/page.py makes it anew"


def programs():
    """The Programs of the library that can be asked: those with a way to check an answer."""
    waiting, found = [Program], set()
    while waiting:
        one = waiting.pop()
        waiting += one.__subclasses__()
        if one.__module__.startswith("workbench.") and not inspect.isabstract(one):
            found.add(one.__name__)
    return found


WITHOUT = {
    "Program",
    *("EnclosingShape", "EnclosingStadium"),  # bases of the circles and stadiums
    # Problems of the CD drive, which are syntheses of their own names.
    *("LoopController", "LowerBandwidth", "MuPid"),
}
"""Programs without a problem here, and why."""


def test_every_program_has_a_problem():
    for module in pkgutil.walk_packages(workbench.__path__, "workbench."):
        if not module.name.endswith("__main__"):
            importlib.import_module(module.name)
    tried = {type(make()).__name__ for make in PROGRAMS.values()}
    assert programs() - tried - WITHOUT == set()
