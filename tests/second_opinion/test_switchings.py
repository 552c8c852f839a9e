"""Periodic switchings drawn at random find the instability of fast switching."""

import numpy as np

from workbench.second_opinion.exact_switchings import exact_products
from workbench.second_opinion.switchings import SWITCHINGS, fastest_growth, switchings

turn, stretch = 0.6, 2.0
A1 = 0.99 * np.array(
    [[np.cos(turn), np.sin(turn) * stretch], [-np.sin(turn) / stretch, np.cos(turn)]]
)
A2 = A1.T.copy()


def test_fast_switching_is_found_unstable_and_slow_switching_stable():
    rate, which = fastest_growth([A1[None], A2[None]], [1, 1], [3, 3])
    assert rate > 0
    assert "for plant 1" in which
    assert fastest_growth([A1[None], A2[None]], [400, 400], [None, None])[0] < 0


def test_three_modes_are_switched_in_every_order():
    stable = 0.5 * np.eye(2)[None]
    assert fastest_growth([stable, stable, stable], [1, 2, 3], [None, 2, 5])[0] < 0
    assert fastest_growth([stable, stable, 100 * stable], [1, 1, 1], [1, 1, 1])[0] > 0


def test_switchings_keep_the_stays_of_every_mode():
    shortest, longest = [1, 3, 2], [2, None, 2]
    tried = list(switchings(np.random.default_rng(0), shortest, longest))
    assert len(tried) > SWITCHINGS
    for modes, stays in tried:
        for i, stay in zip(modes, stays, strict=True):
            assert shortest[i] <= stay <= (longest[i] or stay)
    pairs = {tuple(stays) for modes, stays in tried if modes == [0, 2]}
    assert pairs == {(1, 2), (2, 2)}


def test_exact_products_decide_by_a_hair():
    """Growth by 1 + 2^-50 and decay by 1 - 2^-50 a period, which doubles of the product blur."""
    turn = np.array([[0.0, 1.0], [-1.0, 0.0]])[None]
    for factor, growing in ((1 + 2.0**-50, 20), (1 - 2.0**-50, 0)):
        (check,) = exact_products([turn, factor * turn], [1, 1], [1, 2])
        assert check.value == growing and check.over.startswith("for 20 periodic switchings")


def test_exact_products_leave_out_periods_that_are_too_long():
    assert exact_products([A1[None], A2[None]], [400, 400], [None, None]) == []


def test_exact_products_agree_with_the_switchings_drawn():
    (check,) = exact_products([A1[None], A2[None]], [1, 1], [3, 3])
    assert not check.holds and "plant 1" in check.where
    (check,) = exact_products([0.5 * A1[None], 0.5 * A2[None]], [1, 1], [3, 3])
    assert check.holds
