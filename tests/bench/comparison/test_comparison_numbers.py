"""Counts, means and tables of comparisons, against numbers worked out by hand."""

import math
import shlex

import numpy as np
import pytest
from click.testing import CliRunner
from hypothesis import given
from hypothesis import strategies as st
from lanes import examples
from made_cells import (
    LEVELS,
    heuristic,
    inaccurate,
    invalid,
    made,
    nothing,
    proven,
    solved,
    synthetic,
)

from workbench.bench.comparison import Comparison, badge, failures, judged_cells, rows, shifted_mean
from workbench.bench.comparison.numbers import certified_times, disagreements, penalty, quartiles
from workbench.bench.comparison.tables import HEADS, means, tables
from workbench.cli import main


def test_the_badge_says_what_is_certified_and_what_was_claimed_falsely():
    cells = {("p", f"m{k}"): solved() for k in range(44)} | {("p", "bad"): invalid()}
    data = judged_cells(made(cells | {("p", "none"): nothing("unfit")}))
    assert badge(data) == "certified 44 of 45, 1 false claim"
    assert badge(judged_cells(made({("p", "m"): solved()}))) == "certified 1 of 1, 0 false claims"
    both = made({("p", "a"): solved(2.0), ("p", "b"): heuristic(1.0)})
    assert badge(judged_cells(both)) == "certified 0 of 2, 0 false claims, 2 contradictions"


def test_metrics_count_every_kind_of_cell():
    cells = {
        ("p", "good"): solved(), ("p", "bad"): invalid(), ("p", "dead"): nothing("crashed"),
        ("p", "other"): nothing("unfit"), ("p", "unasked"): nothing(""),
        ("p", "left out"): nothing("not compared"),
    }  # fmt: skip
    assert Comparison.stored().metrics(made(cells)) == {
        "certified_share": pytest.approx(1 / 3), "cells": 3, "certified": 1, "false_claims": 1,
        "contradictions": 0, "unfit": 1,
    }  # fmt: skip


def test_a_comparison_with_no_cell_or_with_altered_verdicts_does_not_hold():
    study = Comparison.stored()
    data = judged_cells(made({("p", "a"): solved(), ("p", "b"): invalid()}))
    assert study.certify(data, 1e-6).holds
    altered = data.assign(
        verdict=data["verdict"].copy(data=np.full(data["verdict"].shape, "solved"))
    )
    assert [check.name for check in study.certify(altered, 1e-6).checks if not check.holds] == [
        "verdicts"
    ]
    assert not study.certify(judged_cells(made({("p", "a"): nothing("")})), 1e-6).holds


@examples(20, 200)
@given(
    st.lists(st.floats(1e-4, 1e4), min_size=1, max_size=9),
    st.floats(1e-3, 1e2),
    st.floats(1e-2, 1e2),
)
def test_a_shifted_mean_is_a_mean(times, shift, factor):
    mean = shifted_mean(times, shift)
    assert min(times) * (1 - 1e-6) - 1e-9 * shift <= mean <= max(times) * (1 + 1e-6) + 1e-9
    scaled = shifted_mean([factor * time for time in times], factor * shift)
    assert scaled == pytest.approx(factor * mean, rel=1e-6, abs=1e-9)
    assert mean <= np.mean(times) * (1 + 1e-9) + 1e-9


def test_a_shifted_mean_by_hand():
    assert shifted_mean([1.0, 7.0], 1.0) == pytest.approx(3.0)  # sqrt(2 * 8) - 1
    assert math.isnan(shifted_mean([], 1.0))


def test_quartiles_leave_out_what_is_not_known():
    values = np.array([[1.0, 2.0, 3.0, 4.0, 5.0], [np.nan] * 5, [7.0] + [np.nan] * 4])
    assert quartiles(values).T.tolist()[0] == [2.0, 3.0, 4.0]
    assert quartiles(values).T.tolist()[2] == [7.0] * 3
    assert np.isnan(quartiles(values)[:, 1]).all()


def test_times_are_medians_of_cells_that_are_certified_each_time():
    cells = {("p", "a", "middle", n): solved(solve=float(n), statement=1.0) for n in range(5)}
    data = judged_cells(made(cells, repetitions=5))
    assert certified_times(data)[:, 0, 0, 0].tolist() == [2.0, 3.0, 4.0]
    cells["p", "a", "middle", 2] = nothing("time limit")
    assert np.isnan(certified_times(judged_cells(made(cells, repetitions=5)))).all()


def test_the_mean_time_counts_failures_with_the_time_limit():
    cells = {
        ("p", "a"): solved(solve=0.5, statement=0.5), ("q", "a"): nothing("failed"),
        ("p", "b"): solved(solve=2.0, statement=1.0), ("q", "b"): invalid(),
    }  # fmt: skip
    data = judged_cells(made(cells, time_limit=8.0))
    heads, table = means(data, penalty(data))
    by_hand = [math.sqrt(t * 8.01) - 0.01 for t in (1.01, 3.01)]
    assert [row[:6] for row in table] == [
        ["a", "middle", "2", "1", "50%", "0"], ["b", "middle", "2", "1", "50%", "1"],
    ]  # fmt: skip
    assert [float(row[6]) for row in table] == pytest.approx(by_hand, rel=1e-3)
    assert heads[6:] == ["mean time, shift 0.01 s", "mean time, shift 10 s"]
    assert penalty(judged_cells(made(cells))) == 3.0  # without a limit, the longest time


