"""Enclosures hold what exact rational arithmetic gives."""

import numpy as np
import pytest
from exact_rational import largest_outside, real_form
from hypothesis import given, settings
from hypothesis import strategies as st

from workbench.certify.rounding import (
    Enclosure,
    enclosed_inverse,
    exact,
    positive_definite,
    solution,
)


def matrices(seed, decades, *shapes):
    rng = np.random.default_rng(seed)
    return [
        (rng.normal(size=shape) + 1j * rng.normal(size=shape))
        * 10 ** rng.uniform(-decades, decades, shape)
        for shape in shapes
    ]


seeds, spans = st.integers(0, 2**31), st.sampled_from([0.0, 3.0, 12.0])


@settings(max_examples=40, deadline=None)
@given(seeds, spans)
def test_products_sums_and_multiples_hold_the_exact_ones(seed, decades):
    A, B, C = matrices(seed, decades, (3, 4), (4, 2), (3, 2))
    a, b, c = map(real_form, (A, B, C))
    product = exact(A) @ exact(B)
    assert largest_outside(product, a * b) <= 1
    assert largest_outside(product + exact(C), a * b + c) <= 1
    assert largest_outside(product - exact(C), a * b - c) <= 1
    assert largest_outside(exact(A).times(0.1), a * real_form([[0.1]])[0, 0]) <= 1
    assert largest_outside(product.H, (a * b).transpose()) <= 1


@settings(max_examples=40, deadline=None)
@given(seeds, spans)
def test_radii_go_on_through_products(seed, decades):
    """The members at the ends of two enclosures: their product is held, too."""
    A, B = matrices(seed, decades, (3, 3), (3, 3))
    rng = np.random.default_rng(seed)
    radii = [np.abs(M) * rng.uniform(0, 1e-3, M.shape) for M in (A, B)]
    a, b = (
        real_form(M + rad * np.exp(2j * np.pi * rng.uniform(size=M.shape)) * (1 - 1e-9))
        for M, rad in zip((A, B), radii, strict=True)
    )
    both = Enclosure(A, radii[0]) @ Enclosure(B, radii[1])
    assert largest_outside(both, a * b) <= 1


@settings(max_examples=40, deadline=None)
@given(seeds, st.sampled_from([0.0, 1.0, 4.0]))
def test_solutions_hold_the_exact_ones(seed, decades):
    A, B = matrices(seed, decades, (4, 4), (4, 2))
    found = solution(exact(A), exact(B))
    back = enclosed_inverse(exact(A))
    inverse = real_form(A).inv()
    if found is not None:
        assert largest_outside(found, inverse * real_form(B)) <= 1
    if back is not None:
        assert largest_outside(back, inverse) <= 1
    assert decades or (found is not None and back is not None)


def test_a_matrix_that_may_be_singular_has_no_inverse():
    A = np.array([[1.0, 1.0], [1.0, 1.0 + 1e-9]])
    assert enclosed_inverse(exact(A)) is not None
    assert enclosed_inverse(Enclosure(A, np.full((2, 2), 1e-9))) is None
    assert enclosed_inverse(exact(np.ones((2, 2)))) is None


@pytest.mark.parametrize("size", [1e-12, 1.0, 1e12])
def test_definiteness_is_told_to_rounding(size):
    rng = np.random.default_rng(0)
    for _ in range(20):
        vectors = np.linalg.qr(rng.normal(size=(5, 5)) + 1j * rng.normal(size=(5, 5)))[0]

        def of(least, vectors=vectors):
            values = size * np.array([1.0, 1.0, 0.5, 0.2, least])
            A = (vectors * values) @ vectors.conj().T
            return exact((A + A.conj().T) / 2)

        assert positive_definite(of(1e-9))
        assert not positive_definite(of(-1e-13))
        assert not positive_definite(of(-1.0))


def test_definiteness_is_that_of_every_member():
    A = np.diag([1.0, 2.0])
    assert positive_definite(Enclosure(A, np.full((2, 2), 0.4)))
    assert not positive_definite(Enclosure(A, np.full((2, 2), 1.1)))
    assert not positive_definite(Enclosure(A, np.array([[0.0, 1.5], [1.5, 0.0]])))
    assert not positive_definite(exact(np.array([[np.nan]])))
