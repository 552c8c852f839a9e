"""The bilinear transformation in doubles against that in balls of many digits."""

import numpy as np
import pytest
from flint import arb_mat, ctx

from workbench.certify.modes.bilinear import bilinear_enclosures
from workbench.certify.modes.enclosed_realisation import GivenRealisation
from workbench.certify.modes.modal_form import real_balls, real_doubles


@pytest.mark.parametrize("period", [1e-3, 0.3])
def test_it_encloses_the_exact_realisation_sharply(period):
    rng = np.random.default_rng(3)
    A = rng.normal(size=(25, 25)) / 8 + 0.7 * np.eye(25)
    parts = A, rng.normal(size=(25, 2)), rng.normal(size=(3, 25)), rng.normal(size=(3, 2))
    found = bilinear_enclosures(parts, period)
    assert found is not None
    for ours, exact in zip(found, GivenRealisation(*parts, period).in_balls(512), strict=True):
        with ctx.workprec(512):
            away = real_doubles(exact - real_balls(ours.mid))
        assert (np.abs(away.mid) <= ours.rad + away.rad).all()
        assert (ours.rad <= 1e-15 * np.abs(ours.mid) + 1e-20 * np.abs(ours.mid).max()).all()
        assert isinstance(exact, arb_mat)


@pytest.mark.parametrize("distance", [1e-4, 1e-8, 1e-10, 1e-12])
def test_it_holds_the_exact_realisation_with_a_pole_near_half_the_sampling_rate(distance):
    rng = np.random.default_rng(4)
    T = np.eye(6) + 0.3 * rng.normal(size=(6, 6))
    poles = np.diag([distance - 1.0, 0.9, 0.5, -0.3, 0.1, 0.7])
    A = T @ poles @ np.linalg.inv(T)
    parts = A, rng.normal(size=(6, 2)), rng.normal(size=(3, 6)), np.zeros((3, 2))
    found = bilinear_enclosures(parts, 1.0)
    assert found is not None
    for ours, exact in zip(found, GivenRealisation(*parts, 1.0).in_balls(512), strict=True):
        with ctx.workprec(512):
            away = real_doubles(exact - real_balls(ours.mid))
        assert (np.abs(away.mid) <= ours.rad + away.rad).all()


def test_a_pole_at_half_the_sampling_rate_has_none():
    A = np.diag([-1.0, 0.5])
    assert bilinear_enclosures((A, np.ones((2, 1)), np.ones((1, 2)), np.zeros((1, 1))), 1.0) is None
