"""Responses of several plants: what is taken, what is refused and in which words."""

import control
import numpy as np
import pytest

from workbench.errors import InputError
from workbench.uncertainty import Responses
from workbench.uncertainty.responses.ratios import Ratios
from workbench.uncertainty.responses.regions import region_radius

OMEGA = 2 * np.pi * np.array([1.0, 2.0, 5.0, 10.0])
VALUES = np.array([[1, 2, 3], [1j, 2j, 3j], [-1, -2, -3], [1 + 1j, 2 + 2j, 3 + 3j]])


def changed(values, place, value):
    values = np.array(values)
    values[place] = value
    return values


@pytest.mark.parametrize(
    ("keywords", "words"),
    [
        ({"omega": OMEGA[:1]}, r"omega of shape \(1,\): two frequencies or more"),
        ({"omega": OMEGA[None]}, r"omega of shape \(1, 4\)"),
        ({"omega": changed(OMEGA, 0, 0)}, r"omega\[0\] is 0.0; it must be positive"),
        ({"omega": changed(OMEGA, 2, -3)}, r"omega\[2\] is -3.0; it must be positive"),
        ({"omega": changed(OMEGA, 1, np.nan)}, r"omega\[1\] is nan"),
        ({"omega": changed(OMEGA, 3, np.inf)}, r"omega\[3\] is inf"),
        ({"omega": OMEGA[[0, 2, 1, 3]]}, r"omega\[1\] = 31.4.* and omega\[2\] .* not increasing"),
        ({"omega": OMEGA[[0, 1, 1, 3]]}, r"omega\[1\] .* and omega\[2\] .* repeated.* keep each"),
        ({"values": VALUES.T}, r"responses of shape \(3, 4\) do not fit 4 frequencies"),
        ({"values": VALUES[:, 0]}, r"responses of shape \(4,\)"),
        ({"values": VALUES[..., None]}, r"needed is \(F, N\), a column for each plant"),
        ({"values": VALUES[:, :1]}, "one plant has no spread to cover"),
        ({"values": VALUES.astype(str)}, "must be numbers, they have type <U"),
        ({"values": VALUES.real > 0}, "must be numbers, they have type bool"),
        ({"values": changed(VALUES, (2, 1), 0)}, "plant 2 is exactly zero at 5 Hz.*present=False"),
        ({"values": changed(VALUES, (3, 0), np.nan)}, "plant 1 is not finite at 10 Hz"),
        ({"values": changed(VALUES, (1, 2), np.inf)}, "plant 3 is not finite at 2 Hz"),
        (
            {"values": changed(VALUES, (1, 2), 0), "plants": ["a", "b", "the third"]},
            "plant the third is exactly zero at 2 Hz",
        ),
        ({"present": np.ones((4, 2), bool)}, r"present must be booleans of shape \(4, 3\)"),
        ({"present": np.ones((4, 3))}, "present must be booleans"),
        ({"present": np.eye(4, 3, dtype=bool)}, "only 1 plant was measured at 1 Hz"),
        ({"present": changed(np.ones((4, 3), bool), 2, False)}, "only 0 plant.* at 5 Hz"),
        ({"plants": ["a", "b"]}, "2 names for 3 plants"),
    ],
)
def test_refused(keywords, words):
    with pytest.raises(InputError, match=words):
        Responses(**({"omega": OMEGA, "values": VALUES} | keywords))


def test_taken():
    responses = Responses(
        omega=OMEGA.tolist(), values=VALUES.tolist(), plants=iter("abc"), unit="m/V"
    )
    np.testing.assert_allclose(responses.frequency_hz, [1, 2, 5, 10])
    assert responses.plants == ("a", "b", "c")
    assert responses.present.all()
    assert np.array_equal(responses.points, VALUES)
    assert responses.place(2) == "5 Hz"
    assert Responses(omega=OMEGA, values=VALUES.real + 4).plants == ("1", "2", "3")


def test_what_is_missing_may_be_anything():
    present = np.ones((4, 3), bool)
    present[0, 0] = present[1, 2] = present[2, 1] = False
    values = np.where(present, VALUES, [[np.nan], [np.inf], [0], [7]])
    points = Responses(omega=OMEGA, values=values, present=present).points
    assert np.isfinite(points).all()
    for k in range(4):
        assert set(points[k]) == set(VALUES[k][present[k]])


@pytest.mark.parametrize("omega", [OMEGA, np.array([1.0, 7.0]), np.geomspace(1e-3, 1e9, 1000)])
def test_shares_are_those_of_the_logarithmic_axis(omega):
    shares = Responses(omega=omega, values=np.ones((omega.size, 2))).shares
    assert shares.sum() == pytest.approx(1, abs=1e-14)
    assert np.all(shares > 0)
    even = Responses(omega=np.geomspace(1, 100, 5), values=np.ones((5, 2))).shares
    np.testing.assert_allclose(even, 0.2)


