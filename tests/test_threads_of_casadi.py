"""Threads wait for each other where CasADi is used, which crashes the process where they meet."""

import re
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest

from workbench import Outcome, solve
from workbench.geometry import SmallestCircle
from workbench.geometry import nonlinear as circles
from workbench.solvers import in_one_thread

ROOT = Path(__file__).parents[1]
CALLED_BY_MARKED = {
    "workbench/mu/lower/nonlinear.py",
    "workbench/identification/parameters/complex_pair.py",
    "workbench/identification/parameters/measured.py",
    "problems/cd_drive/laboratory/known_values.py",
}
"""Files whose use of CasADi is inside of marked functions of other files."""


class Inside:
    """The largest number of threads that were inside at once."""

    def __init__(self):
        self.now, self.most, self.lock = 0, 0, threading.Lock()

    def __enter__(self):
        with self.lock:
            self.now += 1
            self.most = max(self.most, self.now)
        time.sleep(0.02)

    def __exit__(self, *_):
        with self.lock:
            self.now -= 1


def most_at_once(function, items):
    with ThreadPoolExecutor(2) as threads:
        list(threads.map(function, items))


def test_one_thread_at_a_time_runs_marked_functions_which_may_call_each_other():
    inside = Inside()

    def entered(depth):
        with inside:
            pass
        if depth:
            one(depth - 1)

    one, other = in_one_thread(entered), in_one_thread(lambda depth: entered(depth))
    most_at_once(lambda turn: turn(1), [one, other] * 3)
    assert inside.most == 1
    most_at_once(entered, [0] * 6)
    assert inside.most == 2  # without the mark threads meet


def test_two_threads_solve_by_ipopt(monkeypatch):
    inside, made = Inside(), circles.ipopt

    def watched(*arguments, **keywords):
        with inside:
            return made(*arguments, **keywords)

    monkeypatch.setattr(circles, "ipopt", watched)
    rng = np.random.default_rng(69)
    tasks = [SmallestCircle(np.array([[0, 2, 1 + 1j * y]])) for y in rng.uniform(0, 1, 6)]
    found = []
    most_at_once(lambda task: found.append(solve(task, method="ipopt")), tasks)
    assert {one.outcome for one in found} == {Outcome.SOLVED}
    assert all(one.answer.radius == pytest.approx(1.0, abs=1e-5) for one in found)
    assert inside.most == 1


def test_every_file_that_uses_casadi_marks_its_functions():
    unmarked = set()
    for path in [*ROOT.glob("workbench/**/*.py"), *ROOT.glob("problems/**/*.py")]:
        text = path.read_text("utf-8")
        if re.search(r"^ *import casadi", text, re.M) and "@in_one_thread" not in text:
            unmarked.add(path.relative_to(ROOT).as_posix())
    assert unmarked == CALLED_BY_MARKED
