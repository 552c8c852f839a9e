"""Lower bounds of mixed mu: cases with a known mu, what leaves mu as it is, and bad input."""

import numpy as np
import pytest
from lanes import thinned
from scipy.linalg import block_diag
from scipy.optimize import minimize

from workbench.certify import singularity
from workbench.errors import InputError
from workbench.mu.lower.bound import LowerBound, MuLowerBound, lower_bound
from workbench.program import methods
from workbench.solution import solve
from workbench.structure import Complex, Full, Real, Structure

MIXED = Structure([Real(2), Complex(1), Full(2, 1), Real(1)])
FEW = [  # 2 S + F <= 3: the upper bound by scalings is mu
    Structure([Full(2, 3)]),
    Structure([Complex(2), Full(2, 2)]),
    Structure([Full(1, 1), Full(2, 3), Full(3, 2)]),
    Structure([Complex(1), Complex(1), Complex(1)]),
]


def random(rng, structure, *batch):
    shape = (*batch, structure.columns, structure.rows)
    return rng.standard_normal(shape) + 1j * rng.standard_normal(shape)


def random_structure(rng, largest, kinds=("real", "complex", "full")):
    """Blocks at random, at most ``largest`` channels either way."""
    blocks = []
    while not blocks or rng.uniform() < 0.8:
        kind, size = rng.choice(kinds), int(rng.integers(1, 4))
        block = {
            "real": Real(size),
            "complex": Complex(size),
            "full": Full(size, int(rng.integers(1, 4))),
        }[kind]
        trial = Structure([*blocks, block])
        if max(trial.rows, trial.columns) > largest:
            break
        blocks.append(block)
    return Structure(blocks or [Complex(2)])


def certified(M, structure, method=None):
    """Values of a method, whose certificate holds."""
    solution = solve(MuLowerBound(M, structure), method=method)
    assert solution.certificate is not None, solution.message
    assert solution.certificate.valid, solution.certificate
    return solution.answer.value


def scaled_norm(M, structure):
    """Least largest singular value of D M D^-1, D = exp(H), of the structure's commutant."""

    def scalings(p):
        left, right, at = [], [], 0
        for block in structure:
            if isinstance(block, Complex):
                n = block.n
                H = np.zeros((n, n), complex)
                H[np.diag_indices(n)] = p[at : at + n]
                at += n
                for i, j in zip(*np.triu_indices(n, 1), strict=True):
                    H[i, j], at = p[at] + 1j * p[at + 1], at + 2
                    H[j, i] = H[i, j].conj()
                values, V = np.linalg.eigh(H)
                left.append((V * np.exp(values)) @ V.conj().T)
                right.append((V * np.exp(-values)) @ V.conj().T)
            else:
                left.append(np.exp(p[at]) * np.eye(block.columns))
                right.append(np.exp(-p[at]) * np.eye(block.rows))
                at += 1
        return block_diag(*left), block_diag(*right)

    def norm(p):
        left, right = scalings(p)
        return np.linalg.norm(left @ M @ right, 2)

    count = sum(b.n**2 if isinstance(b, Complex) else 1 for b in structure)
    best = np.zeros(count)
    for _ in range(4):  # not smooth: the simplex is started again where it stalls
        options = {"xatol": 1e-7, "fatol": 1e-9, "maxfev": 4000, "adaptive": True}
        best = minimize(norm, best, method="Nelder-Mead", options=options).x
    return norm(best)


@pytest.mark.cases(1)
@pytest.mark.parametrize("structure", thinned(FEW, 2), ids=lambda s: str(s.to_pairs()))
def test_meets_the_upper_bound_where_that_is_mu(structure):
    rng = np.random.default_rng(1)
    M = random(rng, structure, 4)
    lower = certified(M, structure)
    upper = np.array([scaled_norm(matrix, structure) for matrix in M])
    assert (lower <= upper * (1 + 1e-9)).all()
    assert (lower >= upper * (1 - 1e-3)).all()


@pytest.mark.parametrize("method", ["power", "best"])
def test_one_full_block_is_the_largest_singular_value(method):
    rng = np.random.default_rng(2)
    structure = Structure([Full(3, 5)])
    M = random(rng, structure, 20)
    expected = np.linalg.norm(M, 2, axis=(1, 2))
    np.testing.assert_allclose(certified(M, structure, method), expected, rtol=1e-7)


def test_one_repeated_complex_scalar_is_the_spectral_radius():
    structure = Structure([Complex(5)])
    M = random(np.random.default_rng(3), structure, 20)
    expected = abs(np.linalg.eigvals(M)).max(axis=-1)
    np.testing.assert_allclose(certified(M, structure), expected, rtol=1e-10)


