"""Gain and phase margins over a set of plants, against the margins of its members."""

from dataclasses import replace

import control
import numpy as np
import pytest

from workbench.errors import InputError
from workbench.mu import loop_margins
from workbench.mu.margins.classical import classical_margins
from workbench.uncertainty import dynamics, real, ss, tf

PID = control.ss(control.tf([0.3823, 2.303, 3], [1e-3, 1, 0]))


def every_plant(plant, controller=1.0, **settings):
    return loop_margins(plant, controller, **settings).every_plant


def members(plant, controller, count=4):
    """The loops of a grid of plants, ends included."""
    names = list(plant.elements)
    axes = [np.linspace(plant.elements[n].low, plant.elements[n].high, count) for n in names]
    for values in np.stack(np.meshgrid(*axes), -1).reshape(-1, len(names)):
        yield plant.at(**dict(zip(names, values, strict=True))) * controller


def least(plant, controller):
    """Least margins of the grid: gain falling and rising, phase [deg], delay [s]."""
    found = [classical_margins(loop) for loop in members(plant, controller)]
    lows, highs = zip(*(one.gain for one in found), strict=True)
    return (
        max(lows),
        min(highs),
        min(one.phase_deg for one in found),
        min(one.delay for one in found),
    )


def agree(found, exact):
    low, high, phase, delay = exact
    assert found.gain[0] >= low * (1 - 1e-9)
    assert found.gain[1] <= high * (1 + 1e-9)
    assert found.phase_deg <= phase * (1 + 1e-9)
    assert found.gain[0] == pytest.approx(found.gain_lost[0], rel=0.012, abs=0.002)
    assert found.phase_deg == pytest.approx(found.phase_lost_deg, rel=0.012)
    assert found.phase_lost_deg <= phase * (1 + 1e-6)
    assert found.delay <= delay * (1 + 1e-9)
    assert found.delay == pytest.approx(found.delay_lost, rel=0.012)
    assert found.delay_lost <= delay * (1 + 1e-6)


@pytest.mark.slow
def test_two_parameters_and_a_resonance():
    k, d = real("k", 10, percent=30), real("d", 1.8, percent=40)
    plant = tf([18], [1, d, k]) * control.ss(control.tf([1], [0.05, 1]))
    found = every_plant(plant, PID)["input"]
    exact = least(plant, PID)
    agree(found, exact)
    assert found.gain[1] == pytest.approx(found.gain_lost[1], rel=0.012)
    assert found.gain[1] == pytest.approx(exact[1], rel=0.02)
    assert found.phase_deg == pytest.approx(exact[2], rel=0.02)
    # The plant that is lost first is at the border of its set.
    assert found.plants["rise"].keys() == {"k", "d"}
    at_border = plant.at(**found.plants["rise"]) * PID
    assert classical_margins(at_border).gain[1] == pytest.approx(found.gain_lost[1], rel=1e-4)


@pytest.mark.slow
def test_a_loop_that_is_lost_by_a_fall_of_its_gain():
    a = real("a", 1, percent=50)
    plant = ss([[a]], [[1]], [[1]], 0) * control.ss(control.tf([1], [0.1, 1]))
    found = every_plant(plant, 4.0)["loop"]
    agree(found, least(plant, 4.0))
    assert found.gain_lost[0] == pytest.approx(1.5 / 4, rel=1e-6)
    assert "for every plant" in repr(found)


@pytest.mark.cases(0)
def test_disk_margins_are_within():
    """A gain or a phase that a disk allows is allowed alone, too."""
    k = real("k", 10, percent=30)
    plant = tf([18], [1, 1.8, k])
    disk = loop_margins(plant, PID).disks["input"]
    found = every_plant(plant, PID)["input"]
    assert found.gain[0] <= disk.gain[0] + 0.012
    assert found.gain[1] >= disk.gain[1] * 0.98
    assert found.phase_deg >= disk.phase_deg * 0.98


@pytest.mark.slow
def test_with_dynamics_the_proven_side_holds():
    k = real("k", 10, percent=20)
    plant = tf([18], [1, 1.8, k]) * (1 + 0.2 * dynamics("d", 1, 1))
    alone = every_plant(tf([18], [1, 1.8, k]), PID)["input"]
    found = every_plant(plant, PID, parts=120)["input"]
    assert 0 < found.phase_deg < alone.phase_deg
    assert 1 < found.gain[1] <= alone.gain[1]


@pytest.mark.cases(0)
def test_two_channels_and_sampled_time():
    a = real("a", 0.9, plus_minus=0.05)
    plant = ss([[a, 0.1], [0, 0.8]], np.eye(2), np.eye(2), np.zeros((2, 2)), 0.1)
    found = every_plant(plant, 0.3 * np.eye(2))
    assert list(found) == ["input 1", "input 2", "output 1", "output 2"]
    # z = a - 0.3 g in the first channel.
    assert found["input 1"].gain_lost[1] == pytest.approx(1.85 / 0.3, rel=1e-5)
    assert found["input 1"].gain[1] == pytest.approx(1.85 / 0.3, rel=0.012)


