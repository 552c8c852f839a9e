"""Sampled systems: the bilinear transformation keeps mu, so both sides of it must agree."""

import control
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from workbench.certify.stable_system import angular_frequency, bilinear_frequency, stable_system
from workbench.errors import InputError
from workbench.mu import (
    Complex,
    Full,
    Real,
    Structure,
    conditions,
    destabilising_perturbation,
    frequency_sweep,
    peak,
    robust_performance,
    robust_stability,
    skewed_peak,
    upper_bound,
    worst_case_gain,
)
from workbench.mu.frequency.peak_bounds import peak_checks, restored_peak, stored_peak
from workbench.systems.bilinear import bilinear_sampled
from workbench.systems.generalised_plant import GeneralisedPlant
from workbench.uncertainty import dynamics, feedback, real, ss, tf

PERIODS = (1e-5, 0.05)
STRUCTURE = Structure([Real(1, name="k"), Complex(1, name="delta")])


def loop():
    k = real("k", 10, percent=40)
    P = tf([18], [1, 1.8, k]) * (1 + 0.5 * dynamics("delta", 1, 1))
    C = control.ss(control.tf([0.3823, 2.303, 3], [1e-3, 1, 0]))
    return feedback(P * C, 1).system


@pytest.mark.parametrize("period", PERIODS)
def test_a_peak_is_kept_and_its_frequency_is_moved(period):
    system = loop()[:2, :2]
    sampled = bilinear_sampled(system, period)
    one, other = peak(system, STRUCTURE), peak(sampled, STRUCTURE)
    assert other.upper == pytest.approx(one.upper, rel=1e-9)
    assert other.lower == pytest.approx(one.lower, rel=1e-6)
    moved = 2 / period * np.arctan(one.omega * period / 2)
    assert other.omega == pytest.approx(moved, rel=1e-4)
    assert other.band == pytest.approx((0.0, np.pi / period)) and other.dt == period
    M = sampled(np.exp(1j * other.omega * period))
    assert abs(np.linalg.det(np.eye(2) - M @ other.Delta)) < 1e-9


@pytest.mark.parametrize("period", PERIODS)
def test_the_proof_holds_again_and_comes_back(period):
    import xarray as xr

    sampled = bilinear_sampled(loop()[:2, :2], period)
    found = peak(sampled, STRUCTURE)
    back = restored_peak(xr.Dataset(stored_peak("p", found)), "p")
    assert back.dt == period and back.band == pytest.approx(found.band)
    checks = peak_checks(sampled, STRUCTURE, back.lower, back.upper, back)
    assert all(check.holds for check in checks)
    low = peak_checks(sampled, STRUCTURE, back.lower, back.upper / 1.01, back)
    assert not low[0].holds
    other = bilinear_sampled(loop()[:2, :2] * 1.01, period)
    assert not peak_checks(other, STRUCTURE, back.lower, back.upper, back)[0].holds


@pytest.mark.parametrize("period", PERIODS)
def test_the_destabilising_perturbation_is_sampled_and_puts_poles_on_the_circle(period):
    sampled = bilinear_sampled(loop()[:2, :2], period)
    found = peak(sampled, STRUCTURE)
    Delta = destabilising_perturbation(found, sampled, STRUCTURE)
    assert Delta.dt == period
    poles = control.feedback(sampled, Delta, 1).poles()
    assert np.abs(poles - np.exp(1j * found.omega * period)).min() < 1e-9


@pytest.mark.cases(0)
@pytest.mark.parametrize("period", PERIODS)
def test_worst_cases_are_kept(period):
    system = loop()
    sampled = bilinear_sampled(system, period)
    one, other = (worst_case_gain(each, STRUCTURE, tolerance=1e-5) for each in (system, sampled))
    assert other.upper == pytest.approx(one.upper, rel=2e-5)
    assert other.lower == pytest.approx(one.lower, rel=1e-4)
    whole = STRUCTURE.with_performance(1, 1)
    found = skewed_peak(sampled, whole, ["k", "delta"], tolerance=1e-5)
    assert found.upper == pytest.approx(one.upper, rel=2e-5)
    M = sampled(np.exp(1j * found.omega * period))
    assert np.linalg.svd(np.eye(3) - M @ found.Delta)[1][-1] < 1e-7


def test_a_sweep_is_over_the_frequencies_that_were_asked_for():
    sampled = bilinear_sampled(loop()[:2, :2], 0.05)
    omega = np.array([0.0, 1.0, 5.0, 40.0, np.pi / 0.05])
    found = frequency_sweep(sampled, STRUCTURE, omega=omega)
    assert found.omega == pytest.approx(omega, rel=1e-12)
    M = np.array([sampled(z) for z in np.exp(0.05j * omega)])
    assert found.upper == pytest.approx(upper_bound(M, STRUCTURE).value, rel=1e-4)
    grid = frequency_sweep(sampled, STRUCTURE)
    assert grid.omega[-1] == pytest.approx(np.pi / 0.05)


