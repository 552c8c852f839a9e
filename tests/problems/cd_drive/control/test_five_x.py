"""The study at 5X, with a controller that is quickly made in place of the one by D-K iteration."""

from types import SimpleNamespace

import pytest
from workbench.plants.cd_drive.control.controller import controller
from workbench.plants.cd_drive.control.design import synthesis_plant, uncertainty
from workbench.plants.cd_drive.control.five_x.problem import needs
from workbench.plants.cd_drive.control.five_x.report import conclusions_table
from workbench.plants.cd_drive.control.five_x.study import CONTROLLERS, FiveX

import workbench as wb
from workbench.synthesis import hinf

pytestmark = pytest.mark.slow  # the whole study is computed


@pytest.fixture(scope="module")
def study(covered):
    cover, answer = covered("focus", "stadium", "steps")
    run = SimpleNamespace(data=cover.to_dataset(answer), task=cover)
    plant = synthesis_plant("focus", uncertainty("focus", run), 5.0)
    made = SimpleNamespace(answer=SimpleNamespace(K=hinf(plant).K))
    return FiveX("focus", run, made)


@pytest.fixture(scope="module")
def solution(study):
    return wb.solve(study)


@pytest.fixture(scope="module")
def numbers(study, solution):
    return study.metrics(solution.answer)


def test_its_certificate_holds(solution):
    assert solution.certificate is not None, solution.trace
    assert solution.certificate.failures == ()


def test_no_controller_reaches_1_and_the_nominal_plant_tells(numbers):
    assert numbers["nominal_bound"] > 1.6
    assert numbers["nominal_bound"] <= numbers["nominal_norm"] <= 1.01 * numbers["nominal_bound"]
    assert numbers["nominal_bound"] <= numbers["least_possible"] <= numbers["least_reached"]


def test_the_pointwise_bound_is_that_of_the_resonance_at_any_speed(numbers):
    assert numbers["pointwise_bound"] > 1
    assert numbers["pointwise_frequency_hz"] == pytest.approx(31, abs=4)
    assert numbers["pointwise_bound_1X"] == pytest.approx(numbers["pointwise_bound"], rel=1e-3)
    assert numbers["pointwise_bound_disturbance"] <= numbers["pointwise_bound"] * (1 + 1e-3)


def test_the_mu_pid_is_as_in_its_analysis(numbers):
    assert numbers["peak_mu_pid_disturbance"] == pytest.approx(20, rel=0.1)
    assert numbers["adjusted_gain"] == pytest.approx(4.1, abs=0.3)
    channels = (numbers[f"peak_adjusted_{name}"] for name in ("disturbance", "control"))
    assert next(channels) == pytest.approx(next(channels), rel=0.05)


def test_both_channels_are_worse_than_either(numbers):
    for name in ("mu_pid", "adjusted", "full", "ninth"):
        single = max(numbers[f"peak_{name}_{channel}"] for channel in ("disturbance", "control"))
        assert numbers[f"peak_{name}"] >= single * (1 - 2e-3)


def test_every_curve_lies_above_the_least_mu(solution):
    data = solution.answer
    for channel in data["bounded"].values:
        mu = data["mu"].sel(channel=channel, bound="upper")
        assert (mu >= data["least_mu"].sel(bounded=channel, bound="lower") * (1 - 1e-4)).all()


def test_its_checks_find_an_answer_that_was_changed(study, solution):
    factors = {"peak": 0.9, "mu": 0.9, "least_mu": 3.0, "proven_level": 1.1}
    data = solution.answer
    wrong = data.assign({name: factor * data[name] for name, factor in factors.items()})
    failed = {each.name for each in study.certify(wrong, 1e-6).checks if not each.holds}
    assert failed >= {"peaks", "closed form", "least mu", "nominal bound", "nominal proof"}


def test_tables_and_figures_are_made(study, solution):
    assert set(study.figures(solution.answer)) == {"figure-6-5"}
    tables = study.tables(solution.answer)
    assert all(name in tables["peaks"] for name in CONTROLLERS)
    assert "even for the nominal drive" in tables["conclusions"]


@pytest.mark.parametrize(
    ("nominal", "least", "reached", "verdict"),
    [
        (1.2, 1.3, 2.0, "even for the nominal drive"),
        (0.8, 1.3, 2.0, "the nominal drive would allow it"),
        (0.8, 0.9, 0.95, "refuted"),
        (0.8, 0.9, 1.1, "open"),
    ],
)
def test_the_verdict_follows_the_bounds(numbers, nominal, least, reached, verdict):
    told = {"nominal_bound": nominal, "least_possible": least, "least_reached": reached}
    assert verdict in conclusions_table("focus", numbers | told).splitlines()[-1]


def test_the_cover_and_the_design_are_needed():
    asked = needs("radial", frequencies=33, cover="joint")
    assert set(asked) == {"covered", "designed"}
    assert asked["designed"].method == "dk"
    assert asked["designed"].parameters["speed"] == 5.0
    assert asked["covered"].parameters["frequencies"] == 33


def test_the_design_problem_is_that_of_the_speed(study):
    program = controller("focus", study.covered, "stadium", frequencies=60, speed=5.0)
    assert program.structure is not None
    assert [type(block).__name__ for block in program.structure] == ["Real", "Complex"]
