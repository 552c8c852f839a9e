"""Thousands of questions whose answers are known exactly: none is answered falsely."""

import exact_loops
import exact_matrices
import exact_norms
import exact_parameters
import exact_sets
import numpy as np
import pytest
from exact_cases import BAD, judged, table

MAKERS = {
    exact_norms.norm_case: 350,
    exact_norms.mu_case: 200,
    exact_norms.mixed_case: 100,
    exact_norms.worst_of_no_set: 100,
    exact_matrices.matrix_case: 350,
    exact_parameters.margin_case: 200,
    exact_parameters.performance_case: 60,
    exact_parameters.worst_case: 100,
    exact_parameters.probability_case: 100,
    exact_parameters.curved_case: 5,
    exact_loops.classical_case: 120,
    exact_loops.disk_case: 400,
    exact_loops.set_case: 10,
    exact_loops.gap_case: 120,
    exact_loops.coprime_case: 30,
    exact_sets.switching_case: 35,
    exact_sets.unstable_switching_case: 30,
    exact_sets.containment_case: 50,
    exact_sets.circle_case: 50,
}
"""What makes a case of a seed, and how many seeds the slow test takes."""
FEW = 3
"""Seeds of each in the quick tests."""
MOST_BAD = 0.05
"""Largest share of questions that may be refused badly."""


ONCE_BAD = {exact_norms.norm_case: (159, 169, 174, 184, 218), exact_norms.mu_case: (72, 166)}
"""Seeds whose questions were once refused badly, by a verdict or with a raw traceback."""


def verdicts(maker, seeds):
    """The cases of seeds with what became of each."""
    cases = [maker(np.random.default_rng(seed)) for seed in seeds]
    return [(case, judged(case)) for case in cases]


@pytest.mark.parametrize("maker", MAKERS, ids=lambda maker: maker.__name__)
def test_a_few_exact_cases(maker):
    found = verdicts(maker, range(min(FEW, MAKERS[maker] // 5)))
    assert not [(case, verdict) for case, verdict in found if verdict.word in ("false", *BAD)]


@pytest.mark.parametrize("maker", ONCE_BAD, ids=lambda maker: maker.__name__)
def test_what_was_refused_badly_is_so_no_more(maker):
    found = verdicts(maker, ONCE_BAD[maker])
    assert not [(case, verdict) for case, verdict in found if verdict.word in ("false", *BAD)]


@pytest.mark.slow
def test_exact_cases():
    found = [one for maker, seeds in MAKERS.items() for one in verdicts(maker, range(seeds))]
    print(table(found))
    for case, verdict in found:
        if verdict.word in ("false", *BAD):
            print(f"{case.family}, {case.function}: {verdict.word}: {verdict.told}")
    words = [verdict.word for _, verdict in found]
    assert len(found) >= 2000
    assert "false" not in words
    assert sum(word in BAD for word in words) <= MOST_BAD * len(found)
