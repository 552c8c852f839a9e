"""What circles and stadiums share: input, shapes, containment, labels, datasets."""

from dataclasses import replace

import numpy as np
import pytest
import xarray as xr
from tables import each

from workbench.errors import InputError, UnknownNameError
from workbench.geometry import (
    Circle,
    NarrowestStadium,
    SmallestCircle,
    narrowest_stadium,
    smallest_circle,
)
from workbench.solution import solve
from workbench.solvers import Options

FUNCTIONS = [smallest_circle, narrowest_stadium]
PROGRAMS = [SmallestCircle, NarrowestStadium]
PAIRS = list(zip(PROGRAMS, FUNCTIONS, strict=True))


def random_sets(*shape, seed=31):
    rng = np.random.default_rng(seed)
    return rng.normal(size=shape) + 1j * rng.normal(size=shape)


def labelled(points):
    return xr.DataArray(
        points,
        dims=("frequency", "drive"),
        coords={
            "frequency": (
                "frequency",
                [10.0, 31.25, 400.0][: len(points)],
                {"units": "Hz", "long_name": "frequency"},
            ),
            "drive": [f"CD{i}" for i in range(points.shape[1])],
        },
        attrs={"units": "m/V", "long_name": "response"},
    )


# --- input ------------------------------------------------------------------------------------


@each("function", [*FUNCTIONS, *PROGRAMS])
@each(
    ("points", "words"),
    [
        ([], "hold no point"),
        (np.zeros((3, 0), complex), "hold no point"),
        (1j, "hold no point"),
        ([1j, np.nan], "1 of 2 values are NaN"),
        ([1j, complex(0, np.inf)], "index 1"),
        (np.zeros((5, 2)), "x, y pairs"),
        (["a", "b", "c"], "no numbers"),
        (None, "no numbers"),
        ([[1j], [1, 2]], "no array of numbers"),
    ],
)
def test_refused_points(function, points, words):
    with pytest.raises(InputError, match=words):
        function(points)


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"center": np.zeros(4)}, r"center of shape \(4,\) does not fit sets of shape \(3,\)"),
        ({"angle": np.zeros((2, 3))}, "angle of shape"),
        ({"center": [0, np.nan, 0]}, "center must be finite"),
        ({"angle": np.inf}, "angle must be finite"),
        ({"angle": "east"}, "angle"),
        ({"angle": 1j}, "angle"),
        ({"angle": np.array([1j, 0, 0])}, "angle"),
    ],
)
@pytest.mark.parametrize("function", [narrowest_stadium, NarrowestStadium])
def test_refused_centers_and_angles(function, given, words):
    with pytest.raises(InputError, match=words):
        function(random_sets(3, 5), **given)


def test_unknown_method():
    with pytest.raises(UnknownNameError, match="did you mean exact"):
        smallest_circle([1j, 0], method="exakt")


# --- shapes -----------------------------------------------------------------------------------


@pytest.mark.parametrize("method", ["exact", "thesis", "ipopt"])
@pytest.mark.parametrize("batch", [(), (2,), (2, 1)])
@pytest.mark.parametrize("function", FUNCTIONS)
def test_answers_have_the_shape_of_the_sets(function, batch, method):
    points = random_sets(*batch, 6)
    answer = function(points, method=method)
    names = ["center", "radius", "half_length", "angle"]
    assert [np.shape(getattr(answer, name)) for name in names] == [batch] * 4
    assert answer.center.dtype == complex
    assert answer.radius.dtype == float


@pytest.mark.parametrize("batch", [(), (3,), (3, 2)])
@pytest.mark.parametrize(
    "given", [{}, {"center": 1j}, {"angle": 0.5}, {"center": 1j, "angle": 0.5}]
)
def test_a_batch_is_set_by_set(batch, given):
    points = random_sets(*batch, 6)
    answer = narrowest_stadium(points, **given)
    for index in np.ndindex(batch):
        single = narrowest_stadium(points[index], **given)
        for name in ("center", "radius", "half_length", "angle"):
            assert getattr(answer, name)[index] == getattr(single, name)


def test_centers_and_angles_broadcast_against_the_sets():
    points, angle = random_sets(3, 2, 6), np.array([[0.1], [0.2], [0.3]])
    answer = narrowest_stadium(points, center=[0, 1j], angle=angle)
    assert answer.center.tolist() == [[0, 1j]] * 3
    np.testing.assert_allclose(answer.angle, np.broadcast_to(angle, (3, 2)))


