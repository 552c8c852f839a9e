"""A deep verification makes the dear checks, names each, and certifies the cells of comparisons."""

import json

import pytest
from click.testing import CliRunner

import workbench as wb
from workbench.bench.formats import netcdf
from workbench.bench.store import seal
from workbench.cli import main
from workbench.executor import InProcess

DEAR = '''
"""A square root that is tried by more draws where somebody asks for them."""

from dataclasses import dataclass

import numpy as np
import xarray as xr

from workbench import Check, Outcome, Program, method, problem
from workbench.executor.effort import tries

FEWEST = 3


@dataclass(frozen=True)
class Root(Program):
    """A number whose square is 2."""

    default_method = "exact"

    def checks(self, answer, tolerance):
        return [Check("square", "distance", abs(float(answer["x"]) ** 2 - 2), 1e-1)]

    def second_opinion(self, answer):
        missed = float(tries(FEWEST) >= 30 and abs(float(answer["x"]) - 2**0.5) > 1e-6)
        return [Check("drawn", "missed", missed, 0.0, over=f"for {tries(FEWEST)} draws")]

    def objective(self, answer):
        return float(answer["x"])

    def gap(self, answer):
        return "no better one is known", 0.0

    def metrics(self, answer):
        return {"x": float(answer["x"])}


@method(Root, "exact", optimal=False)
def exact(program, context):
    return xr.Dataset({"x": ((), 2**0.5, {"units": "1"})}), Outcome.SOLVED, ""


@method(Root, "near", optimal=False)
def near(program, context):
    return xr.Dataset({"x": ((), 1.415, {"units": "1"})}), Outcome.SOLVED, ""


@problem("dear/root")
def root() -> Root:
    """The square root of 2."""
    return Root()
'''


@pytest.fixture(autouse=True)
def dear(project):
    project.write("plants/dear/problems.py", DEAR)


def compared(*methods, **options):
    return wb.compare(
        "toy/root", methods=methods, accuracies=["middle"], executor=InProcess(), **options
    )


def test_a_deep_verification_tries_more_and_names_its_checks():
    run = wb.run("dear/root")
    usual, deep = wb.verify(run.path), wb.verify(run.path, deep=True)
    assert usual.holds and usual.deep == ()
    assert deep.holds and deep.certificate == usual.certificate
    (check,) = deep.deep
    assert check.name == "drawn" and check.opinion and check.over == "for 30 draws"
    assert "  deep: checked  second opinion, drawn: 0 <= 0; for 30 draws" in repr(deep)


def test_what_only_more_draws_find_is_found():
    run = wb.run("dear/root", method="near")
    assert run.certificate.holds and wb.verify(run.path).holds
    found = wb.verify(run.path, deep=True)
    assert not found.holds
    assert found.problems == ("deep: drawn: 1 exceeds 0",)


def test_the_command_prints_them():
    run = wb.run("dear/root")
    said = CliRunner().invoke(main, ["verify", "--deep", "--json", str(run.path)])
    assert said.exit_code == 0
    (row,) = json.loads(said.output)
    assert [check["name"] for check in row["deep"]] == ["drawn"]
    assert CliRunner().invoke(main, ["verify", "--deep", str(run.path)]).exit_code == 0


# --- comparisons --------------------------------------------------------------------------------


@pytest.mark.cases(0)
def test_a_comparison_certifies_its_stored_cells_again():
    """With those whose failure it states, and none of them is answered anew."""
    run = compared("exact", "lying", "boastful", "raising")
    for deep in (False, True):
        found = wb.verify(run.path, deep=deep)
        assert found.holds and found.notes == (), found


@pytest.mark.cases(0)
def test_a_spoilt_answer_of_a_cell_is_found(project):
    run = wb.compare("dear/root", methods=["near"], accuracies=["middle"], executor=InProcess())
    assert wb.verify(run.path).holds
    found = wb.verify(run.path, deep=True)
    assert not found.holds and "deep: drawn: 1 exceeds 0" in found.problems[0]


@pytest.mark.cases(0)
def test_cells_without_an_answer_are_answered_anew(project):
    run = compared("exact", "lying", light=True)
    found = wb.verify(run.path, deep=True)
    assert found.holds, found
    assert found.notes == ("2 cells without an answer here, answered anew",)
    project.edit("OFFSET = 0.0", "OFFSET = -1.0")
    found = wb.verify(run.path, deep=True)
    assert not found.holds
    assert any("re-run: toy/root exact" in text for text in found.problems)


@pytest.mark.cases(0)
def test_certificates_that_exclude_each_other_are_found(project):
    """A bound that was certified then, and a better answer that is certified now."""
    options = {"accuracies": ["middle"], "executor": InProcess(), "light": True}
    run = wb.compare("dear/root", methods=["near"], **options)
    assert wb.verify(run.path, deep=True).holds
    project.write("plants/dear/problems.py", DEAR.replace("1.415", "1.41"))
    project.restart()
    found = wb.verify(run.path, deep=True)
    assert "exclude stored ones" in " ".join(found.problems)


@pytest.mark.cases(0)
def test_a_sweep_certifies_its_points_again():
    done = wb.sweep("toy/root", {"scale": [1, 4]}, method="rough")
    assert wb.verify(done.path).holds
    point = wb.run("toy/root", method="rough", scale=4.0).path
    data = netcdf.read(point / "data.nc")
    (point / "data.nc").unlink()
    netcdf.write(data.assign(x=0.5 * data["x"]), point / "data.nc")
    seal(point)
    found = wb.verify(done.path)
    assert not found.holds and "data.nc: phasor" in " ".join(found.problems)
