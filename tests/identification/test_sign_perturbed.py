"""Sign-perturbed sums: the region holds the true model as often as it says, in any noise."""

import numpy as np
import pytest

import workbench as wb
from workbench.errors import InputError
from workbench.fitting.rational import Rational
from workbench.identification import CommonPoleModel, RationalModelFit, SignPerturbedRegion

OMEGA = np.geomspace(1.0, 300.0, 12)
POLES = [-1.0 + 20j, -1.0 - 20j]
TRUE = CommonPoleModel(
    [[Rational([-30.0], POLES, 10.0)], [Rational([], POLES, 200.0)]], np.zeros((2, 1))
)
NOISES = {
    "normal": lambda rng, shape: rng.standard_normal(shape),
    "cauchy": lambda rng, shape: rng.standard_cauchy(shape),
    "signs": lambda rng, shape: rng.choice([-1.0, 1.0], shape),
}


def program(rng, noise):
    truth = TRUE.response(OMEGA)
    parts = NOISES[noise](rng, (2, *truth.shape))
    noisy = truth + 0.02 * (parts[0] + 1j * parts[1])
    return RationalModelFit(OMEGA, noisy, np.full(truth.shape, 1e-3), orders=(2,))


@pytest.mark.cases(0)
@pytest.mark.parametrize("noise", NOISES)
def test_the_true_model_is_in_the_region_as_often_as_it_says(noise):
    rng = np.random.default_rng(0)
    held = [
        SignPerturbedRegion(
            program(rng, noise).structure, confidence=0.9, sums=20, seed=seed
        ).contains(TRUE)
        for seed in range(2000)
    ]
    assert np.mean(held) == pytest.approx(0.9, abs=3 * np.sqrt(0.09 / 2000))


def test_the_estimate_is_in_it_and_models_far_off_are_not():
    one = program(np.random.default_rng(1), "normal")
    region = SignPerturbedRegion(one.structure)
    assert region.contains(wb.solve(one).answer.model)
    rank = region.rank(TRUE)
    assert 0 <= rank < 100
    far = CommonPoleModel(
        [[Rational(e.zeros, e.poles, 1.5 * e.gain) for e in row] for row in TRUE.entries],
        np.zeros((2, 1)),
    )
    assert not region.contains(far)


@pytest.mark.parametrize("changes", [{"confidence": 0.955}, {"confidence": 1.0}, {"sums": 1.5}])
def test_a_confidence_that_is_no_fraction_is_refused(changes):
    structure = program(np.random.default_rng(2), "normal").structure
    with pytest.raises(InputError, match=r"confidence|sums"):
        SignPerturbedRegion(structure, **changes)
