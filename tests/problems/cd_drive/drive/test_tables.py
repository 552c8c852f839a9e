"""The tables: cells as printed, corrections beside them, units, errors."""

import dataclasses

import pytest
from workbench.plants.cd_drive.drive import tables

from workbench.errors import InputError

AXES = ("focus", "radial")


@pytest.mark.parametrize("axis", AXES)
def test_twelve_drives_in_order(axis):
    drives = tables.drives(axis)
    assert [drive.name for drive in drives] == [f"CD{n}" for n in range(1, 13)]
    assert {drive.axis for drive in drives} == {axis}


def test_cells_as_printed():
    focus, radial = tables.drives("focus"), tables.drives("radial")
    assert focus[0] == tables.Drive(
        name="CD1",
        axis="focus",
        L=160e-6,
        R_measured=18.4,
        R=18.7,
        Bl=0.24,
        k=20.5,
        b=7.6e-3,
        k1=23.6,
        k2=157.4,
        b1=7.25e-3,
        b2=0.35e-3,
        m1=0.543e-3,
        m2=0.017e-3,
        K_opt=813,
        K_optn=260160,
    )
    assert radial[6].R_measured == 17.6 and radial[6].R == 17.5
    assert radial[3].L == 110e-6 and focus[3].b2 == 0.3e-3
    assert focus[7].K_opt == 589 and radial[11].K_optn == 1000374
    assert radial[10].k2 == 945.7 and radial[10].b1 == 12.35e-3


# Sums over the twelve drives of the columns of Tables A.1-A.3, in the order of SUMMED.
SUMMED = ("R_measured", "R", "Bl", "k", "b", "k1", "k2", "b1", "b2", "m1", "m2", "K_opt", "K_optn")
SUMS = {
    "focus": "214.2 216.1 2.76 244.3 0.093 267.5 2870.4 0.08855 0.00455 0.006419 0.000301 "
    "9987 3364413",
    "radial": "206.7 206.7 2.47 668.3 0.1518 712.3 9273.5 0.14445 0.00735 0.006395 0.000325 "
    "28005 11958049",
}


@pytest.mark.parametrize("axis", AXES)
def test_no_cell_has_changed(axis):
    sums = [sum(getattr(drive, name) for drive in tables.drives(axis)) for name in SUMMED]
    assert sums == pytest.approx([float(cell) for cell in SUMS[axis].split()], rel=1e-12)


def test_corrections_are_kept_beside_the_printed_values():
    for c in tables.corrections():
        number = int(c.drive[2:]) - 1
        printed = tables.drives(c.axis)[number]
        corrected = tables.drives(c.axis, "corrected")[number]
        assert getattr(printed, c.quantity) == c.printed
        assert dataclasses.replace(printed, **{c.quantity: c.corrected}) == corrected
        assert c.reason
    assert len(tables.corrections()) == 3


@pytest.mark.parametrize("axis", AXES)
def test_corrected_values_agree_with_each_other(axis):
    for drive in tables.drives(axis, "corrected"):
        assert drive.k == pytest.approx(drive.k1 * drive.k2 / (drive.k1 + drive.k2), abs=0.15)
        assert drive.b == pytest.approx(drive.b1 + drive.b2, rel=1e-12)
        assert drive.m1 + drive.m2 == pytest.approx(0.56e-3)


def test_only_the_corrected_drives_disagree_as_printed():
    wrong = {
        (drive.name, axis)
        for axis in AXES
        for drive in tables.drives(axis)
        if abs(drive.k - drive.k1 * drive.k2 / (drive.k1 + drive.k2)) > 0.15
        or abs(drive.b - drive.b1 - drive.b2) > 1e-9
    }
    assert wrong == {(c.drive, c.axis) for c in tables.corrections()}


def test_table_5_2():
    focus, radial = tables.nominal_table("focus"), tables.nominal_table("radial")
    assert list(focus) == ["K_total", "R", "Bl", "k1", "k2", "b1", "b2", "m1", "m2"]
    assert focus["K_total"] == tables.Uncertain(76000, 0.079)
    assert radial["K_total"] == tables.Uncertain(300000, 0.2)
    assert focus["m2"] == tables.Uncertain(0.024e-3, 0.31)
    assert radial["m1"] == tables.Uncertain(0.535e-3, 0.0005)


def test_small_tables():
    assert tables.gain_margins()["CD6"] == 13.1 and len(tables.gain_margins()) == 12
    assert tables.reduced_tolerances("focus") == {"R": 0.138, "k1": 0.174, "k2": 0.289}
    assert tables.reduced_tolerances("radial")["R"] == 0.068
    formats = tables.disc_formats()
    assert formats["CD"].track_pitch == 1.6e-6 and formats["CD"].theta2 == 17
    assert formats["DVD"].wavelength == 650e-9 and formats["BRD"].d == 0.24e-6
    disc = tables.compact_disc()
    assert (disc.program_start, disc.velocity_max, disc.frame_rate) == (0.025, 1.4, 7350)
    assert tables.red_book("focus") == tables.RedBook(500e-6, 10, 1e-6)
    assert tables.red_book("radial") == tables.RedBook(70e-6, 0.4, 0.03e-6)


@pytest.mark.parametrize(
    "read",
    [tables.drives, tables.nominal_table, tables.reduced_tolerances, tables.red_book],
)
def test_unknown_axis(read):
    with pytest.raises(InputError, match=r"tangential.*focus.*radial"):
        read("tangential")


def test_unknown_values():
    with pytest.raises(InputError, match=r"rounded.*printed.*corrected"):
        tables.drives("focus", "rounded")
