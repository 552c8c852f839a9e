"""The plants, records and counts by which regions of responses are judged."""

import numpy as np
import pytest
from workbench.plants.bench.regions.design import CASES_OF_A_PLANT, DECIBELS, cases
from workbench.plants.bench.regions.judged import Judged, judged, records, truth
from workbench.plants.bench.regions.plants import PLANTS, Channel, Friction, Plant, heaters, lags
from workbench.plants.bench.regions.records import EXCITATIONS, record
from workbench.plants.bench.regions.yardsticks import output_error_width

import workbench as wb

CHANNELS = [
    pytest.param(channel, id=f"{name} {k + 1}")
    for name, plant in PLANTS.items()
    for k, channel in enumerate(plant.channels)
    if isinstance(channel, Channel)
]


@pytest.mark.parametrize("channel", CHANNELS)
def test_responses_are_those_of_the_simulated_plants(channel):
    """The last of many periods of a sine."""
    period, line = 512, 30
    u = np.cos(2 * np.pi * line * np.arange(90 * period) / period)
    y = channel.output(u)[-period:]
    measured = np.fft.rfft(y)[line] / np.fft.rfft(u[:period])[line]
    frequency = np.array([line / period])
    exact = channel.response(frequency)[0]
    assert abs(measured - exact) < 1e-6 * max(abs(exact), 1.0)
    z = np.exp(2j * np.pi * frequency)
    above, below = channel.polynomials()
    ratio = np.polyval(above[::-1], 1 / z) / np.polyval(below[::-1], 1 / z)
    assert abs(ratio[0] * z[0] ** -int(channel.delay) - exact) < 1e-6 * max(abs(exact), 1.0)


def test_friction_that_is_none_leaves_a_lag():
    plant = Plant((Friction(15.0, 0.0),), 400, 800, (2e-3, 0.2))
    case = cases()[0].__class__("lag", plant, "prbs", 400, 40.0, 0.0)
    frequency = np.array([0.01, 0.05])
    found = truth(case, frequency)[:, 0]
    exact = lags(1.0, 15.0).response(frequency)
    np.testing.assert_allclose(found, exact, rtol=1e-3)


def test_the_design_meets_what_was_asked_for():
    found = cases()
    assert len(PLANTS) >= 14 and len(found) == CASES_OF_A_PLANT * len(PLANTS) >= 60
    assert {case.excitation for case in found} == set(EXCITATIONS)
    for plant in PLANTS.values():
        own = [case for case in found if case.plant is plant]
        assert sorted(case.decibels for case in own) == sorted(DECIBELS)
        assert sum(case.samples == plant.long for case in own) == CASES_OF_A_PLANT / 2
    assert len(heaters()) == 6


@pytest.mark.parametrize("excitation", EXCITATIONS)
def test_records_have_their_noise_and_twelve_bits(excitation):
    plant = PLANTS["two inputs"]
    rngs = [np.random.default_rng(k) for k in range(3)]
    u, y, size = record(plant, excitation, 1500, 20.0, rngs)
    assert u.shape == (3, 2, 1500) and y.shape == (3, 1500)
    again, clean, _ = record(plant, excitation, 1500, 200.0, [np.random.default_rng(0)])
    np.testing.assert_array_equal(u[0], again[0])
    np.testing.assert_allclose((y[0] - clean[0]).std(), size[0], rtol=0.15)
    for signal in (*y, *(u - u.mean(axis=-1, keepdims=True)).reshape(6, -1)):
        levels = np.unique(signal)
        assert np.diff(levels).min() > np.ptp(signal) / 4097


def test_what_is_left_out_is_a_miss_where_it_is_clear():
    held = np.ones((2, 6, 1), bool)
    told = np.ones((2, 6), bool)
    told[:, 0], held[0, 2] = False, False
    clear = np.array([True, True, True, True, True, False])
    one = Judged(np.arange(6.0), held, np.ones((2, 6, 1)), told, np.ones((6, 1)), clear)
    shares = [share for share, _ in one.thirds()]
    assert shares == [0.5, 0.75, 1.0]
    assert one.width == 1.0


def test_output_error_of_the_true_order_is_narrower():
    case = next(c for c in cases() if c.name.startswith("two tanks, prbs"))
    made = records(case, 2, 0)
    ours = judged(case, made, 20)
    error = output_error_width(case, made[0][0, 0], float(made[2][0]), ours)
    assert 0 < error < ours.width < 0.1


@pytest.mark.slow
def test_a_few_cases_keep_their_promise():
    run = wb.run("bench/regions", records=4, draws=2, every=10)
    assert run.certificate.valid
    assert run.metrics["coverage"] > 0.93
