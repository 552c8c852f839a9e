"""Kinds of defects, runs over many of them, shocks, and events in the diodes' plane."""

import numpy as np
import pytest
from workbench.plants.cd_drive.diagnosis.defect_events import APART, LATE, defect_events, features
from workbench.plants.cd_drive.diagnosis.defect_kinds import (
    BEAM,
    KINDS,
    SHOCK_DURATION,
    draw,
    shocks,
)
from workbench.plants.cd_drive.diagnosis.defect_runs import SPACING, run
from workbench.plants.cd_drive.diagnosis.quality import diode_quality
from workbench.plants.cd_drive.drive.disc import VELOCITY, Defect
from workbench.plants.cd_drive.drive.red_book import ACCEPTABLE_ERROR
from workbench.plants.cd_drive.laboratory.bench_setup import RATE
from workbench.plants.cd_drive.laboratory.experiment import STILL, Laboratory, measurements

from workbench.diagnosis import matched_events
from workbench.errors import InputError
from workbench.simulation import play


@pytest.fixture(scope="module", params=["focus", "radial"])
def dirty(request):
    """A run over two defects of each kind, and their kinds."""
    rng = np.random.default_rng(1)
    kinds = list(KINDS) * 2
    return run(Laboratory(request.param), [draw(k, rng, request.param) for k in kinds], 3), kinds


@pytest.mark.parametrize("kind", KINDS)
def test_kinds_keep_to_their_ranges(kind):
    rng = np.random.default_rng(0)
    drawn = [draw(kind, rng, "focus") for _ in range(200)]
    length = np.array([d.length for d in drawn])
    swing = np.array([abs(d.displacement) for d in drawn]) / ACCEPTABLE_ERROR["focus"]
    low, high, most = {
        "scratch": (0.2e-3 + BEAM, 0.5e-3 + BEAM, 0.6),
        "finger print": (4e-3, 10e-3, 0.2),
        "black dot": (0.45e-3 + BEAM, 0.65e-3 + BEAM, 0.0),
        "dropout": (0.15e-3, 0.5e-3, 0.0),
    }[kind]
    assert low <= length.min() < length.max() <= high
    assert swing.max() <= most
    assert all(d.depth < 1.0 for d in drawn)


def test_a_kind_that_is_none():
    with pytest.raises(InputError, match="known: scratch"):
        draw("chewing gum", np.random.default_rng(0), "focus")


def test_a_run_says_where_its_defects_are(dirty):
    one, kinds = dirty
    assert len(one.faults) == len(kinds)
    assert not one.record.events
    dim = one.record.light < 1.0 - 1e-9
    told = np.zeros_like(dim)
    for start, end in one.faults:
        told[start:end] = True
        assert dim[start + 2 : end - 3].all()
    assert not (dim & ~told).any()
    starts = np.diff([start for start, _ in one.faults]) / RATE
    assert starts == pytest.approx(np.full(len(kinds) - 1, SPACING), abs=1.5 / RATE)


def test_the_diodes_are_one_on_a_clean_disc(dirty):
    one, _ = dirty
    assert np.median(one.diodes.sum(axis=1)) == pytest.approx(1.0, abs=1e-12)


@pytest.mark.cases(1)
def test_every_defect_is_an_event(dirty):
    one, kinds = dirty
    dist = play(diode_quality(one.level, 0.18, 0.5), measurements(one.record))[:, 1]
    seen = defect_events(dist, 0.18)
    assert matched_events(seen, one.faults, tail=LATE) == list(range(len(kinds)))
    for (start, end), (a, b) in zip(one.faults, seen, strict=True):
        assert start <= a < b <= end + LATE
        log_duration, largest, fullness, _ = features(one, dist, (a, b))
        assert 10**log_duration == pytest.approx((b - a) / RATE)
        assert largest == dist[a:b].max()
        assert 0.0 < fullness <= 1.0


def test_events_close_to_each_other_are_one():
    dist = np.zeros(200)
    dist[[20, 30, 20 + 3 * APART]] = 1.0
    assert defect_events(dist, 0.2) == [(20, 31), (20 + 3 * APART, 21 + 3 * APART)]
    assert defect_events(np.zeros(5), 0.2) == []
    assert matched_events([(40, 51)], [(0, 5), (48, 49), (60, 70)], tail=LATE) == [-1, 0, -1]


@pytest.mark.parametrize("axis", ["focus", "radial"])
def test_a_shock_accelerates_the_free_lens(axis):
    """Played in open loop, a shock moves the lens as the force (m1 + m2) a does by itself."""
    bench = Laboratory(axis, noise=0.0, bits=None, delay=0.0, electronics=0.0)
    played = shocks(bench, [(0.0, 1e-3, SHOCK_DURATION)], round(5 * SHOCK_DURATION * RATE))
    x = bench.coil_gain * played
    moved = np.zeros(len(x))
    drive = bench.parameters
    # One mass, spring and damper in small steps: what the two are near the first resonance, where
    # the frame moves by `ratio` of the lens, and what the coil's voltage damps.
    ratio = drive.k2 / (drive.k1 + drive.k2)
    k, m = drive.k1 * ratio, drive.m1 + drive.m2 * ratio**2
    b = drive.b1 * ratio**2 + drive.b2 * (1 - ratio) ** 2 + drive.Bl**2 / float(bench.actuator.R)
    position = speed = 0.0
    steps = 20
    for i, time in enumerate(np.arange(len(x)) / RATE):
        moved[i] = position
        for j in range(steps):
            t = time + j / (steps * RATE)
            pulse = 1e-3 * np.sin(np.pi * t / SHOCK_DURATION) if t < SHOCK_DURATION else 0.0
            push = (drive.m1 + drive.m2 * ratio) * pulse
            speed += (push - b * speed - k * position) / m / (steps * RATE)
            position += speed / (steps * RATE)
    record = bench.open_loop(played, STILL)
    assert record.x == pytest.approx(moved, abs=0.03 * abs(moved).max())


def test_a_long_defect_lasts_as_long_as_it_is():
    one = run(Laboratory("focus"), [Defect(length=5e-3, depth=0.3)], 1)
    start, end = one.faults[0]
    assert (end - start) / RATE == pytest.approx(5e-3 / VELOCITY, abs=2 / RATE)
