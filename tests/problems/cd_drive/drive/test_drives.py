"""The loop's elements and gains, the reference controller's crossover, Table 5.2."""

import control
import numpy as np
import pytest
from workbench.plants.cd_drive.drive import plants as drives
from workbench.plants.cd_drive.drive import tables
from workbench.plants.cd_drive.drive.actuator import transfer_coefficients

from workbench.errors import InputError

AXES = ("focus", "radial")
FREQUENCY = np.geomspace(1.0, 30e3, 200)


@pytest.mark.parametrize("axis", AXES)
def test_equation_3_18(axis):
    s = 2j * np.pi * FREQUENCY
    equal = drives.responses(axis, FREQUENCY, gain="equal")
    assert equal.shape == (12, 200)
    K_total = {"focus": 76000, "radial": 300000}[axis]
    for row, drive in zip(equal, tables.drives(axis), strict=True):
        num, den = transfer_coefficients(drive)
        filtered = 2 * np.pi * 8000 / (s + 2 * np.pi * 8000)
        expected = K_total * np.polyval(num, s) / np.polyval(den, s) * filtered
        np.testing.assert_allclose(row, expected, rtol=1e-11)


@pytest.mark.parametrize("antialiasing", [True, False])
def test_plant_as_a_system(antialiasing):
    drive = tables.drives("focus")[4]
    system = drives.plant(drive, 76000, antialiasing)
    assert isinstance(system, control.StateSpace)
    assert system.nstates == 4 + antialiasing
    assert (system.input_labels, system.output_labels) == (["u"], ["f_en"])
    np.testing.assert_allclose(
        system(2j * np.pi * FREQUENCY),
        drives.responses("focus", FREQUENCY, "equal", antialiasing=antialiasing)[4],
        rtol=1e-9,
    )


@pytest.mark.parametrize("axis", AXES)
def test_own_gain_follows_the_optical_gain(axis):
    ratio = drives.responses(axis, [100.0], "own") / drives.responses(axis, [100.0], "equal")
    K_optn = np.array([drive.K_optn for drive in tables.drives(axis)])
    np.testing.assert_allclose(ratio[:, 0], K_optn / ((K_optn.max() + K_optn.min()) / 2))
    assert (abs(ratio).max() + abs(ratio).min()) / 2 == pytest.approx(1.0)


@pytest.mark.parametrize("values", ["printed", "corrected"])
@pytest.mark.parametrize("axis", AXES)
def test_agc_equalises_the_magnitude_at_crossover(axis, values):
    at = [drives.crossover(axis)]
    equalised = abs(drives.responses(axis, at, "agc", values))
    np.testing.assert_allclose(equalised, abs(drives.nominal_response(axis, at))[0], rtol=1e-12)
    assert np.ptp(abs(drives.responses(axis, at, "own", values))) > 0.1 * equalised.mean()


def test_agc_scales_by_a_real_gain():
    ratio = drives.responses("focus", FREQUENCY, "agc") / drives.responses("focus", FREQUENCY)
    np.testing.assert_allclose(ratio, np.broadcast_to(ratio[:, :1].real, ratio.shape), rtol=1e-12)


def test_corrected_values_change_only_the_corrected_drive():
    printed, corrected = (
        drives.responses("radial", FREQUENCY, "equal", values)
        for values in ("printed", "corrected")
    )
    changed = (printed != corrected).any(axis=1)
    assert changed.tolist() == [n == 8 for n in range(12)]  # k, the other one, is not in the model


@pytest.mark.parametrize("axis", AXES)
def test_controller_and_loop(axis):
    s = 2j * np.pi * FREQUENCY
    controller = drives.controller(axis)
    assert isinstance(controller, control.TransferFunction)
    nominal = drives.plant(drives.nominal_parameters(axis), drives.total_gain(axis))
    np.testing.assert_allclose(nominal(s), drives.nominal_response(axis, FREQUENCY), rtol=1e-9)
    np.testing.assert_allclose(
        controller(s) * nominal(s), drives.loop_response(axis, FREQUENCY), rtol=1e-9
    )
    assert (control.feedback(controller * nominal).poles().real < 0).all()


@pytest.mark.parametrize(
    ("axis", "crossover", "margin"), [("focus", 685.3, 57.5), ("radial", 688.6, 56.9)]
)
def test_crossover_and_phase_margin(axis, crossover, margin):
    assert drives.crossover(axis) == pytest.approx(crossover, abs=0.1)
    assert drives.phase_margin(axis) == pytest.approx(margin, abs=0.1)
    above = abs(drives.loop_response(axis, np.geomspace(1.0, 1e5, 5000))) > 1
    assert np.count_nonzero(np.diff(above)) == 1


@pytest.mark.parametrize("axis", AXES)
def test_crossover_agrees_with_python_control(axis):
    system = drives.controller(axis) * drives.plant(
        drives.nominal_parameters(axis), drives.total_gain(axis)
    )
    _, margin, _, omega = control.margin(system)
    assert omega / (2 * np.pi) == pytest.approx(drives.crossover(axis), rel=1e-6)
    assert margin == pytest.approx(drives.phase_margin(axis), abs=1e-4)


@pytest.mark.parametrize("frequency", [[], 5.0, [[1.0, 2.0]], [-1.0], [0.0], [np.nan], [np.inf]])
def test_bad_frequencies(frequency):
    with pytest.raises(InputError, match=r"frequency"):
        drives.responses("focus", frequency)


def test_unknown_choices():
    with pytest.raises(InputError, match=r"'loud'.*own.*equal.*agc"):
        drives.responses("focus", [1.0], gain="loud")
    with pytest.raises(InputError, match=r"focus.*radial"):
        drives.responses("vertical", [1.0])
    with pytest.raises(InputError, match=r"focus.*radial"):
        drives.crossover("vertical")
    with pytest.raises(InputError, match=r"printed.*corrected"):
        drives.responses("focus", [1.0], values="guessed")


def test_frequencies_need_no_order():
    shuffled = np.random.default_rng(0).permutation(FREQUENCY)
    np.testing.assert_array_equal(
        drives.responses("radial", shuffled)[:, np.argsort(shuffled)],
        drives.responses("radial", FREQUENCY),
    )
