"""Every check of a conic claim refuses by itself what it is there for."""

import math

import conic_programs as known
import pytest
import xarray as xr
from flint import fmpq

from workbench.certify.cones.rays import excluded_radius
from workbench.conic import ConicProgram, NoLeastValue, NoSolution

APART = known.form([1], [[-1], [1]], [-2, 1], known.nonnegative(2))
"""x >= 2 and x <= 1."""
FALLING = known.form([-1], [[-1], [0]], [0, 1], known.nonnegative(2))
"""The largest x >= 0."""


def failed(proof, **answer):
    answer = {name: [fmpq(value) for value in values] for name, values in answer.items()}
    return {check.name for check in proof.checks(answer, 0.0) if not check.holds}


@pytest.mark.parametrize(
    ("y", "check"),
    [((1, 1), None), ((0, 0), "separation"), ((1, 2), "separation"), ((2, -1), "dual cone")],
)
def test_a_ray_that_separates_nothing_is_refused(y, check):
    assert failed(NoSolution(APART), y=y) == ({check} if check else set())
    assert (excluded_radius(APART, [fmpq(value) for value in y]) > 0) is (check is None)


@pytest.mark.parametrize(
    ("x", "ray", "check"),
    [(0, 1, None), (0, 0, "falling"), (-1, 1, "solution"), (0, -1, "ray, falling")],
)
def test_a_ray_or_a_start_that_is_none_is_refused(x, ray, check):
    assert failed(NoLeastValue(FALLING), x=[x], ray=[ray]) == set(
        check.split(", ") if check else ()
    )


def test_a_radius_below_all_doubles_excludes_nothing():
    """x >= 1e-200 in units of 1e200 for y = (1, 0): R = 1e-400."""
    form = known.form([1], [[-1e200], [1]], [-1e-200, 1], known.nonnegative(2))
    certificate = NoSolution(form).certify({"y": [fmpq(1), fmpq(0)]}, 1e-6)
    assert certificate.gap.value == math.inf and not certificate.holds


@pytest.mark.parametrize(
    ("cone", "inside", "outside"),
    [
        (known.equal(2), [0.0, 0.0], [0.0, -0.5]),
        (known.nonnegative(2), [0.0, 3.0], [3.0, -0.5]),
        (known.second_order(3), [5.0, 3.0, 4.0], [-5.5, 3.0, 4.0]),
        (known.semidefinite(2), [1.0, 1.0, 1.0], [1.0, 2.0, 1.0]),
    ],
    ids=lambda one: one.kind if hasattr(one, "kind") else "",
)
def test_a_slack_outside_of_its_cone_is_refused(cone, inside, outside):
    """b - A x is b: the answer stays outside, whatever x."""
    for b, holds in ((inside, True), (outside, False)):
        form = known.form([0], [[0]] * len(b), b, cone)
        answer = xr.Dataset({"x": ("column", [0.0])})
        assert [check.holds for check in ConicProgram(form).checks(answer, 1e-9)] == [holds]


@pytest.mark.parametrize(
    ("y", "gap"),
    [((1, 0), 0.0), ((2, 1), 1 / 3), ((1, 1), math.inf), ((0, -1), math.inf)],
    ids=["tight", "loose", "of another objective", "outside the dual cone"],
)
def test_a_gap_is_that_of_a_dual_point(y, gap):
    """The least x from 2 to 3; A'y = -1 for y = (1, 0), (2, 1) and (0, -1)."""
    form = known.form([1], [[-1], [1]], [-2, 3], known.nonnegative(2))
    answer = xr.Dataset({"x": ("column", [2.0]), "dual": ("row", [str(value) for value in y])})
    assert ConicProgram(form).gap(answer)[1] == pytest.approx(gap)