def test_labels():
    labelled = Responses(
        omega=OMEGA, values=VALUES, plants=list("abc"), unit="m/V"
    ).labelled_points()
    assert labelled.dims == ("frequency", "plant")
    assert labelled.sel(frequency=5.0, plant="b") == -2
    assert labelled.attrs["units"] == "m/V"
    assert labelled["frequency"].attrs["units"] == "Hz"


# --- systems of python-control --------------------------------------------------------------------


def frd(omega, gain=1.0):
    return control.frd(gain / (1 + 1j * np.asarray(omega)), omega)


def test_the_same_grid():
    responses = Responses.from_frd([frd(OMEGA), frd(OMEGA, 2), frd(OMEGA, 3)], unit="N")
    np.testing.assert_allclose(responses.values, np.outer(1 / (1 + 1j * OMEGA), [1, 2, 3]))
    assert responses.present.all()
    assert responses.unit == "N"


def test_grids_of_their_own():
    grids = [[1.0, 2.0, 4.0], [4.0, 2.0], [1.0, 4.0, 8.0], [8.0, 2.0]]
    systems = [frd(np.sort(grid), k + 1) for k, grid in enumerate(grids)]
    responses = Responses.from_frd(systems, plants=list("abcd"))
    assert responses.omega.tolist() == [1, 2, 4, 8]
    for k, grid in enumerate(grids):
        measured = responses.omega[responses.present[:, k]]
        assert measured.tolist() == sorted(grid)
        here = responses.present[:, k]
        np.testing.assert_allclose(responses.values[here, k], (k + 1) / (1 + 1j * measured))


def test_lonely_frequencies_are_named():
    words = r"different grids: 2 of 4 frequencies have one plant only, the first at 0.318\d* Hz"
    with pytest.raises(InputError, match=words):
        Responses.from_frd([frd([1.0, 2.0, 3.0]), frd([1.0, 3.0, 4.0])])


def test_systems_that_are_no_plants():
    square = control.frd(np.ones((2, 2, 3)), [1.0, 2.0, 3.0])
    with pytest.raises(InputError, match=r"plant 2 has 2 outputs.*choose one"):
        Responses.from_frd([frd([1.0, 2.0, 3.0]), square])
    with pytest.raises(InputError, match="needed"):
        Responses.from_frd([])
    with pytest.raises(InputError, match=r"one plant has no spread|one plant only"):
        Responses.from_frd([frd([1.0, 2.0])])
    with pytest.raises(InputError, match="plant 1 is no frequency response, but a TransferFunc"):
        Responses.from_frd([control.tf([1.0], [1.0, 1.0]), frd([1.0, 2.0])])


def test_a_stated_difference_from_linear_plants_adds_to_the_noise():
    values = np.array([[1.0, 2j], [3.0, 4.0]])
    known = Responses(omega=np.array([1.0, 2.0]), values=values, variance=0.04, degrees=60.0)
    wider = known.linear_within(0.1)
    np.testing.assert_allclose(wider.variance, 0.04 + 0.01 * np.abs(values) ** 2)
    assert (region_radius(wider, 0.99) > region_radius(known, 0.99)).all()
    assert "stated, not measured: linear plants lie 10 % off" in wider.assumption
    np.testing.assert_array_equal(known.linear_within(0.0).variance, known.variance)
    assert known.linear_within(0.0).assumption == known.assumption
    for wrong in (-0.1, 1.0, np.nan, "1 %", True):
        with pytest.raises(InputError, match="share is"):
            known.linear_within(wrong)
    with pytest.raises(InputError, match="no variance"):
        Responses(omega=known.omega, values=values).linear_within(0.1)


def test_a_ratio_has_the_difference_in_its_numerator():
    values = np.array([[2.0, 4j], [2.0, 4.0]])
    joint = np.broadcast_to(1e-6 * np.eye(2), (2, 2, 2, 2)).astype(complex)
    ratios = Ratios(joint, np.ones(2))
    known = Responses(
        omega=np.array([1.0, 2.0]), values=values, variance=1e-6, degrees=60.0, ratios=ratios
    )
    wider = region_radius(known.linear_within(0.05), 0.95)
    plain = Responses(omega=np.array([1.0, 2.0]), values=values, variance=1e-6, degrees=60.0)
    np.testing.assert_allclose(wider, region_radius(plain.linear_within(0.05), 0.95), rtol=0.02)
