"""First choices of a design: what limits the bandwidth is found and named."""

import numpy as np
import pytest

from workbench.errors import InputError
from workbench.fitting import Rational
from workbench.starter import first_choices
from workbench.starter.first_choices import EFFORT, _phase
from workbench.uncertainty import Responses

OMEGA = np.geomspace(1.0, 1e4, 60)
S = 1j * OMEGA[:, None]
SPREAD = np.random.default_rng(4).uniform(-1, 1, (2, 6))


def plants(values, **given) -> Responses:
    return Responses(omega=OMEGA, values=values * np.ones(6), **given)


def test_delay_limits_a_plant_that_is_known_well():
    chosen = first_choices(plants((1 + 0.02 * SPREAD[0]) / (S + 1)), dt=0.01, delay_samples=1.0)
    assert chosen.bandwidth_hz * 2 * np.pi == pytest.approx(0.35 / 0.015, rel=0.05)
    assert "hold and delay" in chosen.reasons["bandwidth_hz"]
    assert (chosen.order, chosen.unstable_poles) == (1, 0)


@pytest.mark.cases(0)
def test_what_is_not_known_limits_it():
    unknown = 1 + SPREAD[0] * np.minimum(OMEGA / 100, 1.5)[:, None]
    chosen = first_choices(plants(unknown / (S + 1)), dt=1e-5)
    assert chosen.bandwidth_hz * 2 * np.pi < 80
    assert "differ by" in chosen.reasons["bandwidth_hz"]


def test_a_zero_right_of_the_axis_limits_it():
    chosen = first_choices(
        plants((1 + 0.02 * SPREAD[0]) * (S - 30) / (S + 1) / (S + 3000)), dt=1e-5
    )
    assert chosen.bandwidth_hz * 2 * np.pi == pytest.approx(10, rel=0.1)
    assert "zero right of the axis" in chosen.reasons["bandwidth_hz"]


@pytest.mark.cases(0)
def test_an_unstable_plant_is_seen_and_needs_a_bandwidth():
    pole = 100 * (1 + 0.03 * SPREAD[0])
    unstable = plants(1e4 / (S**2 - pole**2))
    chosen = first_choices(unstable, dt=1e-5)
    assert chosen.unstable_poles == 1
    assert chosen.overshoot == 0.1 and "a filter of the set-point" in chosen.reasons["overshoot"]
    assert chosen.bandwidth_hz * 2 * np.pi > 200
    slower = first_choices(unstable, dt=1e-5, at_most_hz=8.0)  # W_e may be slower than the pole
    assert slower.bandwidth_hz == 8.0
    assert slower.effort == pytest.approx(EFFORT * 0.2, rel=0.1)  # |G| at twice the pole
    assert "twice the unstable pole" in slower.reasons["effort"]
    with pytest.raises(InputError, match=r"an unstable pole of 100 rad/s needs a bandwidth of"):
        first_choices(unstable, dt=0.01)


def test_a_gain_that_spreads_evenly_is_known_about_its_middle():
    gain = np.array([0.4, 0.7, 1.0, 1.3, 1.6, 1.9])  # 65 % about 1.15, 90 % about the mean 1
    chosen = first_choices(plants(gain / (S + 1)), dt=0.01)
    assert "hold and delay" in chosen.reasons["bandwidth_hz"]


@pytest.mark.cases(0)
def test_plants_of_opposite_sign_have_no_nominal_there():
    gain = np.array([1.0, 1.0, 1.0, 1.0, 1.0, 1.0])
    opposite = plants(gain / (S + 1) * np.where(np.arange(6) < 3, 1, np.where(S.imag > 1e3, -1, 1)))
    chosen = first_choices(opposite, dt=1e-6)
    assert "differ by inf % from any nominal" in chosen.reasons["bandwidth_hz"]


def test_noise_narrows_the_band():
    values = (1 + 0.02 * SPREAD[0]) / (S + 1)
    noisy = plants(values, variance=np.full((60, 6), 1e-5**2 * 100), degrees=20)
    chosen = first_choices(noisy, dt=1e-4)
    assert chosen.band_hz[0] == pytest.approx(OMEGA[0] / 2 / np.pi)
    assert chosen.band_hz[1] < OMEGA[-1] / 2 / np.pi / 1.2
    assert "region is wider than half" in chosen.reasons["band_hz"]
    with pytest.raises(InputError, match="noise hides a plant at 60 of 60 frequencies"):
        first_choices(plants(values, variance=100.0), dt=1e-4)


