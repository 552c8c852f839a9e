"""Margins of measured loops: python-control's data, estimates with variances, several plants."""

from dataclasses import replace

import control
import numpy as np
import pytest

from workbench.errors import InputError
from workbench.identification import ResponseEstimate
from workbench.mu import loop_margins
from workbench.mu.margins.classical import classical_margins
from workbench.uncertainty import Responses

LOOP = control.tf([4], [1, 3, 3, 1])
OMEGA = np.geomspace(0.05, 50, 60)
EXACT = LOOP(1j * OMEGA)
NOISE = (0.03 * np.abs(EXACT)) ** 2


def estimate(seed=0, degrees=np.inf, values=EXACT):
    rng = np.random.default_rng(seed)
    noise = np.sqrt(NOISE / 2) * (rng.standard_normal((OMEGA.size, 2)) @ [1, 1j])
    shape = (-1, 1, 1)
    return ResponseEstimate(
        OMEGA / 2 / np.pi, (values + noise).reshape(shape), NOISE.reshape(shape), degrees
    )


def test_data_of_a_loop_have_nearly_its_margins():
    truth, found = classical_margins(LOOP), loop_margins(control.frd(EXACT, OMEGA))
    assert found.gain == (0.0, pytest.approx(truth.gain[1], rel=5e-3))
    assert found.phase_deg == pytest.approx(truth.phase_deg, abs=0.2)
    assert found.delay == pytest.approx(truth.delay, rel=1e-2)
    assert np.isnan(found.phases_deg[:, 2:]).all()
    assert found.holds, found.certificate.failures
    assert all("frequencies of the data only" in one.over for one in found.certificate.checks)


@pytest.mark.parametrize("count", [8, 300])
def test_an_integrator_is_told_exactly_whatever_the_grid(count):
    omega = np.geomspace(0.1, 10, count)
    found = loop_margins(control.frd(2.0 / (1j * omega), omega))
    np.testing.assert_allclose(found.phases_deg[:, :2], [[90.0, 2.0]], rtol=1e-12)
    np.testing.assert_allclose(found.delays[:, 0], np.pi / 4, rtol=1e-12)
    assert found.holds, found.certificate.failures


def test_ranges_hold_the_truth_as_often_as_they_say():
    truth, held = classical_margins(LOOP), []
    for seed in range(300):
        found = loop_margins(estimate(seed))
        at = int(np.abs(found.phases_deg[:, 1] - truth.phases_deg[0, 1]).argmin())
        pairs = (
            (found.phases_deg[at], truth.phase_deg),
            (found.delays[at], truth.delay),
            (found.gains[0], truth.gain[1]),
        )
        held.append([row[2] <= one <= row[3] for row, one in pairs])
    share = np.mean(held, axis=0)  # 95 %, with a standard deviation of 1.3 %
    assert (np.abs(share - 0.95) < 0.045).all()


def test_few_degrees_of_freedom_widen_the_ranges():
    wide, narrow = (loop_margins(estimate(0, degrees)) for degrees in (4, np.inf))
    half = [np.diff(one.phases_deg[0, 2:])[0] for one in (wide, narrow)]
    assert half[0] / half[1] == pytest.approx(2.776 / 1.960, rel=1e-3)
    assert wide.holds and narrow.holds
    assert wide.plot()


def test_a_controller_multiplies_data_and_noise():
    K = control.tf([0.5, 0.2], [1, 0])
    shown = K(1j * OMEGA)
    measured = estimate(0)
    loop = replace(
        measured,
        response=measured.response * shown[:, None, None],
        variance=measured.variance * np.abs(shown[:, None, None]) ** 2,
    )
    one, other = loop_margins(measured, K), loop_margins(loop)
    np.testing.assert_allclose(one.phases_deg, other.phases_deg, rtol=1e-9)
    np.testing.assert_allclose(one.gains, other.gains, rtol=1e-9)


def test_several_plants_are_told_by_name():
    values = np.stack([EXACT, 1.5 * EXACT], axis=1)
    plants = Responses(
        omega=OMEGA, values=values, plants=["a", "b"], variance=0.03**2 * np.abs(values) ** 2
    )
    found = loop_margins(plants)
    a, b = found.classical["a"], found.classical["b"]
    assert list(found.classical) == ["a", "b"]
    assert a.gain[1] == pytest.approx(1.5 * b.gain[1])
    assert np.isfinite(a.phases_deg).all()
    assert (found.gain[1], found.phase_deg, found.delay) == (b.gain[1], b.phase_deg, b.delay)
    assert found.modulus == min(a.modulus[0], b.modulus[0])
    assert found.stable is None and "| a" in repr(found)
    assert found.holds, found.certificate.failures
    with pytest.raises(InputError, match="each of a, b has crossings of its own"):
        _ = found.phases_deg


