"""What a nonlinear plant answers at silent lines widens the regions at excited ones."""

import numpy as np
import pytest

from workbench.identification.responses.of_records import excited, record_responses
from workbench.identification.responses.silent_lines import distortion, unexplained

SAMPLES, PERIODS = 2000, 4
LINES = np.unique(np.geomspace(1, 200, 40).round().astype(int))


def record(rng, cubic: float, noise: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Input, output of y = x + cubic (x^2 + x^3) with a lag before it, and the lag's response."""
    phase = rng.uniform(0, 2 * np.pi, LINES.size)
    time = np.arange(SAMPLES)
    u = np.cos(2 * np.pi * np.outer(time, LINES) / SAMPLES + phase).sum(axis=1)
    u /= u.std()
    turn = np.exp(-2j * np.pi * np.arange(SAMPLES // 2 + 1) / SAMPLES)
    G = 0.2 / (1 - 0.8 * turn)
    x = np.fft.irfft(G * np.fft.rfft(u), SAMPLES)
    y = x + cubic * (x**2 + x**3 - 3 * x.var() * x)
    u, y = np.tile(u, PERIODS), np.tile(y, PERIODS)
    return u, y + noise * rng.standard_normal(y.size), G[LINES]


def inside(cubic: float, seed: int) -> tuple[float, float]:
    """Share of lines whose true response lies in its 95 % region, and the regions' median size."""
    rng = np.random.default_rng(seed)
    shares, sizes = [], []
    for _ in range(10):
        u, y, truth = record(rng, cubic, 1e-3)
        (found,), _ = record_responses([(u, y)], 1.0, 500)
        known = np.isin(LINES, np.round(found.frequency_hz * SAMPLES))
        away = np.abs(found.response[:, 0, 0] - truth[known])
        shares.append(np.mean(away <= found.radius(confidence=0.95)[:, 0, 0]))
        sizes.append(np.median(found.radius(confidence=0.95)[:, 0, 0] / np.abs(truth[known])))
    return float(np.mean(shares)), float(np.median(sizes))


def test_regions_count_the_distortion_of_a_nonlinear_plant():
    linear, small = inside(0.0, 1)
    bent, large = inside(0.05, 2)
    assert linear > 0.9 and bent > 0.9
    assert large > 5 * small


def shares(rng, cubic: float, noise: float) -> np.ndarray:
    """Power of the input that would cause the distortion at every excited line."""
    u, y, _ = record(rng, cubic, noise)
    U, Y = (np.fft.rfft(x.reshape(PERIODS, SAMPLES)).T for x in (u, y))
    return distortion(unexplained(U, Y, LINES), U, Y, LINES, LINES)


def test_a_controller_makes_the_input_small_but_not_the_distortion():
    """An integrator behind a bent valve, held by a controller as its record is taken."""
    rng, inside = np.random.default_rng(6), []
    for _ in range(10):
        phase, y = rng.uniform(0, 2 * np.pi, LINES.size), 0.0
        wave = np.cos(2 * np.pi * np.outer(np.arange(SAMPLES), LINES) / SAMPLES + phase).sum(axis=1)
        u, own = np.empty((PERIODS + 1) * SAMPLES), np.empty((PERIODS + 1) * SAMPLES)
        for k in range(u.size):
            u[k], own[k] = wave[k % SAMPLES] - 0.05 * y, y
            y += u[k] + 0.1 * abs(u[k])
        u, own = u[SAMPLES:], own[SAMPLES:] + 1e-3 * rng.standard_normal(PERIODS * SAMPLES)
        (found,), _ = record_responses([(u, own)], 1.0, 500)
        truth = 1 / (np.exp(2j * np.pi * found.frequency_hz) - 1)
        away = np.abs(found.response[:, 0, 0] - truth)
        inside.append(away[:8] <= found.radius(confidence=0.95)[:8, 0, 0])
    assert np.mean(inside) > 0.8


def test_noise_is_no_distortion():
    rng = np.random.default_rng(3)
    assert np.mean(shares(rng, 0.0, 1e-2) > 0) < 0.1
    assert (shares(rng, 0.05, 1e-3) > 0).all()


def test_noise_of_neighbours_counts_as_well_known():
    """Few periods at one line tell noise badly: a region of 99 % would be thrice as wide."""
    u, y, truth = record(np.random.default_rng(4), 0.0, 1e-2)
    (found,), _ = record_responses([(u, y)], 1.0, 500)
    assert found.degrees >= 40
    assert (
        np.mean(np.abs(found.response[:, 0, 0] - truth) <= found.radius(confidence=0.99)[:, 0, 0])
        > 0.97
    )


@pytest.mark.parametrize("weak", [1e-5, 0.01])
def test_a_line_far_weaker_than_its_neighbours_is_not_excited(weak):
    U = np.zeros((400, 3), complex)
    U[LINES[LINES < 390]] = 1.0
    U[150:160] = np.where(U[150:160] == 0, weak, U[150:160])
    assert excited(U).tolist() == LINES[LINES < 390].tolist()


def test_lines_that_fall_slowly_with_frequency_are_all_excited():
    U = np.repeat(1.0 / np.arange(1, 400)[:, None], 3, axis=1)
    assert excited(np.vstack([np.zeros((1, 3)), U])).size == 398


def test_a_resonance_between_the_lines_of_periods_is_told():
    """Lines stand some per cent apart; this resonance is as wide as a tenth of that."""
    rng = np.random.default_rng(5)
    phase, time = rng.uniform(0, 2 * np.pi, LINES.size), np.arange(SAMPLES)
    u = np.cos(2 * np.pi * np.outer(time, LINES) / SAMPLES + phase).sum(axis=1)
    turn = np.arange(SAMPLES // 2 + 1) / SAMPLES
    for damping, told in ((0.002, True), (0.3, False)):
        s = 1j * turn / (LINES[30] / SAMPLES)
        y = np.fft.irfft(np.fft.rfft(u) / (1 + 2 * damping * s + s**2), SAMPLES)
        records = [(np.tile(u, 4), np.tile(y, 4) + 1e-3 * rng.standard_normal(4 * SAMPLES))]
        _, said = record_responses(records, 1.0, 500)
        assert ("narrower than the distance" in said) == told
