"""Covers chosen for a loop: they contain the plants, and lower the mu of the loop."""

from dataclasses import replace

import control
import numpy as np
import pytest

from workbench.errors import InputError
from workbench.executor import Context
from workbench.fitting.rational import Rational, rational_of_system
from workbench.synthesis import ControlCover
from workbench.uncertainty import Responses, contains
from workbench.uncertainty.covers.everywhere import containment_check
from workbench.uncertainty.covers.weights import roots_within_reach

OMEGA = np.geomspace(0.05, 20.0, 40)


SYSTEMS = [control.tf(g, [1.0, 0.6, k]) for k in (0.7, 1.0, 1.3) for g in (0.9, 1.1)]
"""A damped mass with a stiffness of 0.7 to 1.3, and a gain of 0.9 to 1.1."""


def control_cover(responses):
    return ControlCover(
        responses,
        3,
        performance=lambda omega: 0.5 / (1j * omega + 0.05),
        control=lambda omega: 0.02 * np.ones(omega.shape),
        sensor=lambda omega: 1 / (1 + 1j * omega / 50),
        lowest=0.005,
    )


@pytest.fixture(scope="module")
def cover():
    return control_cover(
        Responses(omega=OMEGA, values=np.array([each(1j * OMEGA) for each in SYSTEMS]).T)
    )


@pytest.fixture(scope="module")
def parts():
    K = control.tf([2.0, 3.0, 1.0], [0.05, 1.0, 0.01])
    return {
        "nominal": rational_of_system(control.tf(1.0, [1.0, 0.6, 1.0])),
        "real": Rational([], [-0.5 + 1j, -0.5 - 1j], 0.05),
        "controller": rational_of_system(K),
    }


def largest(loop):
    return loop.weights.mu(loop.T).max()


def test_the_loop_is_that_of_its_transfer_functions(cover, parts):
    loop = cover.loop(parts)
    s = 1j * cover.omega
    assert cover.omega[0] == pytest.approx(0.01 * OMEGA[0])
    L = parts["controller"].response(cover.omega) / (s**2 + 0.6 * s + 1) / (1 + s / 50)
    np.testing.assert_allclose(loop.T, L / (1 + L), rtol=1e-9)
    np.testing.assert_allclose(loop.weights.control, 0.02 * abs(s**2 + 0.6 * s + 1), rtol=1e-9)


def test_the_radius_reaches_the_farthest_plant(cover, parts):
    """The distance of each deviation from the segment of the real weight, by brute force."""
    loop = cover.loop(parts)
    known = np.isin(cover.omega, OMEGA)
    s = 1j * OMEGA
    nominal, end = 1 / (s**2 + 0.6 * s + 1), parts["real"].response(OMEGA)
    away = cover.responses.values / nominal[:, None] - 1
    x = np.linspace(-1, 1, 20_001)
    needed = [
        max(abs(each - x * tip).min() for each in row) for row, tip in zip(away, end, strict=True)
    ]
    np.testing.assert_allclose(loop.radius[known], needed, rtol=1e-4, atol=1e-6)


@pytest.mark.cases(0)
def test_a_chosen_weight_lowers_mu_and_its_model_holds_the_plants(cover, parts):
    last = cover.optimised_parts(parts, ["real"], Context())
    assert last["nominal"] is parts["nominal"]
    assert largest(cover.loop(last)) < 0.99 * largest(cover.loop(parts))
    model = cover.model(last, Context())
    assert contains(model, cover.responses)
    assert (model.W_r.poles.real < 0).all()


def test_known_plants_are_held_at_every_frequency(cover, parts):
    known = control_cover(replace(cover.responses, known=SYSTEMS))
    model = known.model(parts, Context())
    assert containment_check(model, known.responses).holds
    assert not containment_check(cover.model(parts, Context()), known.responses).holds


def test_a_resonance_between_the_frequencies_counts(parts):
    """Its width is 1e-3 of its frequency; the responses' frequencies are 16 % apart."""
    light = [each + control.tf(0.01 * g, [1.0, 4e-3, 4.0]) for g, each in enumerate(SYSTEMS)]
    values = np.array([each(1j * OMEGA) for each in light]).T
    measured, known = (
        control_cover(responses)
        for responses in (
            Responses(omega=OMEGA, values=values),
            Responses(omega=OMEGA, values=values, known=light),
        )
    )
    radii = [np.interp(2.0, each.omega, each.loop(parts).radius) for each in (measured, known)]
    s, end = 2j, parts["real"].response(np.array([2.0]))[0]
    away = [each(s) / parts["nominal"].response(np.array([2.0]))[0] - 1 for each in light]
    x = np.linspace(-1, 1, 20_001)
    needed = max(abs(each - x * end).min() for each in away)
    assert radii[1] == pytest.approx(needed, rel=1e-3)
    assert radii[0] < 0.5 * needed


@pytest.mark.parametrize("unknown", [0, 3])
def test_plants_that_are_not_known_count_beside_those_that_are(cover, parts, unknown):
    """With the widest plant not known, the radius at the given frequencies is that of all."""
    known = [None if i <= unknown else each for i, each in enumerate(SYSTEMS)]
    some = control_cover(replace(cover.responses, known=known))
    at = [np.searchsorted(each.omega, OMEGA) for each in (cover, some)]
    expected, found = (
        each.loop(parts).radius[k] for each, k in zip((cover, some), at, strict=True)
    )
    np.testing.assert_allclose(found, expected, rtol=1e-9)


