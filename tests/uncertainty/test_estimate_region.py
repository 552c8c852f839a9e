"""The confidence region of an estimate as an LFT: the same models, held as often as it says."""

import control
import numpy as np
import pytest
from scipy import stats

import workbench as wb
from workbench.errors import InputError
from workbench.fitting.rational import Rational
from workbench.identification import RationalModelFit
from workbench.identification.rational_models.model import CommonPoleModel
from workbench.synthesis import HinfSynthesis
from workbench.systems.connection import generalised_plant
from workbench.uncertainty import EstimateRegion, cover_of_estimate

OMEGA = np.geomspace(0.3, 60.0, 40)
FINE = np.geomspace(0.1, 200.0, 60)
STABLE = Rational([-6.0], [-0.4 + 3j, -0.4 - 3j, -20.0], 8.0)
UNSTABLE = Rational([], [2.0, -7.0], 5.0)
DIRECT = Rational([-9.0, -1.0], [-0.5 + 4j, -0.5 - 4j], 0.5)


def model_of(entry):
    return CommonPoleModel([[entry]], np.zeros((1, 1)))


def fitted(entry, seed=0, noise=0.1, omega=OMEGA, **more):
    truth = entry.response(omega)[:, None, None]
    deviation = noise * np.maximum(np.abs(truth), 0.02 * np.abs(truth).max())
    parts = np.random.default_rng(seed).standard_normal((2, *truth.shape))
    noisy = truth + deviation * (parts[0] + 1j * parts[1]) / np.sqrt(2)
    order, excess = entry.poles.size, entry.poles.size - entry.zeros.size
    more = {"orders": (order,), "excess": excess} | more
    program = RationalModelFit(omega, noisy, deviation**2, **more)
    solution = wb.solve(program)
    assert solution.certificate.valid, solution.certificate.failures
    return program.uncertainty(solution.answer.model)


def closed(region, e):
    """Response of the system with its perturbation closed by points e of the region."""
    k = region.dimension
    Delta = e[None] if region.region == "ball" else np.diag(e)
    c = len(Delta)
    M = np.array([region.system(1j * omega) for omega in FINE])
    inner = np.eye(k) - M[:, :k, :c] @ Delta
    return M[:, k, c] + (M[:, k:, :c] @ Delta @ np.linalg.solve(inner, M[:, :k, c:]))[:, 0, 0]


@pytest.mark.parametrize("region", ["ball", "box"])
@pytest.mark.parametrize("entry", [STABLE, UNSTABLE, DIRECT], ids=["stable", "unstable", "direct"])
def test_the_system_closed_by_the_region_is_the_region(entry, region):
    found = EstimateRegion(fitted(entry), region=region)
    free = entry.poles.size + entry.zeros.size + 1
    assert found.dimension == free == sum(block.columns for block in found.structure)
    model = found.uncertainty.model
    np.testing.assert_allclose(found.lti(1j * FINE), model.response(FINE)[:, 0, 0], rtol=1e-9)
    for e in found.sampled(np.random.default_rng(1), 6):
        np.testing.assert_allclose(closed(found, e), found.response(FINE, e), rtol=1e-8)
    unstable = found.system.poles().real.max() > 0
    assert unstable == (entry is UNSTABLE)
    assert (found.system.poles().real > 0).sum() == (entry.poles.real > 0).sum()


@pytest.mark.parametrize("entry", [STABLE, UNSTABLE, DIRECT], ids=["stable", "unstable", "direct"])
def test_coordinates_lead_back_to_the_model(entry):
    """Also of a model that is not in the region."""
    found = EstimateRegion(fitted(entry), region="box")
    e = found.coordinates(model_of(entry))
    np.testing.assert_allclose(found.response(FINE, e), entry.response(FINE), rtol=1e-7)
    far = Rational(entry.zeros, 1.5 * entry.poles, 2 * entry.gain)
    np.testing.assert_allclose(
        found.response(FINE, found.coordinates(model_of(far))), far.response(FINE), rtol=1e-6
    )
    assert not found.contains(model_of(far))


def test_to_first_order_it_is_the_ellipsoid_of_the_responses():
    """The largest distance of a small region's responses is the radius of the discs."""
    found = EstimateRegion(fitted(STABLE, noise=1e-5))
    e = found.sampled(np.random.default_rng(0), 20_000)
    away = np.abs(found.response(OMEGA, e) - found.response(OMEGA, 0 * e[0])).max(axis=0)
    radius = found.uncertainty.radius(OMEGA, confidence=0.95, everywhere=True)[:, 0, 0]
    assert (away <= radius * (1 + 1e-3)).all()
    assert (away >= 0.8 * radius).all()


def share_held(records, confidence, seed):
    held = {"ball": 0, "box": 0}
    for draw in range(records):
        uncertainty = fitted(STABLE, seed=(seed, draw), noise=0.02)
        for region in held:
            held[region] += EstimateRegion(
                uncertainty, confidence=confidence, region=region
            ).contains(model_of(STABLE))
    return {region: count / records for region, count in held.items()}


