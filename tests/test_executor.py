"""One interface for all work: results, errors and the clock are the same in every executor."""

import os
import signal
import subprocess
import sys
import threading
import time
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from threadpoolctl import threadpool_info, threadpool_limits

from workbench.errors import (
    CrashedError,
    InputError,
    MemoryLimitError,
    TimeLimitError,
    WorkbenchError,
)
from workbench.executor import (
    Context,
    InProcess,
    Threads,
    Workers,
    finished_calls,
    row_entry,
    spread,
)
from workbench.executor.worker import alarm, printed
from workbench.solvers import Options

HANGS = 120
"""Seconds after which a worker counts as one that does nothing."""


def add(a, b=0):
    return a + b


def fail(message):
    raise ArithmeticError(message)


def sleep(seconds):
    time.sleep(seconds)
    return os.getpid()


def hang(file):
    file.write_text(str(os.getpid()))
    time.sleep(60)


def spin():
    """A loop that hears no request to stop."""
    np.linalg.eigvals(np.ones((20, 20)))
    while True:
        pass


def within(seconds, function, *arguments):
    alarm(seconds)
    return function(*arguments)


def die(how):
    if how == "exit":
        os._exit(7)
    if how == "leave":
        sys.exit(3)
    os.kill(os.getpid(), signal.SIGSEGV)


def unpicklable():
    return lambda: None


def leave_a_mark(folder, number):
    time.sleep(0.05)
    if number == 2:
        raise ArithmeticError("number 2 failed")
    (folder / str(number)).touch()


@pytest.fixture(scope="module")
def processes():
    with Workers(count=2) as executor:
        yield executor


EXECUTORS = {
    "in process": InProcess,
    "processes": lambda: Workers(count=1),
    "threads": lambda: Threads(workers=1),
    "pool": lambda: ProcessPoolExecutor(1),
}


@pytest.mark.parametrize("make", EXECUTORS.values(), ids=EXECUTORS)
def test_every_executor_returns_values_and_raises_errors(make):
    with make() as executor:
        assert executor.submit(add, 1, b=2).result() == 3
        assert list(executor.map(add, [1, 2])) == [1, 2]
        error = executor.submit(fail, "the sky fell").exception()
    assert "the sky fell" in str(error)


def test_an_error_keeps_its_type_and_words_across_processes(processes):
    with pytest.raises(WorkbenchError, match="ArithmeticError: the sky fell"):
        processes.submit(fail, "the sky fell").result()


def test_arrays_cross_processes_whole(processes):
    value = np.arange(1_000_000.0)
    assert np.array_equal(processes.submit(add, value).result(), value)


@pytest.mark.parametrize(
    ("how", "code"), [("exit", 7), ("leave", 3), ("crash", -signal.SIGSEGV)], ids=str
)
def test_a_worker_that_dies_is_an_error_with_its_exit_code(processes, how, code):
    with pytest.raises(WorkbenchError, match=f"worker process died with exit code {code}"):
        processes.submit(die, how).result()


def test_a_value_that_cannot_be_sent_is_an_error(processes):
    with pytest.raises(WorkbenchError, match=r"pickle|local object"):  # of Python 3.11, 3.13
        processes.submit(unpicklable).result()


@pytest.mark.parametrize(
    "task",
    [pytest.param((sleep, 60), marks=pytest.mark.slow), (spin,)],
    ids=["sleeping", "spinning"],
)
def test_a_task_is_killed_at_its_limit_and_the_next_one_runs(task):
    start = time.perf_counter()
    with Workers(count=1) as executor:
        stuck, other = executor.submit(within, 1.0, *task), executor.submit(add, 1)
        with pytest.raises(TimeLimitError, match="limit of 1 s"):
            stuck.result()
        assert other.result() == 1
    assert time.perf_counter() - start < 60  # the task alone takes a minute, or for ever


def killed_for(reason):
    alarm(0.2, reason)
    spin()


def test_a_killed_task_says_why_it_was_killed():
    words = "killed at its time limit of 5 s and 10 s more, which a first call has for imports"
    with Workers(count=1) as executor, pytest.raises(TimeLimitError, match=words):
        executor.submit(killed_for, words).result()


def test_a_killed_task_is_gone(tmp_path):
    with Workers(count=1) as executor, pytest.raises(TimeLimitError):
        executor.submit(within, 0.5, hang, tmp_path / "pid").result()
    with pytest.raises(ProcessLookupError):
        os.kill(int((tmp_path / "pid").read_text()), 0)


def test_processes_stay_for_the_next_task(processes):
    ids = {future.result() for future in [processes.submit(sleep, 0.1) for _ in range(6)]}
    assert len(ids) == 2
    assert os.getpid() not in ids


