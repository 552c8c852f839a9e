"""Light of three beams on five diodes, far out of focus."""

import numpy as np
import pytest
from workbench.plants.cd_drive.coupling.sums.diode_plane import DIODES, Layout, normalised
from workbench.plants.cd_drive.coupling.sums.problem import (
    EXAMPLE,
    RANGES,
    Sums,
    features,
    layout_of,
)

from workbench import solve
from workbench.errors import InputError
from workbench.solvers import Options


def test_far_out_of_focus_a_diode_sees_its_share_of_a_half_disc():
    """At 100 um the half disc has a radius of 90 um and is lit evenly."""
    a, b = 6e-6, 8e-6
    layout = Layout(a, b, 40e-6, 5e-6, 6e-6, 0.0)
    light = dict(zip(DIODES, layout.light(np.array([100e-6]))[:, 0], strict=True))
    area = np.pi / 2 * (0.9 * 100e-6) ** 2
    assert light["D1"] + light["D2"] == pytest.approx(2 * a * b / area, rel=0.03)
    assert light["D1"] < 0.25 * light["D2"]  # the edge is as wide as a ray's patch
    assert light["S1"] == pytest.approx(2 * 5e-6 * 6e-6 / area, rel=0.03)


def test_the_half_disc_changes_sides_with_the_error():
    before, after = EXAMPLE.light(np.array([-3e-6, 3e-6])).T
    assert before[0] == pytest.approx(after[1]) and before[1] == pytest.approx(after[0])
    focus, by_d3, radial = normalised(np.array([before, after]).T)
    assert focus[0] == pytest.approx(-focus[1]) and abs(radial).max() < 1e-9
    assert by_d3 == pytest.approx(focus, rel=1e-3)


def test_the_weaker_the_side_beams_the_more_the_radial_sum_rises():
    error, rises = np.linspace(0.0, 60e-6, 31), []
    for side_light in (0.05, 0.15, 0.4):
        light = layout_of(5e-6, 1e-6, 8e-6, 8e-6, side_light, 0.0).light(error)
        radial = light[3] + light[4]
        rises.append(radial.max() / radial[0])
    assert rises[0] > 2.0 and rises[0] > 1.5 * rises[1] > 1.5 * rises[2]


def test_features_of_the_example():
    from workbench.plants.cd_drive.coupling.sums.problem import ERRORS

    found = features(EXAMPLE.light(ERRORS)[None])
    assert abs(found["turn"][0]) == pytest.approx(6e-6, abs=2e-6)
    assert found["radial_rise"][0] > 2.0 and found["radial_end"][0] < 0.1
    assert found["radial_near"][0] < 1e-3 > found["by_d3"][0]


def test_overlapping_diodes_are_named():
    with pytest.raises(InputError, match="would overlap"):
        Layout(6e-6, 8e-6, 10e-6, 5e-6, 6e-6, 0.1)


def test_study():
    """Another seed changes no verdict."""
    task = Sums(10)
    for seed in (0, 1):
        solution = solve(task, options=Options(seed=seed))
        assert solution.certificate.holds, solution.certificate
        numbers = task.metrics(solution.answer)
        assert numbers["focus_sum_peaks_in_focus_mean"] > 0.5
        assert numbers["radial_near_largest"] < 0.05 and numbers["example_rise"] > 2.0
    assert solution.answer["drawn_sizes"].sizes["size"] == len(RANGES)
    wrong = solution.answer.copy(deep=True)
    wrong["turn"][...] *= 1.5
    assert {one.name for one in task.certify(wrong, 1e-6).checks if not one.holds} == {"s-curve"}
