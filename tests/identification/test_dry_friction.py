"""Dry friction is found at silent lines and taken out of the response."""

import control
import numpy as np
import pytest

from workbench.identification.responses.dry_friction import dry_friction, is_certain
from workbench.identification.responses.of_records import record_responses

SAMPLES, PERIODS, STEP = 1001, 4, 0.05
LINES = np.unique(np.geomspace(2, 150, 40).round().astype(int))
STIFFNESS, DAMPING = 1.0, 0.1


def truth() -> np.ndarray:
    """Response of the linear plant at all lines."""
    A = np.array([[1 - STEP**2 * STIFFNESS, STEP - STEP**2 * DAMPING], [-STEP, 1 - STEP * DAMPING]])
    plant = control.ss(A, [[STEP**2], [STEP]], [[1.0, 0.0]], 0, STEP)
    z = np.exp(2j * np.pi * LINES / SAMPLES)
    return np.asarray(plant(z, squeeze=True))


def record(force, *, noise: float = 1e-3, seed: int = 1) -> tuple[np.ndarray, np.ndarray]:
    """Input and position of a mass on a spring, with a force of position and velocity."""
    rng = np.random.default_rng(seed)
    phase, time = rng.uniform(0, 2 * np.pi, LINES.size), np.arange(SAMPLES)
    u = np.cos(2 * np.pi * np.outer(time, LINES) / SAMPLES + phase).sum(axis=1)
    u = np.tile(u / u.std(), PERIODS + 3)
    y, x, v = np.empty(u.size), 0.0, 0.0
    for k in range(u.size):
        y[k] = x
        v += STEP * (u[k] - STIFFNESS * x - DAMPING * v - force(x, v))
        x += STEP * v
    y += noise * rng.standard_normal(y.size)
    return u[3 * SAMPLES :], y[3 * SAMPLES :]


def friction(size: float):
    return lambda x, v: size * np.tanh(v / 0.02)


def spectra(u, y):
    return [np.fft.rfft(one.reshape(PERIODS, SAMPLES)).T for one in (u, y)]


@pytest.mark.parametrize("size", [0.1, 0.3])
def test_dry_friction_is_found_and_its_damping_taken_out(size):
    u, y = record(friction(size))
    found = dry_friction(*spectra(u, y), LINES, SAMPLES)
    assert found.size == pytest.approx(size, rel=0.2) and is_certain([found])
    U, Y = (one.mean(axis=1) for one in spectra(u, y))
    before, after = (
        np.abs(Y[LINES] / drive[LINES] / truth() - 1).max() for drive in (U, U - found.amplitudes)
    )
    assert after < before / 3


@pytest.mark.parametrize("size", [0.1, 0.3])
def test_regions_hold_the_plant_that_moves(size):
    u, y = record(friction(size))
    (found,), _ = record_responses([(u, y)], 1.0, 500)
    assert found.dry_friction == pytest.approx(size, rel=0.2)
    away = np.abs(found.response[:, 0, 0] - truth())
    assert (away <= found.radius(confidence=0.99)[:, 0, 0]).mean() > 0.9


@pytest.mark.parametrize(
    "force",
    [
        lambda x, v: 0.0,
        lambda x, v: 0.02 * x**3,
        lambda x, v: 0.02 * v**3,
        lambda x, v: 0.05 * x**2,
    ],
    ids=["linear", "stiffer spring", "cubic damping", "bent spring"],
)
def test_what_is_no_dry_friction_is_left(force):
    u, y = record(force)
    assert not is_certain([dry_friction(*spectra(u, y), LINES, SAMPLES)])
    (found,), _ = record_responses([(u, y)], 1.0, 500)
    assert found.dry_friction == 0.0


def test_friction_is_found_where_the_velocity_is_measured():
    u, y = record(friction(0.2), noise=0.0)
    velocity = np.fft.irfft(
        np.fft.rfft(y) * (1 - np.exp(-2j * np.pi * np.arange(y.size // 2 + 1) / y.size)) / STEP,
        y.size,
    )
    assert dry_friction(*spectra(u, velocity), LINES, SAMPLES).size == pytest.approx(0.2, rel=0.2)


def test_friction_is_found_where_the_output_counts_in_the_other_direction():
    u, y = record(friction(0.2))
    found, turned = (dry_friction(*spectra(u, one), LINES, SAMPLES) for one in (y, -y))
    assert turned.size == pytest.approx(found.size, rel=1e-9)


def test_records_of_one_kind_are_judged_together():
    """Of three plants one has no friction: the median decides, and its own size is taken out."""
    records = [record(friction(size), seed=seed) for seed, size in enumerate((0.2, 0.0, 0.2))]
    found, _ = record_responses(records, 1.0, 500)
    assert [one.dry_friction > 0.1 for one in found] == [True, False, True]
    found, _ = record_responses([records[0], records[1], records[1]], 1.0, 500)
    assert [one.dry_friction for one in found] == [0.0] * 3


def test_few_silent_lines_or_one_period_show_no_friction():
    u, y = record(friction(0.2))
    U, Y = spectra(u, y)
    assert dry_friction(U, Y, np.arange(2, 100), SAMPLES) is None
    assert dry_friction(U[:, :1], Y[:, :1], LINES, SAMPLES) is None
