"""Zeros on the imaginary axis are found in any units; slow zeros beside it are left alone."""

import control
import numpy as np
import pytest

from workbench.synthesis import hinf, regularise
from workbench.synthesis.h_infinity.assumptions import checked
from workbench.synthesis.h_infinity.axis_zeros import axis_zeros
from workbench.synthesis.h_infinity.normalised import SingularPlantError
from workbench.systems.balancing import balanced, speed
from workbench.systems.realisation import realisation
from workbench.systems.standard_plant import standard_plant
from workbench.uncertainty import GeneralisedPlant

STATES, INPUTS, OUTPUTS = 6, 2, 3


def zero_block(zero):
    if zero == 0:
        return np.zeros((1, 1))
    a, b = np.real(zero), np.imag(zero)
    return np.array([[a, b], [-b, a]]) if b else np.array([[a]])


def system_with(zero, seed, rates=None, mixed=False):
    """A, B, C, D with D^T D = 1 and a zero; rates (6,) [rad/s] of the states, all 1 if None.

    The first states move unseen where u = -D^T C x; the others are random. Mixed: in random
    coordinates.
    """
    random = np.random.default_rng(seed)
    block = zero_block(zero)
    k, root = len(block), np.sqrt(np.ones(STATES) if rates is None else rates)
    inner = root[:, None] * random.standard_normal((STATES, STATES)) * root
    inner[k:, :k], inner[:k, :k] = 0.0, block
    Q = np.linalg.qr(random.standard_normal((OUTPUTS, OUTPUTS)))[0]
    D, rest = Q[:, :INPUTS], Q[:, INPUTS:]
    B = root[:, None] * random.standard_normal((STATES, INPUTS))
    cancelled = random.standard_normal((INPUTS, STATES)) * root
    shown = random.standard_normal((len(rest.T), STATES)) * root
    shown[:, :k] = 0.0
    A, C = inner + B @ cancelled, rest @ shown + D @ cancelled
    if mixed:
        turn = np.linalg.qr(random.standard_normal((STATES, STATES)))[0]
        A, B, C = turn @ A @ turn.T, turn @ B, C @ turn.T
    return A, B, C, D


def in_units(system, seed, decades, time):
    """The system with its states scaled at random and another unit of time."""
    A, B, C, D = system
    factor = 10.0 ** np.random.default_rng(seed).uniform(-decades, decades, STATES)
    root = np.sqrt(time)
    return time * A * factor[:, None] / factor, root * B * factor[:, None], root * C / factor, D


def frequencies(system):
    """Frequencies of zeros on the axis, by balanced states and a suitable unit of time."""
    A, B, C, D = system
    rate = speed(A, B, C)
    root = np.sqrt(rate)
    return [rate * zero.omega for zero in axis_zeros(*balanced(A / rate, B / root, C / root), D)]


@pytest.mark.parametrize("mixed", [False, True])
@pytest.mark.parametrize("disturbed", [0.0, 1e-12])
@pytest.mark.parametrize("omega", [0.0, 1e-3, 1.0, 30.0])
def test_a_zero_on_the_axis_is_found_in_any_units(omega, disturbed, mixed):
    for seed, (decades, time) in enumerate([(0, 1.0), (0, 1e-8), (0, 1e8), (4, 1.0), (8, 1e8)]):
        *parts, D = system_with(1j * omega, seed, mixed=mixed)
        random = np.random.default_rng(seed)
        parts = [
            part + disturbed * abs(part).max() * random.standard_normal(part.shape)
            for part in parts
        ]
        found = frequencies(in_units((*parts, D), seed, decades, time))
        assert found == [pytest.approx(time * omega, rel=1e-6, abs=1e-9 * time)]


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("zero", [-0.08, 0.08, -1e-3, -20 + 200j, -2e-4 + 200j])
def test_slow_zeros_off_the_axis_beside_fast_states_are_none(zero, seed):
    """Time scales that differ by 3e8 to 3e10; the zero's own is the slowest."""
    rates = np.full(STATES, 3e7)
    rates[: len(zero_block(zero))] = abs(zero)
    system = system_with(zero, seed, rates)
    assert frequencies(system) == []
    assert frequencies(in_units(system, seed, 6, 1e-6)) == []


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("omega", [0.0, 1e-3, 0.08, 200.0, 3e7])
def test_zeros_on_the_axis_beside_states_of_another_speed_are_found(omega, seed):
    for fast in (3e7, 1e-3):
        rates = np.full(STATES, fast)
        rates[: len(zero_block(1j * omega))] = omega or 0.1
        system = system_with(1j * omega, seed, rates)
        assert frequencies(system) == [pytest.approx(omega, rel=1e-6)]


