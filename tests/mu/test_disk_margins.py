"""Margins of loops against documented numbers, python-control and their own definitions.

Sources of numbers: MathWorks, Robust Control Toolbox and Control System Toolbox, reference pages of
allmargin and diskmargin.
"""

from dataclasses import replace

import control
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from workbench.errors import InputError, UnknownNameError
from workbench.mu import (
    Complex,
    Full,
    Real,
    Structure,
    disk_gain,
    disk_phase,
    loop_margins,
    peak,
    skewed_peak,
    worst_case_gain,
)
from workbench.mu.margins.classical import classical_margins
from workbench.uncertainty import append, dynamics, real, ss, tf

DOCUMENTED = control.tf([25.0], [1.0, 10.0, 10.0, 10.0])


def test_crossings_as_documented():
    """allmargin: 3.6000 at 3.1623, 29.1104 degrees at 1.7844, delay 0.2847."""
    found = classical_margins(DOCUMENTED)
    assert found.gains[0] == pytest.approx([3.6, 3.1623], abs=5e-5)
    assert found.phases_deg[0] == pytest.approx([29.1104, 1.7844], abs=5e-5)
    assert found.delay == pytest.approx(0.2847, abs=5e-5)


def test_disk_as_documented():
    """diskmargin: gain 0.6273 to 1.5942, phase 25.8017 degrees, 0.4581 at 1.9503 rad/s."""
    found = loop_margins(DOCUMENTED, tolerance=1e-6).disks["loop"]
    assert found.lower <= 0.45815 and found.upper >= 0.45805
    assert found.gain == pytest.approx((0.6273, 1.5942), abs=2e-4)
    assert found.phase_deg == pytest.approx(25.8017, abs=2e-3)


def random_loop(rng, dt=0.0):
    n = int(rng.integers(1, 7))
    A, B, C = rng.normal(size=(n, n)), rng.normal(size=(n, 1)), rng.normal(size=(1, n))
    if dt:
        A *= rng.uniform(0.3, 0.99) / np.abs(np.linalg.eigvals(A)).max()
    else:
        A -= (np.linalg.eigvals(A).real.max() + rng.uniform(0.01, 1.0)) * np.eye(n)
    return control.ss(A, B, C, rng.choice([0.0, 0.4]), dt)


@pytest.mark.cases(1)
@pytest.mark.parametrize("dt", [0.0, 0.1])
@pytest.mark.parametrize("seed", range(15))
def test_each_crossing_puts_a_pole_on_the_axis(seed, dt):
    L = random_loop(np.random.default_rng(seed), dt)
    L = L * (3.0 / abs(L(1.0 + 0.5j)))
    found = classical_margins(L)
    dense = np.concatenate([np.geomspace(1e-4, np.pi / dt if dt else 1e4, 40_001)])
    z = np.exp(1j * dense * dt) if dt else 1j * dense
    values = L(z)
    for factor, omega in found.gains:
        if np.isfinite(omega):
            at = np.exp(1j * omega * dt) if dt else 1j * omega
            assert abs(1 + factor * L(at)) < 1e-8
    for phase, omega in found.phases_deg:
        at = np.exp(1j * omega * dt) if dt else 1j * omega
        assert abs(1 + np.exp(-1j * np.radians(phase)) * L(at)) < 1e-8
    # None is missed: a dense grid sees no more.
    turns = np.flatnonzero(np.diff(np.sign(values.imag)))
    negative = [k for k in turns if values[k].real < 0 and values[k + 1].real < 0]
    inner = [w for _, w in found.gains if 1e-4 < w < dense[-1] * (1 - 1e-9)]
    assert len(inner) == len(negative)
    unit = np.flatnonzero(np.diff(np.sign(np.abs(values) - 1)))
    assert len([w for _, w in found.phases_deg if w > 1e-4]) == len(unit)