@pytest.mark.cases(0)
def test_a_band_goes_on_beyond_an_antiresonance_that_noise_hides():
    omega = np.geomspace(1.0, 300.0, 120)
    s = 1j * omega[:, None]
    zero, pole = 80.0 * (1 + 0.02 * SPREAD[0]), 160.0 * (1 + 0.02 * SPREAD[0])
    values = (s**2 / zero**2 + 0.01 * s / zero + 1) / (s**2 / pole**2 + 0.02 * s / pole + 1)
    values = values / (s + 3.0)
    rng = np.random.default_rng(3)
    noise = rng.normal(size=(*values.shape, 2)) @ [1, 1j] / np.sqrt(2)
    for size in (3e-4, 3e-2):
        seen = Responses(omega=omega, values=values + size * noise, variance=size**2, degrees=60)
        chosen = first_choices(seen, dt=1e-4)
        assert chosen.band_hz[1] > 160.0 / (2 * np.pi)
        assert "too, a plant's 95 % region" in chosen.reasons["band_hz"]


def test_a_line_that_noise_shows_by_chance_leads_no_band_on():
    values = (1 + 0.02 * SPREAD[0]) / (S + 1) ** 3
    variance = np.full(values.shape, 1e-6)
    variance[-4] = 1e-20  # one line at the end
    band = first_choices(plants(values, variance=variance, degrees=20), dt=1e-4).band_hz
    assert band[1] < OMEGA[-10] / (2 * np.pi)


def test_the_phase_counts_from_frequency_zero():
    omega = np.geomspace(0.01, 1e5, 200)
    for zeros, poles, start, end in (
        ([], [10.0, -10.0], -180, -180),
        ([5.0], [-1 + 3j, -1 - 3j], 0, -270),
        ([-5.0], [-1.0, -2.0], 0, -90),
        ([], [1 + 20j, 1 - 20j], -360, -180),
    ):
        found = np.degrees(_phase(Rational(zeros, poles, 1.0), omega))
        assert found[[0, -1]] == pytest.approx([start, end], abs=1)
        assert np.abs(np.diff(found)).max() < 90


@pytest.mark.parametrize(("spread", "kept"), [(0.12, False), (0.9, True)])
def test_noise_at_the_lowest_lines_does_not_limit_it(spread, kept):
    """A slow disturbance: the plants lie within 12 % there, as far as known within 72 %. Plants
    that differ themselves are kept, and limit the bandwidth."""
    low = OMEGA[:, None] < 3.0
    true = (1 + np.where(low, spread, 0.02) * np.linspace(-1, 1, 6)) / (S / 100 + 1)
    sigma = np.where(low, 0.28, 0.002) * np.abs(true)
    some = plants(true, variance=sigma**2)
    if kept:
        with pytest.raises(InputError, match=r"differ by .* below the first frequency"):
            first_choices(some, dt=1e-4)
        return
    chosen = first_choices(some, dt=1e-4)
    assert 2 * np.pi * chosen.band_hz[0] == pytest.approx(OMEGA[OMEGA > 3.0][0])
    assert "noise lets the plants differ by" in chosen.reasons["band_hz"]
    assert chosen.bandwidth_hz * 2 * np.pi > 100


@pytest.mark.parametrize("lag", [0.0, 0.2, 5.0])
def test_integrating_plants_are_recognised_within_their_regions(lag):
    """A pole that noise hides is told from no integrator; one that is seen is."""
    gains, rng = 1 + 0.1 * SPREAD[0], np.random.default_rng(8)
    truth = gains / ((S + lag) * (S / 300 + 1))
    error = rng.standard_normal(truth.shape) + 1j * rng.standard_normal(truth.shape)
    noisy = plants(
        truth + 0.1 * np.abs(truth) * error, variance=0.02 * np.abs(truth) ** 2, degrees=40
    )
    told = "behaves as an integrator down to 0.1592 Hz"
    assert (told in first_choices(noisy, dt=1e-3).reasons["order"]) == (lag < 1.0)


def test_a_slow_pole_that_is_seen_is_no_integrator():
    values = (1 + 0.1 * SPREAD[0]) / (S * (S / 300 + 1))
    assert "integrator" in first_choices(plants(values), dt=1e-3).reasons["order"]
    slow = plants(values * (S / 0.01) / (S / 0.01 + 1))  # a pole at 1 % of the lowest frequency
    assert "integrator" not in first_choices(slow, dt=1e-3).reasons["order"]