def test_an_unstable_loop_has_no_model(cover, parts):
    wrong = parts | {"controller": rational_of_system(control.tf([50.0], [0.2, 1.0]))}
    assert cover.loop(wrong) is None
    with pytest.raises(InputError, match="unstable"):
        cover.model(wrong, Context())


@pytest.mark.parametrize(("gain", "stable"), [(3.0, True), (0.1, False)])
def test_an_unstable_controller_may_close_a_stable_loop(cover, parts, gain, stable):
    """K = gain * (s^2 + 0.6 s + 1) / ((s - 0.2) (0.05 s + 1)): L(0) = -gain / 0.2 before lags."""
    K = control.tf(gain * np.array([1.0, 0.6, 1.0]), np.polymul([1.0, -0.2], [0.05, 1.0]))
    loop = K * control.tf(1.0, [1.0, 0.6, 1.0]) * control.tf(1.0, [1 / 50, 1.0])
    assert (control.feedback(loop).poles().real < 0).all() == stable
    found = cover.loop(parts | {"controller": rational_of_system(K)})
    assert (found is not None) == stable


def covered_peak(cover, parts, W_c):
    loop = cover.loop(parts)
    return replace(loop.weights, circular=abs(W_c.response(cover.omega))).mu(loop.T).max()


@pytest.mark.cases(0)
def test_all_parts_together_get_lower_than_the_real_weight_alone(cover, parts):
    peaks = []
    for moving in (["real"], ["nominal", "real", "controller"]):
        found = cover.optimised_parts(parts, moving, Context())
        model = cover.model(found, Context())
        assert contains(model, cover.responses)
        peaks.append(covered_peak(cover, found, model.W_c))
        assert peaks[-1] >= largest(cover.loop(found)) * (1 - 1e-6)  # no radius is missed
    assert peaks[1] < 0.99 * peaks[0]


@pytest.mark.cases(0)
def test_a_found_weight_covers_no_more_than_it_must(cover, parts):
    found = cover.optimised_parts(parts, ["real"], Context())
    size = abs(found["circular"].response(cover.omega))
    assert (cover.loop(found).radius / size).max() == pytest.approx(1, abs=1e-9)


def test_slopes_of_the_smoothed_peak_are_those_of_differences(cover, parts):
    """By the real and the imaginary part of each part's value at some of the frequencies."""
    whole = cover._with_circular_weight(parts, Context())
    values = {name: part.response(cover.omega) for name, part in whole.items()}
    places = np.linspace(5, cover.omega.size - 40, 6).astype(int)
    for name in ("nominal", "real", "controller", "circular"):
        for turn in (1, 1j):
            along = np.zeros((1 + cover.omega.size, places.size), complex)
            along[1 + places, range(places.size)] = turn * abs(values[name][places])
            _, slopes = cover._power_mean_of_mu(values, {name: along}, 8)
            for k, slope in enumerate(slopes):
                ends = [
                    cover._power_mean_of_mu(
                        values | {name: values[name] + h * along[1:, k]}, {}, 8
                    )[0]
                    for h in (-1e-6, 1e-6)
                ]
                assert slope == pytest.approx((ends[1] - ends[0]) / 2e-6, rel=1e-3, abs=1e-8)


@pytest.mark.cases(0)
def test_a_search_ends_with_roots_that_a_realisation_can_hold(cover, parts):
    found = cover.optimised_parts(parts, ["nominal", "real", "controller"], Context())
    for part in found.values():
        assert abs(np.concatenate([part.zeros, part.poles])).max() < 1e4 * OMEGA[-1]


@pytest.mark.cases(0)
@pytest.mark.parametrize(
    "K",
    [
        control.tf([-2e-6, 2.0 - 3e-6, 3.0 - 1e-6, 1.0], [0.05e-3, 0.051, 1.0, 0.01]),
        control.tf(3.0 * np.array([1.0, 0.6, 1.0]), np.polymul([1.0, -0.2], [0.05, 1.0])),
    ],
    ids=["zero far on the right", "unstable"],
)
def test_a_controller_keeps_its_roots_on_the_right(cover, parts, K):
    """Mirrored at the imaginary axis, these controllers leave the nominal loop unstable."""
    given = parts | {"controller": rational_of_system(K)}
    found = cover.optimised_parts(given, ["nominal", "real", "controller"], Context())
    assert largest(cover.loop(found)) < largest(cover.loop(given))
    unstable = [int((each["controller"].poles.real > 0).sum()) for each in (given, found)]
    assert unstable[0] == unstable[1]


def test_roots_beyond_reach_are_moved_back_without_effect():
    """A search moves a root without limit where it has no effect, and rounding hides slow poles
    beside fast ones."""
    poles = [0.0, -2.0, -3e-9, -5e13, -6e15 + 1e15j, -6e15 - 1e15j]
    far = Rational([-3.0, -4e17, -7e-12], poles, 7e30)
    near = roots_within_reach(far, 1.0, 1e4)
    sizes = np.abs(np.concatenate([near.zeros, near.poles[near.poles != 0.0]]))
    assert (near.poles == 0.0).sum() == 1
    assert sizes.min() >= 1e-4 * (1 - 1e-12) and sizes.max() <= 1e8 * (1 + 1e-12)
    omega = np.geomspace(1.0, 1e4, 50)
    np.testing.assert_allclose(near.response(omega), far.response(omega), rtol=1e-3)
    assert roots_within_reach(near, 1.0, 1e4).poles == pytest.approx(near.poles, rel=1e-12)
    ordinary = Rational([-3.0], [-2.0, -50.0], 2.0)
    same = roots_within_reach(ordinary, 1.0, 1e4)
    assert np.array_equal(same.poles, ordinary.poles) and same.gain == ordinary.gain
