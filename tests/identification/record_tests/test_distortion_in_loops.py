"""What a loop tells of its plant beyond a linear model: found where it is, and seldom elsewhere."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter
from test_false_alarms import ALLOWED, lower_bound

from workbench import solve
from workbench.identification import ClosedLoopFit, closed_loop_covariance
from workbench.identification.closed_loop.distortion import distortion_in_loop
from workbench.identification.closed_loop.starts import best_by_instruments
from workbench.identification.innovations.curvature import covariance_of_moves
from workbench.identification.innovations.distortion import PARTS

AT = np.array([0.0, 0.01, 0.1, 0.3])
PERIOD, SAMPLES, BEFORE = 100, 3000, 500
SEED = 6700
"""Of the judgement; the test was developed on no such records."""
FEWEST_TESTED = 0.8
"""Least share of the records that are tested; deviations of the others are infinite."""


def plant(rng):
    """Order, numerator and denominator of a lag, two lags with a zero outside, or a resonance."""
    kind = rng.choice(["lag", "right zero", "resonance"])
    if kind == "lag":
        pole = rng.uniform(0.7, 0.97)
        return 1, np.array([0.0, 1 - pole]), np.array([1.0, -pole])
    if kind == "right zero":
        poles = rng.uniform(0.6, 0.95, 2)
        above = np.array([0.0, -1.0, rng.uniform(1.2, 2.0)])
    else:
        poles = rng.uniform(0.85, 0.96) * np.exp(1j * rng.uniform(0.2, 0.8) * np.array([1, -1]))
        above = np.array([0.0, 1.0, 0.8])
    below = np.poly(poles).real
    return 2, above * below.sum() / above.sum(), below


def excitation(kind, rng):
    samples = BEFORE + SAMPLES
    if kind == "noise":
        return rng.standard_normal(samples)
    if kind == "binary":
        return rng.choice([-1.0, 1.0], samples // 4).repeat(4)
    one = rng.choice([-1.0, 1.0], PERIOD // 4).repeat(4)
    return np.tile(one, samples // PERIOD)


def program(kind, rng, bend=0.0):
    """A loop u = r - gain y about a linear plant; the sensor may be bent by a square and a cube."""
    while True:
        order, above, below = plant(rng)
        gain = rng.uniform(0.1, 0.6)
        if np.abs(np.roots(below + gain * above)).max() < 0.97:
            break
    r, loop = excitation(kind, rng), below + gain * above
    v = lfilter([1.0], [1.0, -rng.uniform(0.0, 0.9)], rng.standard_normal(len(r)))
    clean = lfilter(above, loop, r)
    v *= clean.std() * 10 ** (-rng.uniform(25, 50) / 20) / v.std()
    y = clean + lfilter(below, loop, v)
    u = r - gain * y
    y = y + bend * (y**2 + y**3)
    r, u, y = r[BEFORE:], u[BEFORE:], y[BEFORE:]
    period = PERIOD if kind == "periodic" else None
    return ClosedLoopFit(u, y, orders=(order,), direct=False, excitation=r, period_samples=period)


def told(asked, model):
    """What the errors of a model tell, by the explained part of the record."""
    record = asked.estimation_record
    drive = asked.explained_part(record).u
    return distortion_in_loop(
        model, record, drive, False, asked.washout_samples, asked.period_samples
    )


def beyond(asked):
    """What the errors of the model by instruments tell; None where deviations are infinite."""
    record = asked.estimation_record
    clean = asked.explained_part(record)
    model = best_by_instruments(asked, record, clean, asked.orders[0], 1.0)
    if model is None or asked.doubts(model, "instrumental-variables"):
        return None
    return told(asked, model)


def alarms(kind, records):
    """Records of linear loops whose plant seems distorted, or of higher order, and all tested."""
    found = {k: beyond(program(kind, np.random.default_rng([SEED, k]))) for k in range(records)}
    tested = {k: one for k, one in found.items() if one is not None}
    assert len(tested) >= FEWEST_TESTED * records
    return [k for k, one in tested.items() if one.found], len(tested)


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["noise", "binary", "periodic"])
def test_linear_plants_in_many_loops_are_seldom_called_distorted(kind):
    found, tested = alarms(kind, 170)
    assert lower_bound(len(found), tested) <= ALLOWED, found


@pytest.mark.cases(0)
@pytest.mark.parametrize("kind", ["periodic", "binary", "noise"])
def test_linear_plants_in_loops_are_seldom_called_distorted(kind):
    found, _ = alarms(kind, 5)
    assert len(found) <= 1, found


@pytest.mark.cases(0)
@pytest.mark.parametrize("kind", ["periodic", "binary"])
def test_a_bent_sensor_in_a_loop_is_seen(kind):
    found = beyond(program(kind, np.random.default_rng(3), bend=0.3))
    assert found.found and found.powers_chance < 1e-10
    parts = PERIOD // 2 + 1 if kind == "periodic" else PARTS
    assert found.moves(AT).shape == (1 + parts, len(AT), 1, 1)


def test_deviations_are_at_least_those_of_the_larger_model():
    asked = program("periodic", np.random.default_rng(3), bend=0.3)
    answer = solve(asked, method="two-stage")
    assert "the plant is not linear; deviations count this" in " ".join(answer.certificate.facts)
    model = answer.answer.simulator
    larger = covariance_of_moves(told(asked, model).moves(AT))
    stated = closed_loop_covariance(asked, "two-stage", model, AT)
    least = np.linalg.eigvalsh(stated - larger).min(axis=-1)
    assert (least >= -1e-9 * np.trace(larger, axis1=-2, axis2=-1)).all()


def test_a_pole_that_the_model_lacks_is_told_by_the_explained_input():
    rng = np.random.default_rng(4)
    r, v = rng.standard_normal((2, SAMPLES))
    above, below = np.array([0.0, 0.06, 0.03]), np.convolve([1.0, -0.9], [1.0, -0.5])
    loop = below + 0.4 * above
    y = lfilter(above, loop, r) + 0.01 * lfilter(below, loop, v)
    for order, lacks in ((1, True), (2, False)):
        asked = ClosedLoopFit(r - 0.4 * y, y, orders=(order,), direct=False, excitation=r)
        assert (beyond(asked).inputs_chance < 1e-4) == lacks


def test_a_model_that_is_not_stable_is_not_tested():
    asked = program("periodic", np.random.default_rng(5))
    record = asked.estimation_record
    clean = asked.explained_part(record)
    model = best_by_instruments(asked, record, clean, asked.orders[0], 1.0)
    unstable = replace(model, A=1.1 * np.eye(model.order))
    assert told(asked, unstable) is None
