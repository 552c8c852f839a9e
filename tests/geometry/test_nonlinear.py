"""Circles and stadiums as nonlinear programs for IPOPT."""

import numpy as np
import pytest
import xarray as xr
from lanes import thinned

from workbench.errors import SolverError
from workbench.geometry import (
    NarrowestStadium,
    SmallestCircle,
    narrowest_stadium,
    nonlinear,
    smallest_circle,
)
from workbench.program import methods
from workbench.solution import solve
from workbench.solvers import Options, Outcome

CASES = {
    "free": {},
    "centre": {"center": 0.3 - 0.2j},
    "angle": {"angle": 0.7},
    "both": {"center": 0.3 - 0.2j, "angle": 0.7},
}
SETS = {
    "normal": (np.random.default_rng(0).normal(size=(4, 12, 2)) @ [1, 1j]),
    "far": 1e6 + (np.random.default_rng(1).normal(size=(2, 8, 2)) @ [1, 1j]),
    "tiny": 1e-12 * (np.random.default_rng(2).normal(size=(2, 8, 2)) @ [1, 1j]),
    "duplicates": np.array([[0, 0, 1, 1j, 1j, 0.2 + 0.1j]]),
    "two points": np.array([[0j, 2 + 1j]]),
}


def test_what_it_claims():
    assert methods(SmallestCircle)["ipopt"].optimal
    assert not methods(NarrowestStadium)["ipopt"].optimal


@pytest.mark.parametrize("sets", SETS)
@pytest.mark.parametrize("level", ["low", "middle"])
def test_circles(sets, level):
    options = Options(tolerance=level)
    solution = solve(SmallestCircle(SETS[sets]), method="ipopt", options=options)
    exact = smallest_circle(SETS[sets])
    assert solution.outcome is Outcome.SOLVED
    assert np.all(solution.answer.radius >= exact.radius * (1 - 1e-9))
    assert np.all(solution.answer.radius <= exact.radius * (1 + 2 * options.accuracy))


@pytest.mark.parametrize("case", CASES)
@pytest.mark.parametrize("sets", SETS)
@pytest.mark.parametrize("level", thinned(["middle", "low"], 2))
def test_stadiums(case, sets, level):
    options = Options(tolerance=level)
    points, chosen = SETS[sets], dict(CASES[case])
    if "center" in chosen:
        size = np.abs(points - points[:, :1]).max()
        chosen["center"] = points[:, 0] + chosen["center"] * size
    solution = solve(NarrowestStadium(points, **chosen), method="ipopt", options=options)
    exact = narrowest_stadium(points, **chosen)
    assert solution.certificate.valid
    assert np.all(solution.answer.radius >= exact.radius * (1 - 1e-9) - 1e-14)
    # twelve starts find the global minimum of these few points
    size = exact.radius + exact.half_length
    assert np.all(solution.answer.radius <= exact.radius + options.accuracy * size)


def test_starts_are_those_of_the_seed():
    program = NarrowestStadium(SETS["normal"])
    first, again, other = (
        solve(program, method="ipopt", options=Options(tolerance="low", seed=seed)).answer
        for seed in (1, 1, 2)
    )
    np.testing.assert_array_equal(first.angle, again.angle)
    np.testing.assert_array_equal(first.radius, again.radius)
    np.testing.assert_allclose(first.radius, other.radius, rtol=1e-2)


@pytest.mark.parametrize("program", [SmallestCircle, NarrowestStadium])
def test_a_set_that_is_refused_is_named(monkeypatch, program):
    monkeypatch.setattr(
        nonlinear,
        "ipopt_outcome",
        lambda solver: (Outcome.FAILED, "ipopt: Maximum_Iterations_Exceeded"),
    )
    points = xr.DataArray(
        SETS["normal"][:2],
        dims=("frequency", "drive"),
        coords={"frequency": ("frequency", [10.0, 31.25], {"units": "Hz"})},
    )
    solution = solve(program(points), method="ipopt")
    assert solution.outcome is Outcome.FAILED
    words = "ipopt: Maximum_Iterations_Exceeded at frequency 10 Hz (and 1 more sets)"
    assert solution.message == words
    with pytest.raises(SolverError, match="Maximum_Iterations_Exceeded at frequency 10 Hz"):
        smallest_circle(points, method="ipopt")


@pytest.mark.parametrize("batch", [(), (2,), (2, 2)])
def test_batches(batch):
    points = SETS["normal"][: int(np.prod(batch))].reshape(*batch, 12)
    stadium = narrowest_stadium(points, method="ipopt")
    assert stadium.radius.shape == stadium.center.shape == batch
