"""Margins and bandwidths against loops whose numbers are known by hand."""

import control
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from workbench.plants.cd_drive.control.loops import (
    bands,
    bandwidths,
    crossings,
    margins,
    open_loop,
    plants,
)
from workbench.plants.cd_drive.drive.plants import crossover, phase_margin
from workbench.plants.cd_drive.laboratory.bench_setup import PERIOD

HZ = 2 * np.pi


def triple_lag(gain, corner_hz=100.0):
    """gain / (1 + s/w)^3: unstable from a gain of 8, at sqrt(3) w."""
    w = HZ * corner_hz
    return gain * control.ss(control.zpk([], [-w] * 3, w**3))


@given(gain=st.floats(1.5, 7.0), corner=st.floats(10.0, 1000.0))
def test_a_triple_lag(gain, corner):
    found = margins(triple_lag(gain, corner))
    assert found.increase == pytest.approx(8 / gain, rel=1e-8)
    assert found.increase_hz == pytest.approx(np.sqrt(3) * corner, rel=1e-8)
    assert found.decrease == 0.0
    assert np.isnan(found.decrease_hz)
    at = np.sqrt(gain ** (2 / 3) - 1)  # |L| = 1
    assert found.crossover_hz == pytest.approx(at * corner, rel=1e-8)
    assert found.phase == pytest.approx(180 - 3 * np.degrees(np.arctan(at)), rel=1e-7)
    assert found.gain_db == pytest.approx(20 * np.log10(8 / gain))


def test_a_conditionally_stable_loop_has_both_limits():
    loop = control.ss(control.zpk([-HZ * 100] * 2, [-HZ * 0.1] * 3, 1.0))
    loop = 10 * loop / abs(loop(2j * np.pi * 300.0))
    found = margins(loop)
    assert 0 < found.decrease < 1
    assert np.isinf(found.increase)
    assert found.gain_db == pytest.approx(-20 * np.log10(found.decrease))


def test_a_loop_below_one_has_no_crossover():
    found = margins(triple_lag(0.5))
    assert np.isinf(found.phase)
    assert np.isnan(found.crossover_hz)
    assert np.isnan(list(bandwidths(triple_lag(0.2)).values())).all()


def test_bandwidths_of_an_integrator():
    w = HZ * 50
    found = bandwidths(control.ss(control.zpk([], [0], w)))
    # |S| = f / sqrt(f^2 + 50^2), |T| = 50 / sqrt(f^2 + 50^2).
    assert found == pytest.approx({"S": 50.0, "crossover": 50.0, "T": 50.0}, rel=1e-9)


def test_crossings_and_bands_of_a_sine():
    grid = np.geomspace(1.0, 10.0, 50)
    found = crossings(lambda f: np.sin(f), grid)
    assert found == pytest.approx(np.pi * np.arange(1, 4), rel=1e-12)
    positive = bands(lambda f: np.sin(f), grid)
    assert np.array(positive) == pytest.approx(
        np.array([[1.0, np.pi], [2 * np.pi, 3 * np.pi]]), rel=1e-12
    )


@pytest.mark.parametrize("axis", ["focus", "radial"])
def test_the_nominal_loop_is_the_drives_own(axis):
    loop = open_loop(axis, plants(axis, "own", "printed")["nominal"])
    found = margins(loop)
    assert bandwidths(loop)["crossover"] == pytest.approx(crossover(axis), rel=1e-8)
    assert found.phase == pytest.approx(phase_margin(axis), rel=1e-8)


def test_delay_costs_phase():
    plant = plants("focus", "agc", "printed")["CD3"]
    none, half = (margins(open_loop("focus", plant, delay)) for delay in (0.0, 0.5))
    lost = 0.5 * PERIOD * none.crossover_hz * 360
    assert none.phase - half.phase == pytest.approx(lost, rel=2e-3)
    assert half.increase < none.increase
