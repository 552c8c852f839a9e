"""Every problem by every method: each cell stored when it ends, killed at its limits, judged."""

import importlib.util
import json
import os
import signal
import sqlite3
import subprocess
import sys
import time
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from multiprocessing import get_context
from pathlib import Path

import pytest
from click.testing import CliRunner

import workbench as wb
from workbench.bench.cells.answer import WARM
from workbench.bench.cells.stored import Journal, light_records
from workbench.bench.compare import asked_for, described
from workbench.bench.store import damage, seal
from workbench.cli import main
from workbench.errors import InputError, RegistryError, ResultError, UnknownNameError
from workbench.executor import InProcess, Workers
from workbench.geometry import SmallestCircle

POINTS = '''
"""Three points."""

from workbench import problem
from workbench.geometry import SmallestCircle


@problem("mine/points")
def points() -> SmallestCircle:
    """The least circle about three points."""
    return SmallestCircle([[0, 2, 1 + 1j]])
'''
EXECUTORS = {
    "in process": InProcess,
    "workers": Workers,
    "threads": lambda: ThreadPoolExecutor(2),
    "pool": lambda: ProcessPoolExecutor(1, get_context("spawn")),
}
pytestmark = pytest.mark.usefixtures("project")


def cell(run, method, name="outcome", problem=0, accuracy=0, repetition=0):
    values = run.data[name].sel(by_method=method).values
    return values[problem, accuracy, repetition].item()


@pytest.fixture
def one(project):
    """Compare methods on one problem at one accuracy, in this process unless told otherwise."""

    def compare(*methods, **options):
        options = {"accuracies": ["middle"], "executor": InProcess(), **options}
        return wb.compare("toy/root", methods=methods, **options)

    return compare


MORE = """

@method(Root, "leaving", optimal=True)
def leaving(program, context):
    raise SystemExit(3)


@method(Root, "printing", optimal=True)
def printing(program, context):
    print("forty-two lines")
    os.write(2, b"and some of compiled code")
    return roots(program), Outcome.SOLVED, ""


@method(Root, "greedy", optimal=True)
def greedy(program, context):
    kept = np.ones(2**27)
    time.sleep(60)
    return kept, Outcome.SOLVED, ""


@method(Root, "compiling", optimal=True)
def compiling(program, context):
    from numba.core.event import start_event, end_event

    if not hasattr(time, "compiled"):
        start_event("numba:compile")
        time.sleep(1.0)
        end_event("numba:compile")
        time.compiled = True
    return roots(program), Outcome.SOLVED, ""


@method(Root, "noting", optimal=True)
def noting(program, context):
    with open("order.txt", "a") as file:
        file.write(f"{program.targets} ")
    return roots(program), Outcome.SOLVED, ""
"""


@pytest.fixture
def hostile(project):
    """More methods of the toy."""
    project.write("plants/toy/problems.py", project.toy.read_text() + MORE)


@pytest.fixture(scope="module")
def workers():
    with Workers(count=2) as executor:
        yield executor


CELLS = {  # outcome, claim, certified
    "exact": ("solved", "solved", True),
    "rough": ("solved", "solved", True),
    "boastful": ("inaccurate", "solved", False),
    "lying": ("failed", "solved", False),
    "modest": ("solved", "inaccurate", True),
    "hopeless": ("no claim", "infeasible", False),
    "raising": ("failed", "failed", False),
    "garbage": ("failed", "solved", False),
}


@pytest.mark.cases(0)
def test_a_cell_says_what_the_certificate_says_and_what_the_method_claimed(one):
    run = one(*CELLS)
    names = ("outcome", "claim", "certified")
    assert {m: tuple(cell(run, m, name) for name in names) for m in CELLS} == CELLS


@pytest.mark.cases(0)
def test_an_unfit_cell_gives_its_reason_and_is_no_failure(one):
    run = one("exact", "picky", copies=2)
    assert run.holds
    assert (cell(run, "picky"), cell(run, "picky", "message")) == ("unfit", "it counts to three")
    assert run.metrics["cells"] == 1 and run.metrics["unfit"] == 1


def test_a_method_that_nobody_has_is_an_error(one):
    with pytest.raises(UnknownNameError, match="did you mean exact"):
        one("exat")


