"""A method hears of the tolerances that make a difference to it; the key and the checks follow."""

from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

import workbench as wb
from workbench.accuracy import ANY_ACCURACY_ALIKE, DEFAULT_TOLERANCE, EVERY_ACCURACY, AccuracyRange
from workbench.executor import Context
from workbench.program import methods
from workbench.solvers import ACCURACY, Options

tolerances = st.floats(1e-12, 0.5)


@given(st.floats(0, 1), st.floats(0, 1), tolerances)
def test_a_served_tolerance_stands_for_those_served_alike(finest, coarsest, tolerance):
    accuracies = AccuracyRange(min(finest, coarsest), coarsest)
    served = accuracies.served(tolerance)
    assert accuracies.served(served) == served
    assert served == DEFAULT_TOLERANCE or accuracies.finest <= served <= accuracies.coarsest


@given(tolerances, tolerances)
def test_the_two_extremes_serve_all_alike_or_each_by_itself(one, other):
    assert EVERY_ACCURACY.served(one) == one and EVERY_ACCURACY.words == ""
    assert ANY_ACCURACY_ALIKE.served(one) == ANY_ACCURACY_ALIKE.served(other) == DEFAULT_TOLERANCE
    assert ANY_ACCURACY_ALIKE.none and "same at every accuracy" in ANY_ACCURACY_ALIKE.words


def test_a_range_joined_with_a_finest_tolerance_gets_no_finer():
    assert EVERY_ACCURACY.joined(1e-5).served(1e-9) == DEFAULT_TOLERANCE
    assert EVERY_ACCURACY.joined(1e-5).served(1e-3) == 1e-3
    assert EVERY_ACCURACY.joined(1e-8).served(1e-9) == 1e-8
    assert ANY_ACCURACY_ALIKE.joined(1e-3).none


# --- questions, runs, comparisons ---------------------------------------------------------------


@pytest.fixture
def deaf(project):
    """A project whose rough method computes the same at every accuracy."""
    project.edit(
        '@method(Root, "rough", optimal=False)',
        "from workbench.accuracy import ANY_ACCURACY_ALIKE\n\n\n"
        '@method(Root, "rough", optimal=False, accuracy=ANY_ACCURACY_ALIKE)',
    )
    return project


@pytest.mark.usefixtures("deaf")
def test_a_level_that_makes_no_difference_finds_the_same_answer_and_says_so():
    first = wb.run("toy/root", method="rough")
    assert not first.reused and first.note == ""
    for level in ("low", "high", 1e-4):
        found = wb.run("toy/root", method="rough", tolerance=level)
        assert found.reused and found.path == first.path
        assert "is not heeded: the same at every accuracy" in found.note
    assert "not heeded" in wb.run("toy/root", method="rough", tolerance="low", fresh=True).note


@pytest.mark.usefixtures("project")
def test_a_level_that_makes_a_difference_asks_another_question_and_says_nothing():
    runs = [wb.run("toy/root", method="exact", tolerance=level) for level in ACCURACY]
    assert len({one.path for one in runs}) == 3
    assert {one.note for one in runs} == {""}


@pytest.mark.usefixtures("project")
def test_a_study_that_says_nothing_computes_the_same_at_every_accuracy():
    low, high = (wb.run("toy/total", tolerance=level) for level in ("low", "high"))
    assert low.path == high.path and high.reused
    assert all("the same at every accuracy" in run.note for run in (low, high))


def test_an_optimal_method_is_held_to_the_accuracy_asked_even_if_it_computes_the_same(toy):
    kept = methods(toy.Root)["boastful"]
    alike = replace(kept, accuracy=ANY_ACCURACY_ALIKE)
    assert alike.judging_tolerance(1e-9) == 1e-9
    assert replace(alike, optimal=False).judging_tolerance(1e-9) == DEFAULT_TOLERANCE


def test_the_tolerance_of_a_method_never_reaches_it_out_of_range(toy):
    heard = []

    class Deaf(toy.Root):
        pass

    @wb.method(Deaf, "deaf", optimal=False, accuracy=AccuracyRange(1e-4, 1e-2))
    def deaf(program, context):
        heard.append(context.options.accuracy)
        return toy.roots(program), wb.Outcome.SOLVED, ""

    context = Context(options=Options(tolerance="high"))
    notes = [
        wb.solve(Deaf((4.0,)), method="deaf", options=Options(tolerance=tolerance)).note
        for tolerance in (1e-9, 1e-6, 1e-3, 0.1)
    ]
    wb.solve(Deaf((4.0,)), method="deaf", context=context)
    assert heard == [1e-6, 1e-6, 1e-3, 1e-2, 1e-6]
    assert context.options.accuracy == 1e-9
    assert [bool(note) for note in notes] == [True, False, False, True]
    assert "no finer than 0.0001 and no coarser than 0.01" in notes[0]


@pytest.mark.cases(0)
@pytest.mark.usefixtures("deaf")
def test_a_comparison_asks_once_for_what_is_the_same():
    told = []
    run = wb.compare(
        "toy/root", methods=["exact", "rough"], progress=lambda *what: told.append(what)
    )
    assert told[-1] == ("cells", 4, 4)  # three of exact, one of rough
    assert run.data["outcome"].values.tolist() == [[[["solved"]] * 3] * 2]
    assert run.data["served"].sel(by_method="rough").values.ravel().tolist() == [1e-6] * 3
    text = run.tables["comparison"]
    assert "toy/root by rough: one computation for low, middle, high" in text
    assert "by exact: one" not in text
