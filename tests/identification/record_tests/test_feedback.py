"""Is feedback told from an open loop? Simulated records, whose truth is known, say so."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import signal, stats
from simulated_logs import as_record, closed_log, excitation, held, open_log
from timing import least_seconds

from workbench.identification.record_tests.loop.feedback import open_loop
from workbench.identification.record_tests.report import reported

JUDGED_OPEN = range(63_000_000, 63_000_500)
"""Seeds of open records, named before the first run and used for nothing but the judgement."""
JUDGED_CLOSED = range(63_500_000, 63_500_300)


def is_found(record):
    return any(finding.kind == "feedback" for finding in open_loop(record).findings)


def wrong(logs, truth):
    """What is taken for what it is not."""
    return [log.what for log in logs if is_found(log.record) is not truth]


@pytest.mark.cases(0)
def test_some_open_and_closed_loops_are_told_apart():
    assert len(wrong(map(open_log, range(30)), False)) <= 1
    assert len(wrong(map(closed_log, range(20)), True)) <= 2


@pytest.mark.slow
def test_open_records_are_not_called_closed():
    """The lower Clopper-Pearson bound of the rate of false alarms is at most 1 %."""
    alarms = wrong(map(open_log, JUDGED_OPEN), False)
    rate = stats.binomtest(len(alarms), len(JUDGED_OPEN)).proportion_ci(0.95, "exact")
    assert rate.low <= 0.01, alarms


@pytest.mark.slow
def test_feedback_is_found_where_a_tenth_of_the_input_comes_from_the_output():
    missed = wrong(map(closed_log, JUDGED_CLOSED), True)
    assert len(missed) <= 0.05 * len(JUDGED_CLOSED), missed


def regulated(steps=0.0, *, direct=False, n=2000, seed=0):
    """The loop x+ = 0.8 x + 0.2 u, y = x + v, u = -2 (y - r): v slow, steps of the set-point r."""
    rng = np.random.default_rng(seed)
    v = 0.1 * signal.lfilter([1], [1, -0.98], rng.standard_normal(n))
    r = steps * held(rng.choice([-1.0, 1.0], n), n, 200, rng)
    u, y, x = np.zeros(n), np.zeros(n), 0.0
    for k in range(n):
        y[k] = x + v[k]
        u[k] = -2.0 * (y[k] - r[k])
        x = 0.8 * x + 0.2 * u[k]
    return as_record(u, y, direct)


@pytest.mark.parametrize("steps", [0.0, 0.1, 0.3, 1.0, 3.0, 10.0])
def test_a_regulated_plant_is_found_out_whatever_its_set_points_do(steps):
    tested = open_loop(regulated(steps))
    (finding,) = tested.findings
    assert finding.kind == "feedback" and finding.forbids
    assert "excitation=" in finding.remedy and "u0" in finding.where


@pytest.mark.parametrize("steps", [0.0, 1.0])
def test_an_exact_function_of_the_output_is_a_static_plant_or_a_controller(steps):
    (finding,) = open_loop(regulated(steps, direct=True)).findings
    assert finding.kind == "static" and not finding.forbids
    assert "-1/K" in finding.message and "excitation=" in finding.remedy
    record = open_log(3, "white", spoiled=False, plant="lag").record
    assert not open_loop(replace(record, direct=True)).findings


def test_a_ramp_fits_its_delayed_output_and_is_no_feedback():
    u = np.abs(np.arange(2000) % 400 - 200.0)[:1900]
    u[1000:] += 0.3 * np.arange(900)
    assert not open_loop(as_record(u[1:], u[:-1], direct=False)).findings


def plant(u, noise=0.01, seed=0):
    v = np.random.default_rng(seed).standard_normal(len(u))
    return signal.lfilter([0.0, 0.2], [1.0, -0.8], u) + noise * v


def test_an_input_that_repeats_to_rounding_is_open():
    rng = np.random.default_rng(0)
    u = np.tile(rng.standard_normal(250), 8)
    tested = open_loop(as_record(u, plant(u)))
    assert tested.testable and tested.result == "'u0' repeats to rounding: open"
    noisy = u + 0.05 * rng.standard_normal(len(u))
    assert not open_loop(as_record(noisy, plant(u))).findings


def test_feedback_is_found_between_periods():
    rng = np.random.default_rng(1)
    r, v = np.tile(rng.standard_normal(250), 8), 0.1 * rng.standard_normal(2000)
    u, y, x = np.zeros(2000), np.zeros(2000), 0.0
    for k in range(2000):
        y[k] = x + v[k]
        u[k] = r[k] - 0.5 * (y[k - 1] if k else 0.0)
        x = 0.8 * x + 0.2 * u[k]
    assert is_found(as_record(u, y))


@pytest.mark.parametrize("kind", ["sine", "chirp", "steps", "staircase"])
def test_what_cannot_be_tested_does_not_pass(kind):
    rng = np.random.default_rng(5)
    u = excitation(kind, 2000, 4, rng)
    tested = open_loop(as_record(u, plant(u)))
    assert not tested.testable and not tested.findings
    assert str(tested).startswith("open loop: not testable; 'u0' ")


def test_nothing_to_test_is_said():
    u = np.random.default_rng(0).standard_normal(1000)
    assert "no input" in open_loop(as_record(0 * u, u)).result
    assert "no output" in open_loop(as_record(u, np.nan * u)).result
    for record in (as_record(u[:100], u[:100]), as_record(u, u, starts=tuple(range(0, 1000, 40)))):
        tested = open_loop(replace(record, y=plant(record.u[:, 0])[:, None]))
        assert not tested.testable and "200 samples" in tested.result


def test_many_inputs_and_outputs_that_miss_an_experiment():
    rng = np.random.default_rng(4)
    u = rng.standard_normal((1000, 8))
    tested = open_loop(as_record(u, rng.standard_normal((1000, 2))))
    assert tested.testable and "of any input can come" in tested.result
    few = open_loop(as_record(rng.standard_normal((400, 20)), rng.standard_normal((400, 3))))
    assert not few.testable and "many channels" in few.result
    y = plant(u[:, 0])
    y[:400] = np.nan
    assert open_loop(as_record(u[:, 0], y, starts=(0, 400))).testable


def test_with_an_excitation_the_excitation_is_tested():
    closed = regulated(1.0)
    r = np.random.default_rng(9).standard_normal((len(closed.u), 1))
    tested = open_loop(replace(closed, r=r))
    assert tested.testable and not tested.findings
    assert tested.assumption == "excitation from outside"
    (finding,) = open_loop(replace(closed, r=-closed.y)).findings
    assert finding.forbids and "excitation 1" in finding.where
    (finding,) = open_loop(replace(closed, r=-closed.y, direct=True)).findings
    assert finding.kind == "feedback" and finding.forbids and "excitation" in finding.remedy


def test_noise_of_the_sensor_of_u_is_no_feedback():
    """The output tells of the true input what that noise hides."""
    rng = np.random.default_rng(2)
    u = signal.lfilter([1], [1, -0.95], rng.standard_normal(5000))
    measured = u + 0.1 * u.std() * rng.standard_normal(5000)
    assert not open_loop(as_record(measured, plant(u, 0.001))).findings


def test_an_output_that_leads_is_told_to_be_shifted():
    u = np.random.default_rng(3).standard_normal(2000)
    (finding,) = open_loop(as_record(u[:-3], plant(u)[3:])).findings
    assert "too early" in finding.remedy


@pytest.mark.cases(0)
def test_a_share_is_below_its_bound():
    """Of what feedback is not found, the bound of the share holds."""
    for seed in range(40):
        log = closed_log(seed, 0.03, n=1500, driven="dither", plant="lag", controller="P")
        tested = open_loop(log.record)
        if not tested.findings:
            bound = float(tested.result.split("at most ")[1].split(" %")[0]) / 100
            assert bound >= log.share, log.what


@given(st.integers(0, 10), st.sampled_from([1e-9, 1.0, 1e6]), st.sampled_from([0.0, 10.0, -1e3]))
@settings(max_examples=15)
def test_units_and_offsets_change_nothing(seed, unit, offset):
    record = open_log(seed, "coloured", n=600).record
    moved = replace(record, u=unit * (record.u + offset), y=(record.y - offset) / unit)
    assert str(open_loop(moved)) == str(open_loop(record))


def test_order_of_inputs_changes_nothing():
    log = closed_log(4, plant="two inputs", n=2000)
    swapped = replace(log.record, u=log.record.u[:, ::-1], inputs=log.record.inputs[::-1])
    told = open_loop(log.record).findings
    assert {finding.where for finding in open_loop(swapped).findings} == {f.where for f in told}


@pytest.mark.cases(0)
def test_a_long_record_takes_a_second():
    u = np.random.default_rng(0).standard_normal(1_000_000)
    record = as_record(u, plant(u))
    assert not open_loop(record).findings
    assert least_seconds(lambda: open_loop(record), 2) < 3.0  # about 1 s where nothing else runs


def test_the_report_has_it():
    assert not reported(regulated(0.3)).usable