def test_every_method_of_a_problem_is_asked_where_none_is_named(project):
    plan = asked_for("toy/root", None, ["low"], {}, executor=InProcess()).planned()
    assert {labels[1] for labels in plan.places} >= {"exact", "rough", "hanging", "picky"}


def test_a_method_that_is_never_the_best_is_compared_if_it_is_named(project):
    project.edit('"rough", optimal=False', '"rough", optimal=False, by_name=True')

    def states(methods):
        asked = asked_for("toy/root", methods, ["low"], {}, executor=InProcess())
        return {labels[1]: state for labels, state in described(asked.planned())}

    assert states(None)["rough"] == "not compared: ask by name"
    assert states(None)["exact"] == states(["rough"])["rough"] == "would run"


@pytest.mark.cases(0)
def test_a_study_has_nothing_to_compare(project):
    run = wb.compare("toy/[rt]o*", methods=["exact"], accuracies=["low"], executor=InProcess())
    assert run.data["outcome"].values.ravel().tolist() == ["solved", "unfit"]
    assert cell(run, "exact", "message", problem=1) == "toy/total is a study: it has no methods"


@pytest.mark.cases(0)
def test_every_problem_method_level_and_repetition_is_a_cell(project):
    run = wb.compare("toy/?/root", methods=["exact", "boastful"], repeat=2, executor=InProcess())
    assert dict(run.data.sizes) == {
        "problem": 2,
        "by_method": 2,
        "accuracy": 3,
        "repetition": 2,
    }
    assert run.data["problem"].values.tolist() == ["toy/x/root", "toy/y/root"]
    assert run.data["program"].values.tolist() == ["Root", "Root"]
    assert run.data["tolerance"].values.tolist() == [1e-3, 1e-6, 1e-9]
    assert (run.data["certified"].sel(by_method="exact") == 1).all()
    assert (run.data["gap"].sel(by_method="boastful") > 0.4).all()
    keys = run.data["key"].values.ravel().tolist()
    assert len(set(keys)) == 24 and all(len(key) == 16 for key in keys)


@pytest.mark.cases(0)
def test_what_was_measured_has_its_unit(one):
    data = one("exact").data
    for name, unit in {
        "statement": "s",
        "solve": "s",
        "check": "s",
        "cpu": "s",
        "memory": "byte",
    }.items():
        assert data[name].attrs["units"] == unit and (data[name] >= 0).all()
    assert data["memory"].item() > 1e7
    assert {"processor", "cores", "memory", "system"} <= json.loads(data.attrs["machine"]).keys()


# --- stored, found again ----------------------------------------------------------------------


def cell_folders(project):
    return sorted((project.results / "cells").rglob("run.json"))


@pytest.mark.cases(0)
def test_a_cell_is_a_results_folder_of_its_own_that_verifies(project, one):
    run = one("exact", "lying", "raising")
    folders = {file.parent.name for file in cell_folders(project)}
    # What failed is said by the cell, as it ends and as it is read again.
    said = [cell(each, "lying", "message") for each in (run, one("exact", "lying", "raising"))]
    assert said[0] == said[1] and " exceeds " in said[0]
    keys = {m: cell(run, m, "key") for m in ("exact", "lying", "raising")}
    assert folders == {keys["exact"], keys["lying"] + ".failed", keys["raising"] + ".failed"}
    place = project.results / "cells/toy/root" / keys["exact"]
    assert wb.verify(place).holds
    assert wb.open_run(place).data["x"].attrs["units"] == "m"
    assert {run.problem for run in wb.results()} == {"compare"}


@pytest.mark.cases(0)
def test_the_needs_of_a_cell_are_found_when_it_is_verified(project):
    project.write("mine/p.py", NEEDY.format(folder=project.toy.parent))
    wb.add_problems("mine")
    run = wb.compare("mine/fed", methods=["plain"], accuracies=["low"], executor=InProcess())
    place = project.results / "cells/mine/fed" / run.data["key"].item()
    assert wb.verify(place).holds


