"""A run that was stopped goes on where it was; one out of time is the best so far, and says so."""

import json
import os
import pickle
import signal
import time

import numpy as np
import pytest

import workbench as wb
from workbench.bench.checkpoint import FileCheckpoint
from workbench.bench.results import stored_runs
from workbench.bench.store import seal
from workbench.solvers import Outcome


def left(project):
    """The states of iterations that are kept."""
    return list(project.results.glob(".partial/*.npz"))


def interrupted(after, **question):
    """Stop Newton's iteration after so many rounds, as Ctrl-C does."""

    def stop(description, done, total):
        if done == after:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        wb.run("toy/root", method="newton", progress=stop, **question)


def resumed(**question):
    """The round at which the run begins, and the run."""
    told = []
    run = wb.run("toy/root", method="newton", progress=lambda *what: told.append(what), **question)
    return told[0][1], run


def out_of_time(project, limit=0.5):
    """A run that meets its time limit after some of its twelve rounds."""
    project.edit("PAUSE = 0.0", "PAUSE = 0.2")
    return wb.run("toy/root", method="newton", time_limit=limit)


# --- interrupted ------------------------------------------------------------------------------


@pytest.mark.cases(1)
@pytest.mark.parametrize("after", [1, 5, 12])
def test_an_interrupted_run_goes_on_where_it_was(project, after):
    interrupted(after)
    assert len(left(project)) == 1 and wb.results() == []
    first, run = resumed()
    assert first == after
    whole = wb.run("toy/root", method="newton", fresh=True)
    assert run.holds and run.data.identical(whole.data)
    assert run.metrics == whole.metrics


def test_the_whole_iteration_is_told_and_logged(project):
    interrupted(5)
    told = []
    run = wb.run("toy/root", method="newton", watch=lambda rows: told.append(len(rows)))
    assert told == list(range(1, 13))
    assert run.log.count("round ") == 12 and "round 3, excess 0.00" in run.log
    assert "went on where a run was stopped after" in run.note and run.note in run.log
    assert 0 < run.seconds["earlier"] < 60
    assert "earlier" not in wb.run("toy/root", method="newton", fresh=True).seconds


def test_a_state_is_dropped_once_the_question_is_answered(project):
    interrupted(5)
    resumed()
    assert left(project) == []


def test_a_run_may_be_stopped_again_and_again(project):
    for after in (2, 4, 9):
        interrupted(after)
    assert resumed()[0] == 9


def test_a_state_survives_the_listing_of_results(project):
    interrupted(5)
    assert stored_runs(project.results) == []
    assert resumed()[0] == 5


@pytest.mark.cases(0)
@pytest.mark.skipif(os.name == "nt", reason="Windows has no such signal")
def test_a_killed_process_loses_no_finished_round(project):
    project.edit("PAUSE = 0.0", "PAUSE = 0.2")
    command = "from workbench.cli import main; main(['run', 'toy/root', '--method', 'newton'])"
    with project.start(command) as process:
        while not left(project):
            assert process.poll() is None, process.stderr.read()
            time.sleep(0.01)
        process.send_signal(signal.SIGKILL)
    assert process.returncode == -signal.SIGKILL
    first, run = resumed()
    assert 0 < first < 12
    assert run.holds and run.log.count("round ") == 12
    assert left(project) == []


# --- whose state it is ------------------------------------------------------------------------


def test_other_code_does_not_go_on(project):
    interrupted(5)
    project.edit("OFFSET = 0.0", "OFFSET = 0.0  # other code")
    assert resumed()[0] == 0
    assert left(project) == []


@pytest.mark.cases(2)
@pytest.mark.parametrize("change", [{"scale": 4.0}, {"seed": 1}, {"tolerance": "high"}], ids=str)
def test_another_question_does_not_go_on(project, change):
    interrupted(5)
    assert resumed(**change)[0] == 0
    assert resumed()[0] == 5


def test_a_state_under_another_questions_name_is_nobodys(project):
    interrupted(5)
    (state,) = left(project)
    interrupted(3, scale=4.0)
    (other,) = set(left(project)) - {state}
    state.replace(other)
    assert resumed(scale=4.0)[0] == 0


def test_a_fresh_run_begins_anew(project):
    interrupted(5)
    assert resumed(fresh=True)[0] == 0


@pytest.mark.cases(2)
@pytest.mark.parametrize("size", [0, 1, 100, -1])
def test_a_damaged_state_is_not_gone_on_from(project, size):
    interrupted(5)
    (state,) = left(project)
    state.write_bytes(state.read_bytes()[:size])
    first, run = resumed()
    assert first == 0 and run.holds


# --- out of time ------------------------------------------------------------------------------


