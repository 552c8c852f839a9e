"""Bounds that only have to be below a level: they agree with the least ones about the level."""

import numpy as np
import pytest

from workbench.certify.mu_bound import certified_bound
from workbench.errors import InputError
from workbench.mu import Complex, Full, Real, Structure, upper_bound
from workbench.mu.upper.alone import is_alone
from workbench.mu.upper.below import _proven, bounds_below, hold_below
from workbench.mu.upper.linear_algebra import factor_normal, solve_normal
from workbench.mu.upper.newton import hessian
from workbench.mu.upper.pattern import compact_multipliers, expanded_multipliers, pattern_of

STRUCTURES = {
    "complex scalars": Structure([Complex(1)] * 4),
    "real scalars": Structure([Real(1)] * 3),
    "mixed": Structure([Real(1), Complex(1), Full(2, 2)]),
    "not square": Structure([Full(1, 3), Real(1), Full(2, 1)]),
    "repeated real": Structure([Real(3), Full(2, 2)]),
    "repeated complex": Structure([Complex(3), Full(2, 1)]),
    "alone": Structure([Real(4)]),
    "one full": Structure([Full(3, 3)]),
}
KINDS = ("random", "smooth", "graded", "real", "ill-conditioned", "with zeros")
ACCURACY = 1e-6
"""The accuracy that bounds have by default."""
ROUNDING = 1e-9
"""Share by which `certified_bound` may allow more for rounding."""
UNRESOLVED = 1e-7
"""Bounds below this share of the norm are not resolved."""


def drawn(structure, kind, count, seed=0):
    """Matrices (count, c, r), neighbours alike where they are smooth."""
    rng = np.random.default_rng([seed, *kind.encode()])
    c, r = structure.columns, structure.rows
    M = rng.normal(size=(count, c, r)) + 1j * rng.normal(size=(count, c, r))
    if kind == "smooth":
        share = np.linspace(0, 1, count)[:, None, None]
        M = (1 - share) * M[:1] + share * M[1:2]
    if kind == "graded":
        M = (
            M
            * 10.0 ** rng.uniform(-3, 3, (count, c, 1))
            * 10.0 ** rng.uniform(-3, 3, (count, 1, r))
        )
    if kind == "real":
        M = M.real + 0j
    if kind == "ill-conditioned":
        M = M[:, :, :1] @ M[:, :1, :] + 1e-9 * M
    if kind == "with zeros":
        M = np.where(rng.random(M.shape) < 0.6, 0.0, M)
    return M


def agrees(M, structure, level):
    """Bounds at a level, after it is checked that they hold and agree with the least ones."""
    least, found = upper_bound(M, structure).value, bounds_below(M, structure, level)
    assert (found.value <= level)[least <= level * (1 - ACCURACY)].all()
    below = found.value <= level
    if not is_alone(structure):  # where no real eigenvalue leaves a bound, paths may prove less
        assert not below[least > level * (1 + ACCURACY)].any()
    size = np.linalg.norm(M[~below], 2, axis=(1, 2))
    assert (found.value[~below] <= least[~below] * (1 + ACCURACY) + UNRESOLVED * size).all()
    proven = certified_bound(M, structure, found.D_left, found.D_right, found.G)
    # Below UNRESOLVED of the norm the kernel resolves nothing, where other proofs may.
    whole = np.linalg.norm(M, 2, axis=(1, 2))
    assert (proven <= found.value * (1 + ROUNDING) + UNRESOLVED * whole).all()
    return found


@pytest.mark.parametrize("name", STRUCTURES)
@pytest.mark.parametrize("kind", KINDS)
def test_answers_agree_with_the_least_bounds(name, kind):
    structure = STRUCTURES[name]
    M = drawn(structure, kind, 20)
    value = upper_bound(M, structure).value
    for level in (2 * value.max(), 1.001 * value.max(), np.median(value), 0.3 * value.max()):
        if level > 0:
            agrees(M, structure, level)


@pytest.mark.slow
def test_answers_of_two_thousand_matrices_agree():
    count = 2000 // (len(STRUCTURES) * len(KINDS)) + 1
    for structure in STRUCTURES.values():
        for kind in KINDS:
            M = drawn(structure, kind, count, seed=1)
            value = upper_bound(M, structure).value
            for share in (0.5, 0.999, 1.0 + 1e-5, 1.5):
                if value.max() > 0:
                    agrees(M, structure, share * value.max())


@pytest.mark.parametrize("scale", [1e-150, 1e-20, 1e20, 1e150])
@pytest.mark.parametrize("name", ["mixed", "repeated real"])
def test_huge_and_tiny_matrices(name, scale):
    structure = STRUCTURES[name]
    M = drawn(structure, "random", 20)
    level = 1.01 * np.median(upper_bound(M, structure).value)
    plain = agrees(M, structure, level)
    found = agrees(scale * M, structure, scale * level)
    assert ((found.value <= scale * level) == (plain.value <= level)).all()