NEEDY = '''
from dataclasses import dataclass
import numpy as np, xarray as xr
from workbench import Check, Outcome, Program, method, problem, ref

@dataclass(frozen=True)
class Twice(Program):
    """Twice a number."""
    number: float
    default_method = "plain"
    def checks(self, answer, tolerance):
        return [Check("twice", "", abs(answer - 2 * self.number), 1e-9)]
    def metrics(self, answer):
        return {{}}
    def to_dataset(self, answer):
        return xr.Dataset({{"twice": answer}})
    def from_dataset(self, data):
        return float(data["twice"])

@method(Twice, "plain", optimal=False)
def plain(program, context):
    return 2 * program.number, Outcome.SOLVED, ""

@problem("mine/fed", needs={{"part": ref("toy/root")}})
def fed(part) -> Twice:
    return Twice(float(part.data["x"].sum()))
'''


@pytest.mark.cases(0)
def test_what_is_stored_is_not_computed_again(project, one):
    before = one("exact", "raising", "lying")
    stamps = {file: file.stat().st_mtime_ns for file in cell_folders(project)}
    again = one("exact", "raising", "lying", "rough")
    assert {f: f.stat().st_mtime_ns for f in cell_folders(project) if f in stamps} == stamps
    assert len(cell_folders(project)) == 4
    for name in ("key", "solve", "cpu", "outcome"):
        same = again.data[name].sel(by_method=before.data["by_method"])
        assert same.equals(before.data[name])
    one("exact", fresh=True)
    assert {f for f in stamps if f.stat().st_mtime_ns != stamps[f]} != set()


@pytest.mark.cases(0)
def test_an_edit_elsewhere_leaves_cells_fresh_and_one_of_the_method_does_not(project, one):
    def solved():
        return one("exact").data["solve"].item()

    before = solved()
    project.write("plants/else/other.py", "x = 1")
    project.write("plants/toy/unused.py", "x = 1")
    assert solved() == before
    project.write("plants/toy/problems.py", project.toy.read_text() + "\n# another line\n")
    assert solved() != before


@pytest.mark.cases(0)
def test_a_damaged_cell_is_computed_again(project, one):
    run = one("exact")
    place = project.results / "cells/toy/root" / cell(run, "exact", "key")
    (place / "log.txt").write_text("edited")
    one("exact")
    assert damage(place) == []


@pytest.mark.cases(0)
def test_a_collision_of_keys_is_detected(project, one):
    run = one("exact")
    place = project.results / "cells/toy/root" / cell(run, "exact", "key")
    text = (place / "run.json").read_text().replace('"scale": 1.0', '"scale": 2.0')
    (place / "run.json").write_text(text)
    seal(place)
    with pytest.raises(ResultError, match="another question of the same key"):
        one("exact")


@pytest.mark.cases(0)
def test_light_records_are_verified_with_their_comparison(project, one):
    run = one("exact", "lying", light=True)
    found = wb.verify(run.path)
    assert found.holds and not any("not here" in note for note in found.notes)
    with sqlite3.connect(project.results / "cells/light.sqlite") as rows:
        rows.execute("update cells set record = replace(record, '\"solve\":', '\"solve\":1')")
    found = wb.verify(run.path)
    assert not found.holds and "its solve is" in " ".join(found.problems)


@pytest.mark.slow
def test_a_comparison_with_a_crashed_and_a_stopped_cell_is_verified(hostile, one, workers):
    run = one("hanging", "dying", "exact", executor=workers, time_limit=1.0)
    assert {"time limit", "crashed"} <= set(run.data["outcome"].values.ravel().tolist())
    found = wb.verify(run.path)
    assert found.holds, found


@pytest.mark.cases(0)
@pytest.mark.parametrize("light", [True, False])
def test_cells_that_other_code_has_answered_since_are_no_defect_of_a_comparison(
    project, one, light
):
    run = one("exact", "lying", light=light)
    project.edit("OFFSET = 0.0", "OFFSET = 1.0")
    one("lying", light=light)
    found = wb.verify(run.path)
    assert found.holds, found
    assert any("1 of 2 cells were answered again since" in note for note in found.notes)


def test_a_comparison_says_how_many_of_its_cells_are_certified(one):
    assert "certified 0 of 1" in repr(one("lying").certificate)


