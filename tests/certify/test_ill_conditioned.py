"""Certified norms of ill-conditioned realisations against exactly known peaks."""

import math
from collections import Counter

import numpy as np
import pytest
from ill_conditioned import ill_conditioned, known_peak

from workbench.certify.norms import certified_norm
from workbench.errors import InputError
from workbench.mu.frequency.peak import peak
from workbench.structure import Full, Structure


def verdict(seed):
    """Whether the certified norm is "true", "loose" (over 1 % above the peak) or "refused"."""
    case = ill_conditioned(seed)
    truth = known_peak(case)
    try:
        bound = certified_norm(case.system)
    except InputError as refusal:
        assert "condition" in str(refusal)
        return "refused"
    assert bound >= truth, (seed, bound, truth)
    if math.isinf(bound):
        return "refused"
    return "true" if bound < 1.01 * truth else "loose"


@pytest.mark.cases(0)
def test_no_certified_norm_excludes_the_truth_in_a_sample():
    found = Counter(verdict(seed) for seed in range(30))
    assert found["true"] >= 27, found


@pytest.mark.slow
def test_no_certified_norm_excludes_the_truth():
    found = Counter(verdict(seed) for seed in range(300))
    print(found)
    assert found["true"] >= 270, found


def test_the_family_reaches_from_easy_to_hard():
    cases = [ill_conditioned(seed) for seed in range(30)]
    assert min(case.condition for case in cases) < 100 < 1e6 < max(c.condition for c in cases)
    ratios = [case.damping / case.omega.max() for case in cases]
    assert min(ratios) < 1e-9 < 1e-4 < max(ratios)
    assert {case.system.nstates for case in cases} >= {2, 20}


@pytest.mark.parametrize("seed", range(4))
def test_bounds_of_mu_lie_about_the_truth(seed):
    case = ill_conditioned(seed)
    found = peak(case.system, Structure([Full(*reversed(case.D.shape))]))
    truth = known_peak(case)
    assert found.lower <= truth * (1 + 1e-5)
    assert truth <= found.upper <= 1.01 * truth


def test_an_ill_conditioned_system_that_is_not_stable_is_refused():
    case = ill_conditioned(12)
    A = case.system.A + 2 * case.damping * np.eye(case.system.nstates)  # exact: the pole moves
    unstable = type(case.system)(A, case.system.B, case.system.C, case.system.D)
    with pytest.raises(InputError, match=r"unstable|cannot be told"):
        certified_norm(unstable)