def test_zero_matrices_are_below_every_level():
    structure = STRUCTURES["mixed"]
    M = drawn(structure, "random", 30)
    M[::3] = 0.0
    found = agrees(M, structure, 1e-3)
    assert (found.value[::3] <= 1e-3).all()


@pytest.mark.parametrize("name", ["mixed", "repeated real"])
def test_a_level_just_above_and_just_below_the_least_bound(name):
    structure = STRUCTURES[name]
    M = drawn(structure, "random", 12)
    for k, value in enumerate(upper_bound(M, structure).value):
        assert bounds_below(M[k : k + 1], structure, 1.001 * value).value[0] <= 1.001 * value
        assert bounds_below(M[k : k + 1], structure, 0.999 * value).value[0] > 0.999 * value


def test_multipliers_of_neighbours_serve_smooth_responses(monkeypatch):
    """Of a hundred matrices that are alike few are solved on their own."""
    from workbench.mu.upper import fast

    counts, own = [], fast.path_multipliers
    monkeypatch.setattr(
        fast, "path_multipliers", lambda *given: counts.append(len(given[-1])) or own(*given)
    )
    structure = STRUCTURES["mixed"]
    M = drawn(structure, "smooth", 100)
    level = 1.05 * upper_bound(M, structure).value.max()
    counts.clear()
    assert (bounds_below(M, structure, level).value <= level).all()
    assert 0 < sum(counts) <= 20


@pytest.mark.parametrize("name", STRUCTURES)
def test_whether_multipliers_hold_is_what_they_prove(name):
    structure = STRUCTURES[name]
    M = drawn(structure, "random", 20)
    bound = upper_bound(M, structure)
    source = np.arange(20)[::-1].copy()
    parts = bound.D_left[source], bound.D_right[source], bound.G[source]
    proven = certified_bound(M, structure, *parts)
    level = float(np.median(proven))
    held = hold_below(M, structure, level, bound.D_right, bound.G, source)
    sure = np.abs(proven / level - 1) > 1e-6
    assert (held == (proven <= level))[sure].all() and sure.sum() > 10


@pytest.mark.parametrize("name", STRUCTURES)
def test_bounds_that_neighbours_prove_are_lowered_but_not_below_what_they_prove(name):
    structure = STRUCTURES[name]
    M = drawn(structure, "smooth", 200)
    bound = upper_bound(M[::20], structure)
    parts = bound.D_left, bound.D_right, bound.G
    source = np.arange(200) // 20
    level = 1.5 * bound.value.max() or 1.0
    shown = _proven(M, structure, level, bound.D_right, bound.G, source, 2)
    proven = certified_bound(M, structure, *(part[source] for part in parts))
    held = np.isfinite(shown)
    assert held.sum() > 100
    assert (shown[held] >= proven[held] * (1 - 1e-9)).all() and (shown[held] <= level).all()
    once = _proven(M, structure, level, bound.D_right, bound.G, source, 1)
    assert (shown <= once).all() and (shown[held] < level).mean() > 0.9


@pytest.mark.parametrize("level", [0.0, -1.0, np.inf, np.nan])
def test_levels_that_are_refused(level):
    with pytest.raises(InputError, match="level"):
        bounds_below(np.eye(4) + 0j, STRUCTURES["complex scalars"], level)


@pytest.mark.parametrize("name", STRUCTURES)
def test_compact_multipliers_are_those_that_were_expanded(name):
    pattern = pattern_of(STRUCTURES[name])
    bound = upper_bound(drawn(STRUCTURES[name], "random", 3), STRUCTURES[name])
    again = expanded_multipliers(pattern, *compact_multipliers(pattern, bound.D_right, bound.G))
    for one, other in zip(again, (bound.D_left, bound.D_right, bound.G), strict=True):
        np.testing.assert_array_equal(one, other)


@pytest.mark.parametrize("name", STRUCTURES)
def test_the_newton_matrix_is_the_sum_of_traces(name):
    structure = STRUCTURES[name]
    pattern = pattern_of(structure)
    rng, n, m = np.random.default_rng(0), structure.rows + structure.columns, pattern.row.size
    A = rng.normal(size=(2, n, n)) + 1j * rng.normal(size=(2, n, n))
    T, U = A @ A.conj().mT
    H, value = np.zeros((m, m)), np.zeros(pattern.fixed.size, complex)
    hessian(pattern, 1.3, T, U, H, value)
    E = np.zeros((m, n, n), complex)
    for k in range(m):
        for e in range(pattern.first[k], pattern.first[k + 1]):
            E[k, pattern.at[e], pattern.to[e]] += pattern.fixed[e] + 1.3 * pattern.growing[e]
    expected = np.einsum("kab,bc,lcd,da->kl", E, T, E, U).real
    np.testing.assert_allclose(np.triu(H), np.triu(expected), atol=1e-12 * np.abs(expected).max())
    whole, b, x = expected + np.eye(m), rng.normal(size=m), np.zeros(m)
    R = np.triu(whole)
    factor_normal(R)
    solve_normal(R, b, x)
    np.testing.assert_allclose(whole @ x, b, atol=1e-9 * np.abs(whole).max())
