"""Small problems of every kind: numbers of the literature, of peers, and of each other."""

import control
import numpy as np
import pytest
from workbench.plants.quick.crest_factor import crest_factor
from workbench.plants.quick.dwell import LONGEST_LOSS, dwell
from workbench.plants.quick.fault_filter import fault_filter
from workbench.plants.quick.hinf import hinf
from workbench.plants.quick.loops import closed_loop
from workbench.plants.quick.magnitude_fit import magnitude_fit
from workbench.plants.quick.mu_lower import mu_lower
from workbench.plants.quick.mu_upper import mu_upper
from workbench.plants.quick.response_fit import response_fit
from workbench.plants.quick.shapes import OMEGA
from workbench.plants.textbook.controller import PLANTS

import workbench as wb
from workbench.bench.project import registry


def objective(program, method=None):
    return program.objective(wb.solve(program, method=method).answer)


@pytest.mark.cases(0)
def test_every_kind_of_program_is_here_twice_and_none_is_slow():
    kinds = {}
    for entry in registry().match("quick/*"):
        assert not entry.slow
        kinds.setdefault(entry.name.rpartition("/")[2], []).append(entry.name)
    assert set(kinds) == {
        *("mu-upper", "mu-lower", "hinf", "magnitude-fit", "response-fit"),
        *("dwell", "fault-filter", "crest-factor"),
    }
    assert all(len(names) >= 2 for names in kinds.values())


def test_mu_of_the_column_is_that_of_the_literature():
    """Skogestad and Postlethwaite, Multivariable Feedback Control (2005), section 8.11: 5.78."""
    upper = wb.solve(mu_upper("distillation", 200)).answer.value
    assert upper.max() == pytest.approx(5.78, abs=5e-3)


@pytest.mark.parametrize("plant", ["mass-spring", "distillation"])
def test_the_bounds_of_mu_enclose_it(plant):
    upper, lower = (wb.solve(kind(plant)).answer.value for kind in (mu_upper, mu_lower))
    assert np.all(lower <= upper * (1 + 1e-9))
    assert np.all(lower >= 0.9 * upper)


@pytest.mark.parametrize("plant", ["mass-spring", "distillation"])
def test_the_loops_of_mu_are_stable(plant):
    assert closed_loop(plant).system.poles().real.max() < 0


@pytest.mark.parametrize("plant", list(PLANTS))
def test_the_least_norm_is_that_of_python_control(plant):
    generalised = PLANTS[plant]()
    norm = wb.solve(hinf(plant)).answer.norm
    _, _, gamma, _ = control.hinfsyn(
        generalised.system, generalised.measurements, generalised.controls
    )
    assert norm <= gamma * 1.001
    assert norm >= 0.9 * gamma


def test_the_weight_of_a_delay_covers_all_shorter_ones():
    program = magnitude_fit("delay")
    W = wb.solve(program).answer
    for delay in (0.1, 0.5, 1.0):
        gone = np.abs(np.exp(-1j * OMEGA * delay) - 1)
        assert np.all(np.abs(W.response(OMEGA)) >= gone * (1 - 1e-9))
    assert np.abs(W.response([1e-3])) == pytest.approx(1e-3, rel=0.05)


def test_a_fit_of_half_an_order_slopes_by_ten_decibels():
    W = wb.solve(magnitude_fit("half-order")).answer
    low, high = np.abs(W.response([3.0, 30.0]))
    assert 20 * np.log10(low / high) == pytest.approx(10.0, abs=0.6)


@pytest.mark.parametrize("shape", ["delay", "half-order"])
def test_a_better_order_fits_better(shape):
    errors = [objective(response_fit(shape, order)) for order in (2, 4, 6)]
    assert errors[0] > errors[1] > errors[2]


def test_the_cart_survives_losses_between_stays_of_the_proven_length():
    """Random switching between the two modes, as often as it is allowed."""
    program = dwell("cart")
    stay = wb.solve(program).answer.samples
    measured, lost = program.modes
    rng = np.random.default_rng(0)
    for plant in range(3):
        x = np.array([1.0, 0.0])
        for _ in range(200):
            x = np.linalg.matrix_power(measured.A[plant], stay + rng.integers(3)) @ x
            x = np.linalg.matrix_power(lost.A[plant], rng.integers(1, LONGEST_LOSS + 1)) @ x
        assert np.linalg.norm(x) < 1e-2


@pytest.mark.cases(0)
@pytest.mark.parametrize("plant", ["lag", "two-masses"])
def test_every_method_finds_as_good_a_filter_as_the_default_one(plant):
    program = fault_filter(plant)
    default = objective(program)
    assert objective(program, "clarabel") == pytest.approx(default, rel=5e-3)
    assert objective(program, "basis") <= default * (1 + 1e-3)


@pytest.mark.parametrize("lines", ["eight-lines", "odd-lines"])
def test_phases_by_optimisation_beat_those_of_schroeder(lines):
    program = crest_factor(lines)
    assert 1.0 < objective(program, "ipopt") < 0.85 * objective(program, "schroeder")