def fill(file, size):
    with file.open("a") as stream:
        stream.write("tried\n")
    kept = np.ones(size // 8)
    time.sleep(60)
    return kept


def test_a_task_that_takes_too_much_memory_is_killed_once(tmp_path):
    with Workers(count=1, memory_limit=600 * 2**20) as executor:
        greedy = executor.submit(fill, tmp_path / "tries", 2**30)
        other = executor.submit(add, 1)
        with pytest.raises(MemoryLimitError, match="limit of 600 MiB"):
            greedy.result()
        assert other.result() == 1
    assert (tmp_path / "tries").read_text() == "tried\n"


def die_the_first_time(file):
    if not file.exists():
        file.touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return "done"


def test_a_task_whose_worker_is_killed_is_done_again(processes, tmp_path):
    assert processes.submit(die_the_first_time, tmp_path / "tried").result() == "done"


def test_a_task_that_kills_two_workers_is_not_tried_a_third_time(processes, tmp_path):
    with pytest.raises(CrashedError, match=r"exit code 7: .*last words"):
        processes.submit(say_and_die, tmp_path / "tries").result()
    assert (tmp_path / "tries").read_text() == "tried\n" * 2


def say_and_die(file):
    with file.open("a") as stream:
        stream.write("tried\n")
    os.write(2, b"last words")
    os._exit(7)


def say(words):
    print(words)
    return printed()


def test_a_task_reads_what_it_has_printed_and_no_more(processes):
    assert processes.submit(say, "first").result() == "first\n"
    futures = [processes.submit(say, f"next {i}") for i in range(4)]
    assert [future.result() for future in futures] == [f"next {i}\n" for i in range(4)]


def threads():
    return os.environ["OPENBLAS_NUM_THREADS"], max([0, *blas_threads()])


def test_the_threads_of_workers_are_limited():
    with Workers(count=1, threads=1) as executor:
        assert executor.submit(threads).result() == ("1", 1)


def test_an_alarm_that_is_called_off_kills_nothing(processes):
    assert processes.submit(call_off, 0.3).result() == "alive"


def call_off(seconds):
    alarm(seconds)
    alarm(None)
    time.sleep(2 * seconds)
    return "alive"


def test_outside_of_a_worker_there_is_no_alarm_and_nothing_printed(capfd):
    alarm(0.001)
    print("words")
    assert printed() == ""


def test_an_error_in_the_caller_ends_the_workers_at_once(tmp_path):
    start = time.perf_counter()
    with pytest.raises(ArithmeticError), Workers(count=2) as executor:
        executor.submit(hang, tmp_path / "pid")
        written(tmp_path / "pid")
        raise ArithmeticError
    assert time.perf_counter() - start < 60  # which is how long the task would take
    with pytest.raises(ProcessLookupError):
        os.kill(int((tmp_path / "pid").read_text()), 0)


def written(file):
    """What a worker writes into a file as soon as it is there."""
    until = time.perf_counter() + HANGS
    while not file.exists() or not file.read_text():
        assert time.perf_counter() < until, f"{file.name} was not written"
        time.sleep(0.02)
    return file.read_text()


def test_workers_whose_pool_is_killed_are_gone(tmp_path):
    """A hung task too: nobody is left to tell it."""
    code = (
        "import sys, pathlib; sys.path.insert(0, sys.argv[2])\n"
        "import test_executor as t\n"
        "t.Workers(count=1).submit(t.hang, pathlib.Path(sys.argv[1])).result()\n"
    )
    file = tmp_path / "pid"
    pool = subprocess.Popen([sys.executable, "-c", code, str(file), str(Path(__file__).parent)])
    pid = int(written(file))
    pool.kill()
    pool.wait()
    until = time.perf_counter() + 10
    while is_alive(pid) and time.perf_counter() < until:
        time.sleep(0.02)
    assert not is_alive(pid)


def is_alive(process):
    try:
        state = Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[0]
    except OSError:
        return False
    return state != "Z"


def test_a_function_without_a_name_is_sent_as_code(processes):
    offset = 3
    assert processes.submit(lambda number: number + offset, 4).result() == 7


def test_what_cannot_be_sent_is_refused(processes):
    with pytest.raises(InputError, match="cannot be sent"):
        processes.submit(id, threading.Lock()).result()


@pytest.mark.parametrize(
    "wrong", [{"count": 0}, {"threads": 0}, {"memory_limit": -1}], ids=lambda one: next(iter(one))
)
def test_a_pool_that_cannot_be_is_refused(wrong):
    with pytest.raises(InputError, match=f"{next(iter(wrong))} of workers must be 1 or more"):
        Workers(**wrong)


def test_no_more_calls_wait_than_the_window_holds():
    made = []

    def calls():
        for number in range(20):
            made.append(number)
            yield number, (add, number)

    with Workers(count=1) as executor:
        ended = {}
        for label, future in finished_calls(executor, calls(), window=3):
            assert len(made) <= len(ended) + 4
            ended[label] = future.result()
    assert ended == {number: number for number in range(20)}


def test_an_interrupt_passes_through_in_process_work():
    def interrupt():
        raise KeyboardInterrupt

    with InProcess() as executor, pytest.raises(KeyboardInterrupt):
        executor.submit(interrupt)


def blas_threads():
    return [one["num_threads"] for one in threadpool_info() if one["user_api"] == "blas"]


def test_blas_leaves_the_cores_to_the_threads():
    with threadpool_limits(2, "blas"):
        before = blas_threads()
        assert 2 in before  # not each of the libraries takes more than it began with
        with Threads(workers=2) as executor:
            assert set(executor.submit(blas_threads).result()) == {1}
        assert blas_threads() == before


@pytest.mark.parametrize("kind", [Threads, Workers])
def test_after_an_error_nothing_more_is_begun(kind, tmp_path):
    """An interrupted ensemble must not go on to its end before it says so."""
    one = {"workers" if kind is Threads else "count": 1}
    with (
        kind(**one) as executor,
        pytest.raises((ArithmeticError, WorkbenchError), match="number 2"),
    ):
        spread(partial(leave_a_mark, tmp_path), range(12), executor)
    assert len(list(tmp_path.iterdir())) < 6


# --- context ----------------------------------------------------------------------------------


def test_progress_is_told_before_between_and_after():
    told = []
    context = Context(progress=lambda *what: told.append(what))
    assert list(context.track("ab", "letters")) == ["a", "b"]
    assert told == [("letters", 0, 2), ("letters", 1, 2), ("letters", 2, 2)]


def test_work_without_a_known_end_is_tracked_too():
    assert list(Context().track(iter("ab"), "letters")) == ["a", "b"]


def test_work_stops_at_the_limit_and_says_how_far_it_came():
    context = Context(options=Options(time_limit=0.01))
    with pytest.raises(TimeLimitError, match=r"steps: time limit of 0.01 s reached at \d+ of 1000"):
        for _ in context.track(range(1000), "steps"):
            time.sleep(0.001)


def test_rounds_are_counted_from_where_an_earlier_run_was_stopped():
    told = []
    context = Context(progress=lambda *what: told.append(what))
    assert list(context.rounds(5, "newton", first=3)) == [3, 4]
    assert told == [("newton", 3, 5), ("newton", 4, 5), ("newton", 5, 5)]
    assert context.stopped == ""


@pytest.mark.parametrize(("answers", "after"), [(1, "after 1 round;"), (3, "after 3 rounds;")])
def test_rounds_end_at_the_limit_with_the_best_so_far(answers, after):
    context = Context(options=Options(time_limit=100))
    for number in context.rounds(10, "newton"):
        context.record({"round": number})
        if number == answers - 1:
            context.started -= 100  # seconds that pass
    assert [row["round"] for row in context.rows] == list(range(answers))
    assert context.stopped == f"time limit of 100 s reached {after} best so far"


def test_rounds_without_an_answer_fail_at_the_limit():
    context = Context(options=Options(time_limit=100))
    with pytest.raises(TimeLimitError, match="newton: time limit of 100 s reached before any"):
        for _ in context.rounds(10, "newton"):
            context.started -= 100


def test_whoever_watches_is_told_all_rounds_after_each():
    told = []
    context = Context(watch=lambda rows: told.append(list(rows)))
    context.record({"round": 1, "peak": 2.0})
    context.record({"round": 2, "peak": 1.5})
    assert told == [[{"round": 1, "peak": 2.0}], context.rows]
    assert [row["peak"] for row in context.rows] == [2.0, 1.5]


def test_nothing_is_kept_where_nobody_keeps_it():
    context = Context()
    context.checkpoint.save({"x": np.ones(3)})
    assert context.checkpoint.load() is None


@pytest.mark.parametrize(
    ("value", "text"), [(3, "3"), (0.123456, "0.1235"), (float("nan"), "-"), ("dk", "dk")]
)
def test_entries_of_a_row_are_short(value, text):
    assert row_entry(value) == text


def test_one_generator_from_the_seed():
    context, same = Context(options=Options(seed=3)), Context(options=Options(seed=3))
    assert context.rng is context.rng
    assert (
        context.rng.random() == same.rng.random() != Context(options=Options(seed=4)).rng.random()
    )


def test_the_time_of_a_statement_that_fails_is_booked():
    context = Context()
    with pytest.raises(ValueError), context.stating():
        raise ValueError
    assert context.statement_seconds > 0
