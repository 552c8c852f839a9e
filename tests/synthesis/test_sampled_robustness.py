"""A sampled controller around an uncertain continuous plant: what breaks the loop, and what not."""

from dataclasses import replace

import control
import numpy as np
import pytest
from lanes import thinned

from workbench.errors import InputError
from workbench.mu import robust_stability
from workbench.second_opinion.implemented.held_plants import _held
from workbench.synthesis import sampled_robustness
from workbench.uncertainty import UncertaintyModel, delay, dynamics, feedback, real, tf

T = 1.0
PLANT = tf([1], [1, 1]) * (1 + 0.5 * dynamics("d", 1, 1))
K = control.tf([1.5], [1], T)


def all_pass(gain, *sections):
    found = control.ss([], [], [], [[gain]])
    for a, b in sections:
        found = found * control.ss(control.tf([1, -a, b], [1, a, b]))
    return found


def radius(plant, Delta, K, period):
    """Largest modulus of a pole of the loop, sampled exactly."""
    sampled = control.sample_system(plant.at(d=Delta), period, "zoh")
    return np.abs(control.feedback(sampled * K, 1).poles()).max()


@pytest.mark.cases(0)
def test_the_margin_of_the_discretised_plant_is_no_margin():
    """Dynamics between both margins break the loop; those below are borne."""
    sampled = control.sample_system(control.tf([1], [1, 1]), T, "zoh")
    wrong = robust_stability(feedback(UncertaintyModel(sampled, control.tf([0.5], [1], T)) * K, 1))
    found = sampled_robustness(PLANT, K, T)
    assert found.lower == pytest.approx(found.upper, rel=2e-3)
    section = (0.36463, 17.629)  # found by search for the largest pole
    assert radius(PLANT, all_pass(0.999 * found.lower, section), K, T) < 1
    assert radius(PLANT, all_pass(1.005 * found.upper, section), K, T) > 1
    assert 1.005 * found.upper < 0.97 * wrong.lower
    assert "between the samples too" in repr(found)


@pytest.mark.cases(1)
@pytest.mark.parametrize("seed", thinned(range(10), 5))
def test_no_dynamics_below_the_margin_break_the_loop(seed):
    rng = np.random.default_rng(seed)
    period = rng.choice([0.2, 1.0])
    G, d = tf([2], [1, 0.8, 2]), dynamics("d", 1, 1) * control.tf([1, 0.1], [1, 2])
    plant = G * (1 + d) if seed % 2 else feedback(G, d)
    K = control.tf([0.3, -0.2], [1, -1], period)
    found = sampled_robustness(plant, K, period)
    for _ in range(20):
        sections = np.exp(rng.uniform(-4, 5, (rng.integers(1, 4), 2)))
        Delta = all_pass(found.lower * rng.choice([-1, 1]), *sections)
        assert radius(plant, Delta, K, period) < 1


@pytest.mark.cases(1)
@pytest.mark.parametrize("form", ["additive", "multiplicative", "inverse"])
def test_fast_sampling_gives_the_margin_of_the_continuous_loop(form):
    G, d = tf([1], [1, 1, 1]), control.tf([0.3], [0.2, 1]) * dynamics("d", 1, 1)
    plant = {"additive": G + d, "multiplicative": G * (1 + d), "inverse": feedback(G, d)}[form]
    continuous = robust_stability(feedback(plant * control.tf([2], [1]), 1))
    found = sampled_robustness(plant, control.tf([2], [1], 1e-3), 1e-3)
    assert found.upper == pytest.approx(continuous.lower, rel=5e-3)
    assert found.lower == pytest.approx(continuous.lower, rel=5e-3)


