"""Destabilising systems: stable, no larger than said, and a closed-loop pole where said."""

import math

import control
import numpy as np
import pytest

from workbench.certify.stable_system import stable_system
from workbench.errors import InputError
from workbench.mu import destabilising_perturbation, lower_bound
from workbench.mu.frequency.peak import peak
from workbench.mu.frequency.peak_bounds import Peak
from workbench.structure import Complex, Full, Real, Structure

STRUCTURES = [
    Structure([Full(2, 3)]),
    Structure([Complex(2), Full(1, 1)]),
    Structure([Real(1), Complex(1), Full(1, 2)]),
    Structure([Real(2), Full(2, 2), Full(2, 1)]),
    Structure([Full(3, 1), Real(1), Complex(2), Real(2)]),
]
ROTATION = np.array([[0.0, 1.0], [-1.0, 0.0]])


def random_system(rng, structure, states):
    A = rng.standard_normal((states, states))
    A -= (np.linalg.eigvals(A).real.max() + 0.1) * np.eye(states)
    B = rng.standard_normal((states, structure.rows))
    C = rng.standard_normal((structure.columns, states))
    D = 0.1 * rng.standard_normal((structure.columns, structure.rows))
    return control.ss(A, B, C, D)


def at(system, structure, omega):
    """A peak as it would be if its frequency were this one."""
    M = stable_system(system).response([omega])[0]
    found = lower_bound(M, structure)
    return Peak(float(found.value), math.inf, omega, found.Delta, (), "")


def norm(system):
    return control.linfnorm(system)[0] if system.nstates else np.linalg.norm(system.D, 2)


def closed_poles(M, Delta):
    """Of x' = A x + B w, z = C x + D w, w = Delta z, all states in one matrix."""
    loop = np.linalg.inv(np.eye(M.noutputs) - M.D @ Delta.D)
    to_z = loop @ np.hstack([M.C, M.D @ Delta.C])
    to_w = Delta.D @ to_z + np.hstack([np.zeros((M.ninputs, M.nstates)), Delta.C])
    rate = np.vstack([M.B @ to_w, Delta.B @ to_z])
    rate[: M.nstates, : M.nstates] += M.A
    rate[M.nstates :, M.nstates :] += Delta.A
    return np.linalg.eigvals(rate)


def off_structure(Delta, structure, omega):
    """What of the response at a frequency is outside the blocks or not a multiple of 1."""
    value = Delta(1j * omega, squeeze=False)
    nearest = structure.complexified().diagonal(
        block.nearest(value[row, column])
        for block, row, column in zip(
            structure.complexified(), structure.row_slices, structure.column_slices, strict=True
        )
    )
    return abs(value - nearest).max()


@pytest.mark.parametrize("seed", range(50))
def test_closes_a_loop_with_a_pole_at_the_frequency(seed):
    rng = np.random.default_rng(seed)
    structure = STRUCTURES[seed % len(STRUCTURES)]
    system = random_system(rng, structure, int(rng.integers(2, 7)))
    omega = 10 ** rng.uniform(-2, 2)
    found = at(system, structure, omega)
    assert found.lower > 0
    Delta = destabilising_perturbation(found, system, structure)
    assert (Delta.ninputs, Delta.noutputs) == (structure.columns, structure.rows)
    assert (Delta.poles().real < 0).all()
    assert norm(Delta) == pytest.approx(1 / found.lower, rel=1e-6)
    poles = closed_poles(system, Delta)
    for sign in (1j, -1j):
        assert abs(poles - sign * omega).min() < 1e-6 * omega
    for other in (0.0, 0.3 * omega, omega, 7 * omega):
        assert off_structure(Delta, structure, other) < 1e-12 / found.lower
    for block, row, column in zip(
        structure, structure.row_slices, structure.column_slices, strict=True
    ):
        if isinstance(block, Real):
            assert not np.any(Delta.B[:, column])
            assert not np.any(Delta.C[row])


def test_of_a_peak_none_smaller_destabilises():
    structure = STRUCTURES[2]
    system = random_system(np.random.default_rng(100), structure, 4)
    found = peak(system, structure)
    Delta = destabilising_perturbation(found, system, structure)
    poles = closed_poles(system, Delta)
    assert abs(poles - 1j * found.omega).min() < 1e-6 * max(found.omega, 1)
    smaller = closed_poles(system, 0.99 * Delta / (found.upper * norm(Delta)))
    assert (smaller.real < 0).all()


