"""A proven lower bound is never above a certified upper bound; where it is, an error says so."""

from types import SimpleNamespace

import control
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from workbench.certify.agreement import need_agreement
from workbench.certify.band_cover import BandCover
from workbench.errors import ContradictionError
from workbench.mu import (
    branch_and_bound,
    loop_margins,
    lower_bound,
    margin_sensitivity,
    peak,
    skew_bounds,
    upper_bound,
    worst_case_gain,
)
from workbench.mu.boxes import margin
from workbench.mu.margins import set_delay
from workbench.mu.robust import element_sensitivity
from workbench.mu.robust.skew import Skew
from workbench.mu.robust.skewed_peak import SkewSearch
from workbench.structure import Complex, Full, Real, Structure
from workbench.uncertainty import feedback, real, tf

STRUCTURES = [
    Structure([Real(4)]),
    Structure([Real(1), Real(1), Real(1)]),
    Structure([Real(2), Real(1)]),
    Structure([Complex(3)]),
    Structure([Complex(2), Full(2, 1)]),
    Structure([Full(1, 2), Complex(1), Full(2, 1)]),
    Structure([Real(2), Complex(1), Full(2, 1)]),
    Structure([Real(1), Complex(2), Real(1)]),
]
EXACT = [  # 2 (repeated real + repeated complex) + full <= 3: the (D, G) bound is mu
    Structure([Real(3)]),
    Structure([Complex(3)]),
    Structure([Real(2), Full(2, 2)]),
    Structure([Complex(2), Full(1, 2)]),
    Structure([Full(1, 1), Full(2, 1), Full(1, 2)]),
]
KINDS = ("complex", "real", "graded", "huge", "tiny", "nilpotent", "rank one", "orthogonal", "zero")


def matrix(rng, structure, kind):
    """A matrix of a kind that has trapped bounds before."""
    shape = structure.columns, structure.rows
    M = rng.standard_normal(shape) + 1j * rng.standard_normal(shape)
    if kind == "real":
        return M.real + 0j
    if kind == "graded":
        left, right = (10 ** rng.uniform(-6, 6, n) for n in shape)
        return left[:, None] * (M.real if rng.integers(2) else M) * right + 0j
    if kind in ("huge", "tiny"):
        return M * {"huge": 1e140, "tiny": 1e-140}[kind]
    if kind == "nilpotent":
        return np.triu(M, 1)
    if kind == "rank one":
        return np.outer(M[:, 0], M[0])
    if kind == "orthogonal":
        U, _, Vh = np.linalg.svd(M.real, full_matrices=False)
        return U @ Vh + 0j
    return np.zeros(shape, complex) if kind == "zero" else M


@settings(deadline=None, max_examples=60)
@given(
    st.integers(0, 10**6),
    st.sampled_from(STRUCTURES),
    st.sampled_from(KINDS),
    st.sampled_from(["power", "best"]),
)
def test_no_proven_bound_is_above_a_certified_one(seed, structure, kind, method):
    M = matrix(np.random.default_rng(seed), structure, kind)
    need_agreement(lower_bound(M, structure, method=method).value, upper_bound(M, structure).value)


@pytest.mark.parametrize("structure", EXACT, ids=lambda s: str(s.to_pairs()))
def test_both_bounds_meet_where_the_upper_one_is_exact(structure):
    """G. Meinsma, Y. Shrivastava, M. Fu, IEEE Trans. Automatic Control 42 (1997) 1296-1300."""
    rng = np.random.default_rng(3)
    M = np.array([matrix(rng, structure, "complex") for _ in range(6)])
    if structure == EXACT[0]:  # a complex matrix has no real eigenvalue
        M = M.real + 0j
        M[:, 1:, 0] = 0  # one real eigenvalue at least
        M[:, 0, 0] *= 10 / abs(M[:, 0, 0])
    lower, upper = lower_bound(M, structure).value, upper_bound(M, structure).value
    need_agreement(lower, upper)
    np.testing.assert_allclose(lower, upper, rtol=1e-4)


