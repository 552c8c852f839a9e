"""Circumstances drawn at random: what they hold to, and what they refuse."""

from dataclasses import replace

import numpy as np
import pytest
from workbench.plants.cd_drive.diagnosis.defect_kinds import SHOCK_PEAK
from workbench.plants.cd_drive.drive.disc import Defect, Disc
from workbench.plants.cd_drive.drive.tables import red_book
from workbench.plants.cd_drive.laboratory.bench_setup import RATE
from workbench.plants.cd_drive.tolerance.ensemble import (
    BEGIN,
    GROUPS,
    Remembered,
    Spread,
    circumstances,
)

from workbench.errors import InputError


def drawn(count=70, seed=3, spread=None, axis="focus"):
    return circumstances(axis, count, 1.0, np.random.default_rng(seed), spread)


def test_every_group_comes_as_often_with_its_cause_alone():
    many = drawn()
    for one in many:
        defective = one.group in GROUPS[2:]
        assert bool(one.defects) == defective
        assert defective or one.group == "shocks" or not one.shocks
    assert [sum(one.group == group for one in many) for group in GROUPS] == [10] * len(GROUPS)


def test_the_same_seed_draws_the_same():
    assert drawn() == drawn()
    assert drawn() != drawn(seed=4)
    assert drawn()[:7] == drawn(count=7)  # more of them do not change the first


def test_the_noise_is_independent_between_drives_and_repeatable():
    many, drives = drawn(), [f"CD{n}" for n in range(1, 13)]
    seeds = [one.noise_seed(name) for one in many for name in drives]
    assert len(set(seeds)) == len(seeds)
    assert seeds == [one.noise_seed(name) for one in drawn() for name in drives]


@pytest.mark.parametrize("axis", ["focus", "radial"])
def test_what_is_drawn_lies_within_its_ranges(axis):
    spread = Spread()
    for one in drawn(axis=axis):
        wobble = one.disc.warp if axis == "focus" else one.disc.eccentricity
        share = wobble[0] / red_book(axis).deviation
        assert spread.deviation[0] <= share <= spread.deviation[1]
        assert spread.rotation[0] <= one.disc.rotation <= spread.rotation[1]
        for start, peak, lasts in one.shocks:
            assert BEGIN <= start <= 1.0
            assert abs(peak) <= spread.shock[1] * SHOCK_PEAK[axis]
            assert spread.shock_time[0] <= lasts <= spread.shock_time[1]


def test_no_spread_means_one_and_the_same():
    spread = replace(Spread(), rotation=(5.0, 5.0), gain_db=0.0, rotation_error=0.0)
    assert {(one.disc.rotation, one.believed, one.gain_db) for one in drawn(spread=spread)} == {
        (5.0, 5.0, 0.0)
    }


def test_a_remembered_disc_is_the_disc():
    plain = Disc(warp=(1e-4, 1e-6), rotation=6.0, phase=0.3, reflectivity=0.9)
    kept = Remembered(**vars(plain))
    time, defects = np.arange(20000) / RATE, [Defect(angle=0.4)]
    for _ in range(2):
        np.testing.assert_array_equal(kept.deviation("focus", time), plain.deviation("focus", time))
        for a, b in zip(kept.surface(defects, time), plain.surface(defects, time), strict=True):
            np.testing.assert_array_equal(a, b)
            with pytest.raises(ValueError, match="read-only"):
                a[:] = 0.0  # it is what the next strategy is given


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("gain_db", -1.0),
        ("shocks", -1.0),
        ("deviation", (-0.1, 1.0)),
        ("size", (1.5, 0.5)),
        ("rotation", (3.0, np.inf)),
        ("rotation", (0.0, 3.0)),
        ("defects", np.nan),
    ],
)
def test_spreads_that_make_no_sense_are_named(field, value):
    with pytest.raises(InputError, match=field):
        Spread(**{field: value})


def test_an_empty_ensemble_and_a_short_run_are_refused():
    with pytest.raises(InputError, match="ensemble of 0"):
        drawn(count=0)
    with pytest.raises(InputError, match=r"duration is 0\.2"):
        circumstances("focus", 7, 0.2, np.random.default_rng(0))
