"""The joint search of a model: its size, slopes and descent, and what it must not exploit."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from lanes import examples
from scipy.optimize import minimize_scalar

import workbench as wb
from workbench import Options
from workbench.executor import Context
from workbench.fitting import MagnitudeFit
from workbench.fitting.factored import FactoredRational
from workbench.fitting.rational import Rational
from workbench.fitting.root_pairs import pair_logarithms
from workbench.uncertainty import CircleCover, Responses, StadiumCover, limited_orientation
from workbench.uncertainty.covers.cover import HALF_LENGTH_WEIGHT
from workbench.uncertainty.covers.joint.model_size import model_size
from workbench.uncertainty.covers.joint.moved_pairs import with_moved_pair
from workbench.uncertainty.covers.joint.search import (
    BEYOND,
    BEYOND_DECADES,
    FoundModel,
    ModelSize,
    smallest_model,
)
from workbench.uncertainty.covers.joint.starts import starts
from workbench.uncertainty.covers.weights import (
    CONSTANT_DECADES,
    beyond,
    lasting,
    needed_radius,
)

OMEGA = np.geomspace(1, 1000, 14)
CONTEXT = Context(options=Options())
NOMINAL = Rational([-700.0], [-2 + 28j, -2 - 28j], 1.2)
REAL = Rational([-40.0], [-200.0], 0.3)
CIRCLE = Rational([-3 + 20j, -3 - 20j], [-9 + 25j, -9 - 25j], 0.2)
UPRIGHT = limited_orientation()


def plants(seed=1, count=6, spread=0.2, omega=OMEGA):
    """Second-order plants of random frequency, damping and gain."""
    rng = np.random.default_rng(seed)
    level, damping, gain = 1 + spread * rng.uniform(-1, 1, (3, count))
    s = 1j * omega[:, None]
    values = 900 * gain * level**2 / (s**2 + 3 * damping * level * s + 900 * level**2)
    return Responses(omega=omega, values=values)


def program_of(kind, responses, **keywords):
    orders = {"order": 2, "zeros": 1, "complex_order": 2}
    if kind == "circle":
        return CircleCover(responses, **orders, **keywords)
    return StadiumCover(responses, **orders, real_order=1, orientation=UPRIGHT, **keywords)


def size_of(kind, **keywords):
    program = program_of(kind, plants(), **keywords)
    return ModelSize.of(program, FoundModel(NOMINAL, REAL if kind == "stadium" else None, CIRCLE))


@pytest.mark.parametrize("power", [4, 64])
@pytest.mark.parametrize("form", ["multiplicative", "additive"])
@pytest.mark.parametrize("given_nominal", [False, True])
@pytest.mark.parametrize("kind", ["circle", "stadium", "minimum phase"])
def test_slopes_are_those_of_differences(kind, given_nominal, form, power):
    keywords = {"form": form, "nominal": NOMINAL if given_nominal else None}
    if kind == "minimum phase":
        kind, keywords = "stadium", keywords | {"minimum_phase": True}
    size = size_of(kind, **keywords)
    vector = size.start
    value, gradient = size(vector, power)
    assert np.isfinite(value)
    for i in range(vector.size):
        step = np.zeros(vector.size)
        step[i] = 1e-6 * max(abs(vector[i]), 1e-2)
        rise = size(vector + step, power)[0] - size(vector - step, power)[0]
        assert rise / (2 * step[i]) == pytest.approx(gradient[i], rel=1e-4, abs=1e-5 * value)


@pytest.mark.parametrize("form", ["multiplicative", "additive"])
@pytest.mark.parametrize("given_nominal", [False, True])
@pytest.mark.parametrize("kind", ["circle", "stadium"])
def test_slopes_of_the_inflation_are_those_of_differences(kind, given_nominal, form):
    size = size_of(kind, form=form, nominal=NOMINAL if given_nominal else None)
    vector = size.start
    data = size.inflation_data(vector)
    value, gradient = model_size(vector, data, 16)
    assert np.isfinite(value)
    for i in range(vector.size):
        step = np.zeros(vector.size)
        step[i] = 1e-6 * max(abs(vector[i]), 1e-2)
        rise = model_size(vector + step, data, 16)[0] - model_size(vector - step, data, 16)[0]
        assert rise / (2 * step[i]) == pytest.approx(gradient[i], rel=1e-4, abs=1e-5 * value)


@pytest.mark.parametrize("form", ["multiplicative", "additive"])
@pytest.mark.parametrize("kind", ["circle", "stadium"])
def test_of_high_power_the_size_is_that_of_sets_that_contain(kind, form):
    """By needed radii and responses of the parts, in NumPy."""
    size = size_of(kind, form=form)
    program, responses = size.program, size.program.responses
    end = REAL.response(OMEGA) if kind == "stadium" else None
    radius = lasting(needed_radius(program.deviations_from(NOMINAL, program.points), end))
    width = np.abs(CIRCLE.response(beyond(OMEGA)))
    raised = width * np.max(radius / width) / lasting(program.unit)
    below, inside, above = np.split(raised, [CONSTANT_DECADES, -CONSTANT_DECADES])
    wanted = responses.shares @ inside**2 + BEYOND * np.mean(np.append(below, above) ** 2)
    if end is not None:
        wanted += HALF_LENGTH_WEIGHT * responses.shares @ np.abs(end / program.unit) ** 2
        decades = 10.0 ** np.arange(1, BEYOND_DECADES + 1)
        far = np.concatenate([OMEGA[0] / decades, OMEGA[-1] * decades])
        unit = np.repeat(program.unit[[0, -1]], BEYOND_DECADES)
        wanted += BEYOND * np.mean(np.abs(REAL.response(far) / unit) ** 2)
    assert size(size.start, 2**16)[0] == pytest.approx(wanted, rel=1e-3)


def test_a_constant_model_is_the_least_of_all():
    """A constant nominal and radius for real gains, against a search in one variable."""
    gains = np.array([[0.5, 1.0, 2.5], [0.8, 1.1, 1.9]])
    responses = Responses(omega=np.array([1.0, 2.0]), values=gains + 0.2j)
    program = CircleCover(responses, 0, zeros=0, complex_order=0, form="additive")
    start = FoundModel(Rational([], [], 1.0), None, Rational([], [], 1.0))
    found = smallest_model(program, start, (8, 64, 512), CONTEXT)
    least = minimize_scalar(
        lambda c: np.abs(program.points - c).max(), bounds=(0, 3), method="bounded"
    )
    assert found.nominal.gain == pytest.approx(least.x, abs=0.02)


@given(st.lists(st.tuples(st.floats(0.01, 5.0), st.floats(1.0, 100.0)), min_size=1, max_size=3))
@examples(20, 100)
def test_damping_and_frequency_of_pairs(wanted):
    roots = np.concatenate([w * np.roots([1, 2 * z, 1]) for z, w in wanted]).astype(complex)
    function = FactoredRational.of(Rational([], roots, 1.0), 0, (0.1, 1e3), True, False)
    damping, frequency = pair_logarithms(function)
    vector = np.append(function.start, 1.0)
    found = sorted(zip(np.exp(frequency @ vector), np.exp(damping @ vector), strict=True))
    for (w, z), part in zip(found, sorted(found), strict=True):
        assert (w, z) == part
    product = np.prod([w**2 for w, _ in found])
    assert product == pytest.approx(np.prod(np.abs(roots)), rel=1e-6)
    assert sum(2 * z * w for w, z in found) == pytest.approx(-roots.real.sum(), rel=1e-6)


@pytest.mark.parametrize("kind", ["circle", "stadium"])
def test_weights_hide_nothing_between_frequencies(kind):
    """Zeros of W_c, poles of either weight: as damped as half the distance of the frequencies."""
    program = program_of(kind, plants(omega=np.geomspace(1, 1000, 40)))
    limit = np.log(1000) / 39 / 2
    sharp = Rational([-1e-4 + 20.5j, -1e-4 - 20.5j], [-1e-4 + 31j, -1e-4 - 31j], 0.2)
    start = FoundModel(NOMINAL, REAL if kind == "stadium" else None, sharp)
    found = smallest_model(program, start, (8, 32, 128), CONTEXT)
    roots = np.concatenate([found.W_c.zeros, found.W_c.poles])
    assert (-roots.real / np.abs(roots) > 0.98 * min(limit, 0.1)).all()


@pytest.mark.parametrize("kind", ["circle", "stadium"])
def test_plants_that_are_alike_at_one_frequency_are_covered(kind):
    """The narrowest sets there have no size, so ratios to them are infinite."""
    omega = np.geomspace(0.1, 10, 20)
    spread = np.array([-0.1, 0.0, 0.1]) * (np.arange(20) != 7)[:, None]
    values = (1 + spread) / (1j * omega[:, None] + 1)
    program = program_of(kind, Responses(omega=omega, values=values))
    assert wb.solve(program, method="inflation").certificate.valid


@pytest.mark.cases(2)
@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("kind", ["circle", "stadium"])
def test_weights_keep_their_size_beyond_the_frequencies(kind, seed):
    """The middle of a resonance alone is known; a slow pole of W_c would cost nothing there."""
    responses = plants(seed, omega=np.geomspace(15.0, 60.0, 20))
    model = wb.solve(program_of(kind, responses)).answer.model
    ends = np.abs(model.W_c.response(np.array([15.0, 60.0])))
    for away in (1e1, 1e2, 1e4):
        beyond_ends = np.abs(model.W_c.response(np.array([15.0 / away, 60.0 * away])))
        assert (beyond_ends <= 10 * ends.max()).all()


def test_a_search_only_lowers():
    program = program_of("stadium", plants())
    for _, start, _ in starts(program, CONTEXT):
        first = ModelSize.of(program, start)
        found = smallest_model(program, start, (8,), CONTEXT)
        assert found.size <= first(first.start, 8)[0]


@pytest.mark.cases(1)
@pytest.mark.parametrize("kind", ["circle", "stadium"])
def test_units_do_not_matter(kind):
    """Gains of 1e-150 and 1e150: the same relative sizes."""
    answers = []
    for unit in (1.0, 1e-150, 1e150):
        responses = plants()
        program = program_of(kind, replace(responses, values=unit * responses.values))
        solution = wb.solve(program, method="joint")
        assert solution.certificate.valid
        answers.append(program.objective(solution.answer))
    assert answers[1:] == pytest.approx(answers[:1] * 2, rel=0.2)


def test_zeros_that_known_plants_of_excess_poles_leave():
    known = tuple(Rational([], [-w + 0j, -2 * w + 0j], 2 * w**2) for w in (1.0, 1.1))
    values = np.stack([plant.response(OMEGA) for plant in known], axis=1)
    responses = Responses(omega=OMEGA, values=values, known=known)
    assert CircleCover(responses, 3, zeros=3, complex_order=2).useful_zeros == 1
    assert CircleCover(responses, 3, zeros=0, complex_order=2).useful_zeros == 0
    assert CircleCover(responses, 3, zeros=3, complex_order=2, form="additive").useful_zeros == 3
    assert (
        CircleCover(Responses(omega=OMEGA, values=values), 3, zeros=3, complex_order=2).useful_zeros
        == 3
    )
    solution = wb.solve(CircleCover(responses, 3, zeros=3, complex_order=2), method="joint")
    assert solution.certificate.valid
    assert solution.answer.model.nominal.zeros.size <= 1


@pytest.mark.cases(0)
def test_the_drives_sets_are_small():
    """Focus at 100 frequencies; with the complex weight fitted afterwards the mean was 0.06."""
    from problems.cd_drive.uncertainty.measured_drives import measured_drives

    drives = replace(measured_drives("focus", 100, 5.0, 5000.0), known=())
    program = StadiumCover(drives, 4, zeros=2, complex_order=4, real_order=4, orientation=UPRIGHT)
    solution = wb.solve(program, method="joint")
    assert solution.certificate.valid
    assert program.objective(solution.answer) <= 0.045


def test_a_start_that_fits_exactly_is_left():
    """Gains of 0.9, 1 and 1.1: with W_r = 0.1 / 1.1 and W_c = 0.1 / 11 the size is 1e-3 / 1.1."""
    s = 1j * OMEGA[:, None]
    responses = Responses(omega=OMEGA, values=np.array([0.9, 1.0, 1.1]) / (s / 30 + 1))
    program = StadiumCover(
        responses, 1, zeros=0, complex_order=1, real_order=1, nominal=Rational([], [-30.0], 30.0)
    )
    exact = FoundModel(program.nominal, Rational([], [], 0.1), Rational([], [], 1e-4))
    size = ModelSize.of(program, exact)
    assert (np.abs(size(size.start, 4)[1] * size.unit) < 1.0).all()
    solution = wb.solve(program, method="joint")
    assert solution.certificate.valid
    assert program.objective(solution.answer) <= 0.98e-3


def test_a_moved_pair_is_where_it_is_wanted_and_changes_little_elsewhere():
    """The pair that nearly cancels is taken out; the others and the mean size stay."""
    pair = np.array([-1 + 30j, -1 - 30j])
    kept = Rational([-5.0], [-3 + 9j, -3 - 9j], 2.0)
    function = Rational([*kept.zeros, *(1.001 * pair)], [*kept.poles, *pair], 2.0)
    moved = with_moved_pair(function, OMEGA, 300.0, np.random.default_rng(3))
    far = OMEGA < 100
    assert np.abs(moved.poles).max() == pytest.approx(300.0, rel=0.6)
    assert moved.order == function.order
    ratio = moved.response(OMEGA[far]) / kept.response(OMEGA[far])
    assert np.abs(ratio - 1).max() < 0.5
    assert with_moved_pair(REAL, OMEGA, 300.0, np.random.default_rng(3)) is None


@pytest.mark.parametrize("kind", ["circle", "stadium"])
def test_the_inflation_is_made_smaller_than_by_the_mean_size(kind):
    """Judged by the ratios, which are computed from the certified covers."""
    program = program_of(kind, plants(seed=4, omega=np.geomspace(3, 300, 40)))
    ratios = {}
    for method in ("joint", "inflation"):
        solution = wb.solve(program, method=method)
        assert solution.certificate.valid
        ratios[method] = program.inflation(solution.answer).largest
    assert ratios["inflation"] < ratios["joint"]


def test_about_a_given_nominal_circles_have_the_best_weight():
    """The fit of W_c alone is a convex problem, whose optimum is proven by alternation."""
    responses = plants(seed=4, omega=np.geomspace(3, 300, 40))
    away = np.abs(responses.values / NOMINAL.response(responses.omega)[:, None] - 1).max(axis=1)
    for order in (1, 2, 3):
        program = CircleCover(responses, 2, nominal=NOMINAL, complex_order=order)
        fit = MagnitudeFit(responses.omega, away, order, cover=True)
        best = wb.solve(fit)
        assert best.certificate.holds
        found = program.inflation(wb.solve(program, method="inflation").answer).about.max()
        assert found <= 1.02 * (1 + fit.error(best.answer))
