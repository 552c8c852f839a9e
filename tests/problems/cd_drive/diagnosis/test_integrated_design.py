"""Controller and fault filter in one synthesis, and one after the other."""

import control
import numpy as np
import pytest
from scipy.optimize import minimize
from workbench.plants.cd_drive.diagnosis.integrated_design.plants import (
    carried_over,
    control_plant,
    filter_plant,
)
from workbench.plants.cd_drive.diagnosis.integrated_design.problem import integrated_design
from workbench.plants.cd_drive.diagnosis.integrated_design.robust import least_robust, worst_error
from workbench.plants.cd_drive.drive.plants import controller

import workbench as wb
from workbench.certify.norms import certified_norm
from workbench.certify.stability import stability_check


@pytest.mark.parametrize("axis", ["focus", "radial"])
def test_a_filter_carried_over_does_the_same_beside_another_controller(axis):
    """Whatever the filter: here a high-pass that nobody designed."""
    K = control.ss(controller(axis))
    F = control.ss(control.tf([1.0, 0.0], [1.0, 3e3]))
    here = certified_norm(filter_plant(axis, K).close(F))
    for other in (K / 3, 1.5 * K):
        moved = carried_over(axis, F, K, other)
        assert certified_norm(filter_plant(axis, other).close(moved)) == pytest.approx(
            here, rel=1e-3
        )
        assert certified_norm(filter_plant(axis, other).close(F)) != pytest.approx(here, rel=1e-2)


@pytest.mark.parametrize("axis", ["focus", "radial"])
def test_the_reference_controller_closes_the_loop(axis):
    K = control.ss(controller(axis))
    assert stability_check(control_plant(axis).close(K)).holds
    assert not stability_check(control_plant(axis).close(-K)).holds


@pytest.mark.parametrize(
    ("fault", "disturbance", "T", "spread"),
    [(3.0, 0.01, 0.3 - 0.2j, 0.2), (0.05, 0.2, 1.2 + 0.3j, 0.2), (1.0, 1.0, -0.5j, 0.4)],
)
def test_the_least_robust_error_by_another_search(fault, disturbance, T, spread):
    lower, upper = least_robust(fault, disturbance, T, spread)
    s = 1 / (1 + T * spread * np.append(np.exp(2j * np.pi * np.arange(48) / 48), 0.0))

    def worst(x):
        return worst_error(fault, disturbance, np.array([x[0] + 1j * x[1]]), s)[0]

    found = min(
        minimize(worst, x, method="Nelder-Mead", options={"xatol": 1e-9, "fatol": 1e-12}).fun
        for x in ([0.5, 0.0], [1.0, 0.1], [0.0, 0.0])
    )
    assert lower <= found * (1 + 1e-9)
    assert lower == pytest.approx(found, rel=1e-3)
    assert upper == pytest.approx(found, rel=1e-3)


def test_without_uncertainty_it_is_the_nominal_least_error():
    lower, upper = least_robust(2.0, 0.5, 0.8 + 0.1j, 0.0)
    assert lower == pytest.approx(1.0 / np.hypot(2.0, 0.5), rel=1e-3)
    assert upper == pytest.approx(1.0 / np.hypot(2.0, 0.5), rel=1e-3)


@pytest.mark.slow
@pytest.mark.parametrize("axis", ["focus", "radial"])
def test_the_certificate_holds_and_wrong_answers_are_rejected(axis):
    task = integrated_design(axis)
    solution = wb.solve(task)
    assert solution.certificate.holds, solution.certificate
    assert set(task.figures(solution.answer)) == {"designs"}
    for name, factor in (("carried", 1.01), ("joint", 0.2), ("level", 1.1), ("robust", None)):
        answer = solution.answer.copy(deep=True)
        answer[name].values *= factor or 1.0
        if name == "robust":
            answer[name].values[:] = 1.0
        assert not task.certify(answer, 1e-6).holds, name