@pytest.mark.parametrize("seed", range(8))
def test_the_least_margins_are_those_of_python_control(seed):
    L = random_loop(np.random.default_rng(100 + seed))
    L = L * (
        0.8 / np.abs(control.frequency_response(L, np.geomspace(1e-3, 1e3, 999)).magnitude).max()
    )
    L = L * 1.5
    gain, phase, modulus, *_ = control.stability_margins(L)
    found = classical_margins(L)
    if found.gain[1] < np.inf and found.gain[0] == 0:
        assert found.gain[1] == pytest.approx(gain, rel=1e-6)
    if found.phases_deg.size:
        assert found.phase_deg == pytest.approx(phase, rel=1e-6)
    if found.stable:
        assert found.modulus <= modulus * (1 + 1e-9)


@given(st.floats(0.01, 5.0), st.floats(-2.0, 2.0))
def test_gain_and_phase_of_a_disk(alpha, skew):
    low, high = disk_gain(alpha, skew=skew)
    phase = disk_phase(alpha, skew=skew)
    for f in (low, high):
        if np.isfinite(f):
            delta = (f - 1) / ((1 - skew) / 2 + (1 + skew) / 2 * f)
            assert abs(delta) == pytest.approx(alpha, rel=1e-9)
    if phase < 179.0:
        f = np.exp(1j * np.radians(phase))
        delta = (f - 1) / ((1 - skew) / 2 + (1 + skew) / 2 * f)
        assert abs(delta) == pytest.approx(alpha, rel=1e-6)


@pytest.mark.cases(1)
@pytest.mark.parametrize("skew", [-1.0, 0.0, 1.0, 2.0])
def test_disks_as_python_control(skew):
    omega = np.geomspace(1e-2, 1e2, 20_001)
    peer = control.disk_margins(DOCUMENTED, omega, skew=skew)[0]
    found = loop_margins(DOCUMENTED, skew=skew).least_disk
    assert found.lower <= peer * (1 + 1e-6) and found.upper == pytest.approx(peer, rel=2e-4)


def satellite():
    P = control.ss(
        [[0.0, 10.0], [-10.0, 0.0]], np.eye(2), [[1.0, 10.0], [-10.0, 1.0]], np.zeros((2, 2))
    )
    return P, control.ss([], [], [], [[1.0, -2.0], [0.0, 1.0]])


def test_single_loops_hide_what_all_at_once_show():
    P, K = satellite()
    found = loop_margins(P, K)
    peer = control.disk_margins(P * K, np.geomspace(1e-3, 1e3, 4001))[0]
    assert found.multiloop["outputs"].upper == pytest.approx(peer, rel=1e-3)
    assert all(one.lower > 1.99 for one in found.disks.values())
    assert found.least_disk is found.multiloop["all"] and found.least_disk.upper < 0.23
    assert "breaks first" in repr(found)
    assert set(found.multiloop) == {"inputs", "outputs", "all"}
    assert len(found.plot().axes) == 2


def closed_with(P, K, worst, inputs):
    """The loop with factors in its channels."""
    names = list(worst)
    one = control.ss([], [], [], 1.0, P.dt)
    ins = [worst[n] for n in names if n.startswith("input")] or [one] * inputs
    outs = [worst[n] for n in names if n.startswith("output")] or [one] * P.noutputs
    whole = control.append(*outs) * P * control.append(*ins) * K
    return control.feedback(whole, np.eye(P.noutputs)).poles()