@pytest.mark.parametrize(("program", "function"), PAIRS)
def test_no_sets_at_all(program, function):
    points = np.zeros((0, 5), complex)
    assert function(points).radius.shape == (0,)
    assert solve(program(points)).certificate.holds


@pytest.mark.parametrize(("program", "function"), PAIRS)
@pytest.mark.parametrize(
    "change",
    [lambda a: a[:2], lambda a: a[0], lambda a: a[:, None], lambda a: np.append(a, a[:1])],
    ids=["too few", "scalar", "an axis more", "too many"],
)
def test_answers_of_another_shape_are_refused_in_words(program, function, change):
    points = random_sets(3, 6)
    answer = function(points)
    changed = type(answer)(*(change(getattr(answer, name)) for name in program.answer_names))
    with pytest.raises(InputError, match=r"arrays of shape \(3,\) are needed"):
        program(points).certify(changed, 1e-9, optimal=True)


# --- containment ------------------------------------------------------------------------------


def containment(points, center, radius):
    answer = Circle(np.asarray(complex(center)), np.asarray(float(radius)))
    return next(c for c in SmallestCircle(points).checks(answer, 1e-9) if c.name == "containment")


def test_containment_lets_a_billionth_of_the_radius_pass():
    points = np.array([1e-3 + 0j, -1e-3])
    assert containment(points, 0, 1e-3).value == 0
    assert containment(points, 0, 1e-3 * (1 - 0.9e-9)).holds
    check = containment(points, 0, 1e-3 * (1 - 3e-9))
    assert not check.holds
    assert check.value == pytest.approx(3e-9, rel=1e-2)
    assert not containment(points, 0, 0.0).holds


def test_containment_lets_the_rounding_of_the_coordinates_pass():
    points = 1e8 + np.array([1 + 0j, -1])
    rounding = 8 * np.finfo(float).eps * 1e8
    assert containment(points, 1e8, 1 - 0.9 * rounding).holds
    assert not containment(points, 1e8, 1 - 1.2 * rounding).holds


def test_containment_sees_every_point_of_every_set():
    points = random_sets(4, 9)
    answer = smallest_circle(points)
    for index in np.ndindex(4, 9):
        moved = points.copy()
        outward = points[index] - answer.center[index[0]]
        away = answer.radius[index[0]] * (1 + 1e-8)
        moved[index] = answer.center[index[0]] + away * outward / abs(outward)
        check = SmallestCircle(moved).checks(answer, 1e-9)[1]
        assert not check.holds
        assert check.where == f"at set {index[0]}"


@pytest.mark.parametrize(("program", "function"), PAIRS)
@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_answers_that_are_no_numbers_are_rejected(program, function, bad):
    points = random_sets(3, 6)
    answer = function(points)
    for name in program.answer_names:
        values = getattr(answer, name).copy()
        values[1] = bad
        certificate = program(points).certify(replace(answer, **{name: values}), 1e-9)
        assert not certificate.valid
        assert certificate.checks[0].where == "at set 1"


@pytest.mark.parametrize(("program", "function"), PAIRS)
@pytest.mark.parametrize("away", [1e20, 1e200, 1e308])
def test_far_away_and_huge_answers_are_rejected(program, function, away):
    points = random_sets(3, 6)
    answer = function(points)
    for name in program.answer_names:
        if name == "angle":
            continue  # a large angle is an angle
        values = getattr(answer, name).copy()
        values[1] = away
        changed = replace(answer, **{name: values})
        assert not program(points).certify(changed, 1e-3, optimal=True).holds


# --- labels -----------------------------------------------------------------------------------


@pytest.mark.parametrize(("program", "function"), PAIRS)
def test_failures_name_their_place(program, function):
    points = labelled(random_sets(3, 6))
    answer = function(points)
    shrunk = replace(answer, radius=answer.radius * [1, 0.9, 1])
    (failure,) = program(points).certify(shrunk, 1e-9).failures
    assert failure.startswith("containment: ")
    assert failure.endswith("at frequency 31.25 Hz")


@pytest.mark.parametrize(
    ("batch", "place"), [((), ""), ((3,), "at set 1"), ((2, 3), "at set_0 0, set_1 1")]
)
def test_places_without_labels(batch, place):
    points = random_sets(*batch, 6)
    answer = smallest_circle(points)
    radius = np.array(answer.radius)
    radius.flat[min(1, radius.size - 1)] *= 0.5
    check = SmallestCircle(points).checks(replace(answer, radius=radius), 1e-9)[1]
    assert check.where == place


