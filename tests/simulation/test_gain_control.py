"""A gain that a wobble brings to a crossover, on a motor that has nothing to do with CD drives."""

import control
import numpy as np
import pytest

from workbench._core.compiled import compiled
from workbench.errors import InputError
from workbench.simulation import (
    Cascade,
    Part,
    SampledLoop,
    automatic_gain_control,
    linear_controller,
    play,
    sampled_model,
)

PERIOD, CORNER, FREQUENCY = 1e-3, 2000.0, 8.0
SETTINGS = {"interval": (0.2, 6.0), "detection": 0.1, "adaptation": 0.6}
K = control.tf([0.02, 1.0], [0.002, 1.0])


@compiled
def error(position, exogenous, parameters, signals):
    signals[0] = exogenous[0] - position[0]


@compiled
def as_is(channels, parameters, measurement):
    measurement[:] = channels


def motor(gain):
    """Angle of a motor per voltage: an integrator and a lag."""
    return gain * control.ss([[0.0, 1.0], [0.0, -20.0]], [[0.0], [20.0]], [[1.0, 0.0]], 0.0)


def adapted(gain, noise=0.0, reference=0.0, seed=0, **changed):
    """Trajectory of a loop with a plant of some gain."""
    wide = np.array([[0.0, -1e3, 1e3]])
    loop = SampledLoop(
        plant=motor(gain), positions=1, sense=error, sense_parameters=np.zeros(0), signals=1,
        corner=CORNER, read=as_is, read_parameters=np.zeros(0), measurements=1,
        channel_levels=wide, output_levels=wide, dt=PERIOD,
    )  # fmt: skip
    control_gain = automatic_gain_control(FREQUENCY, 0.1, PERIOD, **(SETTINGS | changed))
    law = Cascade(
        ["e"],
        [
            Part("gain control", control_gain, ["e"], outputs=["fed", "gain"]),
            Part("K", linear_controller(K, PERIOD), ["fed"], outputs=["u"]),
        ],
    )
    time = np.arange(7001) * PERIOD
    exogenous = (reference * np.sin(2 * np.pi * 1.0 * time))[:, None]
    noises = noise * np.random.default_rng(seed).standard_normal((7000, 1))
    return loop.run(law, np.zeros((7000, 1)), exogenous, noises)


def loop_gain(gain):
    """|L| at the wobble's frequency of the sampled loop whose gain g is 1, by its model."""
    optics = control.ss(-CORNER, CORNER, 1.0, 0.0)
    law = control.sample_system(control.ss(K), PERIOD, "bilinear")
    L = sampled_model(optics * motor(gain), PERIOD) * law
    return abs(complex(L(np.exp(2j * np.pi * FREQUENCY * PERIOD))))


@pytest.mark.parametrize("gain", [40.0, 90.0, 250.0])
def test_the_loop_crosses_at_the_wobble_whatever_the_gain(gain):
    """The reference is the model's loop, which the gain control does not know."""
    run = adapted(gain)
    final = run.signals["gain"][-1]
    assert final * loop_gain(gain) == pytest.approx(1.0, abs=0.01)
    assert abs(np.log(loop_gain(gain))) > 0.06  # there was something to remove


def test_it_keeps_its_gain_outside_of_the_interval():
    gain = adapted(40.0).signals["gain"]
    settled = 0.2 + 3 * SETTINGS["detection"]
    assert (gain[: round(settled / PERIOD)] == 1.0).all()
    assert np.ptp(gain[round(6.0 / PERIOD) :]) == 0.0


def test_noise_and_a_moving_reference_disturb_it_little():
    quiet, noisy = adapted(40.0), adapted(40.0, noise=0.05, reference=0.2, seed=3)
    ratio = noisy.signals["gain"][-1] / quiet.signals["gain"][-1]
    assert ratio == pytest.approx(1.0, abs=0.05)
    assert ratio != 1.0


def test_it_stays_within_its_largest_gain():
    gain = adapted(40.0, most=1.2).signals["gain"]
    assert gain.max() == pytest.approx(1.2)


def test_a_dead_error_does_no_harm():
    fed = play(automatic_gain_control(FREQUENCY, 0.1, PERIOD, **SETTINGS), np.zeros((1000, 1)))
    assert np.isfinite(fed).all() and (fed[:, 1] == 1.0).all()


@pytest.mark.parametrize(
    "wrong",
    [
        {"frequency_hz": 500.0},
        {"frequency_hz": 0.0},
        {"amplitude": 0.0},
        {"most": 1.0},
        {"interval": (2.0, 1.0)},
        {"interval": (-1.0, 1.0)},
        {"detection": 1.0},
        {"detection": 0.0},
        {"adaptation": np.nan},
    ],
)
def test_wrong_settings_are_named(wrong):
    first = {"frequency_hz": FREQUENCY, "amplitude": 0.1, "dt": PERIOD}
    with pytest.raises(InputError, match=r"need"):
        automatic_gain_control(**(first | SETTINGS | wrong))
