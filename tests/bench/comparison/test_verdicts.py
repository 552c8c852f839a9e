"""Verdicts of cells from all cells of a comparison, rule by rule and by their invariants."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from lanes import examples
from made_cells import heuristic, inaccurate, invalid, made, nothing, proven, solved

from workbench.bench.comparison import SAFETY, judged_cells
from workbench.errors import ResultError


def verdicts(*cells, level="middle", **options):
    """Verdicts of the cells of one problem, in their order."""
    data = made({("p", f"m{k}"): cell for k, cell in enumerate(cells)}, (level,), **options)
    return judged_cells(data)["verdict"].values.ravel().tolist()


def reasons(*cells):
    data = made({("p", f"m{k}"): cell for k, cell in enumerate(cells)})
    return judged_cells(data)["reason"].values.ravel().tolist()


ALONE = {
    "solved": solved(),
    "inaccurate": inaccurate(),
    "infeasible": proven("infeasible"),
    "unbounded": proven("unbounded"),
    "no claim": nothing("no claim", "infeasible"),
    "no solution up to R": nothing("no solution up to R", "infeasible"),
    "failed": nothing("failed", "failed"),
    "crashed": nothing("crashed"),
    "time limit": nothing("time limit", "time limit"),
    "memory limit": nothing("memory limit"),
    "unfit": nothing("unfit"),
    "not compared": nothing("not compared"),
    "wrong": invalid(),
}


@pytest.mark.parametrize("verdict", ALONE)
def test_a_cell_alone_has_the_verdict_of_its_certificate(verdict):
    assert verdicts(ALONE[verdict]) == [verdict]


def test_an_answer_that_could_not_be_checked_is_no_false_claim():
    assert verdicts(nothing("failed", "solved")) == ["failed"]


def test_an_invalid_answer_without_a_claim_is_no_false_claim():
    assert verdicts(invalid("inaccurate")) == ["failed"]


def test_an_invalid_answer_of_a_heuristic_is_a_false_claim():
    assert verdicts(invalid() | {"optimal": 0}) == ["wrong"]


# --- claims of the optimum ----------------------------------------------------------------------


def test_a_claim_is_wrong_where_another_answer_is_clearly_better():
    assert verdicts(inaccurate(1.02), solved(1.0)) == ["wrong", "solved"]
    (said, _) = reasons(inaccurate(1.02), solved(1.0))
    assert (
        said == "says solved, but the valid answer of m1 at middle has a clearly better objective"
    )


def test_a_claim_with_an_open_gap_is_inaccurate_where_nobody_is_better():
    assert verdicts(inaccurate(1.0), solved(1.0), heuristic(1.5)) == [
        "inaccurate", "solved", "solved",
    ]  # fmt: skip


def test_the_reason_of_an_open_gap_is_its_size():
    assert reasons(inaccurate(1.0, 2e-5)) == ["the gap 2e-05 exceeds the tolerance 1e-06"]
    slightly = reasons(solved(1.0 + 2e-6, np.nan), solved(1.0, np.nan))
    assert slightly == [
        "says solved, but the valid answer of m1 at middle has a better objective",
        "",
    ]


@pytest.mark.parametrize(
    ("excess", "verdict"),
    [(0.5, "solved"), (2.0, "inaccurate"), (0.99 * SAFETY, "inaccurate"), (1.01 * SAFETY, "wrong")],
)
def test_without_a_gap_only_others_tell_how_good_an_answer_is(excess, verdict):
    better, worse = solved(1.0, np.nan), solved(1.0 + excess * 1e-6, np.nan)
    assert verdicts(worse, better) == [verdict, "solved"]


@pytest.mark.parametrize("factor", [1.0001, 2.0, 1e9])
def test_a_heuristic_is_never_wrong_for_being_worse(factor):
    assert verdicts(heuristic(factor, gap=factor - 1.0), solved(1.0)) == ["solved", "solved"]


def test_a_method_that_says_inaccurate_claims_nothing():
    assert verdicts(inaccurate(1.5, claim="inaccurate"), solved(1.0))[0] == "inaccurate"


def test_an_answer_far_below_its_own_bound_is_wrong():
    """A gap of -0.98 is no accuracy, and such an answer speaks against nobody."""
    assert verdicts(inaccurate(0.02, -0.98, scale=1.0), solved(1.0)) == ["wrong", "solved"]


def test_an_answer_slightly_below_its_bound_is_inaccurate():
    assert verdicts(inaccurate(1.0, -0.5e-6 * SAFETY)) == ["inaccurate"]


def test_a_heuristic_below_its_own_bound_has_two_certificates_that_exclude_each_other():
    assert verdicts(heuristic(0.5, -0.9), solved(1.0)) == ["contradiction", "solved"]


def test_coarse_answers_do_not_accuse_fine_ones():
    """An answer valid to 1e-3 only may lie 1e-3 below the optimum."""
    cells = {("p", "fine", "high"): solved(1.0, np.nan), ("p", "fine", "low"): solved(1.0, np.nan)}
    cells |= {
        ("p", "coarse", "low"): solved(1.0 - 2e-3, np.nan),
        ("p", "coarse", "high"): nothing(""),
    }
    found = judged_cells(made(cells, ("low", "high")))["verdict"].sel(by_method="fine").values
    assert found.ravel().tolist() == ["inaccurate", "inaccurate"]


def test_rounding_and_scale_decide_near_zero():
    tiny = {"scale": 1.0, "optimal": 1}
    assert verdicts(solved(1e-9, np.nan, **tiny), solved(0.0, np.nan, **tiny)) == ["solved"] * 2
    far = solved(1e-9, np.nan, scale=1e-9)
    assert verdicts(far, solved(0.0, np.nan, scale=0.0)) == ["wrong", "solved"]
    rounded = {"scale": 0.0, "rounding": 1e-9}
    assert verdicts(solved(1e-9, np.nan, **rounded), solved(0.0, np.nan, **rounded)) == [
        "solved", "solved",
    ]  # fmt: skip


def test_the_best_answer_of_a_stopped_method_counts():
    stopped = solved(1.0, np.nan, outcome="time limit", claim="time limit", certified=0)
    assert verdicts(inaccurate(2.0, np.inf), stopped) == ["wrong", "time limit"]


# --- claims that there is no answer -------------------------------------------------------------


def test_a_claim_of_no_answer_is_wrong_where_there_is_one():
    assert verdicts(nothing("no claim", "infeasible"), solved()) == ["wrong", "solved"]
    assert verdicts(nothing("no solution up to R", "infeasible"), heuristic()) == [
        "wrong", "solved",
    ]  # fmt: skip
    assert verdicts(nothing("no claim", "infeasible"), proven("unbounded"))[0] == "wrong"


def test_a_claim_of_no_least_value_needs_a_bound_to_be_wrong():
    claim = nothing("no claim", "unbounded")
    assert verdicts(claim, solved()) == ["wrong", "solved"]
    assert verdicts(claim, heuristic()) == ["no claim", "solved"]  # it may fall for ever
    assert verdicts(claim, proven("infeasible")) == ["wrong", "infeasible"]


def test_a_claim_of_an_answer_is_wrong_where_there_is_none():
    assert verdicts(nothing("failed", "solved"), proven("infeasible")) == ["wrong", "infeasible"]
    assert verdicts(solved(1.0, np.nan), proven("unbounded")) == ["wrong", "unbounded"]


# --- contradictions -----------------------------------------------------------------------------


@pytest.mark.parametrize(
    "pair",
    [
        (solved(), proven("infeasible")),
        (heuristic(), proven("infeasible")),
        (inaccurate(), proven("infeasible")),
        (solved(), proven("unbounded")),
        (proven("infeasible"), proven("unbounded")),
        (solved(2.0, 0.0), heuristic(1.0)),
        (solved(2.0, 0.0), solved(1.0, 0.0)),
    ],
)
def test_certificates_that_exclude_each_other_are_both_shown(pair):
    for one, other in (pair, pair[::-1]):
        assert verdicts(one, other) == ["contradiction"] * 2
        assert "m1" in reasons(one, other)[0] and "m0" in reasons(one, other)[1]


def test_a_cell_in_a_contradiction_proves_nothing_against_others():
    claim = nothing("no claim", "infeasible")
    assert verdicts(solved(), proven("infeasible"), claim) == ["contradiction"] * 2 + ["no claim"]


def test_a_bound_of_one_cell_excludes_an_answer_only_clearly_below_it():
    near = heuristic(1.0 - 0.9e-6 * SAFETY)
    assert verdicts(solved(1.0), near) == ["solved", "solved"]
    assert verdicts(solved(1.0), heuristic(1.0 - 1.1e-6 * SAFETY)) == ["contradiction"] * 2


# --- what holds for all comparisons -------------------------------------------------------------

CELLS = st.sampled_from(
    [
        *ALONE.values(),
        *(solved(value, gap) for value in (1.0, 1.0 + 1e-5, 2.0) for gap in (0.0, np.nan)),
        *(inaccurate(value, 0.5) for value in (1.0, 1.1)),
        *(heuristic(value) for value in (0.9, 1.0, 3.0)),
        inaccurate(0.02, -0.98, scale=1.0),
        nothing("no claim", "unbounded"),
        nothing(""),
    ]
)
CERTIFIED = {"solved", "infeasible", "unbounded"}


@examples(40, 400)
@given(st.lists(CELLS, min_size=1, max_size=6), st.randoms(use_true_random=False))
def test_the_order_of_methods_makes_no_difference(cells, random):
    order = list(range(len(cells)))
    random.shuffle(order)
    found = verdicts(*cells)
    assert verdicts(*(cells[k] for k in order)) == [found[k] for k in order]


@examples(40, 400)
@given(st.lists(CELLS, min_size=1, max_size=6))
def test_no_verdict_is_better_than_the_certificate(cells):
    for cell, verdict in zip(cells, verdicts(*cells), strict=True):
        assert verdict == cell["outcome"] or verdict in ("wrong", "contradiction", "inaccurate")
        assert verdict not in CERTIFIED or cell["outcome"] == verdict
        if cell["outcome"] in ("", "unfit", "crashed", "memory limit"):
            assert verdict == cell["outcome"]
        if verdict == "wrong":
            assert cell["claim"] in ("solved", "infeasible", "unbounded")


@examples(40, 400)
@given(st.lists(CELLS, min_size=1, max_size=5), st.floats(1e-6, 1e6))
def test_units_of_the_objective_make_no_difference(cells, factor):
    scaled = [
        cell | {name: cell[name] * factor for name in ("objective", "scale")} for cell in cells
    ]
    assert verdicts(*scaled) == verdicts(*cells)


@pytest.mark.cases(0)
@examples(40, 400)
@given(st.lists(CELLS, min_size=1, max_size=5), CELLS)
def test_a_cell_of_another_problem_makes_no_difference(cells, other):
    data = {("p", f"m{k}"): cell for k, cell in enumerate(cells)}
    both = (
        judged_cells(made(data | {("q", "m0"): other}))["verdict"].sel(problem="p").values.ravel()
    )
    assert both.tolist()[: len(cells)] == verdicts(*cells)


@examples(40, 400)
@given(st.lists(CELLS, min_size=1, max_size=5))
def test_a_worse_heuristic_speaks_against_no_optimum(cells):
    """It only shows that there is an answer, which matters where somebody says there is none."""
    cells = [cell for cell in cells if cell["outcome"] != "infeasible"]
    worse = heuristic(1e6)
    before, after = verdicts(*cells), verdicts(*cells, worse)
    for cell, one, other in zip(cells, before, after[:-1], strict=True):
        if one != other:
            assert cell["claim"] == "infeasible" and other == "wrong"


def test_every_repetition_is_a_cell_of_its_own():
    cells = {("p", "a", "middle", 0): solved(), ("p", "a", "middle", 1): inaccurate(1.5)}
    found = judged_cells(made(cells, repetitions=2))
    assert found["verdict"].values.ravel().tolist() == ["solved", "wrong"]
    assert "a at middle, repetition 1" in str(found["reason"].values[0, 0, 0, 1])


# --- bad input ----------------------------------------------------------------------------------


def test_an_older_comparison_is_refused_with_what_to_do():
    old = made({("p", "a"): solved()}).isel(repetition=0, drop=True)
    with pytest.raises(ResultError, match=r"dimensions problem, by_method, accuracy; .* again"):
        judged_cells(old)


@pytest.mark.parametrize(
    ("spoil", "words"),
    [
        (lambda data: data.drop_vars("outcome"), "no variable outcome"),
        (lambda data: data.drop_vars(["gap", "size"]), "lacks gap, size"),
        (lambda data: data.assign(gap=data["gap"].isel(repetition=0)), "gap must have dimensions"),
        (lambda data: data.assign(outcome=data["outcome"] + "!"), "unknown outcomes: solved!"),
    ],
)
def test_another_dataset_is_refused(spoil, words):
    with pytest.raises(ResultError, match=words):
        judged_cells(spoil(made({("p", "a"): solved()})))
