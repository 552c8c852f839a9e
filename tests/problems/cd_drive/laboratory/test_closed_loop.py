"""Closed-loop identification: chain, colour of the noise, errors, and a wrong order told."""

from dataclasses import replace

import casadi as ca
import numpy as np
import pytest
from lanes import thinned
from workbench.plants.cd_drive.drive.actuator import resonances, specific_model
from workbench.plants.cd_drive.drive.tables import drives
from workbench.plants.cd_drive.drive.two_masses import FITTED, Lumped, lens, lumped
from workbench.plants.cd_drive.laboratory.bench_setup import RATE
from workbench.plants.cd_drive.laboratory.closed_loop import LIMITS, ClosedLoop
from workbench.plants.cd_drive.laboratory.experiment import Laboratory
from workbench.plants.cd_drive.laboratory.in_the_loop import (
    ERROR_SWING,
    LOOP_SETTLING,
    PERIODS,
    excitation,
    measurement_chain,
    neighbours_p,
    noise_colour,
)

from workbench import solve
from workbench.identification import sine_fit
from workbench.solvers import Options, Outcome

AXES = ("focus", "radial")
GRID = np.array([100.0, 480.0, 530.0, 900.0, 1500.0, 2000.0])
STEP = 10.0


def values(drive):
    return {name: getattr(drive, name) for name in FITTED} | {"gain": 1.0}


@pytest.fixture(scope="module")
def runs():
    """Answers by axis, disturbances and mismatch, each computed once."""
    found = {}

    def run(axis, disturbances=True, mismatch=0.0):
        key = axis, disturbances, mismatch
        if key not in found:
            drive = "CD1" if axis == "radial" else "CD12"
            bench = Laboratory(axis, drive, mismatch=mismatch)
            task = ClosedLoop(bench, np.arange(100.0, 2001.0, STEP), disturbances)
            found[key] = task, solve(task, options=Options(seed=3))
        return found[key]

    return run


@pytest.mark.parametrize("axis", AXES)
@pytest.mark.parametrize("delay", [0.0, 1.0, 1.6])
def test_chain_leaves_the_actuator(axis, delay):
    bench = Laboratory(axis, "CD3", delay=delay)
    exact = bench.response(GRID)
    actuator = exact["f_en"] / exact["u_m"] / measurement_chain(bench, GRID)
    np.testing.assert_allclose(actuator, bench.actuator.response(GRID), rtol=2e-4)


@pytest.mark.parametrize("axis", AXES)
def test_model_is_the_specific_one(axis):
    for drive in drives(axis):
        known = lumped(drive)
        model = lens(values(drive), 2j * np.pi * GRID, known.R, known.Bl)
        np.testing.assert_allclose(model, specific_model(drive).response(GRID), rtol=1e-10)


@pytest.mark.parametrize("axis", AXES)
def test_lumped_values_give_the_first_resonance(axis):
    for drive in drives(axis):
        known = lumped(drive)
        s = 2j * np.pi * resonances(drive).first * np.array([0.8, 1.0, 1.2])
        damper = known.b + known.Bl**2 / known.R
        one_mass = known.Bl / known.R / (known.m * s**2 + damper * s + known.k)
        np.testing.assert_allclose(one_mass, lens(values(drive), s, known.R, known.Bl), rtol=0.01)


def test_lumped_values_as_data():
    drive = drives("focus")[0]
    known = replace(lumped(drive), k=21.0).data
    names = [*FITTED, "gain"]
    residuals = known.residuals(values(drive))
    np.testing.assert_allclose(residuals[1:], 0.0, atol=1e-9)
    assert residuals[0] == pytest.approx((lumped(drive).k / 21.0 - 1) / known.deviation[0])
    vector = ca.MX.sym("p", len(names))
    graph = ca.Function("known", [vector], [known.expression(names, vector)])
    given = [values(drive)[name] for name in names]
    np.testing.assert_allclose(graph(given).full().ravel(), residuals, atol=1e-9)


def test_lumped_values_drawn_with_their_deviation():
    exact, rng = Lumped(20.0, 0.23, 20.0, 8e-3, 5.6e-4), np.random.default_rng(0)
    drawn = [exact.drawn(rng) for _ in range(2000)]
    spread = [
        np.std([getattr(one, name) / getattr(exact, name) for one in drawn]) for name in "kbm"
    ]
    np.testing.assert_allclose(spread, exact.deviation[:3], rtol=0.1)