@pytest.mark.parametrize("part", [0.01, 0.3])
@pytest.mark.parametrize("blocks", [[Real(1), Real(1)], [Real(2), Full(1, 2)]])
def test_with_a_complex_part(part, blocks):
    structure = Structure(blocks)
    A = np.array([[-0.02, 1.0], [-1.0, -0.02]])
    rng = np.random.default_rng(5)
    B, C = rng.standard_normal((2, structure.rows)), rng.standard_normal((structure.columns, 2))
    system = control.ss(A, B, C, np.zeros((structure.columns, structure.rows)))
    found = peak(system, structure, tolerance=1e-2, complex_part=part)
    Delta = destabilising_perturbation(found, system, structure)
    poles = closed_poles(system, Delta)
    assert abs(poles - 1j * found.omega).min() < 1e-6 * found.omega
    omega = np.concatenate([[0.0], np.geomspace(1e-4, 1e4, 500)])
    values = np.moveaxis(Delta(1j * omega, squeeze=False), -1, 0)
    assert np.linalg.norm(values, 2, axis=(1, 2)).max() <= (1 + part) / found.lower * (1 + 1e-9)
    for row, column in zip(structure.row_slices, structure.column_slices, strict=True):
        if isinstance(structure.blocks[0], Real) and row.start == 0:
            away = np.maximum(abs(values[:, 0, 0].real) - 1 / found.lower, 0)
            assert (np.hypot(away, values[:, 0, 0].imag) <= part / found.lower * (1 + 1e-9)).all()
            n = column.stop
            np.testing.assert_allclose(
                values[:, row, column], values[:, :1, :1] * np.eye(n), atol=0
            )


class TestAtTheEndsOfTheAxis:
    def test_a_real_delta_is_a_constant(self):
        system = control.ss(-1, 1, 2, 0)
        found = peak(system, Structure([Full(1, 1)]))
        assert found.omega == 0
        Delta = destabilising_perturbation(found, system, Structure([Full(1, 1)]))
        assert Delta.nstates == 0
        assert abs(closed_poles(system, Delta)).min() < 1e-9

    def test_a_full_block_of_a_real_matrix_is_a_real_dyad(self):
        structure = Structure([Full(2, 3)])
        C = np.random.default_rng(1).standard_normal((3, 2))
        system = control.ss(-np.eye(2), np.eye(2), C, np.zeros((3, 2)))
        found = at(system, structure, 0.0)
        twisted = Peak(found.lower, math.inf, 0.0, found.Delta + 0j, (), "")
        Delta = destabilising_perturbation(twisted, system, structure)
        assert Delta.nstates == 0
        assert np.linalg.norm(Delta.D, 2) == pytest.approx(1 / np.linalg.norm(C, 2))
        assert abs(closed_poles(system, Delta)).min() < 1e-9

    @pytest.mark.parametrize("omega", [0.0, math.inf])
    def test_a_complex_delta_is_interpolated_beside(self, omega):
        structure = Structure([Complex(2)])
        lag = control.ss(-3, 3, 1, 0) if omega == 0 else control.ss(-3, -3, 1, 1)
        system = control.append(lag, lag) * ROTATION  # only delta = +-j makes 1 - M delta singular
        found = at(system, structure, omega)
        assert found.lower == pytest.approx(1)
        Delta = destabilising_perturbation(found, system, structure)
        assert norm(Delta) == pytest.approx(1, abs=1e-5)
        poles = closed_poles(system, Delta)
        place = 3e-6 if omega == 0 else 3e6
        assert abs(poles - 1j * place).min() < 1e-6 * place

    def test_of_a_system_without_states(self):
        structure = Structure([Complex(2)])
        system = control.ss([], [], [], 0.5 * ROTATION)
        found = peak(system, structure)
        Delta = destabilising_perturbation(found, system, structure)
        assert norm(Delta) == pytest.approx(2)
        values = [np.linalg.eigvals(Delta(1j * omega) @ system.D) for omega in (1e-6, 1e6)]
        assert abs(np.array(values) - 1).min() < 1e-9

    def test_real_scalars_at_infinity_make_it_ill_posed(self):
        structure = Structure([Real(1), Complex(1)])
        system = control.ss(-1, [[1, 0]], [[1], [0]], np.diag([2.0, 0.1]))
        found = at(system, structure, math.inf)
        Delta = destabilising_perturbation(found, system, structure)
        assert Delta.nstates == 0
        assert np.linalg.det(np.eye(2) - system.D @ Delta.D) == pytest.approx(0, abs=1e-12)


def test_what_cannot_be_done_is_said():
    system, structure = control.ss(-1, 1, 2, 0), Structure([Full(1, 1)])
    nothing = Peak(0.0, 1.0, 1.0, np.full((1, 1), np.nan), (), "")
    with pytest.raises(InputError, match="lower bound is 0"):
        destabilising_perturbation(nothing, system, structure)
    found = peak(system, structure)
    with pytest.raises(InputError, match="of this system"):
        destabilising_perturbation(found, 3 * system, structure)
    with pytest.raises(InputError, match="shape"):
        destabilising_perturbation(found, control.append(system, system), Structure([Full(2, 2)]))
