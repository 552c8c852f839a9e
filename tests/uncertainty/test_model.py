"""What an uncertainty model contains, against shapely's distances from segments."""

import control
import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from workbench.errors import InputError
from workbench.fitting.rational import Rational
from workbench.structure import Complex, Real
from workbench.uncertainty import Responses, UncertaintyModel, contains

OMEGA = np.geomspace(0.1, 100, 7)
NOMINAL = Rational([-30.0], [-1 + 8j, -1 - 8j], 4.0)
W_C = Rational([-3.0], [-40.0], 0.8)
W_R = Rational([5.0], [-20.0], 0.5)


def value(rational, omega):
    top = np.prod(1j * omega[:, None] - rational.zeros, axis=1)
    return rational.gain * top / np.prod(1j * omega[:, None] - rational.poles, axis=1)


def distances(model, responses):
    """Distance (F, N) of every response from the segment at its frequency, over the radius."""
    nominal = value(model.nominal, responses.omega)
    unit = nominal if model.form == "multiplicative" else np.ones_like(nominal)
    radius = np.abs(unit * value(model.W_c, responses.omega))
    end = unit * value(model.W_r, responses.omega) if model.W_r else np.zeros_like(nominal)
    found = np.empty(responses.values.shape)
    for k, row in enumerate(responses.values):
        a, b = nominal[k] - end[k], nominal[k] + end[k]
        segment = shapely.LineString([(a.real, a.imag), (b.real, b.imag)])
        if model.W_r is None:
            segment = shapely.Point(a.real, a.imag)
        found[k] = shapely.distance(segment, shapely.points(row.real, row.imag)) / radius[k]
    return found


def random_model(rng, form, mixed):
    gains = rng.uniform(0.3, 2, 3)
    parts = [part.scaled(g) for part, g in zip((NOMINAL, W_C, W_R), gains, strict=True)]
    return UncertaintyModel(parts[0], parts[1], parts[2] if mixed else None, form=form)


@settings(derandomize=True, deadline=None, max_examples=60)
@given(
    st.integers(0, 10_000),
    st.sampled_from(["multiplicative", "additive"]),
    st.booleans(),
    st.integers(0, 3),
)
def test_containment_is_distance(seed, form, mixed, leave_out):
    rng = np.random.default_rng(seed)
    model = random_model(rng, form, mixed)
    size = np.abs(value(model.nominal, OMEGA))[:, None]
    spread = rng.uniform(0.1, 1) * (size if form == "multiplicative" else 1)
    noise = rng.normal(size=(7, 6)) + 1j * rng.normal(size=(7, 6))
    values = value(model.nominal, OMEGA)[:, None] + spread * noise
    present = rng.random((7, 6)) > 0.2
    present[:, :2] = True
    responses = Responses(omega=OMEGA, values=values, present=present)
    away = np.where(present, distances(model, responses), -np.inf)
    found = contains(model, responses, leave_out=leave_out)
    np.testing.assert_allclose(found.outside, (away > 1).sum(axis=1))
    worst = np.sort(away, axis=1)[:, -1 - leave_out]
    np.testing.assert_allclose(found.excess, worst - 1, rtol=1e-9, atol=1e-9)
    assert bool(found) == found.holds == bool(np.all(worst <= 1))
    assert found.worst == pytest.approx(worst.max() - 1, abs=1e-9)
    assert found.where == f"at {responses.place(int(worst.argmax()))}"


