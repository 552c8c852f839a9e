"""Both loops over defects, and a map from four diodes to the true errors."""

import numpy as np
import pytest
from workbench.plants.cd_drive.coupling.diode_map.bench import DefectBench, level_of
from workbench.plants.cd_drive.coupling.diode_map.problem import DiodeMapStudy
from workbench.plants.cd_drive.coupling.diode_map.runs import (
    EACH,
    REFRACTIONS,
    DiodeMap,
    Draw,
    Points,
)
from workbench.plants.cd_drive.diagnosis.defect_kinds import KINDS
from workbench.plants.cd_drive.drive.disc import Defect, Disc
from workbench.plants.cd_drive.laboratory.bench_setup import RATE

from workbench import solve
from workbench.solvers import Options


def test_a_defect_dims_all_diodes_and_moves_both_readings():
    """An opaque defect changes no normalised error; one that refracts moves each by its own."""
    bench, disc, turn = DefectBench("CD1", noise=False), Disc(rotation=1.0), 0.2
    defect = Defect(length=13e-3, angle=turn, depth=0.5, edge=0.1)
    middle = round((turn + 5e-3) * RATE)
    dark = bench.over(disc, [(defect, defect)], 0.22, 0)
    before = level_of(dark.read[: middle - 2000], np.zeros(middle - 2000, bool))
    assert dark.read[middle, 2:4] / before == pytest.approx([0.5, 0.5], rel=0.01)
    assert dark.read[middle, 4] / dark.read[middle - 2000, 4] == pytest.approx(0.5, rel=0.01)
    assert abs(dark.error).max() < 0.05e-6
    moved = Defect(length=13e-3, angle=turn, depth=0.5, offset=0.1e-6, edge=0.1)
    found = bench.over(disc, [(moved, defect)], 0.22, 0)
    swing = abs(found.error[middle - 150 : middle + 200]).max(axis=0)
    assert swing[0] > 0.08e-6 > 0.02e-6 > swing[1]  # the focus loop follows what it reads


def test_draws_have_each_kind_and_refractions_that_belong_together_or_not():
    kinds, alike = Draw(3, REFRACTIONS[1]).defects()
    assert sorted(kinds) == sorted(EACH * list(KINDS))
    ratios = {round(r.displacement / f.displacement, 9) for f, r in alike if f.displacement}
    assert len(ratios) == 1
    _, free = Draw(3, REFRACTIONS[0]).defects()
    assert [f for f, _ in free] == [f for f, _ in alike]
    assert len({round(r.displacement / f.displacement, 9) for f, r in free if f.displacement}) > 2


def test_the_map_is_the_mean_error_given_the_readings():
    """Known truth: the focus error is half the reading, and the radial one their difference."""
    rng = np.random.default_rng(4)

    def points(n):
        reading = rng.standard_normal((n, 4))
        error = np.column_stack([0.5 * reading[:, 0], reading[:, 1] - reading[:, 2]])
        return Points(reading, error, np.zeros(n, int), np.zeros(2), np.zeros(2))

    judged = points(500)
    found = DiodeMap(points(40_000)).estimates(judged)
    off = np.sqrt(((found - judged.error) ** 2).mean(axis=1))
    reading, nothing, two, four = off
    assert reading[0] == pytest.approx(0.5, rel=0.1) == nothing[0]
    assert two[0] < 0.06 and four[0] < 0.15  # its own pair tells the focus error
    assert four[1] < 0.4 < 0.9 < two[1]  # and not the radial one, which needs both pairs


@pytest.mark.slow
def test_study():
    """Another seed changes no verdict: at most half is left nowhere."""
    for seed in (1, 2):
        task = DiodeMapStudy(1)
        solution = solve(task, options=Options(seed=seed))
        assert solution.certificate.holds, solution.certificate
        numbers = task.metrics(solution.answer)
        for refraction in REFRACTIONS:
            assert 0.5 < numbers[f"left_focus_{refraction}"] < 1.0
            assert 0.5 < numbers[f"left_radial_{refraction}"] < 1.1
        assert 0.9 < numbers["D3_over_sum_focus"] < 1.1
    wrong = solution.answer.copy(deep=True)
    wrong["square"].loc[{"estimate": "map of four"}] *= 2.0
    assert {one.name for one in task.certify(wrong, 1e-6).checks if not one.holds} == {
        "more diodes"
    }
