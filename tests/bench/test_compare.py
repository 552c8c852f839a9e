"""Every problem by every method: what is right, what only claims to be, what cannot be asked."""

import time
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from multiprocessing import get_context

import pytest

import workbench as wb
from workbench.bench.comparison import rows
from workbench.bench.store import damage
from workbench.errors import InputError, UnknownNameError
from workbench.executor import InProcess, Processes

EXECUTORS = {
    "in process": InProcess,
    "processes": lambda: Processes(1),
    "threads": lambda: ThreadPoolExecutor(2),
    "pool": lambda: ProcessPoolExecutor(1, get_context("spawn")),
}
any_executor = pytest.mark.parametrize(
    "make",
    [
        pytest.param(make, id=name, marks=pytest.mark.slow if name == "pool" else ())
        for name, make in EXECUTORS.items()
    ],
)
pytestmark = pytest.mark.usefixtures("project")


def cell(run, method, name="outcome", problem=0, accuracy=0):
    return run.data[name].sel(by_method=method).values[problem, accuracy].item()


@pytest.fixture
def one(project):
    """Compare methods on one problem at one accuracy."""

    def compare(*methods, executor=None, **options):
        return wb.compare("toy/root", methods, accuracies=["middle"], executor=executor, **options)

    return compare


CELLS = {  # outcome, claim, success, correctness
    "exact": ("solved", "solved", True, True),
    "rough": ("solved", "solved", True, True),
    "boastful": ("inaccurate", "solved", False, False),
    "lying": ("failed", "solved", False, False),
    "modest": ("solved", "inaccurate", True, False),
    "hopeless": ("no claim", "infeasible", False, False),
    "raising": ("failed", "failed", False, False),
    "garbage": ("failed", "solved", False, False),
}


def test_success_is_the_truth_and_correctness_whether_the_claim_agrees(one):
    run = one(*CELLS)
    names = ("outcome", "claim", "success", "correct")
    assert {m: tuple(cell(run, m, name) for name in names) for m in CELLS} == CELLS


def test_rates_count_what_could_be_tried(one):
    run = one("exact", "lying", "modest", "picky", copies=2)
    assert run.metrics == {
        "success_rate": pytest.approx(2 / 3),
        "correctness_rate": pytest.approx(1 / 3),
        "cells": 3,
        "unfit": 1,
    }


def test_an_unfit_cell_gives_its_reason_and_is_no_failure(one):
    run = one("exact", "picky", copies=2)
    assert run.holds
    reason = "it counts to three"
    assert (cell(run, "picky"), cell(run, "picky", "message")) == ("unfit", reason)
    assert [row[3:] for row in rows(run.data)[1:]] == [["unfit"] + ["-"] * 6]


def test_a_method_that_nobody_has_is_an_error(one):
    with pytest.raises(UnknownNameError, match="did you mean exact"):
        one("exat")


def test_methods_may_be_written_as_on_the_command_line(project):
    run = wb.compare("toy/root", "exact,rough", accuracies=["low"])
    assert list(run.data["by_method"].values) == ["exact", "rough"]


def test_a_study_has_nothing_to_compare(project):
    run = wb.compare("toy/[rt]o*", ["exact"], accuracies=["low"])
    assert run.data["outcome"].values.ravel().tolist() == ["solved", "unfit"]
    assert cell(run, "exact", "message", problem=1) == "toy/total is a study: it has no methods"


@pytest.mark.parametrize("methods", [["nothing"], ["raising", "hopeless"]], ids=str)
def test_a_comparison_without_any_answer_is_still_made(one, methods):
    run = one(*methods)
    assert run.holds and run.metrics["success_rate"] == 0
    assert run.figures.keys() == {"accuracy-against-time"}


def test_every_problem_method_and_level_is_a_cell(project):
    run = wb.compare("toy/?/root", ["exact", "boastful"])
    assert dict(run.data.sizes) == {"problem": 2, "by_method": 2, "accuracy": 3}
    assert run.data["problem"].values.tolist() == ["toy/x/root", "toy/y/root"]
    assert run.data["tolerance"].values.tolist() == [1e-3, 1e-6, 1e-9]
    assert (run.data["success"].sel(by_method="exact") == 1).all()
    assert (run.data["gap"].sel(by_method="boastful") > 0.4).all()
    assert len(rows(run.data)) == 12


