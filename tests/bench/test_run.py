"""Run: feed the needs, answer, certify, leave a folder; reuse only what the same code made."""

import json

import pytest

import workbench as wb
from workbench.bench.describe import describe
from workbench.bench.project import registry
from workbench.bench.store import damage
from workbench.errors import (
    InputError,
    RegistryError,
    ResultError,
    UnknownNameError,
    WorkbenchError,
)
from workbench.solvers import Outcome

pytestmark = pytest.mark.usefixtures("project")


def stamp(run):
    """Changes whenever the run is written again."""
    return (run.path / "run.json").stat().st_mtime_ns


# --- answers ----------------------------------------------------------------------------------


def test_a_run_is_certified_and_stored(project):
    run = wb.run("toy/root", scale=4.0)
    assert run.holds and run.outcome is Outcome.SOLVED
    assert run.path == project.results / "toy" / "root" / run.key
    assert run.data["x"].values.tolist() == [2.0, 4.0, 8.0**0.5]
    assert run.metrics == {"largest": 4.0, "count": 3}
    assert damage(run.path) == []


def test_a_problem_may_have_a_default_method_of_its_own(project):
    text = project.toy.read_text()
    edited = text.replace('"toy/root", data=', '"toy/root", method="rough", data=')
    project.toy.write_text(edited)
    run = wb.run("toy/root")
    assert run.method == "rough" and run.holds
    assert wb.run("toy/root", method="exact").method == "exact"
    assert describe(registry().find("toy/root")).methods["rough"].endswith("(default)")
    project.toy.write_text(edited.replace('method="rough"', 'method="ruff"'))
    with pytest.raises(UnknownNameError, match="no method of Root is called 'ruff'"):
        wb.run("toy/root")


@pytest.mark.parametrize(
    ("method", "outcome", "certified"),
    [
        ("rough", Outcome.SOLVED, True),
        ("boastful", Outcome.INACCURATE, True),
        ("lying", Outcome.FAILED, True),
        ("nan", Outcome.FAILED, True),
        ("raising", Outcome.FAILED, False),
        ("garbage", Outcome.FAILED, False),
        ("hopeless", Outcome.NO_CLAIM, False),
    ],
)
def test_only_a_certificate_that_holds_makes_a_result(project, method, outcome, certified):
    run = wb.run("toy/root", method=method)
    assert run.outcome is outcome
    assert (run.certificate is not None) is certified
    assert run.holds is (outcome is Outcome.SOLVED)
    assert run.path.name == run.key + ("" if run.holds else ".failed")
    assert damage(run.path) == []
    assert len(wb.results()) == run.holds


def test_a_failure_says_why_and_keeps_the_trace(project):
    run = wb.run("toy/root", method="raising")
    assert run.info["message"] == "ArithmeticError: the sky fell"
    assert "Traceback" in run.log
    assert "reach: 4 exceeds" in "".join(wb.run("toy/root", method="lying").certificate.failures)


def test_a_failure_is_never_reused(project):
    first = wb.run("toy/root", method="lying")
    before = stamp(first)
    again = wb.run("toy/root", method="lying")
    assert again.path == first.path and not again.reused
    assert stamp(again) != before


def test_an_interrupt_leaves_nothing(project):
    with pytest.raises(KeyboardInterrupt):
        wb.run("toy/root", method="interrupted")
    assert wb.results() == []
    assert {file.suffix for file in project.results.rglob("*") if file.is_file()} <= {".lock"}


@pytest.mark.cases(1)
@pytest.mark.parametrize("seed", [0, 7])
def test_the_seed_makes_random_answers_repeatable(project, seed):
    one, two = (wb.run("toy/root", method="random", seed=seed, fresh=True).data for _ in range(2))
    assert one.identical(two)
    assert not one.identical(wb.run("toy/root", method="random", seed=seed + 1).data)


@pytest.mark.parametrize(
    ("name", "arguments", "error", "words"),
    [
        ("toy/rot", {}, UnknownNameError, "toy/root"),
        ("toy/root", {"method": "exat"}, UnknownNameError, "exact"),
        ("toy/root", {"scael": 1}, UnknownNameError, "scale"),
        ("toy/root", {"scale": "wide"}, InputError, "scale='wide' does not fit"),
        ("toy/root", {"tolerance": 2}, InputError, "between 0 and 1"),
        ("toy/root", {"method": "picky", "copies": 2}, InputError, "it counts to three"),
        ("toy/total", {"method": "exact"}, InputError, "a study: it has no method 'exact'"),
        ("toy/text", {}, RegistryError, "returned str, not a Program or a Study"),
        ("toy/loop/a", {}, RegistryError, "toy/loop/a -> toy/loop/b -> toy/loop/a"),
        ("toy/doomed", {}, ResultError, "toy/root, whose certificate does not hold: see"),
        ("toy/broken", {}, WorkbenchError, "one over nothing"),
    ],
    ids=lambda value: value if isinstance(value, str) else None,
)
def test_what_cannot_be_run_is_a_clear_error(project, name, arguments, error, words):
    with pytest.raises(error, match=words):
        wb.run(name, **arguments)