@pytest.mark.cases(0)
def test_a_computers_delay_costs_margin_and_the_sign_is_that_of_the_loop():
    K = control.tf([0.4], [1, -1], 0.2)
    margins = [
        sampled_robustness(PLANT, K, 0.2, delay_samples=delay).lower for delay in (0.0, 0.5, 1.0)
    ]
    assert margins[0] > margins[1] > margins[2]
    assert sampled_robustness(PLANT, -K, 0.2, sign=1).lower == pytest.approx(margins[0], rel=1e-9)


@pytest.mark.cases(0)
def test_models_of_circles_are_plants_too_and_tiny_uncertainty_is_borne_without_end():
    model = UncertaintyModel(control.tf([1], [1, 1]), control.tf([0.5], [1]))
    assert sampled_robustness(model, K, T).lower == pytest.approx(
        sampled_robustness(PLANT, K, T).lower, rel=1e-6
    )
    tiny = tf([1], [1, 1]) * (1 + 1e-12 * dynamics("d", 1, 1))
    assert sampled_robustness(tiny, K, T).lower == np.inf


@pytest.mark.parametrize(
    ("plant", "changes", "words"),
    [
        (tf([1], [1, 1]) + real("k", 1, percent=10), {}, "elements are k"),
        (control.tf([1], [1, 1]), {}, "elements are none"),
        (PLANT * (1 + dynamics("e", 1, 1)), {}, "elements are"),
        (tf([1], [1, 1]) + dynamics("d", 1, 1), {}, "roll-off"),
        (PLANT * delay("tau", 0, 1e-3), {}, "elements are"),
        (dynamics("d", 2, 2) @ np.ones((2, 1)) * control.tf([1], [1, 1]), {}, "elements are d"),
        (PLANT, {"controller": control.tf([1], [1], 0.5)}, "dt = 0.5"),
        (PLANT, {"controller": control.tf([9.0], [1], T)}, "nominal loop is unstable"),
        (PLANT, {"controller": control.ss([], [], [], np.eye(2), T)}, "2 outputs"),
        (PLANT, {"sign": 2}, "sign is 2"),
        (PLANT, {"dt": 0.0}, "dt"),
        (PLANT, {"delay_samples": -1}, "delay_samples is -1"),
        (tf([0.1], [1e-9, 1]) * (1 + 0.5 * dynamics("d", 1, 1)), {}, "sample faster"),
        (feedback(control.tf([0.1], [1, -0.5], T), dynamics("d", 1, 1)), {}, "continuous time"),
    ],
)
@pytest.mark.filterwarnings("ignore:the sampling time:workbench.errors.RangeWarning")
def test_bad_input_is_named(plant, changes, words):
    given = {"controller": K, "dt": T} | changes
    with pytest.raises(InputError, match=words):
        sampled_robustness(plant, **given)


@pytest.mark.cases(1)
@pytest.mark.parametrize("late", [0.0, 0.3, 1.0, 1.6])
def test_loops_in_time_refute_a_margin_that_is_too_large(late):
    found = sampled_robustness(PLANT, control.tf([0.4], [1, -1], 0.2), 0.2, delay_samples=late)
    assert found.holds, found.certificate.failures
    (check,) = found._checked_by[0].second_opinion(replace(found, lower=2 * found.upper))
    assert not check.holds


def test_a_held_plant_is_what_python_control_makes_of_it():
    plant = control.ss(control.tf([2], [1, 0.8, 2]))
    matrices = plant.A, plant.B, plant.C, plant.D
    A, B, C, D = _held(matrices, 0.2, 0.0)
    held = control.ss(A, B, C, D, 0.2)
    omega = np.array([0.1, 1.0, 10.0])
    exact = control.sample_system(plant, 0.2, "zoh")(np.exp(0.2j * omega))
    np.testing.assert_allclose(held(np.exp(0.2j * omega)), exact, rtol=1e-9)
    A, B, C, D = _held(matrices, 0.2, 2.0)
    late = control.ss(A, B, C, D, 0.2)(np.exp(0.2j * omega))
    np.testing.assert_allclose(late, exact * np.exp(-0.4j * omega), rtol=1e-9)
