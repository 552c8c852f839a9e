"""How the printed amplitude of the noise is read."""

import numpy as np
import pytest
from workbench.plants.cd_drive.drive.tables import drives
from workbench.plants.cd_drive.laboratory.bench_setup import NOISE
from workbench.plants.cd_drive.laboratory.closed_loop import closed_loop
from workbench.plants.cd_drive.laboratory.experiment import Laboratory
from workbench.plants.cd_drive.laboratory.linearity import linearity
from workbench.plants.cd_drive.laboratory.optical_gain import optical_gain
from workbench.plants.cd_drive.laboratory.printed_noise import position_noise


def test_the_natural_reading_is_the_laboratorys_own():
    assert position_noise("focus", "CD6") == NOISE["focus"]
    assert position_noise("radial", "nominal") == NOISE["radial"]


def test_an_amplitude_is_the_end_of_a_distribution_or_three_deviations():
    drawn = np.random.default_rng(0).uniform(-NOISE["focus"], NOISE["focus"], 100_000)
    assert position_noise("focus", "CD1", "uniform") == pytest.approx(drawn.std(), rel=0.01)
    assert position_noise("focus", "CD1", "peak") == pytest.approx(NOISE["focus"] / 3)


def test_drives_with_equal_volts_have_noise_in_inverse_proportion_to_their_light():
    sizes = [position_noise("focus", one.name, fixed="volts") for one in drives("focus")]
    volts = [one.K_opt * size for one, size in zip(drives("focus"), sizes, strict=True)]
    assert np.allclose(volts, volts[0], rtol=1e-12)
    assert drives("focus")[int(np.argmax(sizes))].name == "CD6"
    assert np.median(sizes) == pytest.approx(NOISE["focus"], rel=0.02)


def test_the_laboratory_takes_it():
    size = position_noise("focus", "CD1", "peak")
    record = Laboratory("focus", "CD1", noise=size, electronics=0.0, bits=None).open_loop(
        np.zeros(7000), seed=1
    )
    in_metres = record.f_en.std() / Laboratory("focus", "CD1").parameters.K_optn
    assert in_metres == pytest.approx(size, rel=0.15)


def test_the_experiment_in_closed_loop_takes_it(reference):
    told = reference("cd/focus/open-loop")
    bench = closed_loop("focus", told, delay=0.5, noise="peak", noise_fixed="volts").bench
    assert bench.noise == position_noise("focus", "CD1", "peak", "volts") != NOISE["focus"] / 3
    assert bench.delay == 0.5
    assert closed_loop("focus", told).bench.noise == NOISE["focus"]


def test_the_experiments_on_gains_and_linearity_take_it():
    asked = {"delay": 0.5, "noise": "uniform", "noise_fixed": "volts"}
    size = position_noise("radial", "CD1", "uniform", "volts")
    for bench in (
        optical_gain("radial", **asked).bench("CD1"),
        linearity("radial", **asked).laboratory,
    ):
        assert (bench.delay, bench.noise) == (0.5, size)
    for bench in (optical_gain("radial").bench("CD1"), linearity("radial").laboratory):
        assert (bench.delay, bench.noise) == (1.0, NOISE["radial"])
