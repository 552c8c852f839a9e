"""The command line: what it prints; 0 only when every certificate holds, 2 for errors."""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from click.testing import CliRunner

import workbench
from workbench.cli import main

COMMAND = Path(sys.executable).with_name("workbench")
HEAVY = {"numpy", "scipy", "cvxpy", "casadi", "matplotlib", "xarray", "control", "numba", "pandas"}


@pytest.fixture
def cli(project):
    """Call the command; returns exit status, output and errors."""

    def call(*words):
        project.restart()
        done = CliRunner().invoke(main, words)
        if done.exception and not isinstance(done.exception, SystemExit):
            raise done.exception
        return done.exit_code, done.stdout, done.stderr

    return call


# --- list and show ----------------------------------------------------------------------------


def test_list_prints_a_line_for_every_name(cli):
    status, out, _ = cli("list", "toy/*")
    lines = out.splitlines()
    assert status == 0
    assert lines == sorted(lines) and len(lines) == 13
    assert "toy/root     Least roots of the targets (table 1)." in lines
    assert "toy/late     Takes its time. (slow)" in lines


def test_list_prints_json(cli):
    rows = json.loads(cli("list", "toy/late", "--json")[1])
    assert rows == [{"name": "toy/late", "summary": "Takes its time.", "slow": True}]


def test_list_imports_no_problem_and_nothing_heavy(project):
    project.edit("OFFSET = 0.0", "raise RuntimeError('imported')")
    code = (
        "import sys\nfrom workbench.cli import main\n"
        "main(['list'], standalone_mode=False)\nprint('MODULES', *sys.modules)"
    )
    out, _, modules = project.python(code).partition("MODULES")
    assert "toy/root" in out and "cd/focus/circles" in out
    assert not HEAVY & set(modules.split())


def test_list_answers_at_once(project):
    """Half a second where NumPy is imported in 0.12 s."""

    def measure(*command):
        """CPU time, which does not count what else the machine is doing."""
        start = os.times()
        subprocess.run(command, cwd=project.root, check=True, capture_output=True)
        end = os.times()
        return (end.children_user - start.children_user) + (
            end.children_system - start.children_system
        )

    listed = min(measure(COMMAND, "list") for _ in range(3))
    assert listed < 8 * min(measure(sys.executable, "-c", "import numpy") for _ in range(3))


def test_a_broken_file_is_listed_and_is_an_error_when_run(project, cli):
    project.edit("OFFSET = 0.0", "raise RuntimeError('no luck')")
    assert cli("list", "toy/root")[0] == 0
    for words in (("run", "toy/root"), ("show", "toy/root")):
        status, out, err = cli(*words)
        assert (status, out) == (2, "")
        assert "cannot be imported: RuntimeError: no luck" in err


def test_show_prints_help_parameters_and_methods(cli):
    status, out, _ = cli("show", "toy/root")
    assert status == 0
    for words in (
        "scale: what they are multiplied by.",
        "copies",
        "targets.csv",
        "The square root",
    ):
        assert words in out
    assert json.loads(cli("show", "toy/root", "--json")[1])["parameters"].keys() == {
        "scale",
        "copies",
        "drawn",
    }


@pytest.mark.parametrize("words", [("--help",), ("run", "-h"), ("compare", "-h"), ("verify", "-h")])
def test_help_is_there(cli, words):
    status, out, _ = cli(*words)
    assert status == 0 and "Usage: " in out


def test_the_version_is_told(cli):
    assert workbench.__version__ in cli("--version")[1]


# --- run --------------------------------------------------------------------------------------


def test_run_prints_the_certificate_and_the_folder(cli):
    status, out, _ = cli("run", "toy/root")
    assert status == 0
    assert "largest 2" in out and "checked  reach: " in out and "optimality gap" in out
    assert workbench.open_run(out.splitlines()[-1]).holds


