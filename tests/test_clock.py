"""The clock of the work that runs, as inner loops and proofs see it."""

import pytest

from workbench.errors import TimeLimitError
from workbench.executor import Context
from workbench.executor.clock import clocked_by, proof_tick, proving, tick, time_is_up
from workbench.solvers import Options


def past(limit=1000.0, spent=1000.0):
    """A context of a limit [s], after some time [s]."""
    context = Context(options=Options(time_limit=limit))
    context.started -= spent
    return context


def test_outside_of_any_work_and_without_a_limit_there_is_time():
    tick("search")
    with clocked_by(Context()):
        tick("search")
        assert not time_is_up("search")


def test_an_inner_loop_ends_where_the_time_limit_of_its_work_has_passed():
    with (
        clocked_by(past()),
        pytest.raises(TimeLimitError, match="search: time limit of 1000 s"),
    ):
        tick("search")
    tick("search")  # the work has ended


@pytest.mark.parametrize("inner", [Context(), Context(options=Options(time_limit=1e6))])
def test_the_clock_of_the_work_around_counts_too(inner):
    with clocked_by(past()), clocked_by(inner):
        assert time_is_up("search")
        with pytest.raises(TimeLimitError):
            tick("search")
    assert not inner.stopped


def test_what_is_kept_back_is_taken_from_the_limit():
    context = past(spent=900.0)
    assert 99.0 < context.remaining <= 100.0
    context.reserved = 200.0
    with clocked_by(context), pytest.raises(TimeLimitError):
        tick("search")
    with pytest.raises(TimeLimitError):
        context.seconds_left("search")


def test_a_loop_with_an_answer_ends_without_an_error_and_it_is_told():
    context = past()
    with clocked_by(context):
        assert time_is_up("bisection")
    assert context.stopped == "time limit of 1000 s reached in bisection; best so far"
    context.record({"round": 1})
    context.stop("bisection")
    assert context.stopped == "time limit of 1000 s reached after 1 round; best so far"


def test_a_proof_takes_as_long_as_it_takes_unless_a_time_is_set_for_it():
    with clocked_by(past()):
        proof_tick("proof")
    with proving(1e6):
        proof_tick("proof")
    with proving(0.0), proving(1e6), pytest.raises(TimeLimitError, match="proof: no time is left"):
        proof_tick("proof")
    proof_tick("proof")


def test_whoever_watches_hears_what_a_round_tries():
    told = []
    context = Context(progress=lambda *what: told.append(what))
    with clocked_by(context):
        tick("before any round")
        for _ in context.rounds(2, "search"):
            for _ in range(3):
                tick("fit")
            tick("descent")
    assert told[:5] == [
        ("search", 0, 2),
        ("search: fit", 0, 2),
        ("search: descent", 0, 2),
        ("search", 1, 2),
        ("search: fit", 1, 2),
    ]