def test_the_folder_holds_table_figure_and_data(project, one):
    run = one("exact", "lying")
    assert run.path.parent == project.results / "compare" and damage(run.path) == []
    table = run.tables["comparison"].splitlines()
    cells = [[cell.strip() for cell in line.strip("|").split("|")] for line in table]
    assert len(table) == 4 and cells[0][:3] == ["problem", "method", "accuracy"]
    assert cells[3][:7] == ["toy/root", "lying", "middle", "failed", "solved", "no", "no"]
    assert run.figures.keys() == {"accuracy-against-time"}
    assert run.data["solve"].attrs["units"] == "s" and (run.data["solve"] >= 0).all()
    assert wb.verify(run.path).holds


def test_the_question_decides_the_folder_of_a_comparison(one):
    paths = [run.path for run in (one("exact"), one("exact", scale=2.0), one("rough"))]
    assert len(set(paths)) == 3
    assert one("exact").path == paths[0]


def test_cells_leave_no_results_but_those_of_their_needs(project, one):
    one("exact")
    assert {run.problem for run in wb.results()} == {"compare"}


@any_executor
def test_any_executor_gives_the_same_cells(project, make):
    """Workers know the added folder; a problem that cannot be bound is a failed cell of its own."""
    project.write("mine/p.py", project.toy.read_text().replace("toy/", "mine/"))
    project.write("mine/targets.csv", "9")
    wb.add_problems("mine")
    with make() as executor:
        run = wb.compare("mine/[br]*", ["exact", "lying"], accuracies=["low"], executor=executor)
    assert run.data["problem"].values.tolist() == ["mine/broken", "mine/root"]
    assert [cell(run, method, problem=1) for method in ("exact", "lying")] == ["solved", "failed"]
    assert cell(run, "exact") == "failed"
    assert "one over nothing" in cell(run, "exact", "message")


def test_a_hanging_method_is_killed_and_its_cell_says_so(one):
    start = time.perf_counter()
    with Processes(2, time_limit=2.0) as executor:
        run = one("hanging", "exact", executor=executor)
    assert cell(run, "hanging") == "time limit"
    assert "limit of 2 s" in cell(run, "hanging", "message")
    assert not cell(run, "hanging", "correct")
    assert cell(run, "exact") == "solved"
    assert time.perf_counter() - start < 20


def test_a_method_that_heeds_the_clock_is_out_of_time_in_process(one):
    run = one("exact", "patient", time_limit=0.05)
    assert cell(run, "patient") == cell(run, "patient", "claim") == "time limit"
    assert not cell(run, "patient", "correct")  # it claims nothing of the problem


@pytest.mark.parametrize("name", ["processes", pytest.param("pool", marks=pytest.mark.slow)])
def test_a_worker_that_dies_is_a_failed_cell(one, name):
    with EXECUTORS[name]() as executor:
        run = one("exact", "dying", executor=executor)
    assert cell(run, "exact") == "solved"
    assert cell(run, "dying") == "failed"
    assert cell(run, "dying", "message")
    assert not cell(run, "dying", "correct")


def test_a_relative_results_folder_reaches_the_workers(project, monkeypatch):
    monkeypatch.setenv("WORKBENCH_RESULTS", "kept")
    with Processes(1) as executor:
        run = wb.compare("toy/x/root", ["exact"], accuracies=["low"], executor=executor)
    assert run.path.is_relative_to("kept") or run.path.is_relative_to(project.root / "kept")


@pytest.mark.parametrize(
    ("arguments", "error", "words"),
    [
        ({"pattern": "nothing*"}, UnknownNameError, "no problem is called"),
        ({"methods": []}, InputError, "at least one method"),
        ({"accuracies": ["medium"]}, InputError, "low, middle, high, not .*medium"),
        ({"accuracies": []}, InputError, "low, middle, high"),
        ({"time_limit": -1}, InputError, "time_limit must be positive"),
        ({"scael": 2.0}, UnknownNameError, "did you mean scale"),
    ],
    ids=str,
)
def test_a_comparison_that_cannot_be_made_is_a_clear_error(arguments, error, words):
    with pytest.raises(error, match=words):
        wb.compare(**{"pattern": "toy/root", "methods": ["exact"], **arguments})


def test_progress_counts_cells(one):
    told = []
    one("exact", "rough", progress=lambda *what: told.append(what))
    assert told[-1] == ("cells", 2, 2)


def test_an_interrupt_ends_a_comparison_and_leaves_nothing(project, one):
    with pytest.raises(KeyboardInterrupt):
        one("exact", "interrupted")
    assert not any((project.results / "compare").glob("*"))
