"""Bounds on the norms of all gains in a box, attacked by gains of the box."""

import control
import numpy as np
import pytest

from workbench.errors import InputError
from workbench.synthesis import least_norm_in_box
from workbench.systems.norms import hinf_norm
from workbench.uncertainty import GeneralisedPlant


def random_plant(seed, states=3, controls=1, measurements=1, exogenous=2, performance=2):
    rng = np.random.default_rng(seed)
    B = rng.normal(size=(states, exogenous + controls))
    C = rng.normal(size=(performance + measurements, states))
    D = rng.normal(size=(performance + measurements, exogenous + controls))
    D[-measurements:, -controls:] = 0.0
    D[:-measurements, :-controls] = 0.0
    A = rng.normal(size=(states, states))
    return GeneralisedPlant(control.ss(A, B, C, D), None, controls, measurements)


def norms_of(plant, gains):
    """Norms of the loops with gains, infinite where they do not stabilise."""
    found = []
    for gain in gains:
        loop = plant.close(control.ss([], [], [], gain))
        found.append(hinf_norm((loop.A, loop.B, loop.C, loop.D)))
    return np.array(found)


@pytest.mark.cases(1)
@pytest.mark.parametrize("seed", range(6))
def test_no_gain_of_the_box_comes_below_the_bound(seed):
    plant = random_plant(seed)
    found = least_norm_in_box(plant, [[-4.0]], [[4.0]], distance=0.1, most_boxes=300)
    best = norms_of(plant, np.linspace(-4.0, 4.0, 400)[:, None, None]).min()
    assert found.holds
    assert found.lower <= best * (1 + 1e-9)
    if found.finished and np.isfinite(best):
        assert found.lower >= 0.85 * best


@pytest.mark.cases(0)
def test_two_gains():
    plant = random_plant(11, states=2, measurements=2)
    low, high = [[-2.0, -2.0]], [[2.0, 2.0]]
    found = least_norm_in_box(plant, low, high, distance=0.3, most_boxes=400)
    rng = np.random.default_rng(0)
    best = norms_of(plant, rng.uniform(-2, 2, size=(400, 1, 2))).min()
    assert found.holds
    assert 0 < found.lower <= best


def test_a_box_without_a_stabilising_gain():
    B, C, D = [[1.0, 0, 1]], [[1.0], [0], [1]], [[0, 0, 0], [0, 0, 1], [0, 1, 0]]
    plant = GeneralisedPlant(control.ss([[1.0]], B, C, D), None, 1, 1)
    found = least_norm_in_box(plant, [[-0.9]], [[10.0]])
    assert found.holds
    assert found.lower == np.inf
    assert "no gain in -0.9 to 10 stabilises" in repr(found)


def test_a_proof_that_is_spoilt_fails():
    found = least_norm_in_box(random_plant(2), [[-4.0]], [[4.0]], distance=0.1, most_boxes=60)
    object.__setattr__(found, "lower", 1.01 * found.lower)
    found.__dict__.pop("certificate", None)
    assert not found.holds
    object.__setattr__(found, "lower", 0.5 * found.lower)
    object.__setattr__(found, "proofs", found.proofs[1:])
    found.__dict__.pop("certificate", None)
    assert not found.holds


@pytest.mark.parametrize(
    "low, high, said",
    [
        ([[1.0]], [[-1.0]], "low is above high"),
        ([1.0], [2.0], "shape"),
        ([[np.inf]], [[2.0]], "finite"),
        ("wide", [[2.0]], "low"),
    ],
)
def test_boxes_that_are_none(low, high, said):
    with pytest.raises(InputError, match=said):
        least_norm_in_box(random_plant(0), low, high)


def test_plants_that_do_not_fit():
    sampled = control.ss([[0.5]], [[1.0, 1.0]], [[1.0], [1.0]], np.zeros((2, 2)), 0.1)
    with pytest.raises(InputError, match="sampled"):
        least_norm_in_box(GeneralisedPlant(sampled, None, 1, 1), [[0.0]], [[1.0]])
    direct = control.ss([[-1.0]], [[1.0, 1.0]], [[1.0], [1.0]], np.ones((2, 2)))
    with pytest.raises(InputError, match="direct term"):
        least_norm_in_box(GeneralisedPlant(direct, None, 1, 1), [[0.0]], [[1.0]])
    with pytest.raises(InputError, match="as many of one kind"):
        least_norm_in_box(
            random_plant(0, controls=2, measurements=2, exogenous=1, performance=1),
            np.zeros((2, 2)),
            np.ones((2, 2)),
        )
    with pytest.raises(InputError, match="9 gains may move"):
        least_norm_in_box(
            random_plant(0, controls=3, measurements=3, exogenous=3),
            np.zeros((3, 3)),
            np.ones((3, 3)),
        )