def test_light_records_are_one_file_once_nobody_writes(tmp_path):
    folder = tmp_path / "cells"
    with Journal(tmp_path), Journal(tmp_path):
        assert len(list(folder.iterdir())) > 1
    assert [file.name for file in folder.iterdir()] == ["light.sqlite"]
    assert light_records(tmp_path) == {}  # to read it leaves nothing either
    assert [file.name for file in folder.iterdir()] == ["light.sqlite"]


@pytest.mark.cases(0)
def test_light_cells_leave_records_and_no_folders(project, one):
    run = one("exact", "lying", "raising", light=True)
    assert cell_folders(project) == []
    again = one("exact", "lying", "raising", light=True)
    for name in ("key", "solve", "cpu", "outcome", "message"):
        assert again.data[name].equals(run.data[name])
    with sqlite3.connect(project.results / "cells/light.sqlite") as rows:
        assert rows.execute("select count(*) from cells").fetchone() == (3,)
        rows.execute("update cells set question = '{}'")
    with pytest.raises(ResultError, match="another question of the same key"):
        one("exact", light=True)


def test_a_journal_that_is_no_database_is_a_clear_error(project):
    project.write("results/cells/light.sqlite", "not a database" * 100)
    with pytest.raises(ResultError, match=r"light records .*light\.sqlite"):
        Journal(project.results)


STOPPED = """
import workbench as wb
if __name__ == "__main__":
    print("begun", flush=True)
    wb.compare("toy/root", ["exact", "rough", "hanging"], accuracies=["low"], seed=1)
"""


@pytest.mark.cases(0)
def test_a_comparison_that_is_killed_has_kept_its_finished_cells(project):
    project.write("run.py", STOPPED)
    process = subprocess.Popen([sys.executable, "run.py"], cwd=project.root)
    until = time.monotonic() + 60
    while len(list((project.results / "cells").rglob("SHA256SUMS"))) < 2:
        assert time.monotonic() < until and process.poll() is None
        time.sleep(0.05)
    process.send_signal(signal.SIGKILL)
    process.wait()
    kept = len(cell_folders(project))
    assert kept == 2 and not (project.results / "compare").exists()
    asked = asked_for("toy/root", ["exact", "rough"], ["low"], {}, seed=1, executor=InProcess())
    plan = asked.planned()
    states = [state for _, state in described(plan)]
    assert states.count("stored") == kept


# --- limits, crashes --------------------------------------------------------------------------


@pytest.mark.cases(0)
def test_hostile_methods_cost_their_own_cells_only(hostile, one, workers):
    run = one("hanging", "dying", "exact", "leaving", "printing", executor=workers, time_limit=1.0)
    assert cell(run, "exact") == cell(run, "printing") == "solved"
    assert cell(run, "hanging") == "time limit"
    assert "limit of" in cell(run, "hanging", "message")
    assert cell(run, "dying") == cell(run, "leaving") == "crashed"
    assert "exit code 7" in cell(run, "dying", "message")
    assert "sys.exit(3)" in cell(run, "leaving", "message")
    assert run.metrics["certified_share"] == pytest.approx(2 / 5)


@pytest.mark.cases(0)
def test_the_words_of_a_method_are_in_the_log_of_its_cell(hostile, project, one, workers):
    run = one("printing", executor=workers)
    place = project.results / "cells/toy/root" / cell(run, "printing", "key")
    assert "forty-two lines" in (place / "log.txt").read_text()


@pytest.mark.slow
def test_a_greedy_method_is_killed_for_its_memory(hostile, one):
    run = one("greedy", "exact", executor=None, memory_limit=800 * 2**20)
    assert cell(run, "greedy") == "memory limit"
    assert "800 MiB" in cell(run, "greedy", "message")
    assert cell(run, "exact") == "solved"


@pytest.mark.cases(0)
def test_a_time_limit_counts_neither_start_nor_imports_nor_compilation(hostile, one):
    """A fresh worker takes seconds before its first cell, and this method compiles for some."""
    run = one("exact", "compiling", executor=None, time_limit=0.5)
    assert cell(run, "exact") == cell(run, "compiling") == "solved"
    assert cell(run, "compiling", "solve") < 0.5