def test_margins_of_an_uncertain_sampled_system_by_its_poles():
    """A matrix with an uncertain entry: its poles are known for every k."""
    k = real("k", 10, percent=40)
    system = feedback(ss([[1, 0.05], [-0.005 * k, 0.7]], [[0], [0.05]], [[1, 0]], [[0]], 0.05), 0.5)
    margin = robust_stability(system)
    assert margin.worst["k"] == pytest.approx(-5.0)  # the loop then has a pole at 1
    assert margin.upper == pytest.approx(15 / 4) and margin.lower > 0.98 * margin.upper
    assert np.abs(system.at(**margin.worst).poles()).max() == pytest.approx(1.0)
    bounds = robust_performance(system, gain=2.0)
    ends = [
        control.linfnorm(system.at(k=10 - 4 * size))[0] for size in (bounds.lower, bounds.upper)
    ]
    assert ends[0] < 2.0 * (1 + 1e-6) and ends[1] > 2.0 * (1 - 1e-3)


def test_conditions_of_a_sampled_loop_are_those_of_the_continuous_one():
    system = loop()
    P = GeneralisedPlant(control.append(system, 1.0), STRUCTURE, 1, 1)
    S = GeneralisedPlant(bilinear_sampled(P.system, 0.05), STRUCTURE, 1, 1)
    one = conditions(P, control.ss([], [], [], 0.0))
    other = conditions(S, control.ss([], [], [], 0.0, 0.05))
    assert one.nominal_stability and other.nominal_stability
    assert other.robust_performance.upper == pytest.approx(one.robust_performance.upper, rel=1e-6)
    assert other.stability_margin == pytest.approx(one.stability_margin, rel=1e-4)
    unstable = GeneralisedPlant(control.ss([[1.2]], [[1, 1]], [[1], [1]], 0.0, 0.1), None, 1, 1)
    assert not conditions(unstable, control.ss([], [], [], 0.0, 0.1)).nominal_stability


@pytest.mark.parametrize("pole", [1 - 1e-9, 1 - 1e-6, -1 + 1e-9, 0.0, 0.5])
def test_gains_of_poles_near_the_circle(pole):
    """|1 / (z - pole)| is largest at z = 1 or -1."""
    gain = 1 - abs(pole)
    found = peak(control.ss(pole, 1.0, gain, 0.0, 1e-4), Structure([Complex(1)]), tolerance=1e-6)
    assert found.lower <= 1 + 1e-9 and found.upper >= 1 - 1e-9
    assert found.upper <= found.lower * (1 + 1e-5)
    wanted = {-1: np.pi / 1e-4, 1: 0.0}.get(int(np.sign(pole)))
    assert wanted is None or found.omega == pytest.approx(wanted, abs=1e-3)


@given(st.floats(1e-6, 10.0), st.floats(0.0, 0.999))
def test_frequencies_go_and_come_back(period, share):
    omega = share * np.pi / period
    v = bilinear_frequency(omega, period)
    assert angular_frequency(v, period) == pytest.approx(omega, rel=1e-9, abs=1e-12)


@pytest.mark.parametrize("seed", range(8))
def test_the_transformation_encloses_the_response(seed):
    rng = np.random.default_rng(seed)
    n = int(rng.integers(1, 8))
    A = rng.normal(size=(n, n))
    A *= rng.choice([0.5, 0.99, 1 - 1e-6]) / np.abs(np.linalg.eigvals(A)).max()
    system = control.ss(A, rng.normal(size=(n, 2)), rng.normal(size=(2, n)), 0.0, 0.01)
    stable = stable_system(system, sampled=True)
    omega = rng.uniform(0, np.pi / 0.01, 5)
    expected = np.array([system(z) for z in np.exp(0.01j * omega)])
    found = stable.response(stable.plane(omega))
    assert np.abs(found - expected).max() < 1e-8 * np.abs(expected).max()


@pytest.mark.parametrize(
    ("system", "words"),
    [
        (control.ss(-1.0, 1, 1, 0, 0.1), "pole that cannot be told from z = -1"),
        (control.ss(1.0, 1, 1, 0, 0.1), "cannot be told from the unit circle: z = 1"),
        (control.ss(1.2, 1, 1, 0, 0.1), "is unstable: it has the pole z = 1.2"),
        (control.ss(0.2, 1, 1, 0, True), "sampling time is not given"),
    ],
)
def test_bad_sampled_systems_are_named(system, words):
    with pytest.raises(InputError, match=words):
        peak(system, Structure([Full(1, 1)]))


def test_a_band_beyond_half_the_sampling_rate():
    system = control.ss(0.5, 1, 1, 0, 0.1)
    found = peak(system, Structure([Full(1, 1)]), band=(1.0, 10.0))
    assert found.band == pytest.approx((1.0, 10.0))
    assert found.upper == pytest.approx(abs(system(np.exp(0.1j))), rel=2e-3)
    with pytest.raises(InputError, match="beyond half the sampling rate"):
        peak(system, Structure([Full(1, 1)]), band=(40.0, 50.0))
