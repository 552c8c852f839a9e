"""The gain that makes two channels equally bad, against a closed form."""

import control
import numpy as np
import pytest

from workbench.synthesis import equalising_gain
from workbench.uncertainty import generalised_plant


def plant(effort):
    """G = 1 / (s + 1), outputs e / (s + 1) and effort u: norms 1 / (1 + k), effort k with K = k."""
    return generalised_plant(
        [
            (control.tf(1, [1, 1]), "u", "y"),
            (control.tf(1, [1, 1]), "e", "z"),
            (control.tf(effort, 1), "u", "v"),
        ],
        {"e": "w - y"},
        exogenous="w",
        control="u",
        performance=["z", "v"],
        measurement="e",
    )


def channels(effort):
    return plant(effort).channel(performance="z"), plant(effort).channel(performance="v")


def test_the_gain_is_that_of_the_closed_form():
    K = control.ss([], [], [], [[1.0]])
    exact = (-1 + np.sqrt(1 + 4 / 0.1)) / 2  # 1 / (1 + k) = 0.1 k
    assert equalising_gain(*channels(0.1), K) == pytest.approx(exact, rel=2e-2)


def test_no_gain_is_nan():
    K = control.ss([], [], [], [[1.0]])
    assert np.isnan(equalising_gain(*channels(10.0), K))  # the second is worse already
    assert np.isnan(equalising_gain(*channels(1e-4), K))  # and never is
