"""An executor on a Dask cluster: real processes, some of them killed, one with other code."""

import os
import signal
import site
import time
from concurrent.futures import CancelledError
from dataclasses import replace
from functools import partial
from pathlib import Path

import control
import numpy as np
import pytest
from click.testing import CliRunner

import workbench as wb
from workbench.bench.cells.site import SameCode
from workbench.bench.project import results_root
from workbench.cli import main
from workbench.errors import ClusterError, CrashedError, InputError, TimeLimitError
from workbench.executor import Cluster, Context
from workbench.mu.frequency.sweep import frequency_sweep
from workbench.solvers import Options
from workbench.structure import Full, Real, Structure


@pytest.fixture(scope="module")
def cluster():
    """Two workers, which need nothing of any project."""
    find_this_file = partial(site.addsitedir, str(Path(__file__).parent))
    with Cluster("local", find_this_file, workers=2) as executor:
        yield executor


def fail(message):
    raise ArithmeticError(message)


def die_the_first_time(file):
    if not file.exists():
        file.touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return "done"


def mark_and_die(file):
    with file.open("a") as stream:
        stream.write("tried\n")
    os._exit(7)


def test_values_and_errors_come_back(cluster):
    offset = np.arange(3.0)
    assert cluster.submit(lambda x: x + offset, 1.0).result().tolist() == [1.0, 2.0, 3.0]
    with pytest.raises(ArithmeticError, match=r"^the words$"):
        cluster.submit(fail, "the words").result()
    with pytest.raises(InputError, match="cannot be sent"):
        cluster.submit(iter, (number for number in ())).result()
    assert cluster.submit(os.getpid).result() != os.getpid()


def test_workers_have_the_threads_that_were_asked_for(cluster):
    from threadpoolctl import threadpool_info

    pools = cluster.submit(threadpool_info).result()
    assert pools and all(pool["num_threads"] == 1 for pool in pools)


@pytest.mark.slow
def test_a_task_whose_worker_is_killed_is_done_again(cluster, tmp_path):
    assert cluster.submit(die_the_first_time, tmp_path / "tried").result() == "done"


@pytest.mark.slow
def test_a_task_that_kills_two_workers_is_not_tried_a_third_time(cluster, tmp_path):
    with pytest.raises(CrashedError, match="workers died, the last one at tcp://"):
        cluster.submit(mark_and_die, tmp_path / "tries").result()
    assert (tmp_path / "tries").read_text() == "tried\n" * 2
    assert cluster.submit(pow, 2, 3).result() == 8


def test_a_call_that_is_called_off_does_not_run(cluster, tmp_path):
    busy = [cluster.submit(time.sleep, 0.5) for _ in range(2)]
    waiting = cluster.submit(Path.touch, tmp_path / "ran")
    assert waiting.cancel()
    with pytest.raises(CancelledError):
        waiting.result()
    for one in busy:
        one.result()
    assert cluster.submit(pow, 2, 3).result() == 8 and not (tmp_path / "ran").exists()


def test_parts_of_a_run_give_the_same_bits_anywhere(cluster):
    rng = np.random.default_rng(0)
    items = list(rng.standard_normal((200, 4, 4)))
    here = Context().spread(np.linalg.eigvals, items, "matrices")
    told = []
    context = Context(executor=cluster, progress=lambda *words: told.append(words))
    there = context.spread(np.linalg.eigvals, items, "matrices")
    assert all(np.array_equal(a, b) for a, b in zip(here, there, strict=True))
    assert told[0] == ("matrices", 0, 200) and told[-1] == ("matrices", 200, 200)


def test_parts_of_a_run_end_at_the_time_limit(cluster):
    context = Context(options=Options(time_limit=0.3), executor=cluster)
    with pytest.raises(TimeLimitError, match=r"naps: time limit of 0\.3 s"):
        context.spread(time.sleep, [0.2] * 10, "naps")


def test_a_frequency_sweep_of_mu_gives_the_same_bits_anywhere(cluster):
    rng = np.random.default_rng(1)
    system = control.ss(
        -np.diag([1.0, 2.0, 30.0]), rng.normal(size=(3, 4)), rng.normal(size=(4, 3)), 0
    )
    structure = Structure([Real(2), Full(2, 2)])
    omega = np.geomspace(0.1, 100, 500)
    here, there = (
        frequency_sweep(system, structure, omega=omega, executor=e) for e in (None, cluster)
    )
    for name in ("upper", "lower", "D_left", "D_right", "G"):
        np.testing.assert_array_equal(getattr(here, name), getattr(there, name))


# --- a project --------------------------------------------------------------------------------


@pytest.fixture
def connected(project):
    with wb.connect("local", workers=2) as executor:
        yield executor