@pytest.mark.parametrize(
    ("method", "status", "words"),
    [
        ("exact", 0, "checked  reach"),
        ("rough", 0, "optimality gap 0.5"),
        ("boastful", 1, "FAILS (inaccurate)"),
        ("lying", 1, "FAILS    reach: 4 <= 1e-09"),
        ("raising", 1, "ArithmeticError: the sky fell"),
        ("hopeless", 1, "FAILS (no claim)"),
    ],
)
def test_the_exit_status_is_the_certificates(cli, method, status, words):
    found, out, _ = cli("run", "toy/root", "--method", method)
    assert found == status and words in out


def test_one_failure_among_many_is_enough(cli):
    status, _, err = cli("run", "toy/?/root", "--method", "boastful", "--tolerance", "0.6")
    assert status == 0 and "[2/2] toy/y/root: certificate holds" in err
    status, out, err = cli("run", "toy/?/root", "--method", "boastful")
    assert status == 1 and "[1/2] toy/x/root: inaccurate: optimality gap: 0.5 exceeds" in err
    assert out.count("FAILS (inaccurate)") == 2


def test_parameters_and_options_reach_the_run(cli):
    words = ("--set", "scale=4", "--set", "drawn=yes", "--tolerance", "high", "--seed", "3")
    _, out, _ = cli("run", "toy/root", *words, "--time-limit", "60")
    info = workbench.open_run(out.splitlines()[-1]).info
    assert info["parameters"] == {"scale": 4.0, "copies": 1, "drawn": True}
    assert info["options"] == {"tolerance": 1e-9, "time_limit": 60.0, "seed": 3}


def test_command_line_and_python_ask_the_same_question(project, cli):
    run = workbench.run("toy/root", scale=4, seed=3, time_limit=60)
    words = ("--set", "scale=4.0", "--seed", "3", "--time-limit", "60", "--json")
    (row,) = json.loads(cli("run", "toy/root", *words)[1])
    assert (row["key"], row["reused"]) == (run.key, True)


def test_a_stored_answer_is_told_and_fresh_computes_anew(project, cli):
    cli("run", "toy/root")
    assert "found among the results; --fresh computes it anew" in cli("run", "toy/root")[1]
    assert "recomputed; agrees" in cli("run", "toy/root", "--fresh")[1]
    project.edit("OFFSET = 0.0", "OFFSET = 0.0  # other code")
    assert "recomputed; agrees with the earlier answer" in cli("run", "toy/root")[1]


@pytest.mark.parametrize("name", ["toy/root", "toy/total", "toy/root*"])
def test_run_prints_json_that_any_reader_takes(cli, name):
    def refuse(word):
        raise AssertionError(f"{word} is no JSON")

    status, out, _ = cli("run", name, "--json")
    (row,) = json.loads(out, parse_constant=refuse)
    assert status == 0 and row["holds"] and row["outcome"] == "solved"


def test_problems_marked_slow_run_only_when_asked(cli):
    def ran(*words):
        return [row["problem"] for row in json.loads(cli("run", *words, "--json")[1])]

    assert ran("toy/lat*", "toy/x/root") == ["toy/x/root"]
    assert ran("toy/lat*", "--slow") == ran("toy/late") == ["toy/late"]


def test_running_nothing_says_so(cli):
    _, out, err = cli("run", "toy/lat*")
    assert "--slow" in out + err