def test_a_missing_data_file_is_named(project):
    (project.toy.parent / "targets.csv").unlink()
    with pytest.raises(InputError, match=r"targets\.csv cannot be read"):
        wb.run("toy/root")


def test_a_figure_that_cannot_be_drawn_loses_no_answer(project):
    project.edit("if not self.drawn:", "if 1 / 0:")
    run = wb.run("toy/root")
    assert run.holds and run.data["x"].size
    with pytest.raises(ZeroDivisionError):
        run.show()
    (file,) = wb.report().parent.glob("report/runs/*.html")
    page = file.read_text(encoding="utf-8")
    assert "Figure not drawn: figures: ZeroDivisionError" in page and run.key in page


# --- keys and reuse ---------------------------------------------------------------------------


def test_the_same_question_is_answered_once(project):
    first = wb.run("toy/root", scale=2)
    again = wb.run("toy/root", method="exact", tolerance=1e-6, scale="2.0", copies=1, verbose=True)
    assert (first.reused, again.reused) == (False, True)
    assert again.path == first.path and again.note == ""


@pytest.mark.cases(0)
def test_the_key_is_the_same_in_another_process(project):
    run = wb.run("toy/sum", count=2)
    code = "import workbench as wb; run = wb.run('toy/sum', count=2); print(run.key, run.reused)"
    assert project.python(code).split() == [run.key, "True"]


@pytest.mark.cases(2)
@pytest.mark.parametrize(
    "change",
    [
        {"scale": 1.5},
        {"copies": 2},
        {"method": "rough"},
        {"tolerance": "high"},
        {"seed": 1},
        {"time_limit": 60.0},
    ],
    ids=str,
)
def test_another_question_has_another_folder(project, change):
    one, other = wb.run("toy/root"), wb.run("toy/root", **change)
    assert one.key != other.key and not other.reused
    assert len(wb.results()) == 2


def test_other_data_is_another_question(project):
    before = wb.run("toy/total")
    project.write("plants/toy/targets.csv", "9,16\n")
    after = wb.run("toy/total")
    assert after.key != before.key
    assert after.metrics["total"] == 14.0 and before.metrics["total"] != 14.0


def test_other_code_answers_anew_compares_and_says_so(project):
    before = wb.run("toy/root")
    project.edit("OFFSET = 0.0", "OFFSET = 0.0  # the same in other words")
    after = wb.run("toy/root")
    assert after.path == before.path and not after.reused
    assert after.note == "recomputed; agrees with the earlier answer within 1e-06"
    assert after.note in after.log
    assert wb.run("toy/root").reused


def test_an_answer_that_differs_under_other_code_is_told(project):
    wb.run("toy/root", method="rough")
    project.edit("OFFSET = 0.0", "OFFSET = 1.0")
    note = wb.run("toy/root", method="rough").note
    assert note.startswith("recomputed; differs from the earlier answer: x differs by 0.")


def test_other_versions_answer_anew_under_the_same_key(project, monkeypatch):
    before = wb.run("toy/root")
    monkeypatch.setattr("workbench.bench.code.versions", lambda packages: {"clarabel": "99"})
    after = wb.run("toy/root")
    assert after.key == before.key and not after.reused


def test_fresh_answers_anew_but_not_its_needs(project):
    first = wb.run("toy/total")
    (need,) = wb.results("toy/root")
    before = stamp(first), stamp(need)
    again = wb.run("toy/total", fresh=True)
    assert not again.reused and "agrees" in again.note
    assert stamp(again) != before[0] and stamp(need) == before[1]


@pytest.mark.cases(0)
def test_a_worse_answer_under_other_code_leaves_the_good_one(project):
    good = wb.run("toy/root")
    project.edit("OFFSET = 0.0", "OFFSET = -1.0")
    bad = wb.run("toy/root")
    assert bad.path.name == f"{good.key}.failed"
    assert damage(good.path) == [] and wb.open_run(good.path).holds


@pytest.mark.cases(2)
@pytest.mark.parametrize("file", ["data.nc", "certificate.json", "run.json"])
def test_a_damaged_answer_is_not_reused(project, file):
    path = wb.run("toy/root").path
    (path / file).write_bytes(b"{")
    again = wb.run("toy/root")
    assert not again.reused and again.holds
    assert damage(path) == []


def test_code_edited_in_a_long_session_is_what_runs_next(project):
    before = wb.run("toy/root", method="rough").data["x"].values.max()
    text = project.toy.read_text()
    project.toy.write_text(text.replace("OFFSET = 0.0", "OFFSET = 1.0"))
    again = wb.run("toy/root", method="rough")
    assert not again.reused
    assert again.data["x"].values.max() == 4.5 == 1.5 * before
    (project.toy.parent / "more.py").write_text(
        "from workbench import problem\n@problem('toy/more')\ndef more(): ...\n"
    )
    assert "toy/more" in [entry.name for entry in wb.problems()]