@pytest.mark.cases(0)
def test_a_method_that_heeds_the_clock_is_out_of_time_in_process(one):
    run = one("exact", "patient", time_limit=0.05)
    assert cell(run, "patient") == cell(run, "patient", "claim") == "time limit"


@pytest.mark.slow
@pytest.mark.parametrize(
    "make",
    [
        pytest.param(make, id=name, marks=pytest.mark.slow if name == "pool" else ())
        for name, make in EXECUTORS.items()
    ],
)
def test_any_executor_gives_the_same_cells(project, make):
    """Workers know the added folder; a problem that cannot be bound is a failed cell of its own."""
    project.write("mine/p.py", project.toy.read_text().replace("toy/", "mine/"))
    project.write("mine/targets.csv", "9")
    wb.add_problems("mine")
    with make() as executor:
        run = wb.compare(
            "mine/[br]*", methods=["exact", "lying"], accuracies=["low"], executor=executor
        )
    assert run.data["problem"].values.tolist() == ["mine/broken", "mine/root"]
    assert [cell(run, method, problem=1) for method in ("exact", "lying")] == ["solved", "failed"]
    assert cell(run, "exact") == "failed"
    assert "one over nothing" in cell(run, "exact", "message")


def test_workers_elsewhere_know_the_folders_and_the_results(project, workers, monkeypatch):
    monkeypatch.setenv("WORKBENCH_RESULTS", "kept")
    workers.submit(os.chdir, "/").result()
    workers.submit(os.chdir, "/").result()
    run = wb.compare("toy/x/root", methods=["exact"], accuracies=["low"], executor=workers)
    assert cell(run, "exact") == "solved"
    assert (project.root / "kept/cells/toy/x/root" / cell(run, "exact", "key")).is_dir()


@pytest.mark.slow
def test_cells_run_in_an_order_drawn_with_the_seed(hostile, project):
    def order(seed):
        (project.root / "order.txt").unlink(missing_ok=True)
        settings = {"repeat": 8, "seed": seed, "fresh": True, "executor": InProcess()}
        wb.compare("toy/?/root", methods=["noting"], accuracies=["low"], **settings)
        return (project.root / "order.txt").read_text()

    order(0)  # a first call is made twice
    first = order(0)
    assert order(0) == first != order(1)


@pytest.mark.cases(0)
def test_a_plan_runs_nothing(project):
    asked = asked_for("toy/*", ["exact", "picky"], ["low"], {}, executor=InProcess())
    states = {labels[:2]: state for labels, state in described(asked.planned())}
    assert states["toy/root", "exact"] == "would run"
    assert states["toy/total", "exact"].startswith("unfit")
    assert not project.results.exists() or cell_folders(project) == []


@pytest.mark.parametrize(
    ("arguments", "error", "words"),
    [
        ({"pattern": "nothing*"}, UnknownNameError, "no problem is called"),
        ({"methods": []}, InputError, "at least one method"),
        ({"accuracies": ["medium"]}, InputError, "low, middle, high, not .*medium"),
        ({"accuracies": []}, InputError, "low, middle, high"),
        ({"time_limit": -1}, InputError, "time_limit must be positive"),
        ({"memory_limit": -1}, InputError, "memory_limit of workers must be 1 or more"),
        ({"repeat": 0}, InputError, "repeat must be 1 or more"),
        ({"jobs": 0}, InputError, "jobs must be 1 or more"),
        ({"scael": 2.0}, UnknownNameError, "did you mean scale"),
        ({"pattern": "toy/lat*"}, InputError, "slow"),
    ],
    ids=str,
)
def test_a_comparison_that_cannot_be_made_is_a_clear_error(arguments, error, words):
    with pytest.raises(error, match=words):
        wb.compare(**{"pattern": "toy/root", "methods": ["exact"], **arguments})


@pytest.mark.cases(0)
def test_a_method_of_this_process_alone_is_no_unfit_method(project):
    """Workers do not know it; where cells run in this process it takes part."""
    project.write("mine/points.py", POINTS)
    wb.add_problems("mine")

    @wb.method(SmallestCircle, "of here", optimal=False)
    def of_here(program, context):
        return wb.solve(program, method="exact").answer, wb.Outcome.SOLVED, ""

    with pytest.raises(InputError, match="'of here' of SmallestCircle is registered in this proc"):
        wb.compare("mine/points", methods=["exact", "of here"], accuracies=["low"])
    here = wb.compare("mine/points", methods=["of here"], accuracies=["low"], executor=InProcess())
    assert here.holds and here.metrics["certified_share"] == 1.0


