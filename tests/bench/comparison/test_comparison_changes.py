"""What changed between two comparisons."""

import math
import re

import numpy as np
import pytest
from made_cells import LEVELS, inaccurate, invalid, made, nothing, solved, synthetic
from scipy import stats

from workbench.bench.comparison import changes, changes_table
from workbench.errors import InputError, ResultError


def timed(*times, gap=0.0):
    """A method on as many problems as there are times."""
    return made(
        {(f"p{k}", "a"): solved(1.0, gap, solve=t, statement=0.0) for k, t in enumerate(times)}
    )


def test_nothing_changes_between_a_comparison_and_itself():
    data = synthetic(problems=4, methods=6, repetitions=1)
    found = changes(data, data)
    assert not found["changed"].any()
    assert np.allclose(found["ratio"], 1.0) and np.allclose(found["ratio_low"], 1.0)
    assert changes_table(found).startswith("0 of 72 cells have another verdict.")


def test_ratios_of_times_have_the_interval_of_student():
    found = changes(timed(1.0, 1.0, 1.0), timed(2.0, 4.0, 8.0))
    logs = np.log([2.0, 4.0, 8.0])
    interval = stats.t.interval(0.95, 2, logs.mean(), stats.sem(logs))
    assert found["ratio"].item() == pytest.approx(4.0) and found["pairs"].item() == 3
    assert found["ratio_low"].item() == pytest.approx(math.exp(interval[0]))
    assert found["ratio_high"].item() == pytest.approx(math.exp(interval[1]))


def test_a_change_of_sides_inverts_the_ratio():
    old, new = timed(1.0, 3.0), timed(2.0, 4.0)
    there, back = changes(old, new), changes(new, old)
    assert there["ratio"].item() == pytest.approx(1 / back["ratio"].item())
    assert there["ratio_low"].item() == pytest.approx(1 / back["ratio_high"].item())


def test_one_pair_has_no_interval():
    found = changes(timed(1.0), timed(2.0))
    assert found["ratio"].item() == pytest.approx(2.0) and np.isnan(found["ratio_low"].item())
    assert re.search(r"\| a +\| +1 \| +2 \| +- \|", changes_table(found))


def test_cells_with_another_verdict_are_listed_and_not_timed():
    old = made(
        {("p", "a"): solved(), ("q", "a"): solved(), ("p", "b"): invalid(), ("q", "b"): nothing("")}
    )
    new = made(
        {("p", "a"): inaccurate(), ("q", "a"): solved(), ("p", "b"): solved(), ("q", "b"): solved()}
    )
    found = changes(old, new)
    assert found["changed"].sel(accuracy="middle").values.tolist() == [[1, 1], [0, 0]]
    assert found["pairs"].values.tolist() == [1, 0] and np.isnan(found["ratio"].values[1])
    text = changes_table(found)
    assert text.startswith("2 of 3 cells have another verdict.")
    assert "| p       | a      | middle   | solved         | inaccurate  |" in text
    assert "| p       | b      | middle   | wrong          | solved      |" in text


def test_gaps_keep_their_sign():
    text = changes_table(changes(timed(1.0, gap=1e-7), timed(1.0, gap=-2e-7)))
    assert "1.0e-07" in text and "-2.0e-07" in text


def test_what_only_one_has_is_named_and_left_out():
    old = made({("p", "a"): solved(), ("p", "b"): solved()}, LEVELS)
    new = made({("p", "c"): solved(), ("p", "b"): solved()}, LEVELS[1:])
    found = changes(old, new)
    assert found["by_method"].values.tolist() == ["b"]
    assert found["accuracy"].values.tolist() == ["middle", "high"]
    assert found.attrs == {"only_old": "a, low", "only_new": "c"}
    assert "Only before: a, low" in changes_table(found)


def test_comparisons_that_have_nothing_in_common_are_refused():
    one, other = made({("p", "a"): solved()}), made({("q", "a"): solved()})
    with pytest.raises(InputError, match="no problem in common: p before, q now"):
        changes(one, other)
    with pytest.raises(InputError, match="no method in common: a before, b now"):
        changes(one, made({("p", "b"): solved()}))
    with pytest.raises(InputError, match="have parameters"):
        changes(one, made({("p", "a"): solved()}, parameters='{"scale": 2.0}'))
    with pytest.raises(ResultError, match="no comparison"):
        changes(one, one.drop_vars("outcome"))