def test_a_single_labelled_set_has_no_place_to_name():
    points = labelled(random_sets(1, 6))[0]
    answer = smallest_circle(points)
    shrunk = replace(answer, radius=answer.radius * 0.5)
    assert SmallestCircle(points).checks(shrunk, 1e-9)[1].where == ""


# --- datasets ---------------------------------------------------------------------------------


@pytest.mark.parametrize(("program", "function"), PAIRS)
def test_dataset_keeps_answer_coordinates_and_units(program, function):
    points = labelled(random_sets(3, 6))
    task, answer = program(points), function(points)
    data = task.to_dataset(answer)
    xr.testing.assert_identical(data.coords.to_dataset(), points.coords.to_dataset())
    assert data["points"].dims == points.dims
    np.testing.assert_array_equal(data["points"], points)
    for name in program.answer_names:
        assert data[name].dims == ("frequency",)
        assert data[name].attrs["units"] == ("rad" if name == "angle" else "m/V")
        assert data[name].attrs["long_name"]
    again = task.from_dataset(data)
    assert type(again) is type(answer)
    for name in program.answer_names:
        np.testing.assert_array_equal(getattr(again, name), getattr(answer, name))
    assert task.certify(again, 1e-9, optimal=True).holds


@pytest.mark.parametrize(("program", "function"), PAIRS)
def test_dataset_survives_a_file(program, function, tmp_path):
    points = labelled(random_sets(3, 6))
    task, answer = program(points), function(points)
    data = task.to_dataset(answer)
    parts = {name: data[name] for name in data if data[name].dtype != complex}
    xr.Dataset(parts).to_netcdf(tmp_path / "cover.nc", engine="h5netcdf")
    with xr.open_dataset(tmp_path / "cover.nc", engine="h5netcdf") as stored:
        xr.testing.assert_identical(stored.load(), xr.Dataset(parts))


@pytest.mark.parametrize(("program", "function"), PAIRS)
@pytest.mark.parametrize("batch", [(), (3,), (2, 3)])
def test_dataset_without_labels(program, function, batch):
    points = random_sets(*batch, 6)
    task, answer = program(points), function(points)
    again = task.from_dataset(task.to_dataset(answer))
    for name in program.answer_names:
        np.testing.assert_array_equal(getattr(again, name), getattr(answer, name))


@pytest.mark.parametrize("away", [0, 1e8])
def test_dataset_marks_the_points_on_the_boundary(away):
    points = away + np.array([1, -1, 1j, 0.1j, -0.5 - 0.5j])
    task = SmallestCircle(points)
    support = task.to_dataset(smallest_circle(points))["support"]
    assert support.values.tolist() == [1, 1, 1, 0, 0]
    # three points not on a lattice: the centre is rounded, all three touch
    turned = away + np.exp(1j * np.array([0.1, 2.2, 4.5]))
    support = SmallestCircle(turned).to_dataset(smallest_circle(turned))["support"]
    assert support.values.tolist() == [1, 1, 1]


def test_dataset_of_no_number():
    points = random_sets(2, 5)
    lost = Circle(np.full(2, np.nan + 0j), np.full(2, np.nan))
    data = SmallestCircle(points).to_dataset(lost)
    assert np.isnan(data["radius"]).all()
    assert not data["support"].any()


def test_labelled_input_gives_the_same_answer():
    points = labelled(random_sets(3, 6))
    for function in FUNCTIONS:
        np.testing.assert_array_equal(function(points).radius, function(points.values).radius)


def test_metrics():
    points = np.array([[3 + 1j, 3 - 1j], [11, 9]])
    metrics = SmallestCircle(points).metrics(smallest_circle(points))
    assert metrics["radius_peak"] == pytest.approx(1)
    assert metrics["radius_relative_peak"] == pytest.approx(1 / 3)
    assert (metrics["sets"], metrics["points"]) == (2, 2)
    stadium = NarrowestStadium(points).metrics(narrowest_stadium(points))
    assert stadium["half_length_peak"] == pytest.approx(1)
    assert stadium["radius_peak"] == pytest.approx(0, abs=1e-14)


@pytest.mark.slow
def test_a_million_points_are_certified_within_seconds():
    points = random_sets(1, 1_000_000)
    for program in PROGRAMS:
        solution = solve(program(points), options=Options(tolerance="high"))
        assert solution.certificate.holds
        assert solution.seconds["check"] < 10


def test_a_thousand_sets_are_certified_within_seconds():
    points = random_sets(1000, 12)
    for program in PROGRAMS:
        solution = solve(program(points), options=Options(tolerance="high"))
        assert solution.certificate.holds
        assert solution.seconds["check"] < 10
