"""Rounds are stored whole; an iteration that was stopped goes on to the same answer."""

import os
import signal
import subprocess
import sys
import time
from dataclasses import replace
from functools import cache
from pathlib import Path

import control
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from workbench.plants.textbook.first_order import unstable_first_order

import workbench as wb
from workbench.bench.formats import netcdf
from workbench.executor import Checkpoint, Context
from workbench.solvers import Options, Outcome
from workbench.synthesis import Iterate, MuSynthesis, hinf
from workbench.synthesis.mu import d_step, dk
from workbench.synthesis.mu.biquads import Biquads
from workbench.synthesis.mu.rounds import packed, unpacked
from workbench.synthesis.mu.structured import fixed
from workbench.uncertainty import generalised_plant, real, tf

ROOT = Path(__file__).parents[2]
METHODS = ("dk", pytest.param("mu-dk", marks=pytest.mark.slow), "fixed")


class Memory(Checkpoint):
    """Keeps copies of the last state."""

    state = None

    def save(self, state):
        self.state = {name: np.array(array) for name, array in state.items()}

    def load(self):
        return self.state


def same(one, other):
    """Whether histories are the same to the last bit, the controllers and scalings included."""
    a, b = packed(one), packed(other)
    return a.keys() == b.keys() and all(np.array_equal(a[k], b[k], equal_nan=True) for k in a)


@pytest.fixture(scope="module")
def program():
    plant = unstable_first_order()
    return MuSynthesis(plant, start=hinf(plant).K)


