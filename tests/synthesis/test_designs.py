"""Every synthesis method on one plant that is not a CD drive."""

from dataclasses import replace

import control
import numpy as np
import pytest

from workbench.errors import InputError
from workbench.executor import Context
from workbench.mu import performance_peak
from workbench.synthesis import DESIGNS, DesignTask, MuSynthesis, regularise
from workbench.systems.norms import hinf_norm
from workbench.uncertainty import UncertaintyModel, generalised_plant

QUICK = ("reference", "LQG", "mixed sensitivity", "loop shaping", "full block", "fixed order")
G = control.tf([1.0], [1.0, 0.6, 1.0])
SENSOR = control.tf([1.0], [0.02, 1.0])
W_P, W_U = control.tf([0.5, 0.5], [1.0, 0.01]), 0.05


def size(system):
    return hinf_norm((system.A, system.B, system.C, system.D))


@pytest.fixture(scope="module")
def task():
    """A damped mass, its gain uncertain by 20 % real and by 10 % complex."""
    uncertain = UncertaintyModel(G, control.tf(0.1, 1), control.tf(0.2, 1))
    plant = generalised_plant(
        [
            (uncertain, "u", "y"),
            (W_P, "e", "z_p"),
            (control.tf(W_U, 1), "u", "z_u"),
            (SENSOR, "e", "seen"),
        ],
        {"e": "w - y"},
        exogenous="w",
        control="u",
        performance=["z_p", "z_u"],
        measurement="seen",
    )
    regular = regularise(plant, 0.1)
    # White noise would reach z_p through the direct term of W_p.
    limit = control.ss(-100.0, 100.0, 1.0, 0.0)
    return DesignTask(
        plant=plant,
        regular=regular,
        quadratic=regular.nominal().weighted(exogenous=[limit]),
        nominal=control.ss(G * SENSOR),
        W_S=control.ss(W_P),
        W_KS=W_U,
        reference=control.ss(control.tf([2.0, 2.0], [0.05, 1.0])),
        gains=(0.5, 1.0, 2.0),
        sizes=tuple(np.geomspace(1e-2, 10.0, 7)),
    )


@pytest.fixture(scope="module")
def made(task):
    return {name: DESIGNS[name](task, Context()) for name in QUICK}


@pytest.mark.slow
def test_every_controller_stabilises(task, made):
    for name, K in made.items():
        assert performance_peak(task.plant, K) is not None, name


@pytest.mark.slow
def test_each_method_is_best_at_its_own(task, made):
    def mean_square(K):
        return control.norm(task.quadratic.close(K), 2, print_warning=False)

    def stack(K):
        s = 1j * np.geomspace(1e-4, 1e4, 4000)
        S = 1 / (1 + G(s) * SENSOR(s) * K(s))
        return np.hypot(abs(W_P(s) * S), W_U * abs(K(s) * S)).max()

    def full(K):
        return min(size(task.full_block_plant(each).close(K)) for each in task.sizes)

    def mixed(K):
        return MuSynthesis(task.regular).certified_peak(K).upper

    best = {
        "LQG": (mean_square, 1e-3),
        "mixed sensitivity": (stack, 5e-3),
        "full block": (full, 3e-2),
    }
    for name, (criterion, slack) in best.items():
        values = {each: criterion(K) for each, K in made.items()}
        assert values[name] <= min(values.values()) * (1 + slack), (name, values)
    assert mixed(made["fixed order"]) < mixed(made["reference"])


def test_the_full_block_plant_scales_its_perturbation(task):
    omega = np.array([0.1, 1.0, 10.0])
    one, two = (task.full_block_plant(size).response(omega) for size in (1.0, 2.0))
    np.testing.assert_allclose(two[:, :2, 2:], 2 * one[:, :2, 2:], rtol=1e-9)
    np.testing.assert_allclose(two[:, 2:, :2], one[:, 2:, :2] / 2, rtol=1e-9)
    np.testing.assert_allclose(two[:, :2, :2], one[:, :2, :2], rtol=1e-9)


def test_a_plant_without_perturbation_is_refused(task):
    with pytest.raises(InputError, match="no perturbation"):
        replace(task, plant=task.plant.nominal())
