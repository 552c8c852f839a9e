"""Both bounds against each other, against dense sampling and SLICOT, and flat peaks of mu."""

import time

import control
import numpy as np
import pytest
import slycot

from workbench.certify.stable_system import stable_system
from workbench.mu.frequency.peak import peak
from workbench.mu.lower.bound import lower_bound
from workbench.mu.upper.bound import upper_bound
from workbench.structure import Complex, Full, Real, Structure


def random_structure(rng, largest, real=True):
    """Blocks at random, at most ``largest`` channels either way."""
    blocks = []
    while not blocks or rng.uniform() < 0.8:
        n, m = rng.integers(1, 4, 2)
        block = (Full(int(n), int(m)), Complex(int(n)), Real(int(n)))[rng.integers(2 + real)]
        trial = Structure([*blocks, block])
        if max(trial.rows, trial.columns) > largest:
            break
        blocks.append(block)
    return Structure(blocks or [Complex(2)])


def random_matrix(rng, structure, *batch):
    """Full, real, nearly real or ill-scaled."""
    shape = (*batch, structure.columns, structure.rows)
    real, imag = rng.normal(size=(2, *shape))
    scale = np.exp(3 * rng.normal(size=structure.rows))
    kinds = real + 1j * imag, real + 0j, real + 1e-3j * imag, (real + 1j * imag) * scale
    return kinds[rng.integers(len(kinds))]


