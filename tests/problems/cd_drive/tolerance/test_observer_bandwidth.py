"""The bandwidth of strategy B's loop on a clean disc, with its observer and without."""

import numpy as np
import pytest
import xarray as xr
from workbench.plants.cd_drive.diagnosis.defect_runs import ROTATION
from workbench.plants.cd_drive.drive.plants import controller
from workbench.plants.cd_drive.laboratory.bench_setup import PERIOD
from workbench.plants.cd_drive.tolerance.observer_bandwidth import (
    OBSERVERS,
    SEEN,
    changes,
    closed_radius,
    law,
    observer_bandwidth,
    observers,
    prototype_changes,
    sampled_drives,
)

import workbench as wb
from workbench.diagnosis import estimate
from workbench.simulation import linear_controller, play
from workbench.systems import bandwidths, loop_response
from workbench.systems.sampling import respond


@pytest.mark.parametrize("name", ["thesis", "Kalman"])
def test_the_law_is_what_streams(name):
    """Sample by sample: the observer reads u of the sample before, u = K f_en + u_p."""
    observer = observers("focus")[name]
    f_en = np.random.default_rng(1).standard_normal(40)
    found = respond(law("focus", observer, SEEN[0]), f_en[:, None])[:, 0]
    u_k = play(linear_controller(controller("focus"), PERIOD), f_en[:, None])[:, 0]
    last = np.concatenate([[0.0], found[:-1]])
    u_p = estimate(observer.controller, f_en, last, np.ones(40)).disturbance
    np.testing.assert_allclose(found, u_k + u_p, rtol=1e-7, atol=1e-9 * abs(found).max())


def test_what_the_controller_sees_is_what_it_is_told():
    """Without u_p, u = K f_en_hat."""
    observer = observers("radial")["ITAE 5 kHz"]
    f_en = np.random.default_rng(2).standard_normal(40)
    found = respond(law("radial", observer, SEEN[2]), f_en[:, None])[:, 0]
    last = np.concatenate([[0.0], found[:-1]])
    told = estimate(observer.controller, f_en, last, np.ones(40)).outputs[:, :1]
    expected = play(linear_controller(controller("radial"), PERIOD), told)[:, 0]
    np.testing.assert_allclose(found, expected, rtol=1e-7, atol=1e-9 * abs(found).max())


def test_u_p_makes_the_loop_infinite_at_the_rotation():
    drives = sampled_drives("focus")
    for seen, least in ((SEEN[0], 1e5), (SEEN[2], 0.0)):
        L = drives["CD3"] * law("focus", observers("focus")["thesis"], seen)
        assert abs(loop_response(L, np.array([ROTATION])))[0] > least
    assert abs(loop_response(L, np.array([ROTATION])))[0] < 1e4


def test_a_fast_observer_leaves_the_bandwidth_and_a_slow_one_does_not():
    P, every = sampled_drives("focus")["nominal"], observers("focus")
    alone = bandwidths(P * law("focus", None, SEEN[0]))["T"]
    assert bandwidths(P * law("focus", every["thesis"], SEEN[2]))["T"] == pytest.approx(
        alone, rel=0.01
    )
    slow = law("radial", observers("radial")["ITAE 300 Hz"], SEEN[2])
    assert closed_radius(sampled_drives("radial")["CD1"] * slow) > 1.0


def test_changes_are_against_the_same_drive():
    values = np.arange(1.0, 1.0 + len(OBSERVERS) * 4).reshape(len(OBSERVERS), 2, 2)
    dims = ("observer", "seen", "drive")
    found = changes(xr.DataArray(values, dims=dims, coords={"observer": list(OBSERVERS)}))
    assert (found.sel(observer="none") == 0.0).all()
    assert found.values[1] == pytest.approx(values[1] / values[0] - 1.0)


@pytest.mark.slow
@pytest.mark.parametrize("axis", ["focus", "radial"])
def test_the_certificate_holds_and_wrong_answers_are_rejected(axis):
    task = observer_bandwidth(axis)
    solution = wb.solve(task)
    assert solution.certificate.holds, solution.certificate
    assert set(task.figures(solution.answer)) == {"complementary-sensitivity"}
    for name, factor in (("bandwidth", 1.001), ("radius", 1.0001)):
        answer = solution.answer.copy(deep=True)
        answer[name].values *= factor
        assert not task.certify(answer, 1e-6).holds


def test_changes_by_itae_poles_are_those_of_the_study(reference):
    stored = changes(reference("cd/focus/observer-bandwidth").data["bandwidth"])
    own = stored.sel(observer="ITAE 5 kHz", seen=SEEN[2]).values
    assert prototype_changes("focus", "itae") == pytest.approx(own, abs=1e-6)
    assert abs(prototype_changes("focus", "bessel") - own).max() > 1e-3
