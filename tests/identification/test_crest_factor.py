"""Crest factors: certificates, and methods against each other."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from workbench.errors import InputError
from workbench.identification import CrestFactor, schroeder_phases
from workbench.program import methods
from workbench.solution import solve
from workbench.solvers import Outcome

PROBLEMS = {
    "one line": CrestFactor(2.0, [3], 16),
    "two lines": CrestFactor([1.0, 0.5], [1, 2], 16),
    "fifteen lines": CrestFactor(1.0, np.arange(1, 16), 64),
    "odd lines": CrestFactor(1e-3, np.arange(1, 60, 2), 128),
    "falling, with gaps": CrestFactor(1e3 / np.arange(1, 11), np.arange(1, 11) ** 2, 256),
}


@pytest.mark.parametrize("name", PROBLEMS)
@pytest.mark.parametrize("method", ["schroeder", "clipping", "ipopt"])
def test_every_method_is_certified(name, method):
    program = PROBLEMS[name]
    solution = solve(program, method=method)
    assert solution.certificate.failures == ()
    assert solution.outcome is Outcome.SOLVED
    metrics = program.metrics(solution.answer)
    assert metrics["crest_factor"] >= 1
    # Clipping starts from Schroeder's phases and IPOPT from the clipped ones.
    assert metrics["ratio_to_schroeder"] <= 1.002


def test_the_methods_are_all_tested():
    assert set(methods(CrestFactor)) == {"schroeder", "clipping", "ipopt"}


def test_one_line_is_a_sine():
    program = PROBLEMS["one line"]
    metrics = program.metrics(np.zeros(1))
    assert metrics["crest_factor"] == pytest.approx(np.sqrt(2), rel=2e-3)


def test_optimised_phases_beat_the_formula():
    program = PROBLEMS["fifteen lines"]
    factors = [
        program.metrics(solve(program, method=name).answer)["crest_factor"]
        for name in ("schroeder", "clipping", "ipopt")
    ]
    assert factors[0] > 1.7
    assert factors[1] < 1.5
    assert factors[2] < factors[1]


def test_schroeder_phases_of_a_flat_spectrum():
    k = np.arange(1, 21)
    phases = schroeder_phases(k, np.ones(20))
    np.testing.assert_allclose(phases, -np.pi * k * (k - 1) / 20, atol=1e-12)


@settings(derandomize=True, deadline=None, max_examples=30)
@given(st.lists(st.floats(-4, 4), min_size=5, max_size=5), st.floats(0.1, 10))
def test_nothing_between_the_instants_exceeds_the_bound(phases, size):
    program = CrestFactor([size, 1, 2, 1, 1], [1, 2, 4, 5, 9], 64)
    grid, bound = program.peak(np.array(phases))
    dense = np.abs(program.multisine(phases).period(points=9 * 64 * 7)).max()
    assert dense <= bound * (1 + 1e-12)
    assert grid <= bound <= 1.0013 * grid


def test_wrong_answers_are_refused():
    program = PROBLEMS["two lines"]
    assert not program.certify(np.array([np.nan, 0.0]), 1e-6).valid
    with pytest.raises(InputError, match="2 phases"):
        program.certify(np.zeros(3), 1e-6)
    with pytest.raises(InputError, match="Nyquist"):
        CrestFactor(1.0, [8], 16)


def test_answers_are_stored_and_drawn():
    program = PROBLEMS["odd lines"]
    phases = solve(program, method="schroeder").answer
    data = program.to_dataset(phases)
    np.testing.assert_array_equal(program.from_dataset(data), phases)
    np.testing.assert_array_equal(data["line"], program.lines)
    assert set(program.figures(phases)) == {"period"}
