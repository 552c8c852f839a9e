"""Past samples: single lags, means over growing lags, missing samples, long records."""

from itertools import pairwise

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from simulated_logs import as_record

from workbench.identification.record_tests.loop.lags import (
    MOST_NUMBERS,
    growing,
    last_known,
    past,
    stretches,
)


@given(st.integers(1, 40), st.integers(1, 200))
def test_groups_of_lags_grow_and_leave_no_lag_out(single, longest):
    firsts = growing(single, longest)
    assert firsts[0] == 1 and firsts[-1] <= longest + 1
    widths = np.diff(firsts)
    assert np.all(widths[:single] == 1)
    assert np.all(widths[single:] == 2.0 ** np.arange(1, len(widths) - single + 1))


def test_the_past_is_a_mean_of_earlier_samples():
    signal, firsts = np.random.default_rng(0).standard_normal((50, 2)), growing(3, 15)
    found = past(signal, firsts)
    for k in range(int(firsts[-1]), 50):
        means = [signal[k - b + 1 : k - a + 1].mean(axis=0) for a, b in pairwise(firsts)]
        np.testing.assert_allclose(found[k], np.ravel(means), atol=1e-12)
    np.testing.assert_allclose(found[0], np.tile(signal[0], len(firsts) - 1), atol=1e-12)


def test_missing_samples_hold_the_last_value():
    nan = np.nan
    found, missing = last_known(np.array([[nan, 1.0], [2.0, nan], [nan, nan], [3.0, 4.0]]))
    assert found.tolist() == [[2.0, 1.0], [2.0, 1.0], [2.0, 1.0], [3.0, 4.0]]
    assert missing.sum() == 4


def test_of_a_long_record_stretches_from_begin_to_end_are_taken():
    u = np.zeros(5 * MOST_NUMBERS)
    pieces = stretches(as_record(u, u, starts=(0, MOST_NUMBERS)))
    assert 2 * sum(p.stop - p.start for p in pieces) <= MOST_NUMBERS
    assert pieces[0].start == 0 and pieces[-1].stop > 4 * MOST_NUMBERS
    assert all(a.stop <= b.start for a, b in pairwise(pieces))
    assert list(stretches(as_record(u[:10], u[:10]))) == [slice(0, 10)]
