"""Covers of several orders: which is on the front, which is chosen, and what is refused."""

from dataclasses import replace

import numpy as np
import pytest

from workbench.errors import InputError
from workbench.uncertainty import CoverFront, Responses, cover_front
from workbench.uncertainty.covers.front.points import FrontCover

OMEGA = np.geomspace(0.03, 30, 40)


def lags(seed=2, count=6):
    rng = np.random.default_rng(seed)
    gain, time = 1 + 0.3 * rng.uniform(-1, 1, (2, count))
    return Responses(omega=OMEGA, values=gain / (1j * OMEGA[:, None] * time + 1))


def peak_weight(model):
    """Stands for mu of a loop: the largest |W_c|."""
    return float(np.abs(model.W_c.response(OMEGA)).max())


@pytest.fixture(scope="module")
def front():
    return cover_front(lags(), orders=[1, (2, 1, 2)], shape="circle")


def test_every_cover_is_certified(front):
    assert front.holds
    assert {point.orders for point in front.points} == {(1, 1, 0), (2, 1, 0)}
    assert "containment" in " ".join(check.name for check in front.certificate.checks)
    assert "chosen" in repr(front)
    assert front.plot().axes


def test_a_cover_that_is_too_small_fails(front):
    point = front.points[0]
    model = point.cover.model
    small = replace(point.cover, model=replace(model, W_c=model.W_c.scaled(0.9)))
    wrong = CoverFront((replace(point, cover=small),))
    checks = front._checked_by[0].checks(wrong, 1e-6)
    assert any("containment" in check.name and not check.holds for check in checks)


def test_a_told_cost_below_the_recomputed_one_fails(front):
    point = front.points[0]
    wrong = CoverFront((replace(point, **{n: 0.9 * getattr(point, n) for n in (
        "inflation", "inflation_free", "rms_free")}),))  # fmt: skip
    checks = front._checked_by[0].checks(wrong, 1e-6)
    assert [check.name for check in checks if not check.holds] == ["1, 1, 0: cost"]


def test_mu_of_a_loop_is_the_cost():
    front = cover_front(lags(), orders=[1], shape="circle", loop=peak_weight)
    point = front.chosen
    assert front.value == point.mu == peak_weight(point.cover.model)


def test_larger_orders_never_cost_more():
    """No search minimises the stand-in of mu, so a cover of larger orders alone may cost more."""
    orders = [(1, 1, 0), (2, 1, 0), (1, 2, 0), (2, 2, 0)]
    front = cover_front(lags(5), orders=orders, shape="circle", loop=peak_weight)
    cost = {point.orders: point.cost for point in front.points}
    assert front.holds and len(cost) == len(orders)
    for small in orders:
        for large in orders:
            if np.less_equal(small, large).all():
                assert cost[large] <= cost[small]


def point(states, cost):
    return FrontCover((states, 0, 0), "joint", None, cost, cost, 1.0, cost, float("nan"))


def test_dominated_covers_are_told():
    points = tuple(point(*each) for each in ((2, 3.0), (4, 1.05), (6, 2.0), (8, 1.0)))
    front = CoverFront(points)
    assert [p.states for p in front.front] == [2, 4, 8]
    assert [p.states for p in front.dominated] == [6]
    assert front.chosen.states == 4


@pytest.mark.parametrize("seed", range(5))
def test_the_fewest_states_near_the_best_are_chosen(seed):
    rng = np.random.default_rng(seed)
    states, cost = rng.integers(1, 9, 12), rng.uniform(1, 1.5, 12)
    k = CoverFront.choice(states, cost)
    assert cost[k] <= cost.min() * (1 + CoverFront.near_best)
    assert not np.any((states < states[k]) & (cost <= cost.min() * (1 + CoverFront.near_best)))


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"orders": []}, "orders is empty"),
        ({"orders": 4}, "orders must be a list"),
        ({"orders": [(4, 4)]}, "three for G, W_c, W_r"),
        ({"orders": [2.5]}, "orders"),
        ({"orders": ["abc"]}, "three for G, W_c, W_r"),
        ({"shape": "square"}, "shape"),
        ({"loop": 3.0}, "loop must be a function"),
        ({"responses": np.ones(3)}, "responses must be Responses"),
    ],
)
def test_bad_input_is_named(changes, message):
    responses = changes.pop("responses", lags())
    with pytest.raises(InputError, match=message):
        cover_front(responses, **changes)


def raised(model):
    raise AttributeError("'NoneType' object has no attribute 'upper'")


@pytest.mark.parametrize(
    ("loop", "message"),
    [
        (raised, r"loop raised AttributeError for the cover of orders \(1, 1, 0\): 'NoneType'"),
        (lambda model: float("nan"), "inf if the loop is unstable.*it returned nan"),
        (lambda model: -1.0, "a number of 0 or more.*it returned -1.0"),
        (lambda model: None, "it returned None"),
        (lambda model: "1.0", "it returned '1.0'"),
    ],
)
def test_a_loop_that_gives_no_mu_is_named(loop, message):
    with pytest.raises(InputError, match=message):
        cover_front(lags(), orders=[1], shape="circle", loop=loop)


def test_unstable_loops_cost_infinitely_much():
    front = cover_front(lags(), orders=[1], shape="circle", loop=lambda model: float("inf"))
    assert front.value == float("inf") and front.holds