@pytest.mark.cases(0)
@pytest.mark.parametrize("method", ["best", "gain"])
def test_one_repeated_real_scalar_is_the_largest_real_eigenvalue(method):
    structure = Structure([Real(5)])
    M = np.random.default_rng(4).standard_normal((20, 5, 5))
    values = np.linalg.eigvals(M)
    expected = np.where(values.imag == 0, abs(values), 0).max(axis=-1)
    np.testing.assert_allclose(certified(M, structure, method), expected, rtol=1e-10)


def test_real_scalars_of_a_real_matrix_by_every_vertex():
    structure = Structure([Real(1)] * 4)
    M = np.random.default_rng(5).standard_normal((10, 4, 4))
    signs = np.stack(np.meshgrid(*[[-1.0, 1.0]] * 4), -1).reshape(-1, 4)
    values = np.linalg.eigvals(M[:, None] * signs[:, None, :])
    expected = np.where(values.imag == 0, abs(values), 0).max(axis=(1, 2))
    np.testing.assert_allclose(certified(M, structure), expected, rtol=1e-9)


def test_two_real_scalars_of_a_complex_matrix():
    # det(I - M Delta) = 1 - d1 a - d2 b: with a = 1 + i, b = 1 - 2i zero at d = (2, 1) / 3
    M = np.array([[1 + 1j], [1 + 1j]]) @ np.array([[1, (1 - 2j) / (1 + 1j)]])
    assert certified(M, Structure([Real(1), Real(1)])) == pytest.approx(1.5, rel=1e-9)


def test_a_rank_one_matrix():
    rng = np.random.default_rng(6)
    structure = Structure([Complex(1)] * 5)
    u, v = random(rng, Structure([Full(5, 2)])).copy()
    value = certified(np.outer(u, v.conj()), structure)
    assert value == pytest.approx(np.sum(abs(u * v)), rel=1e-9)


def test_a_block_diagonal_matrix_is_its_worst_block():
    rng = np.random.default_rng(7)
    structure = Structure([Full(2, 2), Complex(3), Full(1, 2)])
    parts = [random(rng, Structure([block])) for block in structure]
    parts[1] *= 2
    expected = max(
        np.linalg.norm(parts[0], 2),
        abs(np.linalg.eigvals(parts[1])).max(),
        np.linalg.norm(parts[2], 2),
    )
    assert certified(block_diag(*parts), structure) == pytest.approx(expected, rel=1e-7)


@pytest.mark.parametrize("kind", [Real, Complex])
def test_a_triangular_matrix_is_its_largest_diagonal_entry(kind):
    M = np.triu(np.random.default_rng(8).standard_normal((5, 5)))
    expected = abs(np.diag(M)).max()
    assert certified(M, Structure([kind(1)] * 5)) == pytest.approx(expected, rel=1e-6)


def test_scalings_permutations_and_conjugation_leave_mu_as_it_is():
    rng = np.random.default_rng(9)
    structure = Structure([Full(2, 2), Complex(1), Complex(2)])
    M = random(rng, structure, 5)
    value = certified(M, structure)
    D = np.diag([1e3, 1e3, 1e-5, 1e4, 1e4])
    U = block_diag(np.linalg.qr(random(rng, Structure([Full(2, 2)])))[0], np.eye(3))
    order = [2, 3, 4, 0, 1]
    permuted = Structure([Complex(1), Complex(2), Full(2, 2)])
    for other, blocks in (
        (D @ M @ np.linalg.inv(D), structure),
        (M @ U, structure),
        (M.conj(), structure),
        (M.swapaxes(1, 2), structure),
        (1j * M, structure),
        (M[:, order][:, :, order], permuted),
    ):
        np.testing.assert_allclose(certified(other, blocks), value, rtol=1e-3)


def test_mu_of_real_blocks_is_no_more_than_of_complex_ones():
    M = random(np.random.default_rng(10), MIXED, 20)
    assert (certified(M, MIXED) <= certified(M, MIXED.complexified()) * (1 + 1e-3)).all()


@pytest.mark.parametrize("scale", [1e-150, 1e-8, 1e150])
@pytest.mark.parametrize("structure", [MIXED, Structure([Real(1), Real(1)])], ids=["mixed", "real"])
def test_scales(structure, scale):
    M = random(np.random.default_rng(11), structure, 5)
    expected = scale * lower_bound(M, structure).value
    np.testing.assert_allclose(certified(scale * M, structure), expected, rtol=1e-3)


def test_one_real_scalar_sees_no_complex_number():
    structure = Structure([Real(1)])
    assert certified(np.array([[-2.0]]), structure) == pytest.approx(2)
    answer = lower_bound(np.array([[2 + 1e-6j]]), structure)
    assert answer.value == 0
    assert np.isnan(answer.Delta).all()


@pytest.mark.parametrize("structure", [MIXED, Structure([Real(1)]), Structure([Full(2, 3)])])
def test_zero_is_not_destabilised(structure):
    answer = lower_bound(np.zeros((2, structure.columns, structure.rows)), structure)
    assert (answer.value == 0).all()
    assert np.isnan(answer.Delta).all()


