"""Certificates of circles: what they accept, and that they reject everything worse."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from workbench.geometry import Circle, SmallestCircle, smallest_circle
from workbench.program import find_method, methods
from workbench.solution import solve
from workbench.solvers import Options, Outcome

HIGH = 1e-9
coordinates = st.one_of(st.integers(-3, 3), st.floats(-10, 10, width=16))
point_sets = st.lists(st.builds(complex, coordinates, coordinates), min_size=1, max_size=12).map(
    np.array
)
TRIANGLE = np.array([1, -1 + 0.5j, 1j])
DEGENERATE = {
    "one point": np.array([2 + 1j]),
    "the origin": np.array([0j]),
    "two points": np.array([0j, 2j]),
    "all equal": np.full(5, 2 + 1j),
    "collinear": np.array([0j, 1 + 1j, 3 + 3j, 2 + 2j]),
    "collinear, turned": np.array([0, 1, 3, 7.3]) * np.exp(0.7j),
    "duplicates": np.array([1] + 100 * [-1] + [1j]),
    "a pair of heaps": np.array(70 * [1] + 70 * [1j] + [-1]),
    "square": np.array([0j, 1, 1j, 1 + 1j]),
    "polygon": np.exp(2j * np.pi * np.arange(1000) / 1000),
    "cocircular": 3 + np.exp(1j * np.random.default_rng(0).uniform(0, 7, 500)),
    "tiny": 1e-300 * TRIANGLE,
    "huge": 1e300 * TRIANGLE,
    "far": 1e8 + TRIANGLE,
    "far, turned": 1e8 * np.exp(0.3j) + TRIANGLE,
    "far heap": 1e8 * np.exp(0.3j) + np.array([-1e-2, 1e-9, 2e-9j, 1e-5, 1e-2, 0.9e-2j - 1e-3]),
    "clustered": np.array([0, 1e-8, 1e-6j, 1e-4, 1e-2j, 1]),
}


def random_sets(seed, *shape):
    rng = np.random.default_rng(seed)
    return rng.normal(size=shape) + 1j * rng.normal(size=shape)


def holds(points, answer, tolerance=HIGH):
    return SmallestCircle(points).certify(answer, tolerance, optimal=True).holds


@pytest.mark.parametrize("name", DEGENERATE)
def test_exact_is_certified_for_degenerate_sets(name):
    solution = solve(
        SmallestCircle(DEGENERATE[name]), method="exact", options=Options(tolerance="high")
    )
    assert solution.certificate.failures == ()
    assert solution.outcome is Outcome.SOLVED


@settings(derandomize=True, deadline=None)
@given(point_sets)
def test_exact_is_certified(points):
    assert holds(points, smallest_circle(points))


@settings(derandomize=True, deadline=None)
@given(point_sets, st.sampled_from([1e-300, 1e-12, 1e12, 1e300]))
def test_exact_is_certified_at_every_scale(points, scale):
    assert holds(points * scale, smallest_circle(points * scale))


def test_exact_is_certified_in_batches():
    for batch in [(), (50,), (5, 10)]:
        points = random_sets(1, *batch, 12)
        assert holds(points, smallest_circle(points))


MUTATIONS = {
    "shrunk": lambda c: replace(c, radius=c.radius * (1 - 1e-6)),
    "inflated": lambda c: replace(c, radius=c.radius * (1 + 1e-6)),
    "radius of zero": lambda c: replace(c, radius=c.radius * 0),
    "radius negative": lambda c: replace(c, radius=-c.radius),
    "shifted": lambda c: replace(c, center=c.center + 1e-3 * c.radius),
    "shifted up": lambda c: replace(c, center=c.center + 1e-3j * c.radius),
    "shifted and inflated": lambda c: Circle(c.center + 1e-3 * c.radius, c.radius * (1 + 1e-3)),
    "centre negative": lambda c: replace(c, center=-c.center),
    "centre conjugate": lambda c: replace(c, center=c.center.conj()),
    "centre swapped": lambda c: replace(c, center=1j * c.center.conj()),
    "permuted": lambda c: Circle(np.roll(c.center, 1), np.roll(c.radius, 1)),
    "centres permuted": lambda c: replace(c, center=np.roll(c.center, 1)),
    "radii permuted": lambda c: replace(c, radius=np.roll(c.radius, 1)),
    "one radius for all": lambda c: replace(c, radius=np.full_like(c.radius, c.radius.max())),
    "centre no number": lambda c: replace(c, center=c.center * np.nan),
    "radius no number": lambda c: replace(c, radius=c.radius * np.nan),
}


@pytest.mark.parametrize("mutation", MUTATIONS)
@pytest.mark.parametrize("seed", range(5))
def test_mutations_of_the_best_are_rejected(mutation, seed):
    points = random_sets(seed, 4, 12)
    best = smallest_circle(points)
    assert holds(points, best)
    assert not holds(points, MUTATIONS[mutation](best))


@pytest.mark.parametrize("mutation", MUTATIONS)
def test_one_mutation_among_many_sets_is_enough(mutation):
    points = random_sets(9, 6, 12)
    best = smallest_circle(points)
    mutated = MUTATIONS[mutation](best)
    if np.isclose(mutated.radius[3], best.radius[3]) and mutated.center[3] == best.center[3]:
        pytest.skip("this set is left alone")
    center, radius = best.center.copy(), best.radius.copy()
    center[3], radius[3] = mutated.center[3], mutated.radius[3]
    certificate = SmallestCircle(points).certify(Circle(center, radius), HIGH, optimal=True)
    assert not certificate.holds
    assert all(check.holds or check.where == "at set 3" for check in certificate.checks)


@pytest.mark.cases(0)
@settings(derandomize=True, deadline=None)
@given(point_sets, st.floats(1e-6, 10), st.floats(0, 7))
def test_nothing_else_is_certified(points, size, direction):
    """The smallest circle is unique: whatever holds is close to it."""
    best = smallest_circle(points)
    scale = best.radius + np.abs(points).max()
    moved = Circle(best.center + size * scale * np.exp(1j * direction), best.radius)
    if size * scale > 1e-3 * (scale + 1e-300):
        assert not holds(points, moved)
        far = np.abs(points - moved.center).max() * (1 + 1e-12)
        assert not holds(points, replace(moved, radius=far))


def test_validity_alone_lets_a_wide_circle_pass():
    points = random_sets(2, 3, 12)
    best = smallest_circle(points)
    wide = replace(best, radius=2 * best.radius)
    certificate = SmallestCircle(points).certify(wide, HIGH)
    assert certificate.holds
    assert certificate.valid
    assert certificate.gap.value == pytest.approx(0.5, abs=1e-9)
    assert not certificate.gap.closed


def test_the_gap_is_how_much_too_wide_it_is():
    points = random_sets(3, 12)
    best = smallest_circle(points)
    for excess in (1e-8, 1e-4, 1e-2):
        wide = replace(best, radius=best.radius * (1 + excess))
        gap = SmallestCircle(points).certify(wide, HIGH).gap.value
        assert gap == pytest.approx(excess / (1 + excess), rel=1e-6)


# --- methods ----------------------------------------------------------------------------------

KNOWN = {
    "one point": ([2 + 1j], 2 + 1j, 0),
    "two points": ([0j, 2j], 1j, 1),
    "collinear": ([0j, 1 + 1j, 3 + 3j], 1.5 + 1.5j, np.sqrt(4.5)),
    "right triangle": ([0j, 1, 1j], 0.5 + 0.5j, np.sqrt(0.5)),
    "square": ([0j, 2, 2j, 2 + 2j], 1 + 1j, np.sqrt(2)),
    "acute triangle": ([1, np.exp(2j), np.exp(-2j)], 0, 1),
    "obtuse triangle": ([-2, 2, 0.5j], 0, 2),
}
FINDING = {"thesis", *(name for name, entry in methods(SmallestCircle).items() if entry.optimal)}
"""Methods that find these circles: those that claim the optimum, and that of the thesis."""


@pytest.mark.parametrize("name", KNOWN)
@pytest.mark.parametrize("method", methods(SmallestCircle))
@pytest.mark.parametrize("tolerance", ["low", "middle"])
def test_known_circles(name, method, tolerance):
    points, center, radius = KNOWN[name]
    options = Options(tolerance=tolerance)
    points = np.array(points, dtype=complex)
    solution = solve(SmallestCircle(points), method=method, options=options)
    assert solution.outcome is Outcome.SOLVED
    assert solution.certificate.valid
    if method in FINDING:
        assert solution.answer.radius == pytest.approx(radius, rel=options.accuracy, abs=1e-15)
        assert abs(solution.answer.center - center) <= np.sqrt(2 * options.accuracy) * radius
    public = smallest_circle(points, method=method, options=options)
    assert public.radius == solution.answer.radius


@pytest.mark.parametrize("kind", ["normal", "cocircular", "grid", "duplicated"])
def test_thesis_is_never_smaller_than_exact(kind):
    rng = np.random.default_rng(4)
    points = random_sets(4, 100, 9)
    if kind == "cocircular":
        points = points / np.abs(points)
    elif kind == "grid":
        points = np.round(2 * points)
    elif kind == "duplicated":
        points = points[:, rng.integers(0, 5, 9)]
    program = SmallestCircle(points)
    answer, _, _ = find_method(program, "thesis").answer(program, None)
    exact = smallest_circle(points)
    found = np.isfinite(answer.radius)
    assert np.all(answer.radius[found] >= exact.radius[found] * (1 - 1e-12))
    valid = SmallestCircle(points[found]).certify(
        Circle(answer.center[found], answer.radius[found]), HIGH
    )
    assert valid.valid


def test_a_method_that_loses_a_set_has_failed(monkeypatch):
    monkeypatch.setattr(
        "workbench.geometry.circle.thesis_circle",
        lambda points: (np.array([0, np.nan + 0j]), np.array([9.0, np.nan])),
    )
    solution = solve(SmallestCircle(random_sets(5, 2, 6)), method="thesis")
    assert solution.outcome is Outcome.FAILED
    assert "1 of the sets" in solution.message
    assert not solution.certificate.valid


def test_an_answer_of_another_shape_does_not_leak_an_exception(monkeypatch):
    monkeypatch.setattr(
        "workbench.geometry.circle.exact_circle", lambda points: (np.zeros(3, complex), np.ones(3))
    )
    solution = solve(SmallestCircle(random_sets(5, 2, 6)), method="exact")
    assert solution.outcome is Outcome.FAILED
