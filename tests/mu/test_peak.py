"""Peaks of mu: closed forms, other people's norms, dense sampling, and the CD drive's loop."""

import math

import control
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from lanes import examples
from workbench.plants.cd_drive.control.control_problem import generalised
from workbench.plants.cd_drive.drive.plants import controller
from workbench.plants.cd_drive.uncertainty.parametric_model import (
    parametric_nominal,
    parametric_plant,
)

from workbench.certify import band_cover
from workbench.certify.stable_system import stable_system
from workbench.errors import InputError, UnknownNameError
from workbench.mu.frequency.complex_part import complex_part_added
from workbench.mu.frequency.peak import peak
from workbench.mu.frequency.sweep import frequency_sweep
from workbench.mu.robust.conditions import conditions
from workbench.structure import Complex, Full, Real, Structure
from workbench.uncertainty import UncertaintyModel

ONE = Structure([Full(1, 1)])
STRUCTURES = [
    Structure([Full(2, 3)]),
    Structure([Complex(3)]),
    Structure([Complex(1), Full(2, 1)]),
    Structure([Real(1), Complex(1), Full(1, 2)]),
    Structure([Real(2), Complex(1), Full(2, 2)]),
]


def modes(rng, structure, count):
    """Lightly damped modes, damping ratios from 1e-4."""
    A = np.zeros((2 * count, 2 * count))
    for i in range(count):
        omega, damping = 10 ** rng.uniform(-1, 3), 10 ** rng.uniform(-4, -1)
        part = slice(2 * i, 2 * i + 2)
        A[part, part] = omega * np.array([[-damping, 1.0], [-1.0, -damping]])
    size = np.sqrt(-np.diag(A))
    B = size[:, None] * rng.standard_normal((2 * count, structure.rows))
    C = rng.standard_normal((structure.columns, 2 * count)) * size
    D = 0.3 * rng.standard_normal((structure.columns, structure.rows))
    return control.ss(A, B, C, D)


