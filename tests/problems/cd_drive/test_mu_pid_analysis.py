"""The mu-PID's analysis: closed forms against the bounds, and what holds of section 6.3."""

from itertools import product
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from workbench.plants.cd_drive.control.mu_pid_analysis.problem import needs
from workbench.plants.cd_drive.control.mu_pid_analysis.study import COVERS, GAINS, MuPidAnalysis
from workbench.plants.cd_drive.control.rank_one import rank_one_mu

import workbench as wb
from workbench.mu import lower_bound, upper_bound
from workbench.structure import Complex, Real, Structure

number = st.floats(-3, 3, allow_nan=False).map(lambda x: round(x, 3))


@given(number, number, st.floats(0.1, 3))
def test_rank_one_mu_is_the_nearest_real_scalar(real, imaginary, others):
    """Against a search over x and t: 1 / mu is the least t that lets |1 - x c| <= t others."""
    c = complex(real, imaginary)
    x = np.linspace(-20, 20, 400_001)
    needed = np.maximum(np.abs(1 - x * c) / others, np.abs(x))
    assert rank_one_mu(np.array(c), np.array(others)) == pytest.approx(1 / needed.min(), rel=1e-3)


def test_rank_one_mu_lies_between_the_bounds():
    rng = np.random.default_rng(5)
    left, right = rng.normal(size=(2, 50, 3)) + 1j * rng.normal(size=(2, 50, 3))
    M = left[:, :, None] * right[:, None, :]
    c = np.diagonal(M, axis1=1, axis2=2)
    exact = rank_one_mu(c[:, 0], np.abs(c[:, 1:]).sum(axis=1))
    structure = Structure([Real(1), Complex(1), Complex(1)])
    np.testing.assert_allclose(upper_bound(M, structure).value, exact, rtol=1e-5)
    lower = lower_bound(M, structure).value
    assert (lower <= exact * (1 + 1e-9)).all()
    np.testing.assert_allclose(lower, exact, rtol=1e-3)


@pytest.fixture(scope="module")
def solved(covered):
    runs = {}
    for form, gain in product(COVERS, GAINS):
        cover, answer = covered("focus", form, "steps", gain)
        runs[form, gain] = SimpleNamespace(data=cover.to_dataset(answer))
    study = MuPidAnalysis("focus", runs)
    return study, wb.solve(study)


@pytest.fixture(scope="module")
def data(solved):
    return solved[1].answer


def test_its_certificate_holds(solved):
    assert solved[1].certificate.failures == ()


def test_what_holds_of_section_6_3(solved, data):
    numbers = solved[0].metrics(data)
    assert numbers["peak_parametric"] == pytest.approx(0.871, abs=1e-3)
    assert numbers["peak_parametric_control"] < 1
    assert numbers["peak_lower_circle"] > 1  # near the resonance, as the thesis says
    assert numbers["frequency_circle"] == pytest.approx(32, abs=6)
    assert numbers["peak_lower_stadium"] > 1  # once its weights are rational functions
    assert numbers["peak_stadium_5X"] == pytest.approx(20, rel=0.1)


def test_the_nominal_loop_meets_the_disturbance_and_control_channels_apart_only(data):
    peak = data["peak"].sel(condition="nominal performance", bound="upper", speed=1.0)
    assert (peak.sel(channel=["disturbance", "control"]) < 1).all()
    assert (peak.sel(channel="both") > 1).all()


def test_orienting_stadiums_for_mu_is_never_worse_than_narrowest(data):
    sets = data["set_mu"]
    assert (sets.sel(set="stadium for mu") <= (1 + 1e-9) * sets.sel(set="stadium narrowest")).all()


def test_the_adjusted_gain_makes_both_channels_equally_bad(data):
    mu = data["adjusted_mu"].sel(bound="upper").max("frequency")
    assert data["adjusted_gain"] > 1
    assert float(mu[0]) == pytest.approx(float(mu[1]), rel=0.05)


def test_figures_and_tables_are_made(solved, data):
    study, _ = solved
    assert set(study.figures(data)) == {"one-x", "five-x", "gains"}
    tables = study.tables(data)
    assert "| own | stadium for mu |" in tables["sets"]
    assert tables["conditions"].count("\n") == 2 + 6 * 7  # the parametric model has one gain
    assert "1X: stadiums below 1" in tables["claims"]


def test_covers_of_every_gain_are_needed():
    asked = needs("radial", frequencies=33, cover="joint")
    assert len(asked) == 6
    assert {need.method for need in asked.values()} == {"joint"}
    assert {need.parameters["gain"] for need in asked.values()} == set(GAINS)
