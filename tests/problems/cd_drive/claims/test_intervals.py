"""The interval of a number that is read from draws."""

import math
from types import SimpleNamespace

import numpy as np
import pytest
import xarray as xr
from scipy import stats
from workbench.plants.cd_drive.claims.intervals import CONFIDENCE, Measured
from workbench.plants.cd_drive.claims.items import Quantity


def run(values, problem="a/run"):
    """A run whose only metric is the mean of an array over its draws."""
    task = SimpleNamespace(metrics=lambda data: {"mean": float(data["x"].mean())})
    data = xr.Dataset({"x": (["draw"] if np.ndim(values) else [], values)})
    return SimpleNamespace(
        data=data, task=task, metrics=task.metrics(data), certificate=None, problem=problem
    )


def test_a_mean_of_ten_draws_has_the_interval_of_student():
    values = np.random.default_rng(3).normal(size=10)
    found = Measured(run(values)).found(Quantity("mean"))
    expected = stats.t.interval(CONFIDENCE, 9, values.mean(), stats.sem(values))
    assert (found.low, found.high) == pytest.approx(expected, rel=1e-9)


@pytest.mark.cases(0)
def test_intervals_of_means_hold_the_truth():
    rng = np.random.default_rng(5)
    held = 0
    for _ in range(300):
        found = Measured(run(rng.normal(size=50))).found(Quantity("mean"))
        held += found.low <= 0.0 <= found.high
    assert held >= 290  # 97 % of what 99 % should be


def test_without_draws_a_number_is_exact():
    assert Measured(run(2.0)).found(Quantity("mean")) == (2.0, 2.0, 2.0)


@pytest.mark.parametrize("values", [np.ones(20), np.array([2.0])], ids=["all agree", "one draw"])
def test_nothing_is_told_where_draws_tell_nothing(values):
    found = Measured(run(values)).found(Quantity("mean"))
    assert (found.low, found.high) == (-math.inf, math.inf)


def test_nothing_is_told_of_studies_that_store_no_draws():
    found = Measured(run(2.0, "cd/focus/best-gains")).found(Quantity("mean"))
    assert (found.value, found.low, found.high) == (2.0, -math.inf, math.inf)
