"""The sweep of a peak finds the largest bound that a sweep of least bounds finds."""

from functools import partial

import control
import numpy as np
import pytest

from workbench.certify import band_cover
from workbench.certify.band_cover import BandCover, refined_bounds
from workbench.certify.mu_bound import certified_bound
from workbench.certify.proofs.peak_proof import proves
from workbench.mu import Complex, Full, Real, Structure, peak
from workbench.mu.frequency.peak_sweep import PeakSweep, with_least_near_top
from workbench.mu.frequency.sweep import bounds_at, fitting

STRUCTURES = [
    Structure([Real(1), Complex(1), Full(2, 2)]),
    Structure([Real(2), Full(2, 2)]),
    Structure([Complex(2), Full(2, 2)]),
    Structure([Complex(1)] * 4),
]
named = pytest.mark.parametrize("structure", STRUCTURES, ids=lambda s: str(s.to_pairs()))


def light_modes(seed, states=40, channels=4, damping=1e-3):
    rng = np.random.default_rng(seed)
    A = np.zeros((states, states))
    for k, omega in enumerate(np.exp(rng.uniform(0, 5, states // 2))):
        A[2 * k : 2 * k + 2, 2 * k : 2 * k + 2] = omega * np.array([[-damping, 1], [-1, -damping]])
    B, C = rng.normal(size=(states, channels)), rng.normal(size=(channels, states))
    return control.ss(A, B, C, 0.1 * rng.normal(size=(channels, channels)))


def both(system, structure):
    """Bounds of the sweep of a peak, and least ones of the usual sweep."""
    stable = fitting(system, structure)
    sweep = PeakSweep(stable, structure)
    found = refined_bounds(sweep, stable.poles, sweep.settled)
    return found, refined_bounds(partial(bounds_at, stable, structure), stable.poles)


@named
@pytest.mark.parametrize("seed", range(3))
def test_the_largest_bound_is_that_of_least_bounds(structure, seed):
    found, least = both(light_modes(seed), structure)
    assert found.upper.max() == pytest.approx(least.upper.max(), rel=5e-3)
    common, here, there = np.intersect1d(found.omega, least.omega, return_indices=True)
    assert len(common) > 100
    assert (found.upper[here] >= least.upper[there] * (1 - 1e-6)).all()
    same = found.is_least[here]
    np.testing.assert_allclose(found.upper[here][same], least.upper[there][same], rtol=1e-5)
    proven = certified_bound(found.M, structure, found.D_left, found.D_right, found.G)
    assert (proven <= found.upper).all()


@named
def test_only_few_bounds_are_the_least(structure):
    found, _ = both(light_modes(5), structure)
    assert 0 < found.is_least.sum() < 0.3 * len(found.omega)
    assert found.is_least[np.argmax(found.upper)]


@named
def test_bounds_near_the_top_become_the_least(structure):
    found, least = both(light_modes(1), structure)
    top = with_least_near_top(found, structure, 0.9)
    near = top.upper > 0.9 * top.upper.max()
    assert top.is_least[near].all() and near.any()
    value = dict(zip(least.omega.tolist(), least.upper.tolist(), strict=True))
    for omega, upper in zip(top.omega[near].tolist(), top.upper[near].tolist(), strict=True):
        assert omega not in value or upper == pytest.approx(value[omega], rel=1e-5)


@named
def test_larger_bounds_beyond_a_band_do_not_raise_its_peak(structure):
    system = control.append(
        *(control.ss(control.tf([gain], [1.0, 0.02, 1.0])) for gain in (0.5, 0.5, 0.5, 0.5))
    )
    for band in ((1e-3, 0.1), (20.0, 300.0), (5.0, np.inf)):
        found = peak(system, structure, band=band)
        inside = PeakSweep(fitting(system, structure), structure, band)(np.geomspace(0.1, 10, 50))
        assert inside.omega.min() >= band[0] and inside.omega.max() <= band[1]
        stable = fitting(system, structure)
        points = np.array([band[0], min(2 * band[0], band[1]), band[1]])
        least = bounds_at(stable, structure, np.unique(points)).upper.max()
        assert found.upper <= 1.0011 * least


def test_settled_is_what_multipliers_of_one_end_prove():
    structure = STRUCTURES[1]
    stable = fitting(light_modes(2), structure)
    sweep = PeakSweep(stable, structure)
    found = sweep(np.geomspace(0.5, 300.0, 150))
    settled = sweep.settled(found)
    level = (1 + band_cover.MAXIMUM_TOLERANCE) * sweep.level
    ends = [
        certified_bound(
            found.M[k + other],
            structure,
            *(part[k + own] for part in (found.D_left, found.D_right, found.G)),
        )
        for k in range(len(found.omega) - 1)
        for own, other in ((0, 1), (1, 0))
    ]
    proven = (np.array(ends).reshape(-1, 2) <= level).any(axis=1)
    assert (settled == proven).mean() > 0.98 and settled.any()


def test_a_zero_response_has_the_level_zero():
    structure = STRUCTURES[3]
    zero = control.ss(-np.eye(2), np.zeros((2, 4)), np.ones((4, 2)), np.zeros((4, 4)))
    stable = fitting(zero, structure)
    sweep = PeakSweep(stable, structure)
    for _ in range(2):  # the level stays zero
        found = sweep(np.array([0.0, 1.0, np.inf]))
        assert (found.upper == 0).all() and found.is_least.all()
    assert sweep.settled(found).shape == (2,)


@pytest.mark.parametrize("damping", [1e-2, 1e-5])
def test_a_narrow_peak_between_wide_ones(damping):
    """Its bound is the largest by little, on a band far narrower than the even grid."""
    structure = Structure([Real(1), Complex(1)])
    wide = control.tf([1.0], [1.0, 0.5, 1.0])
    narrow = control.tf([2.2 * damping * 17.3**2, 0.0], [1.0, 2 * damping * 17.3, 17.3**2]) * (
        1 / 17.3
    )
    system = control.append(control.ss(wide), control.ss(narrow))
    mixing = control.ss([], [], [], [[0.6, 1.0], [1.0, 1.0]])
    found = peak(mixing * system, structure)
    omega = np.concatenate(
        [np.geomspace(0.1, 100, 4000), 17.3 + np.linspace(-3, 3, 4001) * damping]
    )
    stable = fitting(mixing * system, structure)
    dense = bounds_at(stable, structure, np.unique(omega)).upper.max()
    assert dense * (1 - 1e-9) <= found.upper <= dense * 1.0025


@named
def test_the_proof_of_a_peak_of_many_states_is_proven_again(structure, monkeypatch):
    """Trials of multipliers and linear multipliers after few fixed ones leave proofs that hold."""
    monkeypatch.setattr(band_cover, "MANY_STATES", 30)
    system = light_modes(3, damping=1e-2)
    stable = fitting(system, structure)
    many = peak(system, structure)
    assert not proves(stable, structure, many.proof, many.upper)
    monkeypatch.setattr(band_cover, "MANY_STATES", 10**6)
    few = peak(system, structure)
    assert many.upper == pytest.approx(few.upper, rel=1.5e-3)
    assert many.lower <= few.upper and few.lower <= many.upper


def test_trials_do_not_take_multipliers_that_fail(monkeypatch):
    """What is chosen holds with a margin at the frequency it belongs to."""
    structure = STRUCTURES[1]
    monkeypatch.setattr(band_cover, "MANY_STATES", 30)
    stable = fitting(light_modes(4), structure)
    sweep = PeakSweep(stable, structure)
    found = refined_bounds(sweep, stable.poles, sweep.settled)
    at = partial(bounds_at, stable, structure)
    band = BandCover(stable, at, 1e-3, found, None, sweep.holds)
    chosen = band._widest(band._worst())
    parts = band.found.D_left[chosen], band.found.D_right[chosen], band.found.G[chosen]
    assert certified_bound(band.found.M[chosen], structure, *parts) <= band.beta