def test_the_others_run_where_one_cannot(cli):
    status, out, err = cli("run", "toy/doomed", "toy/x/root")
    assert status == 2
    assert "toy/doomed needs toy/root, whose certificate does not hold" in err
    assert "toy/x/root" in out


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("run", "toy/rot"), "no problem is called 'toy/rot'; did you mean"),
        (("run", "toy/root", "--method", "exat"), "no method of Root is called 'exat'"),
        (("run", "toy/root", "--set", "scael=1"), "did you mean scale"),
        (("run", "toy/root", "--set", "scale"), "--set needs KEY=VALUE, not 'scale'"),
        (("run", "toy/root", "--set", "scale=wide"), "scale='wide' does not fit"),
        (("run", "toy/root", "--set", "seed=3"), "seed is an option, not a parameter: --seed"),
        (("run", "toy/root", "--set", "name=x"), "name is an option, not a parameter"),
        (("run", "toy/root\0"), "no problem is called"),
        (("--problems", "a\0b", "list"), "does not exist"),
        (("--results", "a\0b", "run", "toy/root"), "a\\x00b"),
        (("run", "toy/root", "--set", "scale=\ud800"), "does not fit"),
        (("run", "toy/root", "--set", "\ud800=1"), "no parameter"),
        (("run", "toy/root", "--method", "\ud800"), "no method"),
        (("run", "toy/root", "--tolerance", "hihg"), "neither a number nor one of low"),
        (("run", "toy/root", "--time-limit", "-1"), "time_limit must be positive"),
        (("run", "toy/root", "--seed", "x"), "not a valid integer"),
        (("run", "toy/loop/a"), "cyclic needs: toy/loop/a -> toy/loop/b -> toy/loop/a"),
        (("run", "toy/broken"), "one over nothing"),
        (("run",), "Missing argument"),
        (("show", "toy/rot"), "did you mean"),
        (("list", "nothing*"), "no problem is called 'nothing*'"),
        (("results", "nothing*"), "no problem is called 'nothing*'"),
        (("draw", "--width", "page"), "--width page has no effect on a screen"),
        (("--problems", "nowhere", "list"), "nowhere does not exist"),
        (("verify", "nowhere"), "no results folder at or below nowhere"),
        (("verify",), "no results folder at or below"),
        (("compare", "toy/root"), "name --methods A,B,C or ask for --all-methods"),
        (("compare", "toy/root", "--all-methods", "--memory-limit", "much"), "a size is a number"),
        (("compare", "toy/root", "--methods", "exact", "--accuracy", "x"), "low, middle, high"),
        (("compare", "toy/root", "--methods", "exact", "--jobs", "-1"), "jobs"),
        (("compare", "toy/root", "--all-methods", "--plan", "--against", "x"), "leave out --cells"),
        (("compare", "toy/root", "--all-methods", "--cells", "x.xlsx"), ".csv or .parquet"),
        (("compare", "toy/root", "--all-methods", "--against", "x"), "x"),
        (("lsit",), "No such command 'lsit'"),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, tuple) else "",
)
def test_an_error_is_one_message_and_status_2(project, words, message):
    project.restart()
    done = CliRunner().invoke(main, words)
    assert isinstance(done.exception, SystemExit), done.exception
    assert (done.exit_code, done.stdout) == (2, "")
    assert message in done.stderr and "Traceback" not in done.stderr


def test_an_interrupt_says_that_results_are_kept(cli):
    status, _, err = cli("run", "toy/root", "--method", "interrupted")
    assert status == 130
    assert "finished results are kept" in err


def test_the_best_so_far_is_told_from_an_answer(project, cli):
    project.edit("PAUSE = 0.0", "PAUSE = 0.2")
    words = ("run", "toy/root", "--method", "newton", "--time-limit", "0.5")
    status, out, _ = cli(*words)
    assert status == 1
    assert "best so far (time limit)" in out and "checked  reach" in out
    assert "  time limit of 0.5 s reached after " in out and "goes on from there" in out
    (row,) = json.loads(cli(*words, "--seed", "1", "--json")[1])
    assert (row["outcome"], row["holds"]) == ("time limit", False)
    status, _, err = cli("run", "toy/x/root", "toy/y/root", *words[2:])
    assert "[1/2] toy/x/root: time limit: time limit of 0.5 s reached after" in err


# --- where ------------------------------------------------------------------------------------


