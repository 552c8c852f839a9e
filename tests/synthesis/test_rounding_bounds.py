"""Bounds of rounding errors and shifts of sampled controllers, by hand."""

import math

import control
import numpy as np
import pytest

from workbench.synthesis import fixed_point, second_order_sections
from workbench.synthesis.implementation.fixed_point import _shifts
from workbench.synthesis.implementation.implementation_checks import (
    follows,
    integers_agree,
    margins_agree,
)
from workbench.synthesis.implementation.impulse import absolute_sum
from workbench.synthesis.implementation.rounding import (
    ComputedForm,
    _injected,
    _loop_gains,
    absolute_sums,
    fixed_rounding,
    floating_rounding,
)
from workbench.synthesis.implementation.sampled_loop import SampledMargins

K = control.ss([[0.9, 0.2], [-0.1, 0.7]], [[1.0], [0.5]], [[0.4, -1.0]], [[0.3]], 1.0)
UNIT = 0.01


def deaf(outputs):
    """A sampled plant that hears nothing: the loop is open."""
    none = np.zeros((outputs, 1))
    return control.ss([[0.5]], [[0.0]], none, none, 1.0)


def gain(*values):
    """A sampled static controller of one output."""
    return control.ss([], [], [], [values], 1.0)


def margins(phase=60.0, delay=1.0):
    return SampledMargins((0.0, 2.0), phase, 10.0, delay)


@pytest.mark.parametrize("factor", [-1.0, 1.1, 0.0])
def test_another_controller_does_not_follow(factor):
    other = control.ss(K.A, K.B, factor * K.C, factor * K.D, 1.0)
    found = follows(other, K, "double")
    assert not found.holds and follows(K, K, "double").holds
    if factor == -1.0:
        assert found.value == pytest.approx(2.0)


@pytest.mark.parametrize(
    "claimed",
    [
        (margins(phase=70.0), margins()),
        (margins(phase=50.0), margins()),
        (margins(), margins(delay=0.5)),
        (margins(delay=np.nan), margins()),
        (margins(),),
        (),
    ],
)
def test_margins_of_every_control_agree(claimed):
    assert not margins_agree(claimed, (margins(), margins())).holds
    assert margins_agree((margins(), margins()), (margins(), margins())).holds


# --- floating point -----------------------------------------------------------------------------


@pytest.mark.parametrize("values", [(2.0,), (2.0, -3.0, 0.5), (1.0, 0.0, 1.0)])
def test_a_sum_of_products_rounds_once_for_each_term_and_once_more(values):
    """gamma_n = n u / (1 - n u) of Higham, with n terms and the product's own."""
    found = floating_rounding(gain(*values), deaf(len(values)), 1, UNIT)
    terms = np.count_nonzero(values) + 1
    assert found.share == pytest.approx(terms * UNIT / (1 - terms * UNIT))
    assert found.contraction == 0.0


@pytest.mark.parametrize("sign", [1, -1])
def test_errors_go_round_the_loop(sign):
    """y(t + 1) = g u(t) + w(t + 1), u = sign k y: all sums are geometric."""
    k, g = 2.0, 0.3
    plant = control.ss([[0.0]], [[1.0]], [[g]], [[0.0]], 1.0)
    found = floating_rounding(gain(k), plant, sign, UNIT)
    growth, total = 2 * UNIT / (1 - 2 * UNIT), 1 / (1 - k * g)
    assert found.contraction == pytest.approx(growth * k * g * total)
    assert found.share == pytest.approx(growth * total / (1 - growth * k * g * total))


@pytest.mark.parametrize("sign", [1, -1])
def test_gains_of_a_loop_are_absolute_sums_of_its_responses(sign):
    form = ComputedForm(K.A, K.B, K.C, K.D, np.eye(2), np.zeros((1, 2)))
    plant = control.ss([[0.5]], [[0.05]], [[1.0]], [[0.0]], 1.0)
    found = _loop_gains(form, plant, sign)
    loop = control.ss(control.feedback(1, plant * K, sign))  # of the measurement
    samples = control.impulse_response(loop, np.arange(3000.0)).outputs
    assert found[2, 0] == pytest.approx(np.abs(samples).sum(), rel=1e-6)


