"""Wrong input to the functions of the room: an InputError that names what was given."""

import math

import control
import numpy as np
import pytest

from workbench import Options
from workbench.errors import InputError
from workbench.mu import (
    Complex,
    Full,
    Real,
    Structure,
    bound_gradient,
    branch_and_bound,
    conditions,
    destabilising_perturbation,
    frequency_sweep,
    loop_margins,
    lower_bound,
    peak,
    robust_stability,
    skew_bounds,
    upper_bound,
    worst_case_gain,
)
from workbench.uncertainty import feedback

SAMPLED = control.tf([1], [1, -0.5], 0.1)
MIXED = Structure([Real(1, name="a"), Complex(1, name="b"), Full(2, 2, name="c")])
M = np.random.default_rng(0).normal(size=(4, 4)) + 0.5j * np.eye(4)
LIGHT = control.tf([1], [1, 0.02, 1])
ONE = Structure([Full(1, 1)])


@pytest.mark.parametrize("bound", [upper_bound, lower_bound])
def test_matrices_and_options_that_are_none(bound):
    with pytest.raises(InputError, match="array"):
        bound([[1, 2], [3]], MIXED)
    with pytest.raises(InputError, match="options must be Options"):
        bound(M, MIXED, options={"tolerance": 1e-3})
    assert bound(M, MIXED, options=Options()).value > 0


@pytest.mark.parametrize("blocks", [None, 3, Real(1)])
def test_what_is_no_list_of_blocks(blocks):
    with pytest.raises(InputError, match="a list of blocks is needed"):
        Structure(blocks)


@pytest.mark.parametrize("pairs", [None, 3])
def test_what_is_no_list_of_rows(pairs):
    with pytest.raises(InputError, match="rows of two integers"):
        Structure.from_pairs(pairs)


@pytest.mark.parametrize("fixed", [None, 1.0, [0.5], True, [None]])
def test_blocks_that_are_neither_names_nor_numbers(fixed):
    with pytest.raises(InputError, match="names or numbers of blocks"):
        skew_bounds(M, MIXED, fixed)


def test_a_number_of_numpy_is_a_number_of_a_block():
    assert skew_bounds(M, MIXED, np.int64(0)).upper == skew_bounds(M, MIXED, "a").upper


@pytest.mark.parametrize("omega", ["fast", ["a"], [1j]])
def test_frequencies_that_are_not_real(omega):
    with pytest.raises(InputError, match="omega must be real frequencies"):
        frequency_sweep(LIGHT, ONE, omega=omega)


@pytest.mark.parametrize("tolerance", ["high", None, math.nan, 0, 1])
def test_tolerances_that_are_none(tolerance):
    with pytest.raises(InputError, match="tolerance is"):
        peak(LIGHT, ONE, tolerance=tolerance)
    with pytest.raises(InputError, match="tolerance is"):
        worst_case_gain(control.append(LIGHT, LIGHT), ONE, tolerance=tolerance)


@pytest.mark.parametrize("steps", [0, -1, 2.5, None])
def test_steps_that_are_none(steps):
    with pytest.raises(InputError, match="steps is"):
        peak(LIGHT, ONE, steps=steps)


@pytest.mark.parametrize("part", ["little", -1.0, math.inf])
def test_complex_parts_that_are_none(part):
    with pytest.raises(InputError, match="complex_part is"):
        peak(LIGHT, Structure([Real(1)]), complex_part=part)


@pytest.mark.parametrize("asked", [{"tolerance": "5 %"}, {"tolerance": math.nan}, {"nodes": None}])
def test_gaps_and_nodes_that_are_none(asked):
    with pytest.raises(InputError, match=f"{next(iter(asked))} is"):
        branch_and_bound(M, MIXED, **asked)


def test_worst_case_gain_of_no_structure():
    with pytest.raises(InputError, match="must be a Structure"):
        worst_case_gain(control.append(LIGHT, LIGHT), [(1, 1)])


def test_gradients_need_the_bound_of_their_matrices():
    bound = upper_bound(M, MIXED)
    assert np.array_equal(bound_gradient(M.tolist(), MIXED, bound), bound_gradient(M, MIXED, bound))
    smaller = upper_bound(M[:1, :1], Structure([Complex(1)]))
    for wrong in (3.0, upper_bound([M, M], MIXED), smaller):
        with pytest.raises(InputError, match="bound must be that of this M"):
            bound_gradient(M, MIXED, wrong)
    with pytest.raises(InputError, match="not finite"):
        bound_gradient(np.nan * M, MIXED, bound)
    with pytest.raises(InputError, match="has no gradient"):
        bound_gradient([M, 0 * M], MIXED, upper_bound([M, 0 * M], MIXED))


def test_things_of_another_kind():
    with pytest.raises(InputError, match="must be a GeneralisedPlant, not StateSpace"):
        conditions(control.ss(LIGHT), LIGHT)
    with pytest.raises(InputError, match="not TransferFunction"):
        destabilising_perturbation(LIGHT, peak(LIGHT, ONE), ONE)


def test_improper_systems_are_told_their_degrees():
    with pytest.raises(InputError, match="improper: its numerator has degree 2"):
        peak(control.tf([1, 0, 0], [1, 1]), ONE)


def test_a_destabilising_system_needs_the_structure_of_the_peak():
    system = control.ss(-np.eye(4), np.eye(4), M.real, np.zeros((4, 4)))
    found = peak(system, Structure([Full(4, 4)]))
    with pytest.raises(InputError, match="has not the structure"):
        destabilising_perturbation(found, system, Structure([Complex(4)]))


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: worst_case_gain(LIGHT), "no uncertain elements of its own: give the structure"),
        (lambda: worst_case_gain(None), "system must be a StateSpace"),
        (
            lambda: loop_margins(LIGHT, SAMPLED),
            r"sampling times 0 \(cont.* and 0.1 s.*discretise",
        ),
        (lambda: loop_margins(2.0, -0.5), r"not well posed.*\[\[2.0\]\] of plant and \[\[-0.5"),
        (lambda: feedback(-1.0, 1.0), "not well posed.*give one of them a lag, or another gain"),
        (lambda: robust_stability(LIGHT), "no uncertain element; there is nothing"),
    ],
)
def test_what_to_do_is_said(call, words):
    with pytest.raises(InputError, match=words):
        call()