EDITED_BEFORE_THE_FIRST_RUN = """
from pathlib import Path
import workbench as wb
import workbench.plants

workbench.plants.__path__[:] = [str(Path("plants").resolve())]
import workbench.plants.toy.problems as imported

file = Path(imported.__file__)
file.write_text(file.read_text().replace("OFFSET = 0.0", "OFFSET = 1.0"))
print(imported.OFFSET, wb.run("toy/root", "rough").data["x"].values.max())
"""


@pytest.mark.cases(0)
def test_a_module_imported_by_hand_and_edited_before_the_first_run_is_imported_anew(project):
    assert project.python(EDITED_BEFORE_THE_FIRST_RUN) == "0.0 4.5"


# --- needs ------------------------------------------------------------------------------------


def test_a_need_is_run_first_and_reused_after(project):
    run = wb.run("toy/total")
    (need,) = wb.results("toy/root")
    assert need.info["parameters"]["scale"] == 4.0
    assert run.metrics["total"] == pytest.approx(2 + 4 + 8**0.5)
    before = stamp(need)
    wb.run("toy/total", seed=0, tolerance="high")
    assert stamp(need) == before


def test_a_need_is_taken_where_it_is_there(project):
    need = wb.run("toy/root", scale=4.0)
    before = stamp(need)
    run = wb.run("toy/total")
    assert stamp(need) == before
    assert run.info["needs"] == {"part": need.key}


def test_needs_fan_out_over_a_list(project):
    run = wb.run("toy/sum", count=3)
    keys = run.info["needs"]["parts"]
    assert len(set(keys)) == 3 == len(wb.results("toy/root"))
    assert [wb.run("toy/root", scale=i + 1.0).key for i in range(3)] == keys


def test_needs_follow_the_axis_and_name_their_method(project):
    run = wb.run("toy/y/total")
    (need,) = wb.results("toy/?/root")
    assert (need.problem, need.method) == ("toy/y/root", "rough")
    assert run.metrics["total"] == 4.5


def test_a_study_inherits_the_checks_of_its_needs(project):
    names = [check.name for check in wb.run("toy/sum").certificate.checks]
    assert names == ["parts[0]: reach", "parts[1]: reach", "positive"]


def test_a_need_that_fails_stops_what_is_downstream(project):
    with pytest.raises(ResultError, match=r"toy/doomed needs toy/root.*\.failed"):
        wb.run("toy/doomed")
    assert not (project.results / "toy" / "doomed").exists()


def test_a_damaged_need_is_run_again(project):
    need = wb.run("toy/root", scale=4.0)
    (need.path / "data.nc").unlink()
    assert wb.run("toy/total").holds
    assert damage(need.path) == []


def test_the_key_of_a_need_enters_the_key(project):
    before = wb.run("toy/total").key
    project.edit("scale=4.0", "scale=5.0")
    assert wb.run("toy/total").key != before


def test_a_need_that_changes_under_other_code_is_fed_anew(project):
    """The upstream's code changes in a folder of its own; downstream the question is the same."""
    project.write(
        "plants/far/problems.py",
        "from workbench import problem, ref\n\n"
        '@problem("far/total", needs={"part": ref("toy/total")})\n'
        "def total(part):\n"
        '    """Once more."""\n'
        "    from dataclasses import dataclass\n"
        "    from workbench import Check, Study\n\n"
        "    class Same(Study):\n"
        "        def compute(self, context):\n"
        "            return part.data\n"
        "        def checks(self, answer, tolerance):\n"
        "            return []\n"
        "        def metrics(self, answer):\n"
        '            return {"total": float(answer["total"])}\n'
        "        def figures(self, answer):\n"
        "            return {}\n\n"
        "    return Same()\n",
    )
    before = wb.run("far/total").metrics["total"]
    project.edit("OFFSET = 0.0", "OFFSET = 1e-8")
    assert wb.run("far/total").metrics["total"] > before


def test_a_loaded_problem_is_fed_too(project):
    task = wb.load("toy/sum", count=2)
    assert [run.problem for run in task.parts] == ["toy/root"] * 2


# --- two at once ------------------------------------------------------------------------------

ASK = """
import workbench as wb
run = wb.run("toy/sum", count=2)
print(run.path, run.holds, run.reused)
"""


@pytest.mark.cases(0)
def test_two_processes_asking_at_once_share_one_answer(project):
    project.edit(
        "    def compute(self, context):\n",
        "    def compute(self, context):\n        time.sleep(1)\n",
    )
    answers = [[], []]
    started = [project.start(ASK) for _ in answers]
    for answer, process in zip(answers, started, strict=True):
        with process:
            out, err = process.communicate(timeout=600)
        assert process.returncode == 0, err
        answer += out.split()
    assert answers[0][:2] == answers[1][:2] == [answers[0][0], "True"]
    assert {answer[2] for answer in answers} == {"True", "False"}
    assert len(wb.results("toy/sum")) == 1 and len(wb.results("toy/root")) == 2


@pytest.mark.slow
def test_results_may_be_listed_while_one_is_written(project):
    wb.run("toy/root")
    with project.start(ASK) as process:
        while process.poll() is None:
            for run in wb.results():
                assert json.loads((run.path / "run.json").read_text())["outcome"] == "solved"
        assert process.wait() == 0
