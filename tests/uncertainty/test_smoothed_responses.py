"""Responses smoothed over lines: less noise, and regions that contain the plants nevertheless."""

import numpy as np
import pytest

from workbench.errors import InputError
from workbench.uncertainty import Responses, smoothed_responses
from workbench.uncertainty.responses.ratios import Ratios
from workbench.uncertainty.responses.regions import region_radius

OMEGA = np.geomspace(0.1, 10.0, 50)
SEEDS = range(6)


def ringing(omega):
    """Plants with a delay and a resonance of a width of 6 %."""
    s, tone = 1j * np.asarray(omega)[:, None], np.array([2.0, 2.3, 2.7])
    return np.exp(-0.1 * s) / (2 * s + 1) / (s**2 / tone**2 + 0.06 * s / tone + 1)


def measured(noise, seed, **more):
    rng = np.random.default_rng(seed)
    exact = ringing(OMEGA)
    error = rng.standard_normal((2, *exact.shape)) / np.sqrt(2)
    size = noise * np.abs(exact)
    return Responses(
        omega=OMEGA, values=exact + size * (error[0] + 1j * error[1]), variance=size**2, **more
    )


@pytest.mark.cases(3)
@pytest.mark.parametrize("noise", [0.003, 0.03, 0.15])
def test_regions_are_smaller_and_contain_the_plants(noise):
    inside, smaller = [], []
    for seed in SEEDS:
        lines = measured(noise, seed)
        smooth = smoothed_responses(lines)
        radius = region_radius(smooth, 0.99)
        inside.append(np.abs(smooth.values - ringing(OMEGA)) <= radius)
        smaller.append(np.median(radius / region_radius(lines, 0.99)))
    assert np.mean(inside) > 0.975
    assert np.mean(smaller) < 0.7


def test_a_plant_that_no_model_follows_keeps_its_distance():
    """Deviations from line to line that the variance does not explain are not averaged away."""
    rng = np.random.default_rng(1)
    uneven = ringing(OMEGA) * (1 + 0.1 * rng.standard_normal((OMEGA.size, 3)))
    smooth = smoothed_responses(Responses(omega=OMEGA, values=uneven, variance=1e-12))
    missed = np.abs(smooth.values - uneven) / np.abs(uneven)
    left = np.sqrt(smooth.variance) / np.abs(smooth.values)
    assert np.sqrt(np.mean(left**2)) > 0.8 * np.sqrt(np.mean(missed**2)) > 0.03


def test_covariances_of_ratios_shrink_alike():
    lines = measured(0.05, 3)
    joint = np.zeros((*lines.values.shape, 2, 2), complex)
    joint[..., 0, 0] = lines.variance
    both = measured(0.05, 3, ratios=Ratios(joint, np.ones(3)), degrees=40)
    smooth = smoothed_responses(both)
    assert smooth.ratios.joint[..., 0, 0].real == pytest.approx(smooth.variance)
    assert np.isfinite(region_radius(smooth, 0.99)).all()


def test_lonely_and_missing_lines_stay():
    omega = np.geomspace(0.1, 10.0, 9)  # a factor of 1.8 apart
    values = 1 / (1j * omega[:, None] + [1.0, 1.2])
    lonely = Responses(omega=omega, values=values, variance=1e-4)
    assert np.array_equal(smoothed_responses(lonely).values, values)
    present = np.ones((OMEGA.size, 3), bool)
    present[20, 1] = False
    lines = measured(0.05, 2, present=present)
    smooth = smoothed_responses(lines)
    assert np.array_equal(smooth.present, present)
    assert smooth.values[20, 1] == lines.values[20, 1]
    exact = Responses(omega=omega, values=values)
    assert smoothed_responses(exact) is exact


def test_corners_of_regions_are_refused():
    with pytest.raises(InputError, match="corners of confidence regions"):
        smoothed_responses(
            Responses(omega=[1.0, 2.0], values=np.ones((2, 12)), confidence=0.9, degrees=3)
        )