def test_the_truth_is_as_far_away_as_normal_numbers_are():
    """Squares of 12 records' coordinates add to a chi-squared number of 60 degrees of freedom."""
    total = 0.0
    for draw in range(12):
        found = EstimateRegion(fitted(STABLE, seed=(0, draw), noise=0.02))
        total += np.sum((found.size * found.coordinates(model_of(STABLE))) ** 2)
    assert stats.chi2.ppf(0.001, 60) < total < stats.chi2.ppf(0.999, 60)


@pytest.mark.slow
def test_regions_hold_the_truth_as_often_as_they_say_in_a_thousand_records():
    for share in share_held(1000, 0.9, 1).values():
        assert abs(share - 0.9) < 0.03


def test_the_box_is_smaller_along_its_axes_and_larger_at_its_corners():
    uncertainty = fitted(STABLE)
    ball, box = (EstimateRegion(uncertainty, region=region) for region in ("ball", "box"))
    assert box.size < ball.size < box.size * np.sqrt(box.dimension)
    corners = box.sampled(np.random.default_rng(0), 10)
    assert np.abs(corners).max(axis=1) == pytest.approx(1.0)
    assert (np.abs(corners[::2]) == 1.0).all()


def test_an_entry_of_a_matrix_has_a_region_of_its_own():
    omega = OMEGA
    truth = np.stack([entry.response(omega) for entry in (STABLE, STABLE.scaled(0.3))], axis=1)
    truth = truth[:, :, None]
    noise = np.random.default_rng(0).standard_normal((2, *truth.shape))
    noisy = truth * (1 + 0.05 * (noise[0] + 1j * noise[1]) / np.sqrt(2))
    program = RationalModelFit(omega, noisy, (0.05 * np.abs(truth)) ** 2, orders=(3,), excess=2)
    uncertainty = program.uncertainty(wb.solve(program).answer.model)
    for row, entry in enumerate((STABLE, STABLE.scaled(0.3))):
        found = EstimateRegion(uncertainty, entry=(row, 0))
        assert found.dimension == 5
        want = uncertainty.model.response(FINE)[:, row, 0]
        np.testing.assert_allclose(found.lti(1j * FINE), want, rtol=1e-8)
        two = CommonPoleModel([[STABLE], [STABLE.scaled(0.3)]], np.zeros((2, 1)))
        e = found.coordinates(two)
        np.testing.assert_allclose(found.response(FINE, e), entry.response(FINE), rtol=1e-6)


def test_it_is_a_block_of_a_generalised_plant():
    region = EstimateRegion(fitted(UNSTABLE, noise=0.003))
    weight = control.tf([0.05, 0.05], [1.0, 0.01])
    plant = generalised_plant(
        [(region, "u", "y"), (weight, "e", "z"), (control.tf(0.02, 1), "u", "y_u")],
        {"e": "r - y"},
        exogenous="r",
        performance=("z", "y_u"),
        control="u",
        measurement="e",
    )
    assert plant.structure == region.structure
    solution = wb.solve(HinfSynthesis(plant))
    assert solution.certificate.valid
    assert solution.answer.norm < 1  # then every member is stabilised, the truth among them
    loop = control.feedback(control.tf(5.0, np.poly([2.0, -7.0])), solution.answer.K)
    assert loop.poles().real.max() < 0


def test_the_cover_by_discs_holds_the_ball_to_first_order():
    uncertainty = fitted(STABLE, noise=0.01)
    cover = cover_of_estimate(uncertainty, 4, form="additive")
    region = EstimateRegion(uncertainty)
    e = 0.999 * region.sampled(np.random.default_rng(2), 50)
    sizes = np.abs(region.response(OMEGA, e) - region.response(OMEGA, 0 * e[0]))
    assert (sizes <= np.abs(cover.W_c.response(OMEGA)) * 1.05).all()


REFUSED = {
    "between 0 and 1": {"confidence": 1.0},
    "one of": {"region": "ellipse"},
    "entry is": {"entry": (1, 0)},
}


@pytest.mark.parametrize("message", REFUSED)
def test_bad_requests_are_named(message):
    uncertainty = fitted(STABLE)
    with pytest.raises(InputError, match=message):
        EstimateRegion(uncertainty, **REFUSED[message])


def test_delays_samples_and_other_orders_are_refused():
    with pytest.raises(InputError, match="delay"):
        EstimateRegion(fitted(STABLE, delay_bounds=(0.0, 0.1)))
    with pytest.raises(InputError, match="continuous time"):
        EstimateRegion(fitted_sampled())
    with pytest.raises(InputError, match="3 poles"):
        EstimateRegion(fitted(STABLE)).coordinates(model_of(UNSTABLE))


def fitted_sampled():
    omega = np.linspace(0.05, 3.0, 40)
    z = np.exp(1j * omega)
    values = (0.3 / (z - 0.7))[:, None, None]
    noise = np.random.default_rng(0).standard_normal((2, *values.shape)) * 1e-3
    program = RationalModelFit(
        omega,
        values + noise[0] + 1j * noise[1],
        2e-6 + 0 * np.abs(values),
        orders=(1,),
        excess=1,
        dt=1.0,
    )
    return program.uncertainty(wb.solve(program).answer.model)