@pytest.mark.parametrize("form", ["multiplicative", "additive"])
@pytest.mark.parametrize("mixed", [True, False])
def test_points_at_the_boundary(form, mixed):
    """A hair inside is inside; a hair outside is outside, and it is the only one."""
    model = UncertaintyModel(NOMINAL, W_C, W_R if mixed else None, form=form)
    sets = model.shapes(OMEGA)
    turn = np.exp(1j * np.linspace(0, 2 * np.pi, 100))
    end = sets.half_length * np.exp(1j * sets.angle)
    side = np.where((turn[None] * end[:, None].conj()).real >= 0, 1, -1) * end[:, None]
    edge = sets.radius[:, None] * turn
    for factor, inside in ((1 - 1e-7, True), (1 + 1e-7, False)):
        values = sets.center[:, None] + side + factor * edge
        assert contains(model, Responses(omega=OMEGA, values=values)).holds is inside
    values = sets.center[:, None] + side + (1 - 1e-7) * edge
    values[4, 17] = (sets.center[:, None] + side + (1 + 1e-7) * edge)[4, 17]
    responses = Responses(omega=OMEGA, values=values)
    found = contains(model, responses)
    assert found.outside.tolist() == [0, 0, 0, 0, 1, 0, 0]
    assert found.where == f"at {responses.place(4)}"
    assert contains(model, responses, leave_out=1)


def test_every_plant_of_the_model_is_contained():
    rng = np.random.default_rng(0)
    model = UncertaintyModel(NOMINAL, W_C, W_R)
    complex_ = np.sqrt(rng.random(200)) * np.exp(2j * np.pi * rng.random(200))
    real = rng.uniform(-1, 1, 200)
    g, c, r = (value(part, OMEGA)[:, None] for part in (NOMINAL, W_C, W_R))
    assert contains(model, Responses(omega=OMEGA, values=g * (1 + c * complex_ + r * real)))
    sizes = model.sizes(OMEGA)
    np.testing.assert_allclose(sizes[0], np.abs(c[:, 0]))
    np.testing.assert_allclose(sizes[1], np.abs(r[:, 0]))


@pytest.mark.parametrize("mixed", [True, False])
def test_a_weight_of_zero_contains_nothing(mixed):
    zero = W_C.scaled(0)
    responses = Responses(omega=OMEGA, values=value(NOMINAL, OMEGA)[:, None] * np.array([1, 1.1]))
    assert not contains(UncertaintyModel(NOMINAL, zero, W_R if mixed else None), responses)


def test_models_from_systems():
    g, w = control.tf([4.0, 1.0], [1.0, 2.0, 65.0]), control.ss([[-3.0]], [[1.0]], [[2.0]], [[0.1]])
    model = UncertaintyModel(g, w, control.tf([0.2], [1.0]))
    for system, given_system in zip(model.systems().values(), (g, w, None), strict=True):
        response = np.array([system(1j * o) for o in OMEGA])
        wanted = 0.2 if given_system is None else [given_system(1j * o) for o in OMEGA]
        np.testing.assert_allclose(response, np.broadcast_to(wanted, response.shape), rtol=1e-8)
    assert list(model.systems()) == ["G", "W_c", "W_r"]
    assert list(UncertaintyModel(g, w).systems()) == ["G", "W_c"]


def test_structure():
    mixed = UncertaintyModel(NOMINAL, W_C, W_R).structure
    assert [type(block) for block in mixed] == [Real, Complex]
    assert [block.name for block in mixed] == ["real", "complex"]
    assert [type(block) for block in UncertaintyModel(NOMINAL, W_C).structure] == [Complex]


@pytest.mark.parametrize(
    ("given_parts", "words"),
    [
        ((NOMINAL, W_C, W_R, "inverse"), "form is 'inverse'; it must be one of"),
        ((NOMINAL, W_C, W_R, None), "form is None"),
        ((control.ss([], [], [], np.eye(2)), W_C), "SISO"),
        ((NOMINAL, control.tf([1.0], [1.0, 0.5], 0.1)), "W_c has dt = 0.1; 0.0"),
        ((NOMINAL, None), "W_c is needed"),
        ((None, W_C), "nominal is needed"),
    ],
)
def test_refused(given_parts, words):
    with pytest.raises(InputError, match=words):
        UncertaintyModel(*given_parts[:3], **dict(zip(["form"], given_parts[3:], strict=False)))