def test_a_double_zero_is_found():
    integrators = np.array([[0.0, 1.0], [0.0, 0.0]]), np.array([[0.0], [1.0]])
    nothing, D = np.zeros((2, 2)), np.array([[0.0], [1.0]])
    assert frequencies((*integrators, nothing, D)) == [0.0]
    (zero,) = axis_zeros(np.zeros((2, 2)), np.eye(2), nothing, np.eye(2))
    assert np.linalg.matrix_rank(zero.outputs) == 2


def test_what_rounding_leaves_of_a_zero_entry_is_no_mode():
    A, C = np.diag([0.1 + 0.2 - 0.3, -1.0]), np.array([[1e-17, 1.0], [0.0, 0.0]])
    assert A[0, 0] != 0.0
    (zero,) = axis_zeros(A, np.ones((2, 1)), C, np.array([[0.0], [1.0]]))
    assert zero.omega == 0.0


@pytest.mark.parametrize("omega", [0.0, 1.0])
@pytest.mark.parametrize("seed", range(3))
def test_the_outputs_of_a_zero_show_it_at_the_size_of_what_cancels(omega, seed):
    A, B, C, D = system_with(1j * omega, seed, mixed=True)
    (zero,) = axis_zeros(A, B, C, D)
    assert len(zero.outputs) == (2 if omega else 1)
    assert np.linalg.norm(zero.outputs) < 3 * np.linalg.norm(C)
    more = np.vstack([C, 1e-3 * zero.outputs])
    assert axis_zeros(A, B, more, np.vstack([D, np.zeros((len(zero.outputs), INPUTS))])) == []


# --- plants made regular ------------------------------------------------------------------------


def plant_with(zero, fast):
    """A block of states beside a lag of the speed `fast` that the control moves and z shows.

    z = (lag, u / 10 - x1 / 50), y = x1 + lag + noise: with u = x1 / 5 the block moves unseen, its
    modes at the zero.
    """
    block = zero_block(zero)
    k = len(block)
    A = np.block([[block, np.zeros((k, 1))], [np.zeros((1, k)), -fast * np.eye(1)]])
    B = np.zeros((k + 1, 3))
    B[0, 0] = B[0, 2] = 1.0
    B[k, 2] = fast
    A -= 0.2 * np.outer(B[:, 2], np.arange(k + 1) == 0)
    C = np.zeros((3, k + 1))
    C[0, k], C[1, 0], C[2, 0], C[2, k] = 1.0, -0.02, 1.0, 1.0
    D = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 0.1], [0.0, 0.1, 0.0]])
    return GeneralisedPlant(realisation((A, B, C, D), 0.0), None, 1, 1)


def added(plant):
    labels = [*plant.system.input_labels, *plant.system.output_labels]
    return [label for label in labels if label.startswith("regular_")]


@pytest.mark.parametrize("fast", [1.0, 1e3, 1e8])
def test_only_zeros_on_the_axis_are_added_to(fast):
    assert added(regularise(plant_with(0.0, fast), 1e-2)) == ["regular_x0"]
    assert added(regularise(plant_with(1j, fast), 1e-2)) == ["regular_x0", "regular_x1"]
    for zero in (-0.08, 0.08, -0.01 + 1j):
        assert added(regularise(plant_with(zero, fast), 1e-2)) == []


@pytest.mark.cases(1)
@pytest.mark.parametrize("zero", [0.0, 1j])
@pytest.mark.parametrize("fast", [1.0, 1e3])
def test_a_plant_made_regular_has_a_controller(zero, fast):
    plant = plant_with(zero, fast)
    with pytest.raises(SingularPlantError, match=r"\(A, B2, C1, D12\).*stability boundary"):
        checked(standard_plant(plant))
    norm = hinf(regularise(plant, 1e-2)).norm
    assert norm < 3.0
    assert hinf(plant).norm <= 1.001 * norm


def test_units_of_a_plant_do_not_count_for_what_is_added():
    A, B, C, D = (getattr(plant_with(0.0, 10.0).system, name) for name in "ABCD")
    sizes = []
    for factor, time in ((np.ones(2), 1.0), (np.array([1e6, 1e-5]), 1.0), (np.ones(2), 2.0**30)):
        root = np.sqrt(time)
        scaled = time * A * factor[:, None] / factor, root * B * factor[:, None], root * C / factor
        regular = regularise(GeneralisedPlant(control.ss(*scaled, D), None, 1, 1), 1e-2)
        assert added(regular) == ["regular_x0"]
        sizes.append(regular.system.C[2] * factor / root)
    np.testing.assert_allclose(sizes[1:], sizes[:1] * 2, rtol=0.5, atol=1e-9)
