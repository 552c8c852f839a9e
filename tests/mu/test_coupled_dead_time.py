"""Margins of loops of several channels with dead time, against 50 digits, Pade and simulation."""

import math
from dataclasses import replace

import control
import numpy as np
import pytest
from coupled_loops import GRID, late, loop_of
from lanes import thinned

from workbench.errors import InputError
from workbench.mu import loop_margins
from workbench.mu.loops.late_pair import late_pair
from workbench.mu.margins.classical import classical_margins
from workbench.uncertainty import append, block, dead_time_approximation, feedback, real, tf
from workbench.uncertainty.algebra.system import uncertain

SEEDS = 64


@pytest.mark.cases(0)
@pytest.mark.parametrize("seed", thinned(range(SEEDS), 24))
def test_random_loops_in_50_digits(seed):
    loop = loop_of(seed)
    found = loop_margins(loop.plant, loop.controller)
    assert found.stable == loop.is_stable()
    for k in range(2):
        unit, real_ones = loop.crossings(k)
        for name in (f"input {k + 1}", f"output {k + 1}"):
            one = found.classical[name]
            np.testing.assert_allclose(one.phases_deg[:, 1] * loop.unit, unit, rtol=1e-11)
            values = loop.loop(k, 1j * np.array(unit))
            turns = np.angle(np.exp(1j * np.radians(one.phases_deg[:, 0])) / -values)
            assert np.abs(turns).max(initial=0.0) < 1e-9
            factors = [-1 / x for _, x in real_ones]
            below, above = [f for f in factors if f < 1], [f for f in factors if f > 1]
            assert one.gain[0] == pytest.approx(max(below, default=0.0), rel=1e-10)
            assert one.gain[1] == pytest.approx(min(above), rel=1e-10)
            assert {round(math.log(f), 9) for f in one.gains[:, 0]} <= {
                round(math.log(f), 9) for f in factors
            }
            if found.stable:
                nearest = np.abs(1 + loop.loop(k, 1j * GRID)).min()
                assert nearest * (1 - 3e-4) <= one.modulus <= nearest * (1 + 1e-9)
    every = [one for one in found.classical.values() if not one.holds]
    assert not every, every[0].certificate.failures


def test_channels_of_their_own_have_the_margins_of_each():
    """Dead times of the other channel, and its poles, have no effect."""
    first, second = tf([5], [1, 1]) * late(0.3), tf([0.4, 1], [1, 0]) * late(0.1, "other")
    third = tf([4], [1, 3, 3, 1])
    found = loop_margins(append(first, second, third), 1.0).classical
    for k, alone in enumerate((first, second, third), start=1):
        one = classical_margins(alone)
        for name in (f"input {k}", f"output {k}"):
            np.testing.assert_allclose(found[name].phases_deg, one.phases_deg, rtol=1e-12)
            assert found[name].gain == pytest.approx(one.gain, rel=1e-12)
            assert found[name].modulus == pytest.approx(one.modulus, rel=1e-3)


@pytest.mark.cases(0)
@pytest.mark.parametrize("T", [0.2, 0.9])
def test_dead_time_in_an_inner_loop(T):
    """A Smith predictor with a wrong dead time, one channel: L = G C exp(-s T) / (1 + G C (1 - e)).

    ``e`` is exp(-0.5 s).
    """
    G, C = tf([2], [3, 1]), tf([3, 2], [1, 0])
    predictor = feedback(C, G * (1 - late(0.5, "model")))
    found = loop_margins(G * late(T), predictor)
    s = 1j * GRID
    GC = 2 / (3 * s + 1) * (3 * s + 2) / s
    L = GC * np.exp(-s * T) / (1 + GC * (1 - np.exp(-0.5 * s)))
    crossed = np.flatnonzero(np.diff(np.sign(np.abs(L) - 1)))
    one = found.classical["input"]
    np.testing.assert_allclose(one.phases_deg[:, 1], GRID[crossed], rtol=1e-3)
    padded = control.feedback(
        *(dead_time_approximation(x, order=10).nominal for x in (G * late(T), predictor))
    )
    assert found.stable is bool((padded.poles().real < 0).all())
    if found.stable:
        assert one.modulus == pytest.approx(np.abs(1 + L).min(), rel=3e-4)
        assert found.disks["input"].lower == pytest.approx(
            1 / np.abs(1 / (1 + L) - 0.5).max(), 1e-3
        )
    assert found.holds, found.certificate.failures