@pytest.mark.slow
def test_runs_cells_and_sweeps_go_to_workers_in_another_folder(project, connected):
    """The workers' own folder has neither problems nor results."""
    assert connected.submit(os.getcwd).result() != str(Path.cwd())
    grid = {"scale": [1, 4], "copies": [1, 2]}
    there = wb.sweep("toy/root", grid, executor=connected).data
    here = wb.sweep("toy/root", grid, fresh=True).data
    for name in set(here.data_vars) - {"seconds"}:
        np.testing.assert_array_equal(here[name], there[name], err_msg=name)
    cells = wb.compare("toy/root", methods=["exact"], accuracies=["low"], executor=connected)
    assert cells.metrics["certified_share"] == 1 and wb.verify(cells.path).holds


@pytest.mark.slow
def test_a_worker_with_other_code_is_refused(project):
    results_root().mkdir()
    mine = SameCode.here()
    numpy = tuple((name, "1.0" if name == "numpy" else at) for name, at in mine.versions)
    for other, words in (
        (replace(mine, versions=numpy), f"it has numpy {np.__version__} instead of 1.0"),
        (replace(mine, sources="0"), "sources of the workbench or of the problem folders"),
        (
            replace(mine, site=replace(mine.site, results=Path("/nowhere"))),
            "there is no folder /nowhere",
        ),
    ):
        with pytest.raises(ClusterError, match=r"the worker tcp://.* cannot work: ") as refused:
            Cluster("local", other, workers=1)
        assert words in str(refused.value)


@pytest.mark.slow
def test_a_lost_scheduler_is_an_error_and_what_has_ended_is_kept(project):
    with wb.connect("local", workers=1) as executor:
        wb.sweep("toy/root", {"scale": [1, 4]}, executor=executor)
        done = executor.submit(pow, 2, 3)
        assert done.result() == 8
        under_way = executor.submit(time.sleep, 60)
        executor._own._processes[0].kill()
        with pytest.raises(ClusterError, match=r"the Dask scheduler at tcp://.* is lost"):
            under_way.result(timeout=20)
        assert done.result() == 8
        for ask in (
            lambda: executor.submit(pow, 2, 3).result(),
            lambda: wb.compare(
                "toy/root", methods=["exact"], accuracies=["low"], executor=executor
            ),
            lambda: wb.sweep("toy/root", {"scale": [1, 4, 9]}, executor=executor),
        ):
            with pytest.raises(ClusterError, match="is lost"):
                ask()
    assert len(wb.results("toy/root")) == 2


@pytest.mark.parametrize(
    ("address", "options", "error", "words"),
    [
        ("tcp://127.0.0.1:9", {}, ClusterError, "no Dask scheduler answers at tcp://127.0.0.1:9"),
        ("nonsense", {}, ClusterError, "no Dask scheduler answers at nonsense"),
        ("tcp://127.0.0.1:9", {"workers": 2}, InputError, "has its own workers"),
        ("local", {"workers": 0}, InputError, "workers of a cluster must be 1 or more, not 0"),
        ("local", {"threads": -1}, InputError, "threads of a cluster must be 1 or more, not -1"),
    ],
)
def test_bad_input_says_what_is_needed(project, address, options, error, words):
    with pytest.raises(error, match=words):
        wb.connect(address, **options)


def test_without_dask_it_says_what_to_install(project, monkeypatch):
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    with pytest.raises(ClusterError, match=r"pip install 'robust-workbench\[dask\]'"):
        wb.connect("local")


@pytest.mark.cases(0)
def test_the_command_line_takes_a_scheduler(project):
    for command in (
        ["run", "toy/root", "--scheduler", "local", "--jobs", "1"],
        ["sweep", "toy/root", "--over", "scale=1,4", "--scheduler", "local", "--jobs", "2"],
    ):
        done = CliRunner().invoke(main, command)
        assert done.exit_code == 0, done.output
    wrong = CliRunner().invoke(main, ["run", "toy/*", "--scheduler", "tcp://a:1", "--jobs", "2"])
    assert wrong.exit_code == 2 and "has its own workers; leave out --jobs" in wrong.output


@pytest.mark.slow
def test_an_ensemble_gives_the_same_bits_anywhere(tmp_path, monkeypatch):
    from workbench.bench import project as here

    monkeypatch.setenv(here.RESULTS, str(tmp_path))
    alone = wb.run("cd/focus/gain-control", draws=2, fresh=True).data
    with wb.connect("local", workers=2) as executor:
        spread = wb.run("cd/focus/gain-control", draws=2, fresh=True, executor=executor).data
    for name in alone.data_vars:
        np.testing.assert_array_equal(alone[name], spread[name], err_msg=name)
