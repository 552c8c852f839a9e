"""Delays of every length, from every input; and they are handled by fits."""

import numpy as np
import pytest
from scipy.signal import lfilter

from workbench.identification import as_experiments
from workbench.identification.record_tests.delay import delays
from workbench.identification.record_tests.record import RecordData
from workbench.identification.state_space.delays import estimated_delays


def answered(u, wait, pole=0.8):
    return lfilter([0, 1 - pole], [1, -pole], np.r_[np.zeros(wait), u[: len(u) - wait]])


def inputs(kind, rng, n):
    if kind == "binary":
        return np.repeat(rng.choice([-1.0, 1.0], n // 10 + 1), 10)[:n]
    return rng.standard_normal(n)


@pytest.mark.parametrize("kind", ["binary", "white"])
@pytest.mark.parametrize(("wait", "samples"), [(0, 1500), (40, 1500), (150, 1500), (900, 20_000)])
def test_a_delay_is_found_within_its_bounds(kind, wait, samples):
    rng = np.random.default_rng(wait)
    u = inputs(kind, rng, samples)
    y = answered(u, wait) + 0.02 * rng.standard_normal(samples)
    (one,) = delays(RecordData(u[:, None], y[:, None], None, (0,), 1.0, ("u",), ("y",)))
    assert one.tested
    assert wait * 0.9 <= one.least <= wait + 4
    assert one.most >= wait


def test_the_delay_of_each_input_is_its_own():
    rng = np.random.default_rng(3)
    u = rng.standard_normal((5000, 2))
    y = answered(u[:, 0], 150) + answered(u[:, 1], 0) + 0.05 * rng.standard_normal(5000)
    late, soon = delays(RecordData(u, y[:, None], None, (0,), 1.0, ("a", "b"), ("y",)))
    assert (late.input, late.least) == (0, pytest.approx(151, abs=2))
    assert (soon.input, soon.least) == (1, pytest.approx(1, abs=1))
    assert estimated_delays(as_experiments(u, y)) == pytest.approx((151, 1), abs=1)


def test_a_sine_tells_no_delay():
    time = np.arange(3000)
    u = np.sin(0.1 * time)
    (one,) = delays(
        RecordData(u[:, None], answered(u, 50)[:, None], None, (0,), 1.0, ("u",), ("y",))
    )
    assert one.least is None and not one.tested


@pytest.mark.parametrize("wait", [0, 20, 99, 130, 170])
def test_fits_estimate_short_and_long_delays(wait):
    rng = np.random.default_rng(wait)
    u = rng.standard_normal(1500)
    y = answered(u, wait) + 0.02 * rng.standard_normal(1500)
    assert estimated_delays(as_experiments(u, y)) == pytest.approx((wait + 1,), abs=1)
