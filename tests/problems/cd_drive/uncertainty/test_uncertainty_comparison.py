"""The uncertainty models of an axis side by side."""

import numpy as np
import pytest
from workbench.plants.cd_drive.drive.shared_parameters import WINDOWS
from workbench.plants.cd_drive.uncertainty.uncertainty_comparison import (
    COVER_METHODS,
    COVER_SHAPES,
    GAIN_VARIANTS,
    HIGH_FREQUENCY,
    needs,
)


@pytest.fixture(scope="module")
def solved(answered):
    return answered("cd/focus/uncertainty-comparison")


def test_everything_is_on_one_grid():
    asked = needs("focus", frequencies=33)
    assert len(asked) == 5
    assert {need.parameters["frequencies"] for need in asked.values()} == {33}
    assert {need.method for need in asked.values()} == {*COVER_METHODS, None}


def test_the_certificate_holds(solved):
    _, solution = solved
    assert solution.certificate.failures == ()


def test_a_stadium_is_never_wider_than_the_circle_about_the_same_centre(solved):
    _, solution = solved
    variant, size = solution.answer["variant"], solution.answer["size"]
    assert (variant.sel(shape="stadium") <= variant.sel(shape="circle") * (1 + 1e-9)).all()
    about = [size.sel(quantity=f"{name} about") for name in ("width", "radius")]
    assert (about[0] <= about[1] * (1 + 1e-9)).all()


def test_circles_peak_at_the_resonance_where_stadiums_are_several_times_narrower(solved):
    study, solution = solved
    metrics = study.metrics(solution.answer)
    low, high = WINDOWS[study.axis]["first resonance"]
    assert low < metrics["peak_hz"] < high
    assert metrics["radius_over_width_at_peak"] > 2


def test_gain_control_removes_most_above_100_hz(solved):
    study, solution = solved
    metrics = study.metrics(solution.answer)
    assert metrics["median_radius_agc"] < metrics["median_radius_own"] / 2
    high = solution.answer["variant"].sel(shape="circle", frequency=slice(HIGH_FREQUENCY, None))
    assert metrics["median_radius_own"] == pytest.approx(np.median(high.sel(gain="own")))


def test_the_numbers_have_their_names(solved):
    study, solution = solved
    metrics = study.metrics(solution.answer)
    for name in (*GAIN_VARIANTS, *COVER_METHODS):
        assert {f"radius_peak_{name}", f"width_peak_{name}"} <= metrics.keys()
    for method in COVER_METHODS:
        assert {f"{shape}_weight_peak_{method}" for shape in COVER_SHAPES} <= metrics.keys()
        assert metrics[f"circle_weight_peak_{method}"] >= metrics[f"radius_peak_{method}"]
        assert metrics[f"stadium_weight_peak_{method}"] >= metrics[f"width_peak_{method}"]
    assert metrics["radius_peak_joint"] < metrics["radius_peak_steps"]


def test_wide_stadiums_are_found(solved):
    study, solution = solved
    answer = solution.answer.copy(deep=True)
    answer["variant"].loc[{"shape": "stadium"}] *= 100
    failed = {check.name for check in study.checks(answer, 1e-6) if not check.holds}
    assert {"never wider", "narrower"} <= failed


def test_the_run_is_stored_and_shown(solved):
    study, solution = solved
    again = study.from_dataset(study.to_dataset(solution.answer))
    assert all(check.holds for check in study.checks(again, 1e-6))
    tables = study.tables(again)
    assert tables["gains"].count("\n") == 2 + len(GAIN_VARIANTS)
    assert tables["methods"].count("\n") == 2 + len(COVER_METHODS)
    assert study.figures(again).keys() == {"sizes", "gains"}