@pytest.mark.parametrize("dt", [0.0, 0.05])
@pytest.mark.parametrize("seed", range(6))
def test_the_worst_factors_put_a_pole_on_the_axis(seed, dt):
    rng = np.random.default_rng(seed)
    A = rng.normal(size=(3, 3)) - 3 * np.eye(3)
    P = control.ss(A, rng.normal(size=(3, 2)), rng.normal(size=(2, 3)), 0.0)
    K = control.ss(-np.eye(2), np.eye(2), 0.8 * rng.normal(size=(2, 2)), 0.2 * np.eye(2))
    if dt:
        P, K = control.sample_system(P, dt), control.sample_system(K, dt)
    found = loop_margins(P, K)
    if not found.stable:
        pytest.skip("unstable by chance")
    for one in found.multiloop.values():
        assert 0 < one.lower <= one.upper <= one.lower * 1.001
        if one.worst is None or not 0 < one.omega < (3.1 / dt if dt else 1e6):
            continue
        poles = closed_with(P, K, one.worst, 2)
        at = np.exp(1j * one.omega * dt) if dt else 1j * one.omega
        assert np.abs(poles - at).min() < 1e-5 * max(abs(at), 1e-3)


# --- over sets of plants --------------------------------------------------------------------------

CONTROLLER = control.ss(control.tf([0.3823, 2.303, 3], [1e-3, 1, 0]))


@pytest.mark.cases(0)
def test_the_margin_of_a_set_is_attained_and_no_member_has_less():
    k = real("k", 10, percent=40)
    G = tf([18], [1, 1.8, k]) * (1 + 0.3 * dynamics("delta", 1, 1))
    found = loop_margins(G, CONTROLLER)
    disk = found.disks["input"]
    assert disk.lower <= disk.upper <= 1.001 * disk.lower
    assert found.nominal_disks["input"].lower > disk.upper
    P = G.at(**disk.plant)
    poles = control.feedback(P * disk.worst["input"] * CONTROLLER, 1).poles()
    assert np.abs(poles - 1j * disk.omega).min() < 1e-6 * disk.omega
    assert abs(disk.plant["k"] - 10) <= 4 * (1 + 1e-9)
    for member in G.sample(12, seed=1):
        assert loop_margins(member, CONTROLLER).disks["input"].upper >= disk.lower


@pytest.mark.cases(0)
def test_the_worst_case_disks_as_documented():
    """wcdiskmargin: 0.6147 to 0.6160 in the first output, phase 34.1696 degrees."""
    p = real("p", 10, percent=10)
    P = ss([[-0.2, p], [-1 * p, -0.2]], np.eye(2), [[1, p], [-1 * p, 1]], np.zeros((2, 2)))
    plant = P * (append(1, 1) + dynamics("DEL", 2, 2, bound=0.1))
    assert plant.value.repetitions()["p"] == 2
    found = loop_margins(plant, [[1.0, -2.0], [0.0, 1.0]], tolerance=1e-3)
    first = found.disks["output 1"]
    assert 0.6147 <= first.lower <= first.upper <= 0.6160
    assert first.phase_deg == pytest.approx(34.1696, abs=0.1)
    assert found.multiloop["outputs"].upper < first.lower


def test_a_real_parameter_at_the_worst_end():
    """The response to it falls with the frequency: its multipliers grow without limit there."""
    a = real("a", 1, percent=30)
    K = control.tf([5.0, 5.0], [1.0, 10.0])
    disk = loop_margins(tf([1], [1, a, 0]), K).disks["input"]
    assert disk.plant["a"] == pytest.approx(0.7)
    assert len(disk.proof.proof.intervals) < 40
    ends = [loop_margins(tf([1], [1, v, 0]), K).disks["input"].upper for v in (0.7, 0.85, 1.0, 1.3)]
    assert disk.upper == pytest.approx(min(ends), rel=1e-3)