@pytest.mark.parametrize("pole", [0.5, -0.99, 1 - 1e-6, 1 - 1e-9])
def test_absolute_sums_of_one_mode(pole):
    one = np.ones((1, 1))
    found = absolute_sums(pole * one, 2 * one, one, 0.5 * one)[0, 0]
    assert found == pytest.approx(0.5 + 2 / (1 - abs(pole)), rel=1e-6)


# --- fixed point --------------------------------------------------------------------------------


@pytest.mark.parametrize("value", [0.25, 0.75, 3.0, 5.0])
def test_roundings_of_a_gain_in_fixed_point(value):
    """Of the measurement, of the sum, which a shift enlarges, and of the control."""
    fixed = fixed_point(second_order_sections(gain(value, value)), 16, 12)
    step, shift = 2.0**-11, int(fixed.cascades[0][0].shifts[0])
    assert shift == max(math.ceil(math.log2(value * (1 + 2 * step))), -8 if value < 1 else 0)
    found = fixed_rounding(fixed, deaf(2), 1, 12).share
    assert found == pytest.approx(step / 2 * (2 * value + 2 * 2.0**shift + 1))
    assert integers_agree(fixed).holds


@pytest.mark.parametrize("b", [(1.0, 0.5, -0.3), (0.2, 0.0, 0.1)])
def test_a_section_with_its_rounding_error(b):
    """From the entry b / a, from the error 1 / a."""
    rows = np.array([[*b, 1.0, -1.2, 0.5], [0.7, 0.1, 0.0, 1.0, 0.3, 0.02]])
    form = _injected(rows)
    z = np.exp(0.4j)
    powers = np.array([1.0, 1 / z, 1 / z**2])
    sections = [(row[:3] @ powers) / (row[3:] @ powers) for row in rows]
    states = np.linalg.inv(z * np.eye(4) - form.A)
    assert (form.C @ states @ form.B + form.D)[0, 0] == pytest.approx(np.prod(sections))
    of_errors = (form.C @ states @ form.E + form.F)[0]
    poles = [1 / (row[3:] @ powers) for row in rows]
    assert of_errors == pytest.approx([poles[0] * sections[1], poles[1]])


def test_shifts_leave_room_for_signals_and_all_roundings():
    """Two sections of gains above 1 and a pole near the circle, with few bits of signals."""
    rows = np.array(
        [
            [0.999, 0.0, 0.0, 1.0, 0.0, 0.0],
            [0.9, 0.3, 0.0, 1.0, -0.9, 0.0],
            [3.0, 0.0, 0.0, 1.0, 0.5, 0.0],
        ]
    )
    for bits in (8, 10, 24):
        step = 2.0 ** (1 - bits)
        shifts, largest = _shifts(rows, bits, False)
        for k in range(len(rows)):
            after = [rows[j : k + 1].copy() for j in range(k + 1)]
            for one in after:
                one[0, :3] = 1.0, 0.0, 0.0
            errors = step / 2 * np.array([absolute_sum(one) for one in after])
            signal = absolute_sum(rows[: k + 1]) + float((errors[:k] * 2.0 ** shifts[:k]).sum())
            reached = signal / 2.0 ** shifts[k] + errors[k]
            assert reached == pytest.approx(largest[k]) and reached <= 1 - step
            assert signal / 2.0 ** (shifts[k] - 1) + errors[k] > 1 - step
    assert integers_agree(fixed_point(second_order_sections(K), 24, 20)).holds


def test_integers_of_a_cascade_with_several_shifts_stand_for_its_coefficients():
    steep = control.tf([1.0], np.poly([0.9, 0.8, 0.7, 0.6]), 1.0)
    fixed = fixed_point(second_order_sections(control.ss(steep) * gain(0.5)), 24, 32)
    shifts = fixed.cascades[0][0].shifts
    assert len(shifts) > 1 and shifts[0] != 0
    assert integers_agree(fixed).holds
