"""The derived models against the printed ones, against each other and against python-control."""

import dataclasses

import control
import numpy as np
import pytest
from workbench.plants.cd_drive.drive import tables
from workbench.plants.cd_drive.drive.actuator import (
    general_model,
    resonances,
    specific_model,
    stack,
    transfer_coefficients,
)

from workbench.errors import InputError

AXES = ("focus", "radial")
DRIVES = [drive for axis in AXES for drive in tables.drives(axis)]
FREQUENCY = np.geomspace(0.1, 50e3, 400)


def name(drive):
    return f"{drive.name}-{drive.axis}"


def polynomial(values, radius):
    """Coefficients, highest power first, from the values at `radius` times the roots of unity."""
    return (np.fft.fft(values) / len(values) / radius ** np.arange(len(values)))[::-1]


@pytest.mark.parametrize("drive", DRIVES, ids=name)
@pytest.mark.parametrize("r", [1.25, 0.0])
def test_table_3_2(drive, r):
    """Determinant and cofactor of the derived s^2 M + s C + K are Table 3.2's polynomials."""
    actuator = specific_model(drive, r)
    radius = 2 * np.pi * 150.0  # between the two resonances, where no power dominates
    s = radius * np.exp(2j * np.pi * np.arange(8) / 8)[:, None, None]
    dynamic = s**2 * actuator.M + s * actuator.C + actuator.K
    dynamic[:, 0, 0] += s[:, 0, 0] * actuator.Bl**2 / actuator.R
    num = polynomial(actuator.Bl * dynamic[:, 1, 1], radius)
    den = polynomial(actuator.R * np.linalg.det(dynamic), radius)
    printed_num, printed_den = transfer_coefficients(drive, r)
    np.testing.assert_allclose(num[-3:], printed_num, rtol=1e-12)
    np.testing.assert_allclose(den[-5:], printed_den, rtol=1e-12)
    scale = radius ** np.arange(7, -1, -1)
    assert abs(den * scale)[:3].max() < 1e-13 * abs(den * scale).max()


@pytest.mark.parametrize("drive", DRIVES, ids=name)
def test_response_of_table_3_2(drive):
    num, den = transfer_coefficients(drive)
    s = 2j * np.pi * FREQUENCY
    np.testing.assert_allclose(
        specific_model(drive).response(FREQUENCY), np.polyval(num, s) / np.polyval(den, s), 1e-11
    )


@pytest.mark.parametrize("drive", DRIVES, ids=name)
def test_equation_3_10_as_printed(drive):
    m, R, Bl, k, b, L = drive.m1 + drive.m2, drive.R, drive.Bl, drive.k, drive.b, drive.L
    s = 2j * np.pi * FREQUENCY
    electrical = L / R * s * (s**2 + b / m * s + k / m)
    mechanical = s**2 + (Bl**2 / (m * R) + b / m) * s + k / m
    np.testing.assert_allclose(
        general_model(drive, series_resistance=0.0).response(FREQUENCY),
        Bl / (m * R) / (electrical + mechanical),
        1e-11,
    )


@pytest.mark.parametrize("drive", DRIVES, ids=name)
def test_mechanical_transfer_of_equation_3_14(drive):
    p = drive
    s = 2j * np.pi * FREQUENCY
    P = p.m1 * p.m2 * s**4 + (p.m1 * (p.b1 + p.b2) + p.m2 * p.b2) * s**3
    Q = (p.m1 * (p.k1 + p.k2) + p.m2 * p.k2 + p.b1 * p.b2) * s**2
    Q = Q + (p.k1 * p.b2 + p.k2 * p.b1) * s + p.k1 * p.k2
    mechanical = (p.m2 * s**2 + (p.b1 + p.b2) * s + p.k1 + p.k2) / (P + Q)
    # A circuit of such resistance is a current source: no back-EMF, force Bl u / R.
    current_driven = specific_model(p, series_resistance=1e15)
    force = current_driven.Bl / current_driven.R
    np.testing.assert_allclose(current_driven.response(FREQUENCY) / force, mechanical, 1e-11)