def test_the_skewed_peak_of_a_full_block_is_the_worst_case_gain():
    k = real("k", 10, percent=40)
    S = 1 / (1 + tf([18], [1, 1.8, k]) * CONTROLLER * (1 + 0.4 * dynamics("delta", 1, 1)))
    gain = worst_case_gain(S)
    structure = S.structure.with_performance(1, 1)
    found = skewed_peak(S.system, structure, ["k", "delta"], tolerance=1e-2)
    assert found.upper == pytest.approx(gain.upper, rel=1e-6)
    assert found.lower == pytest.approx(gain.lower, rel=1e-4)
    M = S.system(1j * found.omega)
    assert np.linalg.svd(np.eye(3) - M @ found.Delta)[1][-1] < 1e-8
    with pytest.raises(UnknownNameError):
        skewed_peak(S.system, structure, "m")
    with pytest.raises(InputError, match="all blocks are fixed"):
        skewed_peak(S.system, structure, [0, 1, 2])


def test_nothing_is_proven_where_the_set_itself_is_unstable():
    k = real("k", 1, plus_minus=2)
    found = loop_margins(tf([1], [1, 2, k]), 0.5)
    assert found.least_disk.lower == 0.0
    assert "Full" not in repr(found)
    assert Structure([Full(1, 1), Real(1), Complex(1)])


def test_multipliers_near_zero_frequency():
    """A real scalar whose response falls with the frequency is covered in a few intervals."""
    slow = control.ss([[-1.0]], [[1.0]], [[-1.0]], [[1.0]])  # s / (s + 1)
    system = control.ss([[-1.0]], [[1.0, 1.0]], [[-0.6], [1.0]], [[0.0, 0.0], [0.0, 0.5]])
    N = control.append(slow, control.ss([], [], [], 1.0)) * system
    found = peak(N, Structure([Real(1, name="a"), Complex(1, name="f")]), tolerance=1e-2)
    assert found.upper <= 1.02 * found.lower and len(found.intervals) < 60


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: loop_margins("G"), "plant must be a StateSpace.*str"),
        (lambda: loop_margins(DOCUMENTED, "K"), "controller must be"),
        (lambda: loop_margins(DOCUMENTED, np.eye(2)), "must fit each other"),
        (lambda: loop_margins(10 * DOCUMENTED).disks, "unstable at the nominal.*negative feedback"),
        (lambda: loop_margins(DOCUMENTED, skew=np.nan), "skew is nan"),
        (lambda: loop_margins(DOCUMENTED, skew="1"), "skew is '1'"),
        (lambda: loop_margins(DOCUMENTED, tolerance=0.0), "tolerance"),
        (lambda: loop_margins(DOCUMENTED, tolerance=None), "tolerance"),
        (lambda: loop_margins(control.ss([], [], [], -1.0)), "singular"),
        (lambda: loop_margins(control.ss(0.5, 1, 1, 0, 0.1), CONTROLLER), "cannot be combined"),
        (lambda: loop_margins(satellite()[0], CONTROLLER), "must fit each other"),
        (lambda: loop_margins(None), "plant must be"),
        (lambda: loop_margins(control.ss(0.5, 1, 1, 0, True)), "sampling time is not given"),
        (lambda: loop_margins(control.ss(0.5, 1, 1, 0, True), 2), "sampling time is not given"),
        (lambda: loop_margins(control.tf([1, 0, 0], [1, 1])), "improper"),
    ],
)  # fmt: skip
def test_bad_input_is_named(call, words):
    with pytest.raises(InputError, match=words):
        call()


def test_the_worst_factors_of_an_ill_conditioned_loop_are_tried_in_many_digits():
    """s^2 + 0.0001 s, nearly, in states in which doubles lose five digits of the response."""
    A = [[-2203.91650390625, 840.9681396484375], [-5775.78082275390625, 2203.91636657714844]]
    loop = control.ss(A, [[-8.0], [-21.0]], [[-1.4765625, 0.5625]], 0.0)
    disk = loop_margins(loop).disks["loop"]
    assert disk.holds, disk.certificate.failures
    (name, factor), *_ = disk.worst.items()
    for share in (1 - 1e-5, 1 + 1e-5):
        other = replace(disk, worst={name: factor * share})
        checks = disk._checked_by[0].second_opinion(other)
        assert not all(check.holds for check in checks)
