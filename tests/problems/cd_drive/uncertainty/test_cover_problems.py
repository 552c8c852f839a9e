"""The covers of the twelve drives: their parameters, their data and what their numbers say."""

from types import SimpleNamespace

import numpy as np
import pytest
import xarray as xr
from workbench.plants.cd_drive.drive.plants import crossover, nominal_response, responses
from workbench.plants.cd_drive.drive.shared_parameters import WINDOWS
from workbench.plants.cd_drive.drive.tables import drives
from workbench.plants.cd_drive.laboratory.identified import NAMES
from workbench.plants.cd_drive.uncertainty.circle_cover import circle_cover
from workbench.plants.cd_drive.uncertainty.measured_drives import identified_drives, measured_drives
from workbench.plants.cd_drive.uncertainty.stadium_cover import ORIENTATIONS, stadium_cover

import workbench as wb
from workbench.errors import InputError, UnknownNameError
from workbench.uncertainty import contains

SMALL = 48
FOUND = [("focus", "steps"), ("focus", "joint"), ("radial", "steps"), ("radial", "joint")]


def certified(program, method="steps"):
    solution = wb.solve(program, method=method)
    assert solution.certificate is not None, solution.message
    assert solution.certificate.valid, solution.certificate.failures
    return solution.answer, program.metrics(solution.answer)


@pytest.fixture(scope="module", params=FOUND)
def stadiums(request, covered):
    axis, method = request.param
    program, answer = covered(axis, "stadium", method)
    return axis, program, answer


@pytest.fixture(scope="module", params=FOUND)
def circles(request, covered):
    axis, method = request.param
    program, answer = covered(axis, "circle", method)
    return axis, program, answer


def test_a_nominal_chosen_for_small_circles_gives_smaller_ones(covered):
    steps, joint = (
        program.metrics(answer)
        for program, answer in (covered("focus", "circle", m) for m in ("steps", "joint"))
    )
    assert joint["radius_rms"] < steps["radius_rms"]
    assert joint["radius_peak"] < steps["radius_peak"]


@pytest.mark.cases(2)
@pytest.mark.parametrize("gain", ["own", "equal", "agc"])
@pytest.mark.parametrize("shape", ["circle", "stadium"])
@pytest.mark.parametrize("axis", ["focus", "radial"])
def test_no_cover_is_much_larger_than_the_sets_it_is_fitted_to(covered, axis, shape, gain):
    program, answer = covered(axis, shape, "steps", gain)
    assert program.metrics(answer)["inflation"] < 10


@pytest.mark.cases(2)
def test_circles_contain_the_drives(circles):
    _, program, answer = circles
    metrics = program.metrics(answer)
    assert contains(answer.model, program.responses)
    assert metrics["order_nominal"] <= 4 and metrics["order_Wc"] <= 4
    assert metrics["outside"] == 0
    assert metrics["inflation"] >= 1 - 1e-9


def test_the_largest_circle_is_at_the_first_resonance(circles):
    axis, program, answer = circles
    low, high = WINDOWS[axis]["first resonance"]
    assert low < program.responses.frequency_hz[answer.second.radius.argmax()] < high


@pytest.mark.cases(1)
def test_a_stadium_is_never_wider_than_the_circle_about_the_same_nominal(stadiums):
    axis, program, answer = stadiums
    resonance = WINDOWS[axis]["first resonance"]
    frequency = program.responses.frequency_hz
    radius = abs(program.deviations_from(answer.model.nominal, program.points)).max(axis=1)
    assert (answer.second.radius <= radius * (1 + 1e-9)).all()
    assert (answer.third.radius >= answer.second.radius * (1 - 1e-9)).all()
    worst = radius.argmax()
    assert resonance[0] < frequency[worst] < resonance[1]
    assert answer.second.radius[worst] < radius[worst] / 2


def test_stadiums_have_their_numbers(stadiums):
    _, program, answer = stadiums
    metrics = program.metrics(answer)
    names = {"radius_peak", "width_peak", "width_peak_fitted", "length_peak", "inflation"}
    assert names | {"order_nominal", "order_Wc", "order_Wr", "outside"} <= metrics.keys()
    assert metrics["width_peak"] < metrics["radius_peak"]
    assert metrics["order_Wr"] <= 4


@pytest.mark.cases(1)
def test_a_run_is_stored_and_shown(stadiums):
    _, program, answer = stadiums
    stored = program.from_dataset(program.to_dataset(answer))
    assert program.metrics(stored) == pytest.approx(program.metrics(answer))
    assert all(check.holds for check in program.checks(stored, 1e-6))
    assert "plane-first-resonance" in program.figures(stored)


@pytest.mark.cases(1)
@pytest.mark.parametrize("axis", ["focus", "radial"])
def test_automatic_gain_control_removes_most_above_100_hz(axis, covered):
    radius = {}
    for gain in ("own", "agc"):
        program, answer = covered(axis, "circle", "steps", gain)
        radius[gain] = np.median(answer.second.radius[program.responses.frequency_hz > 100.0])
    assert radius["agc"] < radius["own"] / 2


def test_responses_are_those_of_the_drives_without_the_filter():
    measured = measured_drives("radial", 20, 10.0, 1000.0, "equal", "corrected")
    frequency = np.geomspace(10.0, 1000.0, 20)
    expected = responses("radial", frequency, "equal", "corrected", antialiasing=False).T
    np.testing.assert_allclose(measured.values, expected)
    np.testing.assert_allclose(measured.frequency_hz, frequency)
    assert measured.plants == tuple(drive.name for drive in drives("radial"))
    assert measured.unit == "units/V"