OWN_METHOD = """
import workbench as wb
from workbench.geometry import SmallestCircle


@wb.method(SmallestCircle, "own", optimal=False)
def own(program, context):
    return wb.solve(program, "exact").answer, wb.Outcome.SOLVED, ""
"""


@pytest.mark.cases(0)
def test_a_file_of_a_problems_folder_adds_a_method_to_a_problem_of_another(project):
    """Workers know it too; it has no problem of its own."""
    project.write("mine/points.py", POINTS)
    project.write("methods/own.py", OWN_METHOD)
    wb.add_problems("mine")
    wb.add_problems("methods")
    run = wb.compare("mine/points", methods=["exact", "own"], accuracies=["low"])
    assert run.metrics["certified_share"] == 1.0
    assert wb.run("mine/points", method="own").holds


def test_a_file_of_methods_that_cannot_be_imported_costs_its_own_methods_only(project):
    project.write("mine/points.py", POINTS)
    project.write("methods/own.py", OWN_METHOD.replace("SmallestCircle", "NoProgram"))
    wb.add_problems("mine")
    wb.add_problems("methods")
    assert wb.run("mine/points").holds
    with pytest.raises(RegistryError, match=r"'own'; .*own\.py cannot be imported: ImportError"):
        wb.compare("mine/points", methods=["own"], accuracies=["low"])


@pytest.mark.cases(1)
@pytest.mark.parametrize("command", [["run", "mine/points"], ["compare", "mine/points"]])
def test_files_of_methods_that_are_left_out_are_told(project, command):
    project.write("mine/points.py", POINTS)
    project.write("methods/first.py", OWN_METHOD)
    project.write("methods/second.py", OWN_METHOD)
    project.write("methods/third.py", "from helper import x\n" + OWN_METHOD)
    project.write("methods/helper.py", "x = 1\n")
    options = ["--problems", "mine", "--problems", "methods"]
    if command[0] == "compare":
        options += ["--methods", "own", "--accuracy", "low", "--in-process"]
    done = CliRunner().invoke(main, [*command, *options])
    assert done.exit_code == 0, done.output
    assert "two methods of SmallestCircle are called 'own'" in done.stderr
    assert "helper.py lies beside it: write `from .helper import ...`" in done.stderr


@pytest.mark.cases(0)
def test_the_command_that_repeats_a_cell_names_the_folders_of_problems(project):
    project.write("mine/points.py", POINTS)
    project.write("methods/own.py", OWN_METHOD.replace("return ", "return None; return "))
    words = ["compare", "mine/points", "--methods", "own", "--accuracy", "low", "--in-process"]
    done = CliRunner().invoke(main, [*words, "--problems", "mine", "--problems", "methods"])
    (repeat,) = (line for line in done.stdout.splitlines() if "workbench run mine/points" in line)
    assert repeat.split()[-4:] == [
        *("--problems", str(project.root / "mine")),
        *("--problems", str(project.root / "methods")),
    ]


@pytest.mark.cases(0)
def test_progress_counts_cells(one):
    told = []
    one("exact", "rough", progress=lambda *what: told.append(what))
    assert told[-1] == ("cells", 2, 2)


def test_an_interrupt_ends_a_comparison_and_keeps_what_is_finished(project, one):
    with pytest.raises(KeyboardInterrupt):
        one("interrupted", "exact", "rough", seed=3)
    assert not any((project.results / "compare").glob("*"))


@pytest.mark.cases(0)
def test_the_question_decides_the_folder_of_a_comparison(one):
    paths = [run.path for run in (one("exact"), one("exact", scale=2.0), one("rough"))]
    assert len(set(paths)) == 3
    assert one("exact").path == paths[0]
    assert Path(paths[0]).parent.name == "compare"


def test_workers_import_what_there_is():
    """A worker that cannot import dies, and every cell of a comparison with it."""
    assert [name for name in WARM if importlib.util.find_spec(name) is None] == []
