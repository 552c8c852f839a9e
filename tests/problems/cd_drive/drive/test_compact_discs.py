"""A CD's rotation, data rates and the loop of its tracking error, by other ways."""

import control
import numpy as np
import pytest
from workbench.plants.cd_drive.drive import compact_discs, tables

from workbench import load, solve
from workbench.errors import InputError


def test_rotation():
    """One revolution at 25 mm is 157 mm of track."""
    found = compact_discs.rotations()
    assert found["start"] == pytest.approx(1.3 / 0.15708, rel=1e-5)
    assert found["lead_in"] / found["end"] == pytest.approx(58 / 23)


def test_data():
    """44,100 samples of 4 bytes a second, with 8 of 32 bytes for the error code; 75 sectors."""
    bits = compact_discs.coded_bits_per_mm()
    assert bits["slow"] == pytest.approx(44100 * 4 * 8 * 32 / 24 / 1200)
    assert bits["fast"] / bits["slow"] == pytest.approx(1.2 / 1.4)
    assert compact_discs.user_data_rate() == pytest.approx(75 * 2048 / 1024)


def test_tracking_loop():
    """Against python-control: 0 dB at 200 Hz, a stable loop, the same sensitivity."""
    disc = tables.compact_disc()
    zero, pole, at = (
        2 * np.pi * f
        for f in (disc.tracking_lead_zero, disc.tracking_lead_pole, disc.tracking_crossover)
    )
    s = control.tf("s")
    shape = (1 + s / zero) / (s**2 * (1 + s / pole))
    loop = shape / abs(shape(1j * at))
    assert (control.feedback(1, loop).poles().real < 0).all()
    frequency = np.geomspace(100.0, 10e3, 50)
    expected = abs(control.feedback(1, loop)(2j * np.pi * frequency))
    np.testing.assert_allclose(compact_discs.tracking_sensitivity(frequency), expected, rtol=1e-9)
    assert compact_discs.largest_tracking_sensitivity() == pytest.approx(1.239, abs=1e-3)
    with pytest.raises(InputError, match=r"contains 0\.0"):
        compact_discs.tracking_sensitivity([0.0])


def test_problem_tells_them():
    study = load("cd/red-book", frequencies=20)
    metrics = study.metrics(solve(study).answer)
    assert metrics["rotation_lead_in_hz"] == pytest.approx(9.0, abs=0.01)
    assert 2.5 * metrics["coded_bits_per_mm_slow"] == pytest.approx(3920)
    assert metrics["user_data_kib_per_s"] == pytest.approx(150)
    assert metrics["largest_tracking_S"] == pytest.approx(1.239, abs=1e-3)