def test_answers_keep_the_leading_axes():
    M = random(np.random.default_rng(12), MIXED, 2, 3)
    answer = lower_bound(M, MIXED, method="power")
    assert answer.value.shape == (2, 3)
    assert answer.Delta.shape == (2, 3, MIXED.rows, MIXED.columns)
    assert lower_bound(M[:0], MIXED).value.shape == (0, 3)


def test_the_same_seed_gives_the_same_answer():
    M = random(np.random.default_rng(13), MIXED, 3)
    first, second = lower_bound(M, MIXED), lower_bound(M, MIXED)
    np.testing.assert_array_equal(first.Delta, second.Delta)


@pytest.mark.cases(1)
@pytest.mark.parametrize("method", methods(MuLowerBound))
def test_every_method_is_certified_and_none_beats_best_by_much(method):
    M = random(np.random.default_rng(14), MIXED, 8)
    assert (certified(M, MIXED, method) <= certified(M, MIXED) * (1 + 1e-2)).all()


@pytest.mark.cases(2)
@pytest.mark.parametrize("largest", thinned(range(2, 13), 3))
def test_certificates_of_random_structures(largest):
    rng = np.random.default_rng(100 + largest)
    for _ in range(10):
        structure = random_structure(rng, largest)
        M = random(rng, structure, 20)
        M[::4] = M[::4].real
        value = certified(M, structure, "power")
        assert (value <= np.linalg.norm(M, 2, axis=(1, 2)) * (1 + 1e-12)).all()


def test_a_bound_that_is_said_is_proven_from_another_rounding_of_the_proof(monkeypatch):
    """The vector that the proof starts from rounds in another way on another processor."""
    rng = np.random.default_rng(5)
    structure = Structure([Complex(1), Complex(1), Full(2, 2)])
    M = rng.standard_normal((20, 4, 4)) + 1j * rng.standard_normal((20, 4, 4))
    program = MuLowerBound(M, structure)
    found = solve(program, method="power").answer
    direction = singularity._direction

    def rounded(M, Delta):
        v, share = direction(M, Delta)
        return v * (1 + 4e-16 * rng.standard_normal(v.shape)), share

    monkeypatch.setattr(singularity, "_direction", rounded)
    assert (np.asarray(found.value) > 0).all()
    assert program.certify(found, 1e-6).valid


@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_entries_that_are_not_finite_are_refused(bad):
    with pytest.raises(InputError, match="not finite"):
        lower_bound(np.array([[bad]]), Structure([Real(1)]))


def test_bad_input_is_refused():
    with pytest.raises(InputError, match="shape"):
        lower_bound(np.eye(3), Structure([Full(2, 2)]))
    with pytest.raises(InputError, match="numbers"):
        lower_bound([["a"]], Structure([Real(1)]))
    with pytest.raises(InputError, match="no real block"):
        lower_bound(np.eye(2), Structure([Full(2, 2)]), method="gain")


class TestCertificate:
    """What the checks reject."""

    M = random(np.random.default_rng(15), MIXED, 3)
    program = MuLowerBound(M, MIXED)
    answer = lower_bound(M, MIXED, method="power")

    def failures(self, value=None, Delta=None):
        value = self.answer.value if value is None else value
        Delta = self.answer.Delta if Delta is None else Delta
        certificate = self.program.certify(LowerBound(value, Delta), 1e-6)
        return {check.name for check in certificate.checks if not check.holds}

    def test_of_a_good_answer(self):
        assert self.failures() == set()

    def test_of_a_value_too_large(self):
        assert self.failures(value=1.001 * self.answer.value) == {"norm", "singularity"}

    def test_of_a_regular_delta(self):
        smaller = self.failures(1.001 * self.answer.value, self.answer.Delta / 1.001)
        assert smaller == {"singularity"}

    def test_of_another_structure(self):
        for entry in ((0, 0), (0, 1), (5, 0)):
            Delta = self.answer.Delta.copy()
            Delta[1, *entry] += 1e-12j
            assert self.failures(Delta=Delta) == {"structure"}

    def test_of_no_numbers(self):
        assert "proper" in self.failures(value=np.array([1, np.nan, 1]))
        assert "singularity" in self.failures(Delta=np.full_like(self.answer.Delta, np.nan))

    def test_of_other_shapes(self):
        with pytest.raises(InputError, match="shapes"):
            self.failures(value=np.ones(2))

    def test_dataset_and_metrics_and_figures(self):
        stored = self.program.to_dataset(self.answer)
        back = self.program.from_dataset(stored)
        np.testing.assert_array_equal(back.Delta, self.answer.Delta)
        assert stored["mu_lower"].attrs["units"] == "1"
        assert self.program.metrics(self.answer)["mu_lower_peak"] == self.answer.value.max()
        assert set(self.program.figures(self.answer)) == {"mu_lower"}
