"""A need is replaced with the run that needs it, or not at all."""

import sys

import pytest

import workbench as wb
from workbench.bench.problem import Problem
from workbench.bench.run import Bench
from workbench.bench.store import Store
from workbench.errors import ResultError
from workbench.solvers import Options

CHAIN = '''
import os
from pathlib import Path

import xarray as xr

from workbench import Check, problem, ref
from workbench.study import Study

FACTOR = 2.0


class Product(Study):
    headline = "product"

    def __init__(self, name, parts):
        self.name, self.parts = name, parts

    @property
    def known(self):
        return FACTOR_OF[self.name] * sum(float(run.data["product"]) for run in self.parts or [])

    def compute(self, context):
        with open("computed.txt", "a") as file:
            file.write(self.name)
        if os.environ.get("STOPPED") == self.name:
            raise KeyboardInterrupt
        return xr.Dataset({"product": ((), self.known if self.parts else FACTOR)})

    def checks(self, answer, tolerance):
        wrong = os.environ.get("WRONG") == self.name
        value = abs(float(answer["product"]) - self.known) if self.parts else 0.0
        return [Check("product", "distance from the product", value + wrong, 1e-9)]

    def metrics(self, answer):
        return {"product": float(answer["product"])}


FACTOR_OF = {"b": 3.0, "c": 5.0}


@problem("chain/a")
def a() -> Product:
    """First."""
    return Product("a", ())


@problem("chain/b", needs={"run": ref("chain/a")})
def b(run) -> Product:
    """Three times a."""
    return Product("b", (run,))


@problem("chain/c", needs={"run": ref("chain/b")})
def c(run) -> Product:
    """Five times b."""
    return Product("c", (run,))
'''


@pytest.fixture
def chain(project, monkeypatch):
    """The three problems; ``edit`` changes the factor of the first, and with it all answers."""
    file = project.toy.parent / "chain.py"
    file.write_text(CHAIN)
    monkeypatch.chdir(project.root)

    def edit(factor):
        file.write_text(CHAIN.replace("FACTOR = 2.0", f"FACTOR = {factor}"))

    return edit


def computed(project):
    """Letters of the problems computed since the last call."""
    file = project.root / "computed.txt"
    text = file.read_text() if file.exists() else ""
    file.unlink(missing_ok=True)
    return text


def aside(project):
    """Folders of answers that wait beside."""
    return list((project.results / ".partial" / "beside" / "chain").glob("*/*"))


def values():
    return {run.problem: run.value for run in wb.results("chain/*")}


def all_verified():
    return all(wb.verify(run.path).holds for run in wb.results("chain/*"))


BEFORE = {"chain/a": 2.0, "chain/b": 6.0, "chain/c": 30.0}
AFTER = {"chain/a": 7.0, "chain/b": 21.0, "chain/c": 105.0}


@pytest.mark.parametrize("stopped", ["a", "b", "c"])
def test_an_interrupted_run_leaves_every_earlier_result_verified(
    project, chain, monkeypatch, stopped
):
    wb.run("chain/c")
    assert computed(project) == "abc" and values() == BEFORE
    chain(7.0)
    monkeypatch.setenv("STOPPED", stopped)
    with pytest.raises(KeyboardInterrupt):
        wb.run("chain/c")
    assert values() == BEFORE and all_verified()
    assert len(aside(project)) == "abc".index(stopped)
    computed(project)
    monkeypatch.delenv("STOPPED")
    assert wb.run("chain/c").value == 105.0
    assert computed(project) == "abc"["abc".index(stopped) :]  # what was finished is taken
    assert values() == AFTER and all_verified()
    assert not aside(project)


def test_what_an_interrupted_run_has_left_is_not_taken_for_other_code(project, chain, monkeypatch):
    wb.run("chain/c")
    chain(7.0)
    monkeypatch.setenv("STOPPED", "c")
    with pytest.raises(KeyboardInterrupt):
        wb.run("chain/c")
    monkeypatch.delenv("STOPPED")
    chain(11.0)
    assert wb.run("chain/c").value == 165.0
    assert all_verified()


def test_an_interrupted_run_of_edits_that_are_taken_back_changes_nothing(
    project, chain, monkeypatch
):
    wb.run("chain/c")
    chain(7.0)
    monkeypatch.setenv("STOPPED", "c")
    with pytest.raises(KeyboardInterrupt):
        wb.run("chain/c")
    monkeypatch.delenv("STOPPED")
    chain(2.0)
    assert wb.run("chain/c").reused
    assert values() == BEFORE and all_verified()
    assert not aside(project)


def test_a_need_that_fails_is_told_in_its_place_and_replaces_nothing(project, chain, monkeypatch):
    wb.run("chain/c")
    chain(7.0)
    monkeypatch.setenv("WRONG", "b")
    with pytest.raises(ResultError, match=r"chain/c needs chain/b.*results.chain.b"):
        wb.run("chain/c")
    monkeypatch.delenv("WRONG")
    assert values() == BEFORE and all_verified()
    assert list(project.results.glob("chain/b/*.failed"))


def test_needs_of_a_loaded_problem_are_in_their_places(project, chain, monkeypatch):
    """The problem is bound to them once."""
    wb.run("chain/c")
    chain(7.0)
    made, task = [], Problem.task
    monkeypatch.setattr(Problem, "task", lambda one, *fed: made.append(one.name) or task(one, *fed))
    bound = Bench(Store(project.results), Options()).load("chain/c", {})
    (need,) = bound.fed
    assert made == ["chain/a", "chain/b", "chain/c"]
    assert need.path.parent == project.results / "chain" / "b" and need.value == 21.0
    assert wb.verify(need.path).holds


@pytest.mark.parametrize("work", ["run", "verify"])
def test_the_problems_of_a_project_are_looked_for_once(project, chain, work):
    """However many needs there are."""
    path = wb.run("chain/c").path
    looked = []

    def count(frame, event, argument):
        code = frame.f_code
        if event == "call" and code.co_name == "registry" and "project.py" in code.co_filename:
            looked.append(1)

    sys.setprofile(count)
    try:
        wb.run("chain/c") if work == "run" else wb.verify(path)
    finally:
        sys.setprofile(None)
    assert len(looked) == 1
