"""Numbers of random experiments over their draws: mean, interval, and what may be claimed."""

import numpy as np
import pytest
import xarray as xr
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy import stats

from workbench.errors import InputError, TimeLimitError
from workbench.executor import Context
from workbench.solvers import Options
from workbench.study import (
    draws_summary,
    independent_seeds,
    interval_text,
    share_interval,
    share_of_draws,
    verdict_of_share,
)

SIZES = st.floats(-1e6, 1e6)


@pytest.mark.cases(0)
@given(arrays(float, (3, 20), elements=SIZES))
def test_the_interval_holds_nine_draws_of_ten(values):
    found = draws_summary(xr.DataArray(values, dims=("drive", "draw"), attrs={"units": "m"}))
    mean, low, high = found.transpose("summary", ...).values
    inside = (values >= low[:, None] - 1e-9) & (values <= high[:, None] + 1e-9)
    assert (inside.sum(axis=1) >= 18).all()
    np.testing.assert_allclose(mean, values.mean(axis=1), atol=1e-9)
    assert found["summary"].values.tolist() == ["mean", "low", "high"]
    assert found.attrs["units"] == "m"


def test_drives_may_be_draws_too():
    values = xr.DataArray(np.arange(6.0).reshape(2, 3), dims=("drive", "draw"))
    assert float(draws_summary(values, "drive").sel(summary="mean")) == 2.5
    with pytest.raises(InputError, match="has no dimension 'axis'"):
        draws_summary(values, "axis")
    with pytest.raises(InputError, match="has no dimension 'draw'"):
        draws_summary(values.isel(draw=0))


def test_in_words():
    values = xr.DataArray(np.linspace(0.0, 1.0, 101), dims="draw")
    assert interval_text(draws_summary(values), form="{:.2f}") == "0.50 (0.05 to 0.95)"


@pytest.mark.parametrize(
    ("share", "words"),
    [(1.0, "holds"), (0.95, "holds"), (0.94, "undecided"), (0.06, "undecided"), (0.05, "fails")],
)
def test_what_is_claimed(share, words):
    assert verdict_of_share(share) == words


@pytest.mark.parametrize("share", [-0.1, 1.1, float("nan")])
def test_a_share_is_from_0_to_1(share):
    with pytest.raises(InputError, match="must be from 0 to 1"):
        verdict_of_share(share)


def test_shares_are_paired():
    one = xr.DataArray([[1.0, 2.0], [3.0, 4.0]], dims=("drive", "draw"))
    assert float(share_of_draws(one < one + 0.1)) == 1.0
    assert share_of_draws(one > 2.5, "drive").values.tolist() == [0.0, 1.0]


def test_seeds_do_not_repeat():
    seeds = independent_seeds(np.random.default_rng(0), 13, 50)
    assert seeds.shape == (13, 50) and len(np.unique(seeds)) == 650


def test_experiments_run_in_threads_within_the_time_limit():
    seen = []
    context = Context(progress=lambda *told: seen.append(told))
    assert context.spread(lambda n: n * n, [1, 2, 3], "squares") == [1, 4, 9]
    assert seen[-1] == ("squares", 3, 3)
    late = Context(options=Options(time_limit=1e-9))
    with pytest.raises(TimeLimitError, match="squares: time limit of 1e-09 s reached"):
        late.spread(lambda n: n, [1], "squares")


def test_draws_without_a_value_do_not_count():
    values = xr.DataArray([[1.0, np.nan], [np.nan, np.nan], [3.0, np.nan]], dims=("draw", "kind"))
    told = draws_summary(values)
    assert told.sel(summary="mean").values[0] == 2.0
    assert np.isnan(told.isel(kind=1)).all()


@pytest.mark.parametrize(("true", "many"), [(0, 7), (3, 10), (29, 30), (5, 5)])
def test_interval_of_a_share_is_that_of_another_library(true, many):
    holds = xr.DataArray(np.arange(many) < true, dims="draw")
    interval = stats.binomtest(true, many).proportion_ci(0.99, "exact")
    found = share_interval(holds).values
    assert found == pytest.approx([true / many, interval.low, interval.high], rel=1e-9, abs=1e-12)


def test_shares_are_told_apart_along_kept_dimensions():
    holds = xr.DataArray([[True, True], [True, False]], dims=("draw", "drive"))
    assert share_interval(holds, "drive").sel(summary="mean").values.tolist() == [1.0, 0.5]


def test_an_interval_needs_experiments_and_a_probability():
    with pytest.raises(InputError, match="no experiment"):
        share_interval(xr.DataArray(np.zeros(0, bool), dims="draw"))
    with pytest.raises(InputError, match=r"confidence is 1\.0"):
        share_interval(xr.DataArray([True], dims="draw"), confidence=1.0)