def test_a_folder_of_problems_on_the_command_line(project, cli):
    project.write("mine/p.py", project.toy.read_text().replace("toy/", "mine/"))
    project.write("mine/targets.csv", "9")
    assert "mine/root" in cli("--problems", "mine", "list", "mine/*")[1]
    assert cli("--problems", "mine", "run", "mine/total")[0] == 0
    assert "mine/root" in cli("list", "mine/*", "--problems=mine", "--results", "elsewhere")[1]


def test_a_folder_of_results_on_the_command_line(project, cli):
    _, out, _ = cli("--results", "kept", "run", "toy/root")
    assert Path(out.splitlines()[-1]).is_relative_to(project.root / "kept")
    assert not project.results.exists()


# --- verify, results, compare -----------------------------------------------------------------


def test_verify_tells_the_good_from_the_bad(project, cli):
    good, bad = workbench.run("toy/x/root"), workbench.run("toy/y/root")
    assert cli("verify")[:2] == (
        0,
        f"{good.path}: verified\n{bad.path}: verified\n2 of 2 verified\n",
    )
    (bad.path / "metrics.json").write_text("{}")
    status, out, _ = cli("verify", "results")
    assert status == 1 and out.endswith("1 of 2 verified\n")
    assert "  metrics.json was changed: SHA-256" in out
    assert cli("verify", str(good.path))[0] == 0
    assert cli("verify", str(good.path), str(bad.path))[0] == 1
    rows = json.loads(cli("verify", "--json")[1])
    assert [row["holds"] for row in rows] == [True, False]
    assert "metrics.json" in rows[1]["problems"][0]


def test_draw_without_paths_draws_all_results(cli):
    assert cli("run", "toy/root", "--set", "drawn=yes")[0] == 0
    status, out, _ = cli("draw")
    assert status == 0 and out and out == cli("draw", "results")[1]
    assert all(Path(line).is_file() for line in out.splitlines())


def test_verify_runs_again_on_request(project, cli):
    path = str(workbench.run("toy/root", method="rough").path)
    assert "re-run within 1e-06" in cli("verify", path, "--rerun")[1]
    project.edit("OFFSET = 0.0", "OFFSET = 1.0")
    status, out, _ = cli("verify", path, "--rerun")
    assert status == 1 and "re-run: x differs" in out


def test_results_are_listed(cli):
    status, out, _ = cli("results")
    assert status == 0 and "no results of *" in out
    workbench.run("toy/root")
    workbench.run("toy/total")
    status, out, _ = cli("results", "toy/r*")
    assert status == 0 and len(out.splitlines()) == 3 and "largest 2" in out
    assert "started [UTC]" in out and "tolerance" not in out
    rows = json.loads(cli("results", "--json")[1])
    assert [row["problem"] for row in rows] == ["toy/root", "toy/root", "toy/total"]


def test_compare_prints_the_cells(cli):
    words = (
        "compare",
        "toy/root",
        "--methods",
        "exact,lying,picky",
        "--set",
        "copies=2",
        "--accuracy",
        "low,high",
        "--in-process",
    )
    status, out, _ = cli(*words)
    assert status == 1  # a certificate fails
    lines = [line.split() for line in out.splitlines()]
    assert lines[1][:5] == ["toy/root", "exact", "low", "solved", "solved"]
    assert lines[3][:5] == ["toy/root", "lying", "low", "wrong", "solved"]
    assert lines[5][:4] == ["toy/root", "picky", "low", "unfit"]
    assert "certified 2 of 4, 2 false claims" in out
    assert "workbench run toy/root --method lying --tolerance low --seed 0" in out
    done = json.loads(cli(*words, "--json")[1])
    assert len(done["cells"]) == 6 and done["metrics"]["certified_share"] == 0.5


def test_a_plan_of_a_comparison_is_printed(cli):
    words = ("compare", "toy/root", "--methods", "exact", "--accuracy", "low", "--in-process")
    status, out, _ = cli(*words, "--plan")
    assert status == 0 and "1 of 1 would run" in out
    cli(*words)
    assert "0 of 1 would run" in cli(*words, "--plan")[1]


