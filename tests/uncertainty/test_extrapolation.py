"""Sets of a stated probability content, against sampling."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats

import workbench as wb
from workbench.errors import InputError
from workbench.uncertainty import CircleCover, Responses, widened_responses
from workbench.uncertainty.responses.extrapolation import prediction_polygon


def inside(corners, points):
    """Which points (F,) lie in convex polygons (F, K), of either sense of rotation."""
    away = corners - points[:, None]
    cross = (away.conj() * np.roll(away, -1, axis=1)).imag
    return np.all(cross >= 0, axis=1) | np.all(cross <= 0, axis=1)


def ellipse(values, content):
    """Mean, inverse covariance and level of the prediction ellipse of values (N,)."""
    n = len(values)
    points = np.stack([values.real, values.imag])
    level = 2 * (n - 1) * (n + 1) / (n * (n - 2)) * stats.f(2, n - 2).ppf(content)
    return points.mean(axis=1), np.linalg.inv(np.cov(points)), level


@pytest.mark.parametrize("content", [0.9, 0.99])
@pytest.mark.parametrize("count", [4, 12])
def test_a_further_plant_is_inside_with_the_probability_asked_for(count, content):
    rng = np.random.default_rng(20261121 + count)
    trials = 20_000
    mix = np.array([[3.0, 0.0], [1.0, 0.2]])
    drawn = rng.normal(size=(trials, count + 1, 2)) @ mix + [5, -2]
    drawn = drawn[..., 0] + 1j * drawn[..., 1]
    corners = prediction_polygon(drawn[:, :count], np.ones((trials, count), bool), content)
    share = inside(corners, drawn[:, count]).mean()
    spread = np.sqrt(content * (1 - content) / trials)
    assert share > content - 4 * spread
    # the polygon is a little larger than the ellipse, whose content is exact
    assert share < content + 4 * spread + 0.02 * (1 - content)


@settings(derandomize=True, deadline=None, max_examples=30)
@given(st.integers(0, 10_000), st.integers(4, 9), st.floats(0.05, 0.999))
def test_the_polygon_is_drawn_around_the_ellipse(seed, count, content):
    rng = np.random.default_rng(seed)
    values = rng.normal(size=count) + 1j * rng.normal(size=count)
    corners = prediction_polygon(values[None], np.ones((1, count), bool), content)
    mean, inverse, level = ellipse(values, content)
    turn = np.linspace(0, 2 * np.pi, 200)
    around = np.linalg.cholesky(np.linalg.inv(inverse)) @ np.stack([np.cos(turn), np.sin(turn)])
    edge = mean[0] + 1j * mean[1] + np.sqrt(level) * (around[0] + 1j * around[1])
    shrunk = edge + 1e-9 * (mean[0] + 1j * mean[1] - edge)
    assert inside(np.repeat(corners, 200, axis=0), shrunk).all()
    away = np.stack([corners[0].real - mean[0], corners[0].imag - mean[1]])
    distance = np.einsum("ik,ij,jk->k", away, inverse, away)
    np.testing.assert_allclose(distance, level / np.cos(np.pi / corners.shape[1]) ** 2)


@settings(derandomize=True, deadline=None, max_examples=30)
@given(st.integers(0, 10_000), st.lists(st.floats(-3, 3), min_size=6, max_size=6))
def test_the_region_moves_with_the_plants(seed, numbers):
    """Under an affine map of the plane inside stays inside and outside outside."""
    shape = np.reshape(numbers[:4], (2, 2))
    if np.linalg.cond(shape) > 30:
        return
    rng = np.random.default_rng(seed)
    values = rng.normal(size=(1, 6)) + 1j * rng.normal(size=(1, 6))

    def mapped(z):
        x = shape @ np.stack([z.real.ravel(), z.imag.ravel()])
        return (x[0] + 1j * x[1] + complex(*numbers[4:])).reshape(z.shape)

    present = np.ones((1, 6), bool)
    one = prediction_polygon(values, present, 0.9)
    other = prediction_polygon(mapped(values), present, 0.9)
    # corners stand elsewhere on the ellipse, at the same distance in its own metric
    mean, inverse, level = ellipse(mapped(values)[0], 0.9)
    for corners in (mapped(one), other):
        away = np.stack([corners[0].real - mean[0], corners[0].imag - mean[1]])
        distance = np.einsum("ik,ij,jk->k", away, inverse, away)
        np.testing.assert_allclose(distance, level / np.cos(np.pi / 24) ** 2, rtol=1e-6)


OMEGA = np.geomspace(1, 100, 12)


def plants(count=5, seed=0):
    rng = np.random.default_rng(seed)
    gain, corner = 1 + 0.1 * rng.normal(size=count), 20 * (1 + 0.1 * rng.normal(size=count))
    return gain / (1 + 1j * OMEGA[:, None] / corner)


def test_corners_are_added_as_plants():
    values = plants()
    present = np.ones(values.shape, bool)
    present[3, 1] = False
    values[3, 1] = np.nan
    wide = widened_responses(
        Responses(omega=OMEGA, values=values, present=present, plants=list("abcde"), unit="m"), 0.9
    )
    assert wide.plants[:6] == ("a", "b", "c", "d", "e", "predicted 1")
    assert wide.unit == "m"
    assert wide.present[:, 5:].all()
    assert not wide.present[3, 1]
    rest = values[3, [0, 2, 3, 4]][None]
    corners = prediction_polygon(rest, np.ones((1, 4), bool), 0.9)
    np.testing.assert_allclose(wide.values[3, 5:], corners[0])


def test_the_assumption_stands_in_the_certificate():
    wide = widened_responses(Responses(omega=OMEGA, values=plants()), 0.95)
    program = CircleCover(wide, 1, zeros=0, complex_order=1)
    solution = wb.solve(program, method="steps")
    assert solution.certificate.valid
    statement = solution.certificate.checks[0].statement
    assert "bivariate normal distribution" in statement
    assert "probability 0.95" in statement
    bare = CircleCover(Responses(omega=OMEGA, values=plants()), 1, zeros=0, complex_order=1)
    assert "assumed" not in bare.checks(solution.answer, 1e-6)[0].statement


def test_what_an_assumption_needs_is_not_left_out():
    wide = widened_responses(Responses(omega=OMEGA, values=plants()), 0.95)
    with pytest.raises(InputError, match=r"leave_out is 1, but .* bivariate normal .* all of them"):
        CircleCover(wide, 1, zeros=0, complex_order=1, leave_out=1)


def test_a_share_of_linearity_only_widens_variances_and_lets_plants_be_left_out():
    bent = Responses(omega=OMEGA, values=plants(), variance=1e-6).linear_within(0.01)
    program = CircleCover(bent, 1, zeros=0, complex_order=1, leave_out=1)
    assert program.points.shape[1] <= bent.values.shape[1]
    with pytest.raises(InputError, match="leave_out counts plants, confidence covers regions"):
        CircleCover(bent, 1, confidence=0.95, leave_out=1)


@pytest.mark.parametrize("content", [0, 1, -0.1, 2, np.nan])
def test_refused_contents(content):
    with pytest.raises(InputError, match="content is a probability between 0 and 1, it is"):
        widened_responses(Responses(omega=OMEGA, values=plants()), content)


def test_few_plants_say_little():
    with pytest.raises(InputError, match=r"3 plants at 0.159\d* Hz say too little.*4 or more"):
        widened_responses(Responses(omega=OMEGA, values=plants(3)), 0.9)
    present = np.ones((12, 5), bool)
    present[7, :2] = False
    with pytest.raises(InputError, match=r"3 plants at 2\.98227 Hz"):
        widened_responses(Responses(omega=OMEGA, values=plants(), present=present), 0.9)