@pytest.mark.slow
def test_the_margins_are_those_of_a_pade_approximation_of_high_order():
    loop = loop_of(8)
    near = [dead_time_approximation(one, order=14).nominal for one in (loop.plant, loop.controller)]
    exact, other = loop_margins(loop.plant, loop.controller), loop_margins(*near)
    assert exact.stable and other.stable
    for name, one in exact.classical.items():
        assert one.gain[1] == pytest.approx(other.classical[name].gain[1], rel=1e-6)
        assert one.phase_deg == pytest.approx(other.classical[name].phase_deg, rel=1e-6)
    for name, disk in {**exact.disks, **exact.multiloop}.items():
        padded = {**other.disks, **other.multiloop}[name]
        assert disk.lower <= padded.upper * (1 + 1e-6) and padded.lower <= disk.upper * (1 + 1e-6)
        assert disk.lower >= disk.upper * (1 - 3e-3)
    assert exact.holds, exact.certificate.failures


@pytest.mark.cases(0)
@pytest.mark.parametrize("share", [0.97, 1.03])
def test_a_gain_below_the_margin_decays_in_time_and_one_above_it_grows(share):
    """x' = -x + B u(t - T), simulated by Heun's method; the margin of one input's gain."""
    plant = append(tf([1], [1, 1]) * late(0.4, "a"), tf([1], [1, 1]) * late(0.7, "b"))
    K = np.array([[1.5, 0.8], [-0.6, 1.2]])
    found = loop_margins(plant, K)
    gains = np.array([share * found.classical["input 1"].gain[1], 1.0])
    step, delays = 5e-3, np.array([80, 140])
    x = np.zeros((24_000, 2))
    x[:141] = 1.0
    for k in range(140, len(x) - 1):
        late_u = [
            [-(gains * (K @ x[k + ahead - delays[i]]))[i] for i in range(2)] for ahead in (0, 1)
        ]
        first = -x[k] + late_u[0]
        x[k + 1] = x[k] + step / 2 * (first - (x[k] + step * first) + late_u[1])
    half = len(x) // 2
    assert bool(np.abs(x[half:]).max() < np.abs(x[1000:half]).max()) is (share < 1)
    assert found.holds, found.certificate.failures


def test_an_unstable_loop_of_two_channels_is_said_first_and_has_no_disks():
    loop = append(tf([5], [1, 1]) * late(0.3), tf([5], [1, 1]) * late(0.4, "b"))
    found = loop_margins(loop, 1.0)
    assert found.stable is False and "UNSTABLE" in repr(found)
    assert {one.modulus for one in found.classical.values()} == {0.0}
    with pytest.raises(InputError, match="unstable at the nominal with its dead time tau, b"):
        _ = found.disks
    assert found.holds, found.certificate.failures


@pytest.mark.parametrize(
    ("plant", "words"),
    [
        (append(tf([2, 1], [1, 1]) * late(0.3), tf([1], [1, 1])), "add up to 2 at infinite"),
        (append(1.0 * late(0.3), tf([1], [1, 1])), "add up to 1 at infinite"),
        (tf([1], [1, 1]) * late(1.0) + 1.0, "crosses the unit circle again and again"),
        (append(-1.0, tf([1], [1, 1]) * late(0.3)), "not well posed"),
        (
            append(*(tf([1], [1, 1]) * late(0.1, f"t{k}") for k in range(9))),
            "9 channels with dead time",
        ),
    ],
)
def test_what_has_no_exact_margins_is_refused_by_name(plant, words):
    with pytest.raises(InputError, match=words):
        loop_margins(plant, 1.0)


@pytest.mark.cases(0)
def test_a_direct_gain_below_1_is_borne():
    """L = 0.5 exp(-s) in one channel: it is 0.5 from -1 and may grow twofold."""
    plant = block([[0.5 * late(1.0), 0.0], [tf([1], [1, 1]), tf([1], [1, 1]) * late(0.5, "b")]])
    found = loop_margins(plant, 1.0)
    one = found.classical["input 1"]
    assert found.stable and one.gain[1] == pytest.approx(2.0, rel=1e-9)
    assert one.modulus == pytest.approx(0.5, rel=1e-3)
    assert found.disks["input 1"].lower == pytest.approx(2 / 3, rel=1e-3)
    with pytest.raises(InputError, match="does not fall to 0 at infinite"):
        _ = found.multiloop
    assert found.holds, found.certificate.failures


