"""What bandwidth gains on the disc and costs in a scratch."""

from dataclasses import replace

import numpy as np
import pytest
from workbench.plants.cd_drive.diagnosis.scratch_draws import ScratchDraw
from workbench.plants.cd_drive.drive.plants import controller
from workbench.plants.cd_drive.drive.tables import red_book
from workbench.plants.cd_drive.laboratory.bench_setup import PERIOD
from workbench.plants.cd_drive.laboratory.experiment import Laboratory
from workbench.plants.cd_drive.tolerance.bandwidth_trade_off.problem import (
    bandwidth_trade_off,
)
from workbench.plants.cd_drive.tolerance.bandwidth_trade_off.runs import ROTATION

import workbench as wb
from workbench.simulation import discrete_system
from workbench.solvers import Options


@pytest.fixture(scope="module")
def task(slower):
    return bandwidth_trade_off("focus", slower["focus"], draws=2)


@pytest.mark.cases(1)
@pytest.mark.parametrize("axis", ["focus", "radial"])
def test_the_disc_leaves_what_the_sensitivity_says(slower, axis):
    """|S| of the sampled loop at the rotation frequency, from its responses alone."""
    loop = bandwidth_trade_off(axis, slower[axis]).loop
    z = np.exp(2j * np.pi * ROTATION * PERIOD)
    error = Laboratory(axis, "nominal").response([ROTATION])["f_en"][0]
    for law, gain in (("full gain", 1.0), ("third gain", 1 / 3)):
        K = complex(discrete_system(controller(axis), PERIOD)(z)) * gain
        left = 0.25 * red_book(axis).deviation / abs(1 - K * error)
        found = loop.reaction(law, 0.25, 1e-3, ScratchDraw(1, 0.3)).disc
        assert found == pytest.approx(left, rel=0.03, abs=0.02e-6)


def test_a_scratch_that_takes_and_shifts_nothing_moves_nothing(task):
    loop = replace(task.loop, depth=1e-12, swing=0.0)
    reaction = loop.reaction("full gain", 0.1, 1e-3, ScratchDraw(1, 0.3))
    assert reaction.scratch == 0.0 and reaction.control == 0.0 and not reaction.lost


@pytest.mark.cases(0)
def test_fast_for_the_disc_and_slow_for_scratches(task):
    """Another seed changes no verdict."""
    for seed in (0, 1):
        solution = wb.solve(task, options=Options(seed=seed))
        assert solution.certificate.holds, solution.certificate
        metrics = task.metrics(solution.answer)
        assert metrics["disc_third_over_full_low"] > 2.5
        assert metrics["scratch_third_over_full_high"] < 0.6
        assert 0 < metrics["better_third"] < metrics["cases"]
        assert set(task.figures(solution.answer)) == {"figure-6-7", "reactions"}


@pytest.mark.slow
def test_another_drive_and_more_draws(slower):
    for axis in ("focus", "radial"):
        task = bandwidth_trade_off(axis, slower[axis], drive="CD6", draws=12)
        assert wb.solve(task).certificate.holds
