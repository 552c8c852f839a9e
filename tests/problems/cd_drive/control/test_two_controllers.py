"""Two controllers: the front, its bounds, and the two that are chosen."""

import numpy as np
import pytest
from workbench.plants.cd_drive.control.trade_off import CHANNELS, TradeOff, defect_weight
from workbench.plants.cd_drive.control.two_controllers import problem as module
from workbench.plants.cd_drive.control.two_controllers.checks import _channels
from workbench.plants.cd_drive.control.two_controllers.problem import TwoControllers
from workbench.plants.cd_drive.drive.disc import VELOCITY
from workbench.plants.cd_drive.drive.plants import controller

import workbench as wb
from workbench.errors import InputError
from workbench.systems import crossings
from workbench.systems.generalised_plant import response

LENGTH = 1.6e-3


@pytest.fixture(scope="module")
def trade():
    return TradeOff("focus", LENGTH)


@pytest.fixture(scope="module")
def solved():
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(module, "GAIN_FACTORS", (1.0,))
        patch.setattr(module, "SHARES", (2.0, 20.0))
        study = TwoControllers("focus", 2, LENGTH, 60)
        yield study, wb.solve(study)


@pytest.fixture(scope="module")
def data(solved):
    return solved[1].answer


@pytest.mark.slow
def test_its_certificate_holds(solved):
    assert solved[1].certificate.failures == ()


@pytest.mark.slow
def test_bandwidth_is_traded_for_immunity(data):
    a, b = (data["nominal"].sel(channel=z).values for z in ("z_p", "z_sd"))
    assert a[0] < a[1] and b[0] > 2 * b[1]
    high, low = (data.sel(case=case) for case in ("high", "low"))
    assert float(high["crossover_hz"]) > 1.5 * float(low["crossover_hz"])
    assert float(abs(high["defect_error"]).max()) > float(abs(low["defect_error"]).max())
    assert data["chosen"].values.tolist() == [0, 1]


@pytest.mark.slow
def test_the_reference_controller_lies_above_the_front(data):
    a, b, _ = data["reference_nominal"].values[0]
    assert a == pytest.approx(0.732, abs=2e-3)
    design = data.isel(share=0)["nominal"].values
    assert design[0] < 1.1 * a and design[1] < 0.8 * b


@pytest.mark.slow
def test_worst_cases_are_worse(data):
    upper = data["worst"].sel(bound="upper").values
    assert (upper >= data["nominal"].sel(channel=["z_p", "z_sd"]).values * (1 - 1e-6)).all()


@pytest.mark.slow
def test_a_bound_that_is_too_high_is_found(solved, data):
    study, _ = solved
    wrong = data.copy(deep=True)
    wrong["excluded"] = 2 * wrong["excluded"]
    failed = {check.name for check in study.checks(wrong, 1e-6) if not check.holds}
    assert failed == {"bounds"}


@pytest.mark.slow
def test_tables_and_figures_are_made(solved, data):
    study, _ = solved
    tables = study.tables(data)
    assert tables["front"].count("\n") == 2 + 2 + 1
    assert "high bandwidth" in tables["two"]
    assert set(study.figures(data)) == {"front", "loops"}
    assert study.metrics(data)["largest_distance_from_bound"] > 0


def test_what_is_bearable_is_what_the_pickup_catches():
    assert TwoControllers("focus", 2, LENGTH, 20).relaxed == pytest.approx(3.0)
    assert TwoControllers("radial", 2, LENGTH, 20).relaxed == pytest.approx(4.0)


def test_choice():
    study = TwoControllers("focus", 4, LENGTH, 20)
    worst = np.array([[1.1, 0.5], [1.0, 0.4], [2.9, 0.2], [3.1, 0.1]])
    assert study.choice(worst) == [1, 2]
    assert study.choice(worst + np.array([5.0, 0.0])) == [
        1,
        1,
    ]  # none is bearable: the least bad one


def test_the_defects_weight():
    omega = np.geomspace(1, 1e6, 200)
    size = abs(response(defect_weight(LENGTH), omega)[:, 0, 0])
    assert (np.diff(size) > 0).all() and size[-1] == pytest.approx(1, abs=1e-3)
    corner = VELOCITY / LENGTH
    half = crossings(
        lambda f: abs(response(defect_weight(LENGTH), 2 * np.pi * f)[:, 0, 0]) - 2**-1.5,
        np.geomspace(10, 1e4, 50),
    )
    np.testing.assert_allclose(half, [corner], rtol=1e-6)


@pytest.mark.parametrize("axis", ["focus", "radial"])
def test_channels_of_the_plant_are_their_formulas(axis):
    trade = TradeOff(axis, LENGTH)
    omega = 2 * np.pi * np.geomspace(1, 1e5, 60)
    K = controller(axis)
    expected = _channels(trade, K, omega)
    for i, name in enumerate(CHANNELS):
        found = response(trade.nominal.channel(performance=name).close(K), omega)[:, 0, 0]
        np.testing.assert_allclose(found, expected[i], rtol=1e-6, atol=1e-9)


def test_effort_is_spent(trade):
    _, K = trade.design(5.0)
    assert trade.effort(K) == pytest.approx(0.99, abs=6e-3)


def test_filters_of_a_bound_share_out_every_frequency(trade):
    """By how much u moves the channels; w moves the error alone."""
    omega = 2 * np.pi * np.geomspace(1, 1e5, 50)
    x = np.log([2 * np.pi * 400, 2 * np.pi * 5000, 0.7])
    before, after = (
        plant.response(omega)[:, :3, 1] for plant in (trade.nominal, trade.shared(3.0, x))
    )
    shares = abs(after / (before * [1.0, 3.0, 0.7])) ** 2
    np.testing.assert_allclose(shares.sum(axis=1), 1.0, rtol=1e-6)


def test_wrong_input_is_named():
    with pytest.raises(InputError, match="designs"):
        wb.run("cd/focus/two-controllers", designs=1)