def test_wrong_loops_are_refused():
    k = real("k", 10, percent=20)
    unstable = loop_margins(tf([18], [1, 1.8, k]), -5.0)
    assert unstable.stable is False
    for ask in (
        lambda: unstable.every_plant,
        lambda: unstable.phase_deg,
        lambda: unstable.least_disk,
    ):
        with pytest.raises(InputError, match="unstable at the nominal"):
            ask()
    with pytest.raises(InputError, match="parts is 0"):
        loop_margins(tf([18], [1, 1.8, k]), PID, parts=0)
    with pytest.raises(InputError, match="time_limit is -1"):
        loop_margins(tf([18], [1, 1.8, k]), PID, time_limit=-1)


def test_a_certain_plant_has_no_margins_of_a_set():
    assert every_plant(control.tf([1], [1, 1])) == {}


@pytest.mark.cases(0)
def test_a_set_without_parameters_has_margins_of_every_plant():
    """Of 4 (1 + 0.2 delta) / (s + 1)^3: some is lost once |1 + 1 / (t L)| is 0.2 somewhere."""
    plant = control.tf([4], [1, 3, 3, 1]) * (1 + 0.2 * dynamics("d", 1, 1))
    found = every_plant(plant, parts=60)["loop"]
    inverse = (1 + 1j * np.linspace(0.5, 3, 20_001)) ** 3 / 4
    room = np.array([np.abs(1 + inverse / t).min() for t in np.linspace(1, 2, 1001)])
    assert found.gain[1] == pytest.approx(1 + (room > 0.2).sum() / 1000, rel=0.02)
    late = [np.abs(1 + inverse * np.exp(1j * a)).min() for a in np.linspace(0, 0.4, 1001)]
    assert found.phase_deg == pytest.approx(np.degrees(0.4 * np.mean(np.array(late) > 0.2)), 0.05)
    assert found.gain_lost[1] == pytest.approx(2.0)  # of the nominal


@pytest.mark.cases(0)
def test_what_is_known_when_time_ends_is_kept():
    """Bounds hold however early the search ends, and are checked as others are."""
    plant = tf([18], [1, 1.8, real("k", 10, percent=30)])
    narrow, early = (every_plant(plant, PID, time_limit=t)["input"] for t in (None, 0.2))
    for kind in ("delay", "phase_deg"):
        assert 0 <= getattr(early, kind) <= getattr(narrow, kind) * 1.02
    assert early.delay <= early.delay_lost and early.gain[1] <= early.gain_lost[1]
    assert early.holds, early.certificate.failures


@pytest.fixture(scope="module")
def lost_every_way():
    """The margins of an unstable plant with two lags: some plant is lost in every way."""
    a = real("a", 1, percent=50)
    lags = control.ss(control.tf([1], [0.1, 1])) * control.ss(control.tf([1], [0.05, 1]))
    return every_plant(ss([[a]], [[1]], [[1]], 0) * lags, 4.0, tolerance=0.1)["loop"]


BETTER = {
    "largest gain": lambda one: {"gain": (one.gain[0], 1.01 * one.gain_lost[1])},
    "least gain": lambda one: {"gain": (0.99 * one.gain_lost[0], one.gain[1])},
    "phase": lambda one: {"phase_deg": 1.01 * one.phase_lost_deg},
    "delay": lambda one: {"delay": 1.01 * one.delay_lost},
}


@pytest.mark.cases(1)
@pytest.mark.parametrize("kind", BETTER)
def test_a_margin_of_a_set_that_is_too_good_fails(lost_every_way, kind):
    """No search proves it again."""
    found = lost_every_way
    wrong = replace(found, **BETTER[kind](found))
    checks = found._checked_by[0].checks(wrong, 1e-6)
    assert [check.name for check in checks if not check.holds] == [kind]


@pytest.mark.cases(1)
@pytest.mark.parametrize("kind", ["rise", "fall", "phase", "delay"])
def test_a_plant_that_keeps_more_than_is_said_to_be_lost_is_found(lost_every_way, kind):
    """The margins of each named plant are its own crossings, which a smaller claim contradicts."""
    found = lost_every_way
    assert found.holds and kind in found.plants, found.plants
    low, high = found.gain_lost
    spoilt = {
        "rise": {"gain_lost": (low, 0.99 * high)},
        "fall": {"gain_lost": (1.01 * low, high)},
        "phase": {"phase_lost_deg": 0.99 * found.phase_lost_deg},
        "delay": {"delay_lost": 0.99 * found.delay_lost},
    }[kind]
    opinion = found._checked_by[0].second_opinion(replace(found, **spoilt))
    assert [check.name for check in opinion if not check.holds] == [f"lost: {kind}"]
