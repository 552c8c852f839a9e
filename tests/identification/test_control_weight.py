"""The choice of a model for control: errors count around the bandwidth."""

import numpy as np
import pytest
from scipy.signal import freqz, lfilter

from workbench import solve
from workbench.errors import InputError
from workbench.identification import StateSpaceFit
from workbench.identification.experiments.several import Experiments
from workbench.identification.innovations.model import InnovationsModel
from workbench.identification.state_space.control_weight import control_fit, control_weight


def record(samples=1500, seed=0):
    """A slow mode of great gain and a fast resonance of small gain, with noise."""
    rng = np.random.default_rng(seed)
    u = rng.standard_normal(samples)
    slow = lfilter([0.0, 0.02], [1.0, -0.98], u)
    ring = lfilter([0.0, 0.02], [1.0, -2 * 0.97 * np.cos(1.2), 0.97**2], u)
    return u[:, None], (10 * slow + ring + 0.02 * rng.standard_normal(samples))[:, None]


def test_the_weight_is_sensitivity_times_its_complement():
    b, a = control_weight(5.0, 0.01)
    f, found = freqz(b, a, worN=np.array([0.05, 5.0, 20.0]), fs=100.0)
    assert abs(found[1]) == pytest.approx(0.5)
    s = 2j / 0.01 * np.tan(np.pi * f * 0.01)
    loop = 2 / 0.01 * np.tan(np.pi * 5.0 * 0.01) / s
    np.testing.assert_allclose(found, loop / (1 + loop) ** 2, rtol=1e-9)


def test_errors_far_from_the_bandwidth_do_not_count():
    u, y = record()
    n = np.arange(len(u))
    still = InnovationsModel(
        np.zeros((1, 1)), np.zeros((1, 1)), np.zeros((1, 1)), np.zeros((1, 1)), np.zeros((1, 1)),
        np.zeros(1), np.zeros(1),
    )  # fmt: skip
    sines = [np.sin(2 * np.pi * f * n)[:, None] for f in (0.002, 0.1)]
    exact = InnovationsModel(
        np.zeros((1, 1)), np.zeros((1, 1)), np.zeros((1, 1)), np.ones((1, 1)), np.zeros((1, 1)),
        np.zeros(1), np.zeros(1),
    )  # fmt: skip
    near = control_fit(exact, Experiments(sines[1], sines[0] + sines[1]), 50, 0.1)
    far = control_fit(exact, Experiments(sines[1], sines[0] + sines[1]), 50, 0.002)
    assert near[0] > 90 and far[0] < 30
    assert control_fit(still, Experiments(u, y), 50, 0.1)[0] == pytest.approx(0.0, abs=0.5)


@pytest.mark.cases(0)
def test_the_simulator_is_chosen_for_the_bandwidth_and_its_runner_up_named():
    u, y = record()
    slow = StateSpaceFit(u, y, orders=(1,), bandwidth_hz=0.19)
    both = StateSpaceFit(u, y, orders=(1, 3), bandwidth_hz=0.19)
    low, high = (solve(each, method="best") for each in (slow, both))
    assert high.certificate.holds, high.certificate.failures
    assert high.answer.simulator.order >= 3
    own = both.metrics(high.answer)["fit_control_y1"]
    assert own > slow.metrics(solve(slow, method="prediction-error").answer)["fit_control_y1"] + 20
    facts = " ".join(high.certificate.facts)
    assert "design a loop of 0.19 Hz" in facts and "runner-up" in facts and "+-" in facts
    assert "fit_control_y1" not in StateSpaceFit(u, y, orders=(1,)).metrics(low.answer)


def test_orders_of_one_kind_are_chosen_for_the_bandwidth_too():
    u, y = record()
    program = StateSpaceFit(u, y, orders=(1, 3), bandwidth_hz=0.19)
    answer = solve(program, method="prediction-error").answer
    assert answer.simulator.order == 3
    np.testing.assert_allclose(
        answer.scores[1, 1],
        np.mean([
            control_fit(_fitted(program, used), left, program.washout_samples, 0.19)
            for used, left in program.folds
        ], axis=0),
    )  # fmt: skip


def _fitted(program, used):
    from workbench.identification.state_space.methods import SubspaceStarts, refined_fits

    return refined_fits(program, SubspaceStarts(program), 1.0)(3)(used)


@pytest.mark.parametrize("bandwidth", [0.0, -1.0, 0.5, np.nan, "1", True])
def test_a_bandwidth_that_is_none_is_refused(bandwidth):
    u, y = record(300)
    with pytest.raises(InputError, match="bandwidth"):
        StateSpaceFit(u, y, orders=(1,), bandwidth_hz=bandwidth)