@pytest.mark.cases(0)
def test_cells_are_written_and_an_older_comparison_is_told_apart(cli, tmp_path):
    words = ("compare", "toy/root", "--accuracy", "low", "--in-process", "--methods")
    old = cli(*words, "exact,lying")[1].splitlines()[-1]
    table = tmp_path / "cells.csv"
    again = cli(*words, "exact,lying", "--against", old, "--cells", str(table))[1]
    assert "0 of 2 cells have another verdict" in again
    lines = table.read_text().splitlines()
    assert len(lines) == 3 and lines[1].startswith("toy/root,exact,low")
    other = json.loads(cli(*words, "exact,picky", "--against", old, "--json")[1])
    assert other["changed"] == []
    status, out, said = cli(*words, "exact", "--against", str(tmp_path))
    assert (status, out) == (2, "") and str(tmp_path) in said


def test_a_run_that_is_no_comparison_cannot_be_compared_against(cli):
    run = json.loads(cli("run", "toy/root", "--json")[1])[0]
    status, _, said = cli(
        *("compare", "toy/root", "--methods", "exact", "--against", run["path"], "--in-process")
    )
    assert status == 2 and "this is no comparison" in said


@pytest.mark.slow
def test_compare_kills_what_hangs(cli):
    words = ("compare", "toy/root", "--methods", "exact,hanging", "--accuracy", "low")
    status, out, _ = cli(*words, "--time-limit", "10", "--jobs", "2")
    assert status == 1
    assert [line.split()[1:5] for line in out.splitlines()[1:3]] == [
        ["exact", "low", "solved", "solved"],
        ["hanging", "low", "time", "limit"],
    ]


def test_the_installed_command_is_this_one(project):
    done = subprocess.run([COMMAND, "run", "toy/rot"], capture_output=True, text=True)
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr.startswith("workbench: no problem is called 'toy/rot'")


# --- several at once --------------------------------------------------------------------------


@pytest.mark.slow
def test_jobs_run_several_and_say_the_same(project, cli):
    words = ("run", "toy/root", "toy/total", "toy/broken")
    status, out, err = cli(*words, "--jobs", "2")
    assert status == 2
    assert "workbench: toy/broken: " in err and "one over nothing" in err
    assert "/3] toy/root: certificate holds" in err and "/3] toy/total: certificate holds" in err
    again = cli(*words)[1]
    assert [line.split()[:5] for line in again.splitlines()[1:]] == [
        line.split()[:5] for line in out.splitlines()[1:]
    ]
    assert "stored" in again


def test_verbose_and_jobs_exclude_each_other(project, cli):
    assert "leave out" in cli("run", "toy/root", "--verbose", "--jobs", "2")[2]


@pytest.mark.cases(0)
@pytest.mark.skipif(os.name == "nt", reason="Windows has no such signal")
def test_an_interrupt_of_jobs_ends_them_all(project):
    project.edit("PAUSE = 0.0", "PAUSE = 20.0")
    words = ["run", *(f"toy/{one}/root" for one in "xy"), "toy/root", "--method", "newton"]
    running = subprocess.Popen(
        [COMMAND, *words, "--jobs", "2"],
        stderr=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
        start_new_session=True,
        # A shell that starts the tests in the background has its children ignore interrupts.
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler),
    )
    deadline = time.monotonic() + 120  # two cold processes on a busy machine
    while len(list(project.results.rglob("*.lock"))) < 2:  # taken when a run begins
        assert time.monotonic() < deadline and running.poll() is None
        time.sleep(0.1)
    time.sleep(1)
    os.killpg(running.pid, signal.SIGINT)  # as a terminal does, to all of them
    _, err = running.communicate(timeout=120)
    assert running.returncode == 130
    assert "finished results are kept" in err and "Traceback" not in err
    assert not list(project.results.rglob("run.json"))
