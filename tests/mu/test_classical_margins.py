"""What is printed of classical margins: both units, the sign of a phase, stability first."""

import subprocess
import sys

import control
import numpy as np
import pytest

from workbench.mu.margins.classical import classical_margins


def test_frequencies_are_told_in_both_units():
    found = classical_margins(control.tf([4], [1, 3, 3, 1]))  # crosses -1 at sqrt(3) with gain 2
    said = repr(found)
    assert "gain from 0 to 2 at 1.732 rad/s (0.2757 Hz)" in said
    assert f"phase {found.phase_deg:.4g} degrees at 1.233 rad/s (0.1962 Hz)" in said
    assert f"delay {found.delay:.4g} s at 1.233 rad/s" in said and "samples" not in said


def test_a_delay_of_a_sampled_loop_is_told_in_samples_too():
    found = classical_margins(control.tf([0.3], [1, -1], 0.1))
    assert found.dt == 0.1
    assert f"delay {found.delay:.4g} s ({found.delay / 0.1:.4g} samples) at" in repr(found)


def test_the_sign_of_a_phase_margin_is_kept_and_an_unstable_loop_said_first():
    found = classical_margins(control.tf([9 * 8], [1, 3, 3, 1]))  # beyond 8: unstable
    assert found.phase_deg < 0 and not found.stable
    assert repr(found).startswith("ClassicalMargins: the closed loop is UNSTABLE; gain from 0.1111")
    assert f"phase {found.phase_deg:.4g} degrees" in repr(found)
    assert found.holds, found.certificate.failures


@pytest.mark.parametrize("form", [lambda L: L, control.ss])
def test_eight_equal_lags_list_a_crossing_once(form):
    loop = form(control.tf([1.9], [1, 1]))
    for _ in range(7):
        loop = loop * form(control.tf([1], [1, 1]))
    found = classical_margins(loop)
    omega = np.sqrt(1.9**0.25 - 1)
    np.testing.assert_allclose(found.phases_deg[:, 1], [omega], rtol=1e-9)
    assert found.phases_deg[0, 0] == pytest.approx(180 - np.degrees(8 * np.arctan(omega)), rel=1e-7)


@pytest.mark.cases(0)
def test_crossings_alone_load_nothing_of_what_is_computed_when_asked_for():
    code = """
import sys, control
from workbench.mu import loop_margins
found = loop_margins(control.tf([4], [1, 3, 3, 1]))
assert found.stable and found.gain[1] > 1.99 and found.phases_deg.size and found.delay > 0
dear = {f"workbench.mu.margins.{name}" for name in ("disk", "late_disk", "of_sets", "drawn")}
assert not dear & {*sys.modules}, dear & {*sys.modules}
assert found.disks and "workbench.mu.margins.disk" in sys.modules
"""
    subprocess.run([sys.executable, "-c", code], check=True)