def test_rounding_decides_on_no_stability():
    """An undamped pole that its own loop does not reach."""
    plant = append(tf([1], [1, 0, 1]) * late(2 * math.pi), tf([1], [1, 1]) * late(0.1, "b"))
    assert loop_margins(plant, np.diag([0.0, 1.0])).stable is False
    assert late_pair(uncertain(plant), uncertain(np.diag([1e-18, 1.0]))).stable is False


@pytest.mark.cases(0)
def test_every_plant_of_a_set_of_two_channels():
    k = real("k", 1.0, percent=10)
    plant = append(tf([k], [1, 1]) * late(0.3), tf([2], [1, 2]) * late(0.2, "b"))
    K = np.array([[1.0, 0.3], [0.0, 1.0]])
    found, ends = loop_margins(plant, K, tolerance=0.02), []
    for value in (0.9, 1.1):
        fixed = append(tf([value], [1, 1]) * late(0.3), tf([2], [1, 2]) * late(0.2, "b"))
        ends.append(loop_margins(fixed, K))
    assert found.stable
    disk, truth = found.disks["input 1"], min(one.disks["input 1"].lower for one in ends)
    assert 0.8 * truth < disk.lower <= truth * (1 + 1e-3)
    assert found.nominal_disks["input 1"].lower > disk.lower


@pytest.mark.cases(0)
@pytest.mark.parametrize("gain", [1e-2, 1e-4])
def test_disks_of_a_weak_loop_are_near_the_largest(gain):
    """Where L is 0 a disk is 2; factors of both channels then break the loop at once, nearly."""
    plant = append(tf([1], [1, 1]) * late(0.3), tf([1], [1, 2]) * late(0.5, "b"))
    disk = loop_margins(plant, gain * np.array([[1.0, 0.5], [0.2, 1.0]])).multiloop["inputs"]
    assert 2.0 * (1 - gain) <= disk.lower <= disk.upper <= 2.0
    assert disk.holds, disk.certificate.failures


@pytest.fixture(scope="module")
def pair():
    plant = append(tf([1], [1, 1]) * late(0.3), tf([2], [1, 2]) * late(0.5, "b"))
    return loop_margins(plant, np.array([[1.0, 0.5], [-0.3, 1.0]]))


@pytest.mark.parametrize("field", ["gains", "phases_deg", "delays", "modulus", "stable"])
def test_a_claim_that_is_too_good_fails(pair, field):
    found = pair.classical["input 2"]
    value = getattr(found, field)
    wrong = (not value) if field == "stable" else value * 1.001
    claimed = replace(found, **{field: wrong}).with_checker(found._checked_by[0])
    assert not claimed.holds


def test_a_crossing_that_is_left_out_is_missed(pair):
    found = pair.classical["input 2"]
    claimed = replace(found, phases_deg=found.phases_deg[:0], delays=found.delays[:0])
    assert not claimed.with_checker(found._checked_by[0]).holds


def test_a_nearest_gain_that_is_left_out_is_found_by_encirclements(pair):
    found = pair.classical["input 2"]
    claimed = replace(found, gains=found.gains[1:]).with_checker(found._checked_by[0])
    assert "encirclements" in " ".join(claimed.certificate.failures)


@pytest.mark.cases(1)
@pytest.mark.parametrize("name", ["input 1", "inputs", "all"])
@pytest.mark.parametrize("field", ["lower", "upper"])
def test_a_disk_that_is_too_good_fails(pair, name, field):
    disk = {**pair.disks, **pair.multiloop}[name]
    factor = 1.01 if field == "lower" else 0.99
    wrong = replace(disk, **{field: factor * getattr(disk, field)})
    assert not wrong.with_checker(disk._checked_by[0]).holds


@pytest.mark.parametrize("name", ["input 2", "inputs", "all"])
def test_the_worst_factors_put_a_pole_on_the_axis(pair, name):
    disk = {**pair.disks, **pair.multiloop}[name]
    s = 1j * disk.omega
    f = {n: complex(disk.worst[n](s)) if n in disk.worst else 1.0 for n in pair.classical}
    g = np.diag([np.exp(-0.3 * s) / (s + 1), 2 * np.exp(-0.5 * s) / (s + 2)])
    K = np.array([[1.0, 0.5], [-0.3, 1.0]])
    loop = np.diag([f["output 1"], f["output 2"]]) @ g @ np.diag([f["input 1"], f["input 2"]]) @ K
    assert abs(np.linalg.det(np.eye(2) + loop)) < 1e-6


def test_the_figure_has_every_channel(pair):
    (figure,) = pair._checked_by[0].figures(pair).values()
    assert {"input 1", "output 2"} <= {
        line.get_label() for axes in figure.axes for line in axes.lines
    }