def test_disagreement_is_the_largest_difference_over_the_scale():
    cells = {
        ("p", "a"): solved(1.0), ("p", "b"): solved(1.0 + 1e-7), ("p", "c"): nothing("failed"),
        ("q", "a"): solved(-4.0), ("q", "b"): solved(-5.0), ("q", "c"): nothing("unfit"),
    }  # fmt: skip
    found = disagreements(made(cells))
    assert found[0, 1] == found[1, 0] == pytest.approx(0.2)
    assert found[0, 0] == found[1, 1] == 0.0
    assert np.isnan(found[2]).all() and np.isnan(found[:, 2]).all()


def test_two_objectives_of_zero_agree():
    assert disagreements(made({("p", "a"): solved(0.0), ("p", "b"): solved(0.0)}))[0, 1] == 0.0


# --- tables -------------------------------------------------------------------------------------


def test_a_row_shows_medians_and_quartiles_of_repetitions():
    cells = {("p", "a", "middle", n): solved(solve=1.0 + n, statement=0.5) for n in range(3)}
    cells["p", "b"] = nothing("")
    (row,) = rows(judged_cells(made(cells, repetitions=3)))
    assert row == [
        "p", "a", "middle", "solved", "solved", "0.0e+00", "1", "0.5000",
        "2.0000 (1.5000 to 2.5000)", "0.1000", "100",
    ]  # fmt: skip
    assert len(row) == len(HEADS)


def test_repetitions_that_end_differently_show_every_verdict_and_the_largest_gap():
    cells = {("p", "a", "middle", 0): solved(1.0, 1e-9)}
    cells["p", "a", "middle", 1] = inaccurate(1.0, -1e-6 * 5)
    (row,) = rows(judged_cells(made(cells, repetitions=2)))
    assert row[3] == "solved / inaccurate" and row[5] == "-5.0e-06"


def test_failures_say_why_and_how_to_repeat_them_and_the_worst_stand_first():
    cells = {
        ("a b", "slow"): nothing("time limit", message="stopped | after\n8 s"),
        ("a b", "good"): solved(), ("a b", "boast"): inaccurate(2.0),
        ("a b", "picky"): nothing("unfit"),
    }  # fmt: skip
    parameters = '{"word": "x y", "count": 3, "list": [1, 2]}'
    heads, table = failures(
        judged_cells(made(cells, time_limit=8.0, seed=5, parameters=parameters))
    )
    assert heads == ["problem", "method", "accuracy", "verdict", "reason", "command"]
    assert [row[3] for row in table] == ["wrong", "time limit"]
    assert table[0][4].startswith("says solved, but the valid answer of good at middle")
    assert table[1][4] == "stopped / after 8 s"
    assert shlex.split(table[1][5].strip("`")) == [
        *("workbench", "run", "a b", "--method", "slow", "--tolerance", "middle"),
        *("--time-limit", "8", "--seed", "5"),
        *("--set", "word=x y", "--set", "count=3", "--set", "list=[1, 2]", "--fresh"),
    ]


def test_the_command_that_repeats_a_cell_is_one_that_the_program_has(project):
    cells = {("toy/root", "lying"): invalid()}
    data = judged_cells(made(cells, time_limit=60.0, parameters='{"scale": 2.0}'))
    words = shlex.split(failures(data)[1][0][5].strip("`"))
    done = CliRunner().invoke(main, words[1:])
    assert "lying" in done.output and "failed" in done.output, done.output


def test_programs_have_tables_of_their_own():
    cells = {
        ("p", "a"): solved(), ("p", "b"): solved(), ("q", "b"): solved(), ("q", "a"): nothing(""),
        ("s", "a"): nothing("unfit", message="a study"), ("s", "b"): nothing("unfit"),
        ("p", "c"): nothing("not compared", message="ask by name"),
    }  # fmt: skip
    programs = {"p": "SmallestCircle", "q": "MuUpperBound", "s": ""}
    found = tables(judged_cells(made(cells, programs=programs)))
    assert found.keys() == {"means", "failures", "agreement", "comparison"}
    circle, mu = found["means"].split("SmallestCircle")[1].split("MuUpperBound")
    assert "| a " in circle and "| b " in circle and "| b " in mu and "| a " not in mu
    assert found["failures"] == "Every cell is certified.\n"
    assert "Unfit: s by a: a study" in found["comparison"]
    assert "Not compared: p by c: ask by name" in found["comparison"]
    empty = judged_cells(made({("p", "a"): nothing("failed")}))
    assert tables(empty)["agreement"] == "No Program of this comparison has an objective.\n"


def test_methods_that_one_computation_answers_are_alike():
    cells = {("p", "a"): solved(served=1e-6), ("p", "b"): solved(served=np.nan)}
    text = tables(judged_cells(made(cells, LEVELS)))["comparison"]
    assert "Alike: p by a: one computation for low, middle, high" in text and "p by b" not in text


def test_many_cells_have_every_table():
    data = judged_cells(synthetic(problems=4, methods=6))
    found = tables(data)
    assert found["agreement"].count("At accuracy") == 3
    assert len(rows(data)) == 4 * 6 * 3
    assert found["means"].count("method-5") == 3


def test_a_comparison_with_two_certificates_that_exclude_each_other_does_not_hold():
    both = made({("p", "a"): solved(), ("p", "b"): proven("infeasible")})
    alone = made({("p", "a"): solved()})
    assert Comparison.stored().certify(judged_cells(alone), 1e-6).holds
    found = Comparison.stored().certify(judged_cells(both), 1e-6)
    assert [check.name for check in found.checks if not check.holds] == ["contradictions"]