def test_data_have_no_disks():
    found = loop_margins(control.frd(EXACT, OMEGA))
    for ask in (lambda: found.disks, lambda: found.least_disk, lambda: found.loops):
        with pytest.raises(InputError, match="measured responses say nothing between"):
            ask()
    assert found.every_plant == {} and found.plot()


def test_a_plant_that_was_not_measured_everywhere_keeps_its_own_frequencies():
    values = np.stack([EXACT] * 3, axis=1)
    present = np.ones(values.shape, bool)
    present[::2, 0] = False
    found = loop_margins(Responses(omega=OMEGA, values=values, present=present))
    found = found.classical
    assert found["1"]._checked_by[0].data.omega.size == OMEGA.size // 2
    assert found["2"]._checked_by[0].data.omega.size == OMEGA.size


def test_a_sampled_loop_is_told_in_samples():
    omega = np.geomspace(0.01, 3.0, 200) / 0.1
    loop = control.tf([0.3], [1, -1], 0.1)
    found = loop_margins(control.frd(loop(np.exp(0.1j * omega)), omega, dt=0.1))
    truth = classical_margins(loop)
    assert found.delay == pytest.approx(truth.delay, rel=1e-3)
    assert f"({found.delay / 0.1:.4g} samples)" in repr(found)
    assert "rad/s (" in repr(found) and "Hz)" in repr(found)


def test_the_sign_of_a_phase_margin_is_kept():
    found = loop_margins(control.frd(EXACT * 4 / (1j * OMEGA), OMEGA))
    assert found.phase_deg < 0
    assert "phase -" in repr(found) and "do not tell whether the closed loop is stable" in repr(
        found
    )


@pytest.mark.parametrize("unit", [1e-6, 1e6])
def test_the_unit_of_time_changes_nothing_else(unit):
    one, other = (loop_margins(control.frd(EXACT, OMEGA / scale)) for scale in (1.0, unit))
    np.testing.assert_allclose(other.gains[:, 0], one.gains[:, 0], rtol=1e-9)
    np.testing.assert_allclose(other.delays[:, 0], unit * one.delays[:, 0], rtol=1e-9)


@pytest.mark.parametrize(
    ("data", "controller", "words"),
    [
        (control.frd(np.ones((2, 2, 3)), [1, 2, 3]), 1.0, "2 outputs and 2 inputs"),
        (control.frd([1.0], [1.0]), 1.0, "two or more responses"),
        (control.frd([1.0, np.nan], [1.0, 2.0]), 1.0, "finite"),
        (control.frd([1.0, 0.0], [1.0, 2.0]), 1.0, "not zero"),
        (control.frd(EXACT, OMEGA), control.tf([1], [1, 0.5], 0.1), "they must be the same"),
        (control.frd(EXACT, OMEGA), np.eye(2), "2 outputs and 2 inputs"),
        (control.frd(EXACT, OMEGA), "PI", "controller"),
    ],
)
def test_what_has_no_margins_is_refused(data, controller, words):
    with pytest.raises(InputError, match=words):
        loop_margins(data, controller)


@pytest.mark.parametrize("field", ["gains", "phases_deg", "delays", "modulus"])
def test_margins_that_the_data_do_not_have_fail(field):
    found = loop_margins(estimate(0)).classical["loop"]
    wrong = replace(found, **{field: getattr(found, field) * 1.01})
    assert not wrong.with_checker(found._checked_by[0]).holds


def test_a_second_opinion_alone_notices_what_is_missing_or_too_narrow():
    found = loop_margins(estimate(0)).classical["loop"]
    checker = found._checked_by[0]
    narrow = found.phases_deg.copy()
    narrow[:, 2:] = narrow[:, :1] + (narrow[:, 2:] - narrow[:, :1]) / 2
    for wrong in (
        replace(found, gains=found.gains[:0]),
        replace(found, phases_deg=narrow),
        replace(found, phases_deg=found.phases_deg * [1, 1.5, 1, 1]),
    ):
        assert not all(check.holds for check in checker.second_opinion(wrong))
    assert all(check.holds for check in checker.second_opinion(found))
