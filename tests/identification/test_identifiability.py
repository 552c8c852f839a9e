"""Words for what the data cannot see."""

import numpy as np
import pytest

from workbench.identification.parameters.identifiability import identifiability

NAMES = ("m", "k", "b", "Bl", "R")


def blind_to(*directions):
    """A Jacobian whose null space the directions span."""
    rng = np.random.default_rng(0)
    space = np.linalg.qr(np.array(directions, dtype=float).T)[0]
    jacobian = 1e3 * rng.normal(size=(50, len(NAMES)))
    return jacobian - jacobian @ space @ space.T


@pytest.mark.parametrize(
    ("direction", "words"),
    [
        ([1, 1, 1, 0.5, 0], "m, k, b and Bl^2 scale together"),
        ([-2, -2, -2, -1, 0], "m, k, b and Bl^2 scale together"),
        ([1, -1, 0, 0, 0], "m and 1/k scale together"),
        ([0, 0, 0, 1, -0.5], "Bl and 1/R^2 scale together"),
        ([0, 1, 0, 0, 1 / 1.23], "k and R^1.23 scale together"),
        ([0, 0, 1, 0, 0], "b does not show in the data"),
    ],
)
def test_a_combination_is_named(direction, words):
    found = identifiability(blind_to(direction), NAMES)
    assert len(found.blind) == 1
    assert found.blind[0].startswith(words)
    assert found.unseen == found.blind
    assert found.condition > 1e9


def test_two_combinations_are_kept_apart():
    found = identifiability(blind_to([1, 1, 0, 0, 0], [0, 0, 0, 1, 0]), NAMES)
    assert {text.split(" scale")[0].split(" does")[0] for text in found.blind} == {"m and k", "Bl"}


def test_all_seen():
    found = identifiability(np.random.default_rng(0).normal(size=(500, 5)), NAMES)
    assert found.blind == found.unseen == ()


def test_noise_hides_what_a_quieter_one_does_not():
    jacobian = np.diag([100.0, 100.0, 100.0, 2.0, 100.0])
    assert identifiability(jacobian, NAMES).unseen == ()
    (text,) = identifiability(jacobian, NAMES, spread=3.0).unseen
    assert text.startswith("Bl does not show")


def test_nothing_free():
    assert identifiability(np.empty((5, 0)), ()).condition == 1.0
