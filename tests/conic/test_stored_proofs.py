"""A run of a program without a solution: its folder holds the proof, and is verified from it."""

import json

import pytest
from conic_programs import IRRATIONAL

import workbench as wb
from workbench.bench.store import seal
from workbench.errors import ResultError

PROBLEMS = '''
"""Linear programs with and without a solution, by honest methods and by a liar."""

import xarray as xr

from workbench import Outcome, Study, method, problem, ref
from workbench.conic import ConeFactor, ConeKind, ConicForm, ConicProgram


@problem("cone/{kind}", kind=("infeasible", "unbounded", "solvable"))
def program(kind: str) -> ConicProgram:
    """x >= 1, and x at most -1, 2 or anything."""
    rows = {"infeasible": [[1.0]], "solvable": [[1.0]], "unbounded": []}[kind]
    b = {"infeasible": [-1.0], "solvable": [2.0], "unbounded": []}[kind]
    c = [-1.0 if kind == "unbounded" else 1.0]
    cones = (ConeFactor(ConeKind.NONNEGATIVE, 1 + len(b)),)
    return ConicProgram(ConicForm(c, [[-1.0], *rows], [-1.0, *b], cones))


@method(ConicProgram, "liar", optimal=True)
def liar(program, context):
    """Says that there is no solution, whatever it is asked."""
    return None, Outcome.INFEASIBLE, "none"


class Fed(Study):
    def __init__(self, part):
        self.part = part


@problem("cone/fed", needs={"part": ref("cone/infeasible")})
def fed(part) -> Fed:
    """Fed with what has no solution."""
    return Fed(part)
'''


@pytest.fixture
def cones(project):
    project.write("plants/cone.py", PROBLEMS)
    return project


@pytest.mark.cases(1)
@pytest.mark.parametrize("kind", ["infeasible", "unbounded"])
def test_a_proof_is_stored_found_again_verified_and_made_again(cones, kind):
    run = wb.run(f"cone/{kind}")
    assert run.outcome == kind and run.holds and not run.path.name.endswith(".failed")
    assert run.headline == {"infeasible": "radius inf", "unbounded": "falling 1"}[kind]
    assert wb.run(f"cone/{kind}").reused
    verified = wb.verify(run.path, rerun=True)
    assert verified.holds, verified
    assert verified.certificate.holds
    assert set(run.answer) == {"infeasible": {"y"}, "unbounded": {"x", "ray"}}[kind]
    assert run.figures == run.tables == {}
    assert type(run.task).__name__ == "ConicProgram"


def test_a_lie_about_a_solvable_program_is_a_failure_that_says_what_is_true(cones):
    run = wb.run("cone/solvable", method="liar")
    assert run.outcome == "no solution up to R" and not run.holds
    assert run.path.name.endswith(".failed") and run.metrics["radius"] <= 1.0
    assert "max |x| < R" in run.info["message"]


def test_a_stored_proof_that_was_changed_is_not_verified(cones):
    run = wb.run("cone/infeasible")
    data = run.data.load()
    data["y"].values[0] = "7"
    from workbench.bench.formats import netcdf

    netcdf.write(data, run.path / "data.nc")
    seal(run.path)
    assert not wb.verify(run.path).holds


def test_a_proof_under_the_name_of_an_answer_is_not_verified(cones):
    run = wb.run("cone/infeasible")
    info = json.loads((run.path / "run.json").read_text())
    info["outcome"] = "solved"
    (run.path / "run.json").write_text(json.dumps(info))
    seal(run.path)
    assert not wb.verify(run.path).holds


def test_what_has_no_solution_feeds_nothing(cones):
    with pytest.raises(ResultError, match="says: no answer"):
        wb.run("cone/fed")


@pytest.mark.cases(0)
def test_in_a_comparison_only_what_is_proven_counts(cones):
    run = wb.compare("cone/*", methods=["clarabel", "liar"], accuracies=["middle"])
    names = run.data["problem"].values.tolist()
    cell = {
        (name, method): tuple(
            run.data[what].sel(by_method=method).values[i, 0, 0].item()
            for what in ("outcome", "certified", "verdict")
        )
        for i, name in enumerate(names)
        for method in ("clarabel", "liar")
    }
    assert cell["cone/infeasible", "clarabel"] == ("infeasible", 1, "infeasible")
    assert cell["cone/infeasible", "liar"] == ("infeasible", 1, "infeasible")  # right for once
    assert cell["cone/unbounded", "clarabel"] == ("unbounded", 1, "unbounded")
    assert cell["cone/unbounded", "liar"][1] == 0
    assert cell["cone/solvable", "clarabel"] == ("solved", 1, "solved")
    assert cell["cone/solvable", "liar"] == ("no solution up to R", 0, "wrong")


def test_the_report_shows_proofs(cones):
    wb.run("cone/infeasible")
    wb.run("cone/solvable", method="liar")
    page = wb.report().read_text(encoding="utf-8")
    assert "cone/infeasible" in page and "no solution up to R" in page


def test_irrational_rays_are_known_for_what_they_are():
    form = next(iter(IRRATIONAL.values()))
    from workbench.conic import ConicProgram

    assert wb.solve(ConicProgram(form)).outcome == "no solution up to R"