def identified(**changed):
    """What the slow identification gives, in another order: the tables' values, some changed."""
    twelve = drives("focus")[::-1]
    names = [drive.name for drive in twelve]
    values = [[changed.get(name, getattr(drive, name)) for name in NAMES] for drive in twelve]
    table = xr.DataArray(
        values, dims=("drive", "parameter"), coords={"drive": names, "parameter": list(NAMES)}
    )
    gains = xr.DataArray(
        [[1.0, drive.K_optn] for drive in twelve],
        dims=("drive", "quantity"),
        coords={"drive": names, "quantity": ["K_opt", "K_optn"]},
    )
    return [
        SimpleNamespace(data=xr.Dataset({k: v})) for k, v in (("value", table), ("gain", gains))
    ]


@pytest.mark.parametrize("gain", ["own", "agc"])
def test_identified_drives_stand_in_for_the_tables(gain):
    given = measured_drives("focus", 20, 5.0, 5000.0, gain)
    found = measured_drives("focus", 20, 5.0, 5000.0, gain, "printed", *identified())
    assert found.plants == given.plants
    np.testing.assert_allclose(found.values, given.values, rtol=1e-12)
    other = measured_drives("focus", 20, 5.0, 5000.0, gain, "printed", *identified(k1=25.0))
    assert abs(other.values / given.values - 1).max() > 1e-3


def test_a_cover_of_identified_drives():
    assert identified_drives("focus") == {}
    needs = identified_drives("focus", "identified")
    assert {name: need.name for name, need in needs.items()} == {
        "identified": "cd/focus/identified",
        "optical_gains": "cd/focus/optical-gain",
    }
    program = circle_cover("focus", *identified(), frequencies=SMALL, source="identified")
    certified(program)


@pytest.mark.slow
def test_additive_weights_have_the_responses_unit():
    program = stadium_cover("focus", frequencies=SMALL, form="additive")
    answer, metrics = certified(program)
    assert answer.model.form == "additive"
    away = (
        program.responses.values - answer.model.nominal.response(program.responses.omega)[:, None]
    )
    assert metrics["radius_peak"] == pytest.approx(abs(away).max())


@pytest.mark.slow
def test_points_left_out_make_smaller_sets():
    whole, _ = certified(circle_cover("focus", frequencies=SMALL))
    program = circle_cover("focus", frequencies=SMALL, leave_out=2)
    fewer, metrics = certified(program)
    assert (fewer.first.radius <= whole.first.radius * (1 + 1e-9)).all()
    assert 0 < metrics["outside"] <= 2 * SMALL
    assert not contains(fewer.model, program.responses)
    assert contains(fewer.model, program.responses, leave_out=2)


@pytest.mark.slow
def test_content_widens_the_sets_and_says_what_it_assumes():
    program = circle_cover("focus", frequencies=SMALL, content=0.95)
    solution = wb.solve(program, method="steps")
    assert solution.certificate.valid
    assert "normal distribution" in solution.certificate.checks[0].statement
    assert "0.95" in solution.certificate.checks[0].statement
    plain, _ = certified(circle_cover("focus", frequencies=SMALL))
    assert np.median(solution.answer.first.radius / plain.first.radius) > 1.2


@pytest.mark.slow
def test_orientations_of_the_third_set():
    turn = {}
    for name in ORIENTATIONS:
        answer, _ = certified(stadium_cover("focus", frequencies=120, orientation=name))
        steps = np.diff(answer.third.angle)
        turn[name] = abs(np.mod(steps + np.pi / 2, np.pi) - np.pi / 2).max()
        if name == "narrowest":
            np.testing.assert_allclose(answer.third.radius, answer.second.radius, rtol=1e-9)
    assert turn["smooth"] < turn["narrowest"]


@pytest.mark.slow
def test_minimum_phase_is_kept_and_checked():
    program = stadium_cover("focus", frequencies=SMALL, minimum_phase=True)
    answer, _ = certified(program)
    assert (answer.model.W_r.zeros.real < 0).all()
    assert "W_r minimum phase" in [check.name for check in program.checks(answer, 1e-6)]


def test_the_agc_levels_the_drives_at_crossover():
    at = crossover("focus")
    measured = measured_drives("focus", 2, at, 2 * at, "agc")
    expected = abs(nominal_response("focus", [at], antialiasing=False))
    np.testing.assert_allclose(abs(measured.values[0]), expected[0], rtol=1e-9)


@pytest.mark.parametrize(
    ("parameters", "message"),
    [
        ({"frequencies": 1}, "frequencies"),
        ({"lowest": 100.0, "highest": 10.0}, "must be below"),
        ({"gain": "none"}, "gain"),
        ({"form": "relative"}, "form"),
        ({"source": "guessed"}, "source"),
        ({"order": 13}, "order"),
        ({"order": 2, "zeros": 3}, "zeros"),
        ({"leave_out": 5}, "leave_out"),
        ({"content": 1.0}, "content"),
        ({"orientation": "random"}, "orientation"),
        ({"leave_out": 1, "content": 0.9}, "leave_out"),
        ({"frequencies": 6, "complex_order": 6}, "complex_order"),
    ],
)
def test_bad_parameters_are_named(parameters, message):
    with pytest.raises(InputError, match=message):
        wb.load("cd/focus/stadium-cover", **parameters)


def test_unknown_names_are_answered_with_known_ones():
    with pytest.raises(UnknownNameError, match="cd/focus/stadium-cover"):
        wb.load("cd/sledge/stadium-cover")
    with pytest.raises(UnknownNameError, match="real_order"):
        wb.load("cd/focus/stadium-cover", rael_order=2)
