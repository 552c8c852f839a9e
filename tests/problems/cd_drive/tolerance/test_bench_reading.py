"""Readings of the bench: the natural one is the laboratory as it is, and others change it."""

from dataclasses import replace

import pytest
from workbench.plants.cd_drive.laboratory.bench_setup import NOISE
from workbench.plants.cd_drive.laboratory.experiment import Laboratory
from workbench.plants.cd_drive.tolerance.bench_reading import BenchReading


@pytest.mark.parametrize("axis", ["focus", "radial"])
def test_the_natural_reading_is_the_laboratory(axis):
    read = BenchReading().laboratory(axis, "CD6")
    assert read == replace(Laboratory(axis, "CD6"), noise=NOISE[axis])


def test_other_readings_change_gain_delay_and_noise():
    read = BenchReading("agc", 0.5, "peak", "volts").laboratory("focus", "CD6")
    assert read.gain == "agc" and read.delay == 0.5
    # CD6 has the least light, so its noise is more than a third of 0.15 um.
    assert read.noise > 1.5 * NOISE["focus"] / 3


def test_a_quiet_bench_has_no_noise():
    read = BenchReading(noise_fixed="volts").laboratory("focus", "CD6", noisy=False, refine=2)
    assert (read.noise, read.electronics, read.refine) == (0.0, 0.0, 2)