def test_a_run_out_of_time_is_the_best_so_far_and_says_so(project):
    run = out_of_time(project)
    words = "time limit of 0.5 s reached after "
    assert run.outcome is Outcome.TIME_LIMIT and run.best_so_far
    assert run.certificate.valid and not run.holds
    assert run.info["claim"] == run.info["outcome"] == "time limit"
    assert run.info["message"].startswith(words) and "best so far" in run.info["message"]
    assert words in run.log and "outcome: time limit" in run.log
    assert run.path.name == f"{run.key}.failed" and wb.results() == []
    assert "goes on from there" in run.note


def test_more_time_goes_on_from_the_best_so_far(project):
    short = out_of_time(project)
    rounds = short.log.count("round ")
    first, run = resumed(time_limit=100.0)
    assert 0 < first == rounds < 12
    assert run.holds and run.key != short.key and left(project) == []


def test_the_same_question_goes_on_too_and_is_answered_in_the_end(project):
    short = out_of_time(project).path
    for _ in range(12):
        run = wb.run("toy/root", method="newton", time_limit=0.5)
        assert not run.reused
        if run.holds:
            break
    assert run.holds and short.name == f"{run.path.name}.failed"
    assert not short.exists() and left(project) == []


def test_an_earlier_answer_is_not_replaced_by_the_best_so_far(project):
    good = wb.run("toy/root", method="newton", time_limit=0.5)
    short = out_of_time(project)
    assert good.holds and short.best_so_far and short.key == good.key
    assert [run.path for run in wb.results()] == [good.path]


def test_the_best_so_far_is_verified_for_what_it_is(project):
    run = out_of_time(project)
    found = wb.verify(run.path)
    assert found.holds, found
    assert any(note.startswith("stopped by the clock: time limit of 0.5 s") for note in found.notes)
    for name in ("outcome", "claim"):
        info = json.loads((run.path / "run.json").read_text())
        (run.path / "run.json").write_text(json.dumps(info | {name: "solved"}))
        seal(run.path)
        assert not wb.verify(run.path).holds


def test_the_report_shows_the_best_so_far(project):
    out_of_time(project)
    (page,) = wb.report().parent.glob("report/runs/*.html")
    assert "Time limit, best so far." in page.read_text(encoding="utf-8")


def test_before_the_first_answer_there_is_none(project):
    run = wb.run("toy/root", method="newton", time_limit=1e-9)
    assert run.outcome is Outcome.TIME_LIMIT and run.certificate is None
    assert "reached before any answer" in run.info["message"]
    assert not run.best_so_far and "goes on" not in run.note


# --- the file ---------------------------------------------------------------------------------


@pytest.fixture
def file(tmp_path):
    return tmp_path / "kept" / "state.npz"


def checkpoint(file, mark="question"):
    file.parent.mkdir(exist_ok=True)
    return FileCheckpoint(file, file.parent / "scratch" / file.name, mark)


def test_arrays_come_back_as_they_were(file):
    state = {
        "matrix": np.array([[1.0, np.nan], [-0.0, np.inf]]),
        "empty": np.zeros((0, 3)),
        "count": np.array(7),
        "file": np.array([1j, 2.0]),
        "mark": np.array("a name that the file uses too"),
    }
    checkpoint(file).save(state)
    again = checkpoint(file).load()
    assert again.keys() == state.keys()
    for name, array in state.items():
        assert again[name].dtype == array.dtype
        np.testing.assert_array_equal(again[name], array)


def test_only_its_own_mark_is_loaded(file):
    checkpoint(file).save({"x": np.ones(2)})
    assert checkpoint(file, "other").load() is None and not checkpoint(file, "other").kept
    assert checkpoint(file).kept
    checkpoint(file).drop()
    assert checkpoint(file).load() is None and not file.exists()
    checkpoint(file).drop()


class Bomb:
    def __reduce__(self):
        return print, ("a pickle was opened",)


def test_no_pickle_is_written_or_read(file, capsys):
    with pytest.raises(ValueError, match="x: an array of objects would need a pickle"):
        checkpoint(file).save({"x": np.array([Bomb()])})
    assert checkpoint(file).load() is None
    np.savez(file, **{"mark": np.array("question"), "state/x": np.array([Bomb()], dtype=object)})
    assert checkpoint(file).load() is None
    file.write_bytes(pickle.dumps(Bomb()))
    assert checkpoint(file).load() is None
    assert capsys.readouterr().out == ""


def test_a_write_cut_short_leaves_the_state_before(file, monkeypatch):
    kept = checkpoint(file)
    kept.save({"x": np.ones(2)})

    def savez(stream, **arrays):
        stream.write(b"half")
        raise KeyboardInterrupt

    monkeypatch.setattr(np, "savez", savez)
    with pytest.raises(KeyboardInterrupt):
        kept.save({"x": np.zeros(2)})
    np.testing.assert_array_equal(checkpoint(file).load()["x"], np.ones(2))


def test_the_seconds_of_all_runs_add_up(file):
    one = checkpoint(file)
    time.sleep(0.02)
    one.save({})
    two = checkpoint(file)
    two.load()
    assert two.earlier >= 0.02
    two.save({})
    three = checkpoint(file)
    three.load()
    assert three.earlier >= two.earlier