def test_an_upper_bound_that_is_false_is_found_out():
    structure = Structure([Real(1), Complex(1)])
    M = np.diag([1.0, 2.0])

    def half(M, structure):
        return SimpleNamespace(value=0.5 * upper_bound(M, structure).value)

    with pytest.raises(ContradictionError, match=r"at least 1.99.*at most 1.0") as caught:
        branch_and_bound(M, structure, upper=half)
    assert caught.value.lower > caught.value.upper


def test_a_false_bound_over_frequency_or_of_a_skewed_mu_is_found_out(monkeypatch):
    system, structure = control.ss(-1, 1, 2, 0), Structure([Full(1, 1)])
    N = control.ss(-1, [[0.5, 3]], [[1], [1]], np.zeros((2, 2)))
    with monkeypatch.context() as patch:
        patch.setattr(BandCover, "proven", 1.0)
        with pytest.raises(ContradictionError, match="the peak of mu"):
            peak(system, structure)
    proven = SkewSearch.proven
    with monkeypatch.context() as patch:
        patch.setattr(
            SkewSearch, "proven", lambda self, t: (proven(self, t)[0] / 2, *proven(self, t)[1:])
        )
        with pytest.raises(ContradictionError, match="the worst-case gain"):
            worst_case_gain(N, structure)
    upper = Skew.upper
    with monkeypatch.context() as patch:
        patch.setattr(Skew, "upper", lambda self: upper(self) / 2)
        with pytest.raises(ContradictionError, match="the skewed mu"):
            skew_bounds(np.eye(2) / 2, Structure([Complex(1), Complex(1)]), [0])


def _halved(level, *others):
    return level / 2, *others


def test_the_message_shows_the_place_and_both_claims():
    need_agreement([1.0, np.inf], [1.0, np.inf])
    with pytest.raises(ContradictionError, match=r"mu at index .1,.*least 3.0.*exactly.*most 2.0"):
        need_agreement([1.0, 3.0], [1.0, 2.0], lower_claim="it was proven exactly")


@pytest.mark.slow
def test_contradictions_over_many_matrices(record_property):
    """5,000 random and 300 ill-conditioned matrices."""
    rng = np.random.default_rng(4)
    wrong = proven = 0
    for structure in STRUCTURES:
        for kind, count, method in (("complex", 313, "power"), ("real", 312, "power")):
            M = np.array([matrix(rng, structure, kind) for _ in range(count)])
            lower = lower_bound(M, structure, method=method).value
            wrong += np.count_nonzero(lower > upper_bound(M, structure).value)
            proven += np.count_nonzero(lower)
    for k in range(300):
        structure = STRUCTURES[k % len(STRUCTURES)]
        M = matrix(rng, structure, "graded")
        lower = lower_bound(M, structure).value
        wrong += lower > upper_bound(M, structure).value
        proven += lower > 0
    record_property("contradictions", int(wrong))
    record_property("proven of 5300", int(proven))
    assert wrong == 0


LOOP = tf([18], [1, 1.8, real("k", 10, percent=40)])
LEAD = control.tf([0.4, 1.0], [0.02, 1.0])


def test_a_box_that_holds_an_unstable_member_and_is_excluded_is_one(monkeypatch):
    def decide(search, size, parts):
        search.lower = 2 * search.upper
        return True

    monkeypatch.setattr(margin._Search, "decide", decide)
    with pytest.raises(ContradictionError, match="the margin"):
        _ = loop_margins(LOOP, LEAD, tolerance=0.1).every_plant


@pytest.mark.cases(0)
def test_a_delay_that_one_plant_does_not_bear_and_is_proven_is_one(monkeypatch):
    def decide(search, delay, region):
        search.upper = delay / 2
        return True

    monkeypatch.setattr(set_delay._DelaySearch, "decide", decide)
    with pytest.raises(ContradictionError, match="the delay"):
        _ = loop_margins(LOOP, LEAD, tolerance=0.1).every_plant


def test_a_margin_that_rises_with_the_set_is_one(monkeypatch):
    grown = element_sensitivity._grown
    shrunk = lambda system, name, factor: grown(system, name, 0.5)  # noqa: E731
    monkeypatch.setattr(element_sensitivity, "_grown", shrunk)
    with pytest.raises(ContradictionError, match="with more of k"):
        margin_sensitivity(feedback(LOOP * LEAD, 1), tolerance=1e-2)