@pytest.fixture(scope="module", autouse=True)
def few():
    """Rounds enough to be stopped in the midst of them."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(dk, "MOST_ROUNDS", 5)
        patch.setattr(fixed, "MOST_STEPS", 8)
        yield


@pytest.fixture(scope="module")
def whole_of(program, few):
    """What a method gives that nobody stops."""
    return cache(lambda name: wb.solve(program, method=name))


# --- stopped ----------------------------------------------------------------------------------


@pytest.mark.cases(0)
@pytest.mark.parametrize("name", METHODS)
def test_an_interrupted_iteration_goes_on_to_the_same_answer(program, whole_of, name):
    whole = whole_of(name)
    kept, rows = Memory(), []
    for after in (1, 3):

        def stop(description, done, total, after=after):
            if done == after:
                raise KeyboardInterrupt

        with pytest.raises(KeyboardInterrupt):
            wb.solve(program, method=name, context=Context(progress=stop, checkpoint=kept))
    context = Context(watch=lambda told: rows.append(len(told)), checkpoint=kept)
    again = wb.solve(program, method=name, context=context)
    assert same(again.answer.history, whole.answer.history)
    assert (again.answer.lower, again.answer.upper) == (whole.answer.lower, whole.answer.upper)
    np.testing.assert_array_equal(again.answer.K.A, whole.answer.K.A)
    assert (again.message, again.outcome) == (whole.message, Outcome.SOLVED)
    assert rows == list(range(1, len(whole.answer.history) + 1))
    assert [row["peak"] for row in context.rows] == [each.peak for each in whole.answer.history]


@pytest.mark.cases(0)
@pytest.mark.parametrize("name", METHODS)
def test_an_iteration_out_of_time_gives_its_best_and_goes_on_with_more(program, whole_of, name):
    whole, kept = whole_of(name), Memory()
    context = Context(options=Options(time_limit=1000.0), checkpoint=kept)

    def late(description, done, total):
        if done == 3:
            context.started -= 1000.0

    context.progress = late
    short = wb.solve(program, method=name, context=context)
    rounds = len(short.answer.history)
    assert rounds < len(whole.answer.history)
    assert short.outcome is Outcome.TIME_LIMIT and short.certificate.holds
    assert short.message == f"time limit of 1000 s reached after {rounds} rounds; best so far"
    assert short.answer.upper == pytest.approx(
        min(each.peak for each in short.answer.history), rel=1e-2
    )
    again = wb.solve(program, method=name, context=Context(checkpoint=kept))
    assert again.outcome is Outcome.SOLVED and same(again.answer.history, whole.answer.history)


@pytest.mark.cases(0)
def test_rounds_with_multipliers_that_go_on_late_keep_what_they_had():
    pole = real("pole", 1.0, percent=50)
    weight, effort = control.tf([0.4], [1.0, 0.1]), control.tf([0.1], [1.0])
    plant = generalised_plant(
        [(tf([1], [1, pole]), "u", "y"), (weight, "e", "z_e"), (effort, "u", "z_u")],
        {"e": "r - y"},
        exogenous=["r"],
        performance=["z_e", "z_u"],
        control=["u"],
        measurement="e",
    )
    program, kept, told = MuSynthesis(plant), Memory(), []

    def stop(description, done, total):
        if description == "multipliers" and done == 2:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        wb.solve(program, method="dgk", context=Context(progress=stop, checkpoint=kept))
    context = Context(options=Options(time_limit=1000.0), checkpoint=kept)

    def late(description, done, total):
        if description == "multipliers":
            told.append(done)
            context.started -= 1000.0

    context.progress = late
    short = wb.solve(program, method="dgk", context=context)
    assert told and short.outcome is Outcome.TIME_LIMIT and short.certificate.holds
    peaks = [each.peak for each in short.answer.history]
    assert short.answer.upper == pytest.approx(min(peaks), rel=1e-2)
    assert [row["peak"] for row in context.rows] == peaks


def test_before_the_first_controller_there_is_no_answer(program):
    options = Options(time_limit=1e-9)
    solution = wb.solve(replace(program, start=None), method="dk", options=options)
    assert solution.outcome is Outcome.TIME_LIMIT and solution.answer is None
    assert "before any answer" in solution.message


@pytest.mark.skipif(os.name == "nt", reason="Windows has no such signal")
@pytest.mark.slow
def test_a_killed_run_of_the_command_goes_on_where_it_was(tmp_path, monkeypatch):
    monkeypatch.setattr(dk, "MOST_ROUNDS", 30)  # as in a process of its own
    monkeypatch.setenv("WORKBENCH_RESULTS", str(tmp_path))
    command = [sys.executable, "-m", "workbench", "run", "unstable-first-order/controller"]
    with subprocess.Popen(command, cwd=ROOT, stdout=subprocess.DEVNULL) as process:
        while not list(tmp_path.glob(".partial/*.npz")):
            assert process.poll() is None
            time.sleep(0.005)
        process.send_signal(signal.SIGKILL)
    assert process.returncode == -signal.SIGKILL and wb.results() == []
    told = []
    run = wb.run("unstable-first-order/controller", progress=lambda *what: told.append(what))
    first = next(done for description, done, _ in told if description == "mu synthesis")
    whole = wb.solve(wb.load("unstable-first-order/controller"))
    assert 0 < first < len(whole.answer.history)
    assert run.holds and run.metrics["peak"] == pytest.approx(whole.answer.upper, rel=1e-9)
    assert run.data.sizes["round"] == len(whole.answer.history)
    assert wb.verify(run.path).holds and not list(tmp_path.glob(".partial/*.npz"))


# --- stored -----------------------------------------------------------------------------------


@pytest.mark.cases(0)
@pytest.mark.parametrize("name", METHODS)
def test_every_round_is_stored_with_its_controller_and_scalings(program, whole_of, name, tmp_path):
    answer = whole_of(name).answer
    netcdf.write(program.to_dataset(answer), tmp_path / "data.nc")
    data = netcdf.read(tmp_path / "data.nc")
    back = program.from_dataset(data)
    assert same(back.history, answer.history)
    assert data["round_peak"].values.tolist() == [each.peak for each in answer.history]
    for each in back.history:  # a round's peak is that of its controller, on frequencies only
        found = program.answer(each.K)
        assert 0.99 * found.lower <= each.peak <= found.upper


@pytest.mark.cases(0)
def test_the_scalings_are_those_that_were_fitted_to_the_loop(program, whole_of):
    """The bound of the scaled loop is the one that `fit` says it misses."""
    from workbench.mu import upper_bound
    from workbench.synthesis.mu.scaling_fit import diagonals

    for each in whole_of("dk").answer.history:
        loop = d_step.LoopResponse.of(program.plant.close(each.K))
        x = each.scalings["D"]
        value, _ = Biquads.of(x).log_magnitude(x, loop.omega)
        rows, columns = diagonals(program.closed_structure, value)
        scaled = np.exp(rows)[:, :, None] * loop.M * np.exp(-columns)[:, None, :]
        bound = upper_bound(loop.M, program.closed_structure).value
        ratio = np.linalg.norm(scaled, 2, axis=(1, 2)) / np.maximum(
            bound, d_step.REFERENCE_FLOOR * bound.max()
        )
        assert ratio.max() == pytest.approx(1.0 + each.fit, rel=1e-9)


def test_an_answer_without_rounds_is_stored_too(program):
    answer = program.answer(program.start)
    back = program.from_dataset(program.to_dataset(answer))
    assert back.history == () and back.upper == answer.upper


SIZES = st.integers(0, 4)


@st.composite
def histories(draw):
    """Rounds of controllers of any order with any scalings."""
    outputs, inputs = draw(st.integers(1, 3)), draw(st.integers(1, 3))
    rng = np.random.default_rng(draw(st.integers(0, 99)))
    history = []
    for _ in range(draw(st.integers(1, 4))):
        n = draw(SIZES)
        sizes = ((n, n), (n, inputs), (outputs, n), (outputs, inputs))
        K = control.ss(*(rng.standard_normal(size) for size in sizes))
        scalings = {
            name: rng.standard_normal((draw(st.integers(1, 3)), 1 + 4 * draw(SIZES)))
            for name in draw(st.sets(st.sampled_from(["D", "gamma", "G_1"])))
        }
        level = draw(st.sampled_from([np.nan, 1.5]))
        history.append(Iterate(rng.random(), level, rng.random(), K, scalings=scalings))
    return history


@given(histories())
def test_rounds_come_back_from_their_arrays(history):
    back = unpacked(packed(history))
    assert [each.order for each in back] == [each.K.nstates for each in history]
    for one, other in zip(back, history, strict=True):
        np.testing.assert_array_equal(
            [one.peak, one.level, one.fit], [other.peak, other.level, other.fit]
        )
        for part in "ABCD":
            np.testing.assert_array_equal(getattr(one.K, part), getattr(other.K, part))
        assert one.scalings.keys() == other.scalings.keys()
        for name, x in other.scalings.items():
            np.testing.assert_array_equal(one.scalings[name], x)


def test_a_row_of_the_table_has_what_people_follow():
    each = Iterate(0.9, 1.1, 0.01, control.ss([[-1.0]], [[1.0]], [[1.0]], [[0.0]]))
    row = {"round": 3, "peak": 0.9, "level": 1.1, "order": 1, "fit": 0.01}
    assert each.row(3) == row and list(each.row(3)) == list(row)