@pytest.mark.parametrize("stiff", [{"k2": 1e9}, {"b2": 1e8}])
def test_general_model_is_the_limit_of_the_specific_one(stiff):
    """A rigid link between the masses and no inductance leave one and the same model."""
    for drive in DRIVES:
        rigid = specific_model(dataclasses.replace(drive, **stiff))
        lumped = general_model(dataclasses.replace(drive, L=0.0, k=drive.k1, b=drive.b1))
        below = FREQUENCY[FREQUENCY < 1e3]
        np.testing.assert_allclose(rigid.response(below), lumped.response(below), 1e-5)


def test_small_inductance_tends_to_none():
    drive = DRIVES[0]
    without = general_model(dataclasses.replace(drive, L=0.0)).response(FREQUENCY)
    error = [
        abs(general_model(dataclasses.replace(drive, L=L)).response(FREQUENCY) / without - 1).max()
        for L in (1e-9, 1e-10)
    ]
    assert error[0] < 1e-4 and error[1] == pytest.approx(error[0] / 10, rel=1e-3)


@pytest.mark.parametrize("drive", DRIVES, ids=name)
@pytest.mark.parametrize("model", [specific_model, general_model])
def test_state_space_has_the_same_response(drive, model):
    actuator = model(drive)
    system = actuator.state_space()
    assert isinstance(system, control.StateSpace)
    assert system.nstates == (4 if model is specific_model else 3)
    np.testing.assert_allclose(
        system(2j * np.pi * FREQUENCY), actuator.response(FREQUENCY), rtol=1e-8
    )


def test_poles_and_zeros():
    for drive in DRIVES:
        actuator = specific_model(drive)
        num, den = transfer_coefficients(drive)
        for mine, printed in ((actuator.poles(), den), (actuator.zeros(), num)):
            assert (mine.real < 0).all()
            np.testing.assert_allclose(np.sort_complex(mine), np.sort_complex(np.roots(printed)))
        assert general_model(drive).zeros().size == 0


def test_batch_of_drives():
    batch = stack([specific_model(drive) for drive in DRIVES]).response(FREQUENCY)
    assert batch.shape == (24, 400)
    for row, drive in zip(batch, DRIVES, strict=True):
        np.testing.assert_allclose(row, specific_model(drive).response(FREQUENCY), rtol=1e-13)


def test_first_resonance():
    """Near 30 Hz (focus) and 50 Hz (radial); |s| / 2 pi and the magnitude's peak agree."""
    fine = np.arange(10.0, 100.0, 0.01)
    for axis, low, high in (("focus", 28.5, 33.4), ("radial", 46.6, 51.8)):
        for drive in tables.drives(axis):
            first = resonances(drive).first
            assert low < first < high
            peak = fine[abs(specific_model(drive).response(fine)).argmax()]
            assert peak == pytest.approx(first, rel=0.01)


def test_parasitic_pair():
    """Near 500 Hz (focus); 856-976 Hz (radial), where the text says 800; zero below pole."""
    for axis, low, high in (("focus", 484, 563), ("radial", 856, 976.5)):
        found = [resonances(drive) for drive in tables.drives(axis)]
        assert all(low < r.parasitic_pole < high for r in found)
        assert all(0.97 < r.parasitic_zero / r.parasitic_pole < 0.99 for r in found)


def test_series_resistance_hardly_shifts_the_resonance():
    """The thesis says 1-2 Hz; the model says less than 0.01 Hz."""
    for drive in DRIVES:
        assert abs(resonances(drive, 0.0).first - resonances(drive).first) < 0.01


@pytest.mark.parametrize(
    ("frequency", "message"),
    [
        ([], "not empty"),
        (10.0, "1-D"),
        ([[1.0]], "1-D"),
        ([0.0, 1.0], "contains 0.0"),
        ([1.0, -2.0], "contains -2.0"),
        ([1.0, np.inf], "contains inf"),
        ([np.nan], "contains nan"),
    ],
)
def test_bad_frequencies(frequency, message):
    with pytest.raises(InputError, match=message):
        specific_model(DRIVES[0]).response(frequency)


def test_state_space_of_a_batch():
    with pytest.raises(InputError, match="one drive at a time"):
        stack([specific_model(drive) for drive in DRIVES]).state_space()


def test_empty_stack():
    with pytest.raises(InputError, match="at least one"):
        stack([])