@pytest.mark.parametrize(
    "count", [200, pytest.param(2000, marks=pytest.mark.slow)], ids=["fast", "slow"]
)
def test_lower_is_never_above_upper(count):
    rng = np.random.default_rng(0)
    for _ in range(count // 10):
        structure = random_structure(rng, int(rng.integers(2, 13)))
        M = random_matrix(rng, structure, 10)
        upper = upper_bound(M, structure).value
        for method in ("power", "best") if count == 2000 else ("power",):
            assert (lower_bound(M, structure, method=method).value <= upper * (1 + 1e-9)).all()


@pytest.mark.parametrize(
    "structure",
    [
        Structure([Full(3, 2)]),
        Structure([Full(2, 2), Full(1, 3)]),
        Structure([Complex(1), Full(2, 2), Full(2, 1)]),
        Structure([Complex(3)]),
        Structure([Complex(2), Full(2, 3)]),
    ],
    ids=lambda s: str(s.to_pairs()),
)
def test_bounds_meet_where_theory_says_so(structure):
    # 2 S + F <= 3 for S repeated scalars and F full blocks
    M = random_matrix(np.random.default_rng(1), structure, 20)
    lower, upper = lower_bound(M, structure).value, upper_bound(M, structure).value
    norm = np.linalg.norm(M, 2, axis=(1, 2))
    assert (upper - lower <= 1e-3 * np.maximum(upper, norm)).all()
    assert (lower <= upper * (1 + 1e-9)).all()


@pytest.mark.cases(1)
@pytest.mark.parametrize("seed", range(3))
def test_a_peak_is_no_lower_than_100000_samples_of_lightly_damped_modes(seed, record_property):
    rng = np.random.default_rng(seed)
    structure = Structure([Full(2, 2)])
    A = np.zeros((8, 8))
    for i, damping in enumerate(10 ** rng.uniform(-4, -3, 4)):
        omega = 10 ** rng.uniform(0, 2)
        A[2 * i : 2 * i + 2, 2 * i : 2 * i + 2] = omega * np.array([[-damping, 1], [-1, -damping]])
    system = control.ss(A, rng.normal(size=(8, 2)), rng.normal(size=(2, 8)), np.zeros((2, 2)))
    found = peak(system, structure)
    poles = np.linalg.eigvals(A)
    near = poles.imag[:, None] - poles.real[:, None] * np.linspace(-30, 30, 8000)
    omega = np.concatenate([np.geomspace(1e-2, 1e4, 100_000 - near.size), np.abs(near.ravel())])
    sampled = np.linalg.norm(stable_system(system).response(omega), 2, axis=(1, 2)).max()
    record_property("upper over lower bound, less 1", found.upper / found.lower - 1)
    assert sampled <= found.upper
    assert found.lower <= found.upper <= 1.002 * found.lower


def flat_loop(seed):
    """An all-pass loop of random sections, scaled by a D that depends on frequency."""
    rng = np.random.default_rng(seed)
    one = control.ss([], [], [], [[1.0]])
    loop = control.ss([], [], [], np.eye(3))
    for corner in 10 ** rng.uniform(-1, 2, 3):
        Q = np.linalg.qr(rng.normal(size=(3, 3)))[0]
        section = control.ss(control.tf([-1 / corner, 1], [1 / corner, 1]))
        loop = loop * control.ss([], [], [], Q) * control.append(section, one, one)
    d, inverse = control.tf([1, 1], [0.1, 2]), control.tf([0.1, 2], [1, 1])
    outer = control.append(control.ss(d), one, control.ss([], [], [], [[100.0]]))
    inner = control.append(control.ss(inverse), one, control.ss([], [], [], [[0.01]]))
    return outer * loop * inner


@pytest.mark.cases(0)
@pytest.mark.parametrize("first", [Real(1), Complex(1)])
def test_a_flat_peak_is_covered_by_multipliers_that_change(first):
    structure = Structure([first, Complex(1), Full(1, 1)])
    system = flat_loop(0)
    found = peak(system, structure)
    assert "above" not in found.message
    assert found.upper == pytest.approx(1.001, rel=1e-5)
    assert len(found.intervals) < 300
    assert any(one.slopes is not None for one in found.intervals)
    omega = np.geomspace(1e-4, 1e5, 5000)
    covered = np.zeros(len(omega), dtype=bool)
    for one in found.intervals:
        inside = (omega >= one.low) & (omega <= one.high)
        covered |= inside
        D_left, D_right, G = one.multipliers(omega[inside].reshape(-1, 1, 1))
        M = stable_system(system).response(omega[inside])
        twisted = 1j * (G @ M)
        slack = found.upper**2 * D_right - M.conj().mT @ D_left @ M - twisted - twisted.conj().mT
        root = np.linalg.inv(np.linalg.cholesky(D_right))
        assert (np.linalg.eigvalsh(root @ slack @ root.conj().mT) > -1e-9).all()
    assert covered.all()


def test_a_flat_peak_ends_in_few_steps_with_a_coarser_bound():
    structure = Structure([Complex(1), Complex(1), Full(1, 1)])
    found = peak(flat_loop(1), structure, steps=10)
    assert 1.0 <= found.upper < 5.0
    assert "above" in found.message


@pytest.mark.slow
def test_a_certified_peak_is_no_slower_than_ab13md_at_1000_frequencies(record_property):
    structure = Structure([Real(1), Complex(1), Full(2, 2)])
    ratios = []
    for seed in range(3):
        rng = np.random.default_rng(seed)
        A = rng.standard_normal((20, 20))
        A -= (np.linalg.eigvals(A).real.max() + 0.1) * np.eye(20)
        B, C = rng.standard_normal((20, 4)), rng.standard_normal((4, 20))
        system = control.ss(A, B, C, 0.3 * rng.standard_normal((4, 4)))
        if not ratios:
            peak(system, structure)  # compiled now
        start = time.process_time()
        found = peak(system, structure)
        middle = time.process_time()
        M = stable_system(system).response(np.geomspace(1e-2, 1e2, 1000))
        for matrix in M:
            slycot.ab13md(matrix, np.array([1, 1, 2]), np.array([1, 2, 2]))
        ratios.append((middle - start) / (time.process_time() - middle))
        assert upper_bound(M, structure).value.max() <= found.upper
    record_property("ratios", str(ratios))
    assert np.median(ratios) < 1.0
