"""Room of a controller's gain, beside the closed form of one complex scalar."""

import control
import numpy as np
import pytest
from scipy.optimize import brentq
from workbench.plants.textbook.first_order import unstable_first_order

from workbench.errors import InputError
from workbench.mu import gain_room

K = control.tf([4.0], [1.0])
OMEGA = np.concatenate([[0.0], np.geomspace(1e-4, 1e5, 4000)])


def mu(factor):
    """|W_P S| + |W_I T| of the loop, largest over the frequencies."""
    s = 1j * OMEGA
    L = 4.0 * factor / (s - 1)
    S, T = 1 / (1 + L), L / (1 + L)
    return (abs((s / 4 + 0.6) / (s + 0.006) * S) + abs(0.25 * (s / 2 + 1) / (s / 32 + 1) * T)).max()


@pytest.fixture(scope="module")
def weak():
    """The plant with a hundredth of its performance asked for, so that there is room."""
    return unstable_first_order().weighted(performance=[0.01])


def weak_mu(factor):
    s = 1j * OMEGA
    L = 4.0 * factor / (s - 1)
    S, T = 1 / (1 + L), L / (1 + L)
    performance = 0.01 * abs((s / 4 + 0.6) / (s + 0.006) * S)
    return (performance + abs(0.25 * (s / 2 + 1) / (s / 32 + 1) * T)).max()


def test_edges_are_where_the_closed_form_crosses_one(weak):
    room = gain_room(weak, K, tolerance=1e-3)
    assert weak_mu(1.0) < 1.0
    high = brentq(lambda f: weak_mu(f) - 1, 1.0, 20.0)
    low = brentq(lambda f: weak_mu(f) - 1, 0.26, 1.0)
    assert room.low >= low * (1 - 1e-6) and room.below <= low * (1 + 1e-6)
    assert room.high <= high * (1 + 1e-6) and room.above >= high * (1 - 1e-6)
    assert room.low / room.below <= 1.0012 and room.above / room.high <= 1.0012


def test_the_nominal_loop_is_lost_at_low_gain(weak):
    """1 / (s - 1) is unstable where the gain is below 1, a quarter of the given one."""
    assert gain_room(weak, K, tolerance=1e-2).below >= 0.25


def test_without_robust_performance_there_is_no_room():
    assert mu(0.3) > 1.0
    assert gain_room(unstable_first_order(), 0.3 * K) is None


def test_where_the_search_ends_nothing_is_said_of_what_is_lost(weak):
    room = gain_room(weak, K, tolerance=1e-2, most=1.3)
    assert room.high == pytest.approx(1.3) and room.above == np.inf
    assert room.low == pytest.approx(1 / 1.3) and room.below == 0.0


def test_bad_input_is_refused(weak):
    with pytest.raises(InputError, match="most"):
        gain_room(weak, K, most=1.0)
    with pytest.raises(InputError, match="tolerance"):
        gain_room(weak, K, tolerance=-1.0)