@pytest.mark.parametrize("axis", AXES)
def test_excitation_keeps_to_both_limits(axis):
    bench = Laboratory(axis, "CD7")
    sine = excitation(bench, GRID)
    assert sine.amplitude.max() <= 4.0
    quiet = Laboratory(axis, "CD7", noise=0.0, electronics=0.0, bits=None)
    record = ClosedLoop(quiet, GRID, disturbances=False)._play(sine, 0)
    parts = np.split(record.x, round(LOOP_SETTLING * RATE) + np.cumsum([0, *sine.lengths]))[1:-1]
    swing = [
        abs(sine_fit(part, RATE, frequency)[PERIODS // 2 :, 0]).mean()
        for part, frequency in zip(parts, GRID, strict=True)
    ]
    np.testing.assert_allclose(swing[:3], ERROR_SWING[axis], rtol=0.03)
    assert max(swing) < 1.03 * ERROR_SWING[axis]


def test_colour_of_noise():
    rng = np.random.default_rng(1)
    noise = rng.standard_normal((4000, 12)) + 1j * rng.standard_normal((4000, 12))
    white, steps = noise[:, 1:11], np.diff(noise, axis=1)[:, 1:11]
    walk = np.cumsum(noise, axis=1)[:, :10]
    ratio = [
        noise_colour(one - one.mean(axis=1, keepdims=True)).mean() for one in (white, steps, walk)
    ]
    assert ratio[0] == pytest.approx(1.0, abs=0.03)
    assert ratio[1] < 0.35  # what a period's end took, the next one's start gives back
    assert ratio[2] > 2.5


def test_neighbours_alike_by_chance_or_not():
    rng = np.random.default_rng(2)
    noise = rng.standard_normal((400, 200)) + 1j * rng.standard_normal((400, 200))
    chance = np.array([neighbours_p(one, 5) for one in noise])
    assert np.mean(chance < 0.1) == pytest.approx(0.1, abs=0.05)
    bulge = 3.0 * np.exp(-(((np.arange(200) - 80) / 8) ** 2))
    assert np.median([neighbours_p(one + bulge, 5) for one in noise]) < 0.01


@pytest.mark.parametrize("axis", thinned(AXES, 2))
@pytest.mark.parametrize("disturbances", [False, True])
def test_parameters_come_back(runs, axis, disturbances):
    task, solution = runs(axis, disturbances)
    assert solution.outcome is Outcome.SOLVED, solution.certificate.failures
    metrics = task.metrics(solution.answer)
    assert metrics["covered"] == 1.0
    assert metrics["covered_response"] > 0.96
    assert not metrics["wrong_order"]
    assert {f"error_{name}" for name in LIMITS} <= metrics.keys()


@pytest.mark.parametrize("axis", AXES)
def test_the_disc_hardly_matters(runs, axis):
    still, turning = (runs(axis, d)[1].answer["value"] for d in (False, True))
    half = runs(axis, False)[1].answer["half_width"]
    assert (abs(still - turning) < half / 2).all()


def test_wrong_order_is_told_not_failed(runs):
    task, solution = runs("focus", mismatch=0.25)
    assert solution.outcome is Outcome.SOLVED
    metrics = task.metrics(solution.answer)
    assert metrics["wrong_order"]
    assert metrics["covered"] < 0.7  # intervals as narrow as ever, about wrong values
    assert metrics["error_m2"] > metrics["half_width_m2"]
    assert "for instance order" in task.tables(solution.answer)["parameters"]


def test_wrong_order_fails_where_it_was_not_asked_for(runs):
    task, solution = runs("focus", mismatch=0.25)
    trusting = replace(task, bench=replace(task.bench, mismatch=0.0))
    failed = " ".join(trusting.certify(solution.answer, 1e-6).failures)
    assert "order" in failed


def test_lost_loop_and_saturation_fail(runs):
    task, solution = runs("focus")
    worse = solution.answer.assign(events=2, saturated=1e-6, largest_error=3e-6)
    failed = " ".join(task.certify(worse, 1e-6).failures)
    assert all(name in failed for name in ("loop", "saturation", "linear range"))


def test_figure_and_table(runs):
    task, solution = runs("focus")
    (figure,) = task.figures(solution.answer).values()
    assert all(panel.get_ylabel().endswith("]") for panel in figure.axes)
    table = task.tables(solution.answer)["parameters"]
    assert all(f"| {name} " in table for name in FITTED)