def dense(system, count):
    """Frequencies, half of them in the resonances."""
    poles = stable_system(system).poles
    width = np.linspace(-20, 20, max(count // (2 * len(poles)), 2))
    near = (np.abs(poles.imag)[:, None] + poles.real[:, None] * width).ravel()
    points = np.concatenate([np.geomspace(1e-5, 1e7, count // 2), near])
    return np.unique(points[points > 0])


def check(system, structure, found, count=100_000):
    """The cover is whole, and each interval's multipliers prove the bound at the samples."""
    omega = dense(system, count)
    M = stable_system(system).response(omega)
    covered = np.zeros(len(omega), dtype=bool)
    assert found.intervals[0].low == 0.0
    assert found.intervals[-1].high == math.inf or any(
        one.high == math.inf for one in found.intervals
    )
    for one in found.intervals:
        inside = (omega >= one.low) & (omega <= one.high)
        covered |= inside
        D_left, D_right, G = one.multipliers(omega[inside].reshape(-1, 1, 1))
        X, root = M[inside], np.linalg.inv(np.linalg.cholesky(D_right))
        twisted = 1j * (G @ X)
        bound = X.conj().mT @ D_left @ X + twisted + twisted.conj().mT
        scaled = root @ bound @ root.conj().mT
        if inside.any():
            assert np.linalg.eigvalsh(scaled)[:, -1].max() <= found.upper**2 * (1 + 1e-9)
    assert covered.all()


def check_delta(system, structure, found):
    """Delta makes the loop singular at the peak's frequency and is as small as claimed."""
    M = stable_system(system).response([found.omega])[0]
    assert np.linalg.norm(found.Delta, 2) == pytest.approx(1 / found.lower)
    assert structure.contains(found.Delta)
    loop = np.eye(len(M)) - M @ found.Delta
    assert np.linalg.svd(loop, compute_uv=False)[-1] < 1e-8 * max(1, np.linalg.norm(loop))


@pytest.mark.cases(1)
@pytest.mark.parametrize("structure", STRUCTURES, ids=lambda s: str(s.to_pairs()))
@pytest.mark.parametrize("seed", [0, pytest.param(1, marks=pytest.mark.slow)])
def test_against_dense_sampling(structure, seed):
    rng = np.random.default_rng(seed)
    system = modes(rng, structure, int(rng.integers(1, 6)))
    found = peak(system, structure)
    assert found.lower <= found.upper < 1.05 * found.lower
    check(system, structure, found)
    check_delta(system, structure, found)
    sampled = frequency_sweep(system, structure, omega=dense(system, 300)).upper
    assert sampled.max() <= found.upper * (1 + 1e-9)


@pytest.mark.parametrize("seed", range(4))
def test_of_one_full_block_is_the_norm(seed):
    structure = Structure([Full(2, 3)])
    system = modes(np.random.default_rng(seed), structure, 4)
    norm = control.norm(system, "inf", tol=1e-9)
    found = peak(system, structure, tolerance=1e-4)
    assert found.lower <= norm * (1 + 1e-7)
    assert norm <= found.upper * (1 + 1e-7)
    assert found.upper < norm * 1.0003


def test_of_a_repeated_complex_scalar_is_the_spectral_radius():
    system = modes(np.random.default_rng(3), Structure([Complex(3)]), 3)
    found = peak(system, Structure([Complex(3)]))
    M = stable_system(system).response(dense(system, 100_000))
    radius = np.abs(np.linalg.eigvals(M)).max()
    assert radius <= found.upper
    assert found.upper < 1.003 * radius


@pytest.mark.parametrize(
    ("system", "omega"),
    [
        (control.tf(1, [1, 1]), 0.0),
        (control.tf([1, 0], [1, 1]), math.inf),
        (control.ss([], [], [], [[1.0]]), 0.0),
    ],
)
def test_at_the_ends_of_the_axis(system, omega):
    found = peak(system, ONE)
    assert found.omega == omega
    assert found.lower == pytest.approx(1.0)
    assert found.upper == pytest.approx(1.001)


def test_beyond_the_end_of_a_grid():
    bump = control.tf([1, 0], [1, 1e5, 1e10]) * 1e5
    system = control.tf(0.9, [1, 1]) + bump
    assert frequency_sweep(system, ONE, omega=np.geomspace(1e-3, 1e3, 200)).upper.max() < 0.91
    assert peak(system, ONE).upper == pytest.approx(1.001, rel=1e-3)


@pytest.mark.parametrize("damping", [1e-4, 1e-7])
@pytest.mark.parametrize("size", [1e-13, 1.0, 1e13])
def test_of_a_resonance(damping, size):
    found = peak(size * control.tf(1, [1, 2 * damping, 1]), ONE)
    assert found.lower == pytest.approx(size / (2 * damping), rel=2e-3)
    assert found.lower <= found.upper <= 1.002 * found.lower


@examples(6, 15)
@given(st.integers(0, 10**6), st.floats(-9, 9), st.sampled_from(STRUCTURES))
def test_does_not_depend_on_the_unit_of_time(seed, decades, structure):
    system = modes(np.random.default_rng(seed), structure, 2)
    faster = control.ss(10**decades * system.A, 10**decades * system.B, system.C, system.D)
    one, other = peak(system, structure), peak(faster, structure)
    assert other.upper == pytest.approx(one.upper, rel=4e-3)
    assert other.lower <= one.upper * (1 + 1e-6)


@pytest.mark.parametrize("system", [control.ss(-1, 1, 0, 0), control.ss([], [], [], [[0.0]])])
def test_of_zero(system):
    found = peak(system, ONE)
    assert (found.lower, found.upper) == (0.0, 0.0)


def test_of_what_no_perturbation_can_destabilise():
    system = control.ss(-np.eye(2), np.eye(2), [[0, 1], [0, 0]], np.zeros((2, 2)))
    found = peak(system, Structure([Full(1, 1), Full(1, 1)]))
    assert found.lower == 0.0
    assert found.upper <= 1e-6


def test_balls_prove_what_doubles_leave_open(monkeypatch):
    """Doubles that prove nothing leave the middles of gaps to balls, from the second step on."""
    structure = Structure([Real(2), Complex(1), Full(2, 2)])
    system = modes(np.random.default_rng(0), structure, 3)
    known = peak(system, structure)
    monkeypatch.setattr(band_cover, "proven_in_doubles", lambda *given: (None, True))
    monkeypatch.setattr(band_cover, "FIXED_INTERVALS", 1)
    found = peak(system, structure)
    assert len(found.intervals) > 3 and all(one.slopes is None for one in found.intervals)
    assert known.lower <= found.upper <= known.upper * (1 + 1e-2)


def test_stopped_early_it_is_still_a_bound():
    structure = STRUCTURES[3]
    system = modes(np.random.default_rng(7), structure, 5)
    exact, rough = (
        peak(system, structure, tolerance=1e-5),
        peak(system, structure, tolerance=1e-5, steps=5),
    )
    assert rough.upper >= exact.lower
    check(system, structure, rough)


def test_real_scalars_alone_need_a_complex_part():
    system, real = control.tf(1, [1, 2e-3, 1]), Structure([Real(1, name="k")])
    with pytest.raises(InputError, match="not continuous"):
        peak(system, real)
    parts = [peak(system, real, complex_part=part) for part in (1e-2, 1e-3, 1e-4)]
    assert [found.complex_part for found in parts] == [1e-2, 1e-3, 1e-4]
    for found in parts:
        M = stable_system(system).response([found.omega])[0, 0, 0]
        assert found.upper >= 1.0  # M(0) = 1
        assert abs(1 - M * found.Delta[0, 0]) < 1e-8
    assert parts[2].upper < parts[1].upper < parts[0].upper
    with pytest.raises(InputError, match="no real scalar"):
        complex_part_added(system, ONE, 0.01)
    with pytest.raises(InputError, match="positive"):
        complex_part_added(system, real, -1.0)


@pytest.mark.parametrize(
    ("system", "words"),
    [
        (control.tf(1, [1, -2]), "pole 2"),
        (control.tf(1, [1, 0]), "imaginary axis"),
        (control.ss(-1, [[1, 1]], 1, [[0, 0]]), "shape"),
    ],
)
def test_a_system_that_will_not_do(system, words):
    with pytest.raises(InputError, match=words):
        peak(system, ONE)


def test_a_tolerance_that_will_not_do():
    with pytest.raises(InputError, match="tolerance"):
        peak(control.tf(1, [1, 1]), ONE, tolerance=0.0)


def uncertainty(kind):
    if kind == "parametric":
        return parametric_plant("focus")
    W_c = control.tf([1.5e-4, 0.1], [1 / 80_000, 1])
    W_r = control.tf(0.2, [1 / 1200, 1]) if kind == "stadium" else None
    return UncertaintyModel(parametric_nominal("focus"), W_c, W_r)


@pytest.mark.cases(1)
@pytest.mark.parametrize(
    "kind", ["circle", "stadium", pytest.param("parametric", marks=pytest.mark.slow)]
)
def test_conditions_of_the_focus_loop(kind):
    plant = generalised("focus", uncertainty(kind))
    asked = conditions(plant, controller("focus"), performance="z_p", exogenous="w_p")
    assert asked.nominal_stability
    for found in (asked.nominal_performance, asked.robust_stability, asked.robust_performance):
        assert found.lower <= found.upper <= 1.05 * found.lower
    assert asked.nominal_performance.upper == pytest.approx(0.732, abs=0.002)
    assert asked.nominal_performance.lower <= asked.robust_performance.upper
    assert asked.robust_stability.complex_part == (0.01 if kind == "parametric" else 0.0)
    assert asked.met == (kind == "parametric")
    by_number = conditions(plant, controller("focus"), performance=0, exogenous=[0])
    assert by_number.robust_performance.upper == asked.robust_performance.upper


def test_conditions_of_an_unstable_loop_and_of_signals_that_are_not_there():
    plant = generalised("focus", uncertainty("circle"))
    unstable = conditions(plant, -controller("focus"))
    assert not unstable.nominal_stability
    assert not unstable.met
    assert unstable.robust_performance is None
    with pytest.raises(UnknownNameError, match="w_u"):
        conditions(plant, controller("focus"), exogenous="w_uu")
    with pytest.raises(InputError, match="no performance output 7"):
        conditions(plant, controller("focus"), performance=7)


@pytest.mark.parametrize("scale", [1e-150, 1e-100, 1e100, 1e150])
def test_peaks_have_the_scale_of_their_system(scale):
    rng = np.random.default_rng(5)
    A = np.kron(np.diag([0.3, 2.0]), [[-0.01, 1.0], [-1.0, -0.01]])
    system = control.ss(A, rng.normal(size=(4, 4)), rng.normal(size=(4, 4)), 0.1 * np.eye(4))
    structure = Structure([Real(1), Complex(1), Full(2, 2)])
    one, other = peak(system, structure), peak(scale * system, structure)
    assert other.upper / scale == pytest.approx(one.upper, rel=1e-3)
    assert other.lower / scale == pytest.approx(one.lower, rel=1e-3)


@pytest.mark.parametrize(
    "band, omega", [((0.0, 0.4), 0.4), ((3.0, np.inf), 3.0), ((0.5, 2.0), None)]
)
def test_the_peak_of_a_band(band, omega):
    system = control.tf([1.0], [1.0, 0.1, 1.0])
    found = peak(system, Structure([Full(1, 1)]), band=band)
    expected = abs(system(1j * omega)) if omega else abs(system(1j * np.sqrt(1 - 0.005)))
    assert found.lower <= expected * (1 + 1e-9)
    assert expected <= found.upper <= expected * (1 + 3e-3)
    assert found.intervals[0].low <= band[0] and found.intervals[-1].high >= band[1]


@pytest.mark.parametrize("band", [(2.0, 1.0), (-1.0, 1.0), (1.0, 1.0), (np.nan, 1.0)])
def test_bands_that_are_none(band):
    with pytest.raises(InputError, match="the lower one first"):
        peak(control.tf([1.0], [1.0, 1.0]), Structure([Full(1, 1)]), band=band)
