"""The filter that the printed scalings and weights of section 7.3.2 define."""

import control
import numpy as np
import pytest
from workbench.plants.cd_drive.control.control_problem import performance_weight
from workbench.plants.cd_drive.diagnosis.defect_kinds import SHOCK_PEAK
from workbench.plants.cd_drive.diagnosis.fault_filter.defect_estimates import SIZE
from workbench.plants.cd_drive.diagnosis.fault_filter.printed_filter import (
    DESIGNS,
    LENGTHS,
    ORDER,
    of_low_order,
    sampled_bump,
)
from workbench.plants.cd_drive.diagnosis.fault_filter.printed_weights import (
    EPSILON,
    least_at_each_frequency,
    robust_program,
    shock_weight,
    weights,
)
from workbench.plants.cd_drive.drive.disc import VELOCITY
from workbench.plants.cd_drive.drive.red_book import ACCEPTABLE_ERROR
from workbench.plants.cd_drive.laboratory.experiment import Laboratory

from workbench.systems import response


@pytest.fixture(scope="module")
def focus(reference):
    return reference("cd/focus/printed-filter")


def test_the_weight_of_defects_is_equation_7_32():
    """Written out anew: M = 250, A = 0.001, X = 3, w_B of 230 Hz."""
    s = 2j * np.pi * np.geomspace(0.1, 1e5, 50)
    corner = 3 * 2 * np.pi * 230.0
    printed = (s + corner * 0.001 ** (1 / 3)) ** 3 / (s / 250 ** (1 / 3) + corner) ** 3
    of_fault = [weights("focus", one)["defect"](s) for one in DESIGNS]
    assert of_fault[0] == pytest.approx(2e-5 * printed, rel=1e-9)
    assert of_fault[1] == pytest.approx(np.hypot(5e-3, 2e-5) * printed, rel=1e-9)


def test_no_filter_does_better_at_a_frequency():
    """The formula against a search over the gain from disturbance and defect to the estimate."""
    omega = 2 * np.pi * np.array([20.0, 200.0, 2e3])
    for design in DESIGNS:
        disc, defect = (abs(W(1j * omega)) for W in weights("focus", design).values())
        T = np.linspace(0.0, 1.0, 200_001)[:, None]
        found = np.hypot(disc * T, defect * (1 - T)).min(axis=0)
        assert least_at_each_frequency("focus", design, omega) == pytest.approx(found, rel=1e-6)


def test_without_a_filter_the_error_is_the_weight_of_defects(focus):
    """250 at high frequency, times the scaling: above 1 with both rows, and far below otherwise."""
    none = focus.data["mu"].sel(stage="none", bound="upper")
    assert float(none.sel(design="rows")) == pytest.approx(250 * np.hypot(*EPSILON), rel=2e-3)
    assert 250 * EPSILON[1] < float(none.sel(design="channels")) < 1.0


@pytest.mark.cases(1)
@pytest.mark.parametrize("design", DESIGNS)
def test_members_of_the_set_stay_below_the_peak(focus, design):
    """Errors of random plants, by the loop's formula, are below the bound of robust performance."""
    study, F = focus.task, focus.task.filters(focus.data)[design]
    loop, rng = study.loops["continuous"], np.random.default_rng(7)
    omega = 2 * np.pi * np.geomspace(1.0, 3e4, 200)
    closed = robust_program("focus", loop, design).loop(F)
    N = response(closed.system, omega)
    peak = float(focus.data["mu"].sel(design=design, stage="full", bound="upper"))
    for _ in range(20):
        delta = np.diag([rng.uniform(-1, 1), np.exp(2j * np.pi * rng.uniform())]) / peak
        inner = np.linalg.solve(np.eye(2) - N[:, :2, :2] @ delta, N[:, :2, 2:])
        error = N[:, 2:, 2:] + N[:, 2:, :2] @ delta @ inner
        assert np.linalg.norm(error, axis=(1, 2)).max() <= peak


@pytest.mark.parametrize("design", DESIGNS)
def test_a_filter_of_low_order_is_stable_and_near(focus, design):
    F = focus.task.filters(focus.data)[design]
    few = of_low_order(F)
    assert few.nstates == ORDER and few.poles().real.max() < 0.0
    omega = 2 * np.pi * np.geomspace(1.0, 1e4, 100)
    assert abs(response(few, omega) - response(F, omega)).max() < 0.05


@pytest.mark.parametrize("length", LENGTHS[-2:])
def test_a_bump_has_its_length_and_size(length):
    time, seen = sampled_bump(length)
    half = np.ptp(time[seen > 0.5 * SIZE])
    assert half == pytest.approx(0.5e-3 * length / VELOCITY, rel=0.15)
    assert 0.75 * SIZE < seen.max() <= SIZE


@pytest.mark.slow
def test_wrong_answers_are_rejected(focus):
    study, answer = focus.task, focus.data.load()
    wrong = {
        "norms again": {"norm": 1.01 * answer["norm"]},
        "mu again": {"mu": 0.99 * answer["mu"]},
        "least norm": {"level": 0.99 * answer["level"]},
        "stable filters": {"poles": -answer["poles"]},
    }
    for check, changed in wrong.items():
        checks = {one.name: one for one in study.certify(answer.assign(changed), 1e-6).checks}
        assert not checks[check].holds, check


def test_the_disc_weight_is_that_of_equation_6_11():
    at = 2j * np.pi * np.array([10.0, 1e3])
    assert weights("radial", "channels")["disc"](at) == pytest.approx(
        5e-3 * performance_weight("radial")(at)
    )
    assert isinstance(weights("radial", "rows")["disc"], control.StateSpace)


@pytest.mark.parametrize("axis", ["focus", "radial"])
def test_the_weight_of_shocks_is_that_of_a_mass_on_a_spring(axis):
    """A constant acceleration bends the suspension by m a / k; a fast one leaves the lens behind
    by a / omega^2, since the coil's force, unlike a shock, acts on the lens alone.
    """
    p, a = Laboratory(axis, "nominal").parameters, SHOCK_PEAK[axis] / ACCEPTABLE_ERROR[axis]
    still, fast = 2 * np.pi * np.array([0.01, 200.0])
    m, k = p.m1 + p.m2, p.k1 * p.k2 / (p.k1 + p.k2)
    found = abs(shock_weight(axis)(1j * np.array([still, fast])))
    assert found[0] == pytest.approx(m * a / k, rel=1e-3)
    assert found[1] == pytest.approx(a / fast**2, rel=0.15)


@pytest.mark.slow
@pytest.mark.parametrize("axis", ["focus", "radial"])
def test_the_stored_certificates_hold(reference, axis):
    run = reference(f"cd/{axis}/printed-filter")
    assert run.task.certify(run.answer, 1e-6).holds
    assert {"figure-7-12", "figure-7-13"} <= set(run.task.figures(run.answer))
