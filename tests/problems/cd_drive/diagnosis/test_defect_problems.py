"""The problems cd/{axis}/diode-plane and cd/{axis}/residuals, and their checks."""

from dataclasses import replace

import numpy as np
import pytest
from workbench.plants.cd_drive.diagnosis.diode_plane.problem import diode_plane
from workbench.plants.cd_drive.diagnosis.residuals.problem import residuals

import workbench as wb
from workbench.solvers import Options


@pytest.fixture(scope="module")
def plane(answered):
    return answered("cd/focus/diode-plane")


@pytest.fixture(scope="module")
def curves(answered):
    return answered("cd/radial/residuals")


def failures(study, answer):
    return {check.name for check in study.checks(answer, 1e-6) if not check.holds}


def test_the_plane_is_certified(plane):
    study, solution = plane
    assert solution.certificate is not None, solution.message
    assert solution.certificate.holds, solution.certificate
    numbers = study.metrics(solution.answer)
    assert numbers["isolated_low"] > 0.9
    assert numbers["false_alarms_error_shock_low_per_s"] > 10.0
    assert numbers["missed_error_low"] > 0.3  # the error shows few of them: it is no detector
    assert numbers["quality_leads_binary_low_us"] < numbers["quality_leads_binary_high_us"]
    assert "undecided" in study.tables(solution.answer)["claims"]


def test_every_held_out_defect_is_counted(plane):
    counts = plane[1].answer["confusion"]
    assert (counts.sum("found") == 6 * plane[0].defects).all()


@pytest.mark.parametrize(
    ("change", "name"),
    [
        ({"zoom_quality": 0.9}, "equation 7.13"),
        ({"lost": 1.0}, "loop"),
        ({"clean": -1.0}, "triangle"),
        ({"coupling": 200.0}, "coupling"),
        ({"missed": 1.1}, "quality finds them"),
        ({"lead": -1.0}, "sooner"),
    ],
)
def test_the_planes_checks_can_fail(plane, change, name):
    study, solution = plane
    ((key, factor),) = change.items()
    spoiled = solution.answer.copy(deep=True)
    spoiled[key] = spoiled[key] * factor + (1.0 if key in ("lost", "missed") else 0.0)
    assert name in failures(study, spoiled)


def test_alarms_of_the_sum_and_wrong_kinds_are_failures(plane):
    study, solution = plane
    spoiled = solution.answer.copy(deep=True)
    spoiled["false_alarms"].loc[{"detector": "binary", "condition": "shock"}] = 1.0
    spoiled["confusion"] = spoiled["confusion"].roll(found=1)
    clean = spoiled["clean"].values  # some of them farther out than any Gaussian
    clean[:80] += 4.0 * (clean[:80] - clean.mean(axis=0))
    assert {"decoupled", "kinds", "clean ellipse"} <= failures(study, spoiled)


def test_the_curves_are_certified(curves):
    _, solution = curves
    assert solution.certificate is not None, solution.message
    assert solution.certificate.holds, solution.certificate
    area = solution.answer["area"]
    assert float(area.sel(statistic="sum").mean("draw").min()) > 0.5
    assert (area.sel(statistic="quality", depth=0.4).mean("draw") > 0.99).all()


def test_noise_makes_shallow_defects_harder(curves):
    area = curves[1].answer["area"].sel(statistic="sum", depth=0.05)
    assert (area.mean("draw").diff("noise") <= 0.05).all()
    assert (area.isel(noise=-1) < area.isel(noise=0)).mean() > 0.95


def test_numbers_of_the_curves_have_an_interval(curves):
    study, solution = curves
    numbers = study.metrics(solution.answer)
    for name in ("area_sum", "area_error_10pct_1mm", "isolated", "light_lost_at_alarm_level"):
        low, mean, high = (numbers[f"{name}_{end}"] for end in ("low", "mean", "high"))
        assert low < mean < high
    assert "undecided" in study.tables(solution.answer)["claims"]


def test_the_curves_checks_can_fail(curves):
    study, solution = curves
    spoiled = solution.answer.copy(deep=True)
    spoiled["area"] = 1.0 - spoiled["area"]
    spoiled["detection"].values = spoiled["detection"].isel(rate=slice(None, None, -1)).values
    spoiled["alarms"].values[:] = int(spoiled["blocks"]) // 2
    spoiled["confusion"] = spoiled["confusion"].roll(isolated_as=1)
    spoiled["lost"].values[:] = 2
    expected = {"loop", "curves rise", "area", "promised rate", "deep defects", "depth"}
    assert expected | {"isolation"} <= failures(study, spoiled)


@pytest.mark.slow
@pytest.mark.parametrize("study", [residuals("radial", draws=4), diode_plane("focus", draws=4)])
def test_another_seed_changes_no_verdict(study):
    for seed in (0, 1):
        solution = wb.solve(study, options=Options(seed=seed))
        assert solution.certificate.holds, solution.certificate


def test_a_curve_without_noise_of_the_seeds_is_its_own():
    """The same seeds give the same trial, other ones another."""
    trials = replace(residuals("radial").trials, defects=10)
    series = [
        trials.met(trials.bench(), 0.4, 1e-3, np.ones(10), seed).record.sum for seed in (1, 1, 2)
    ]
    np.testing.assert_array_equal(series[0], series[1])
    assert (series[0] != series[2]).any()


@pytest.mark.cases(0)
def test_figures_and_tables(plane, curves):
    for study, solution in (plane, curves):
        drawn = study.figures(solution.answer)
        for figure in drawn.values():
            assert all(panel.get_xlabel() or panel.get_subplotspec() for panel in figure.axes)
            figure.canvas.draw()
        assert all("|" in text for text in study.tables(solution.answer).values())
    assert np.isfinite(list(curves[0].metrics(curves[1].answer).values())).sum() > 20


@pytest.mark.cases(0)
@pytest.mark.parametrize("dist_max", [0.1, 0.18])
def test_limits_out_of_order_end_the_study(dist_max):
    solution = wb.solve(diode_plane("focus", dist_max=dist_max))
    assert solution.answer is None
    assert "dist_min < dist_max" in solution.message
