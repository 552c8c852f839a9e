"""Every case of a spoilt record ends in a finding that says what is wrong."""

from dataclasses import replace

import numpy as np
import pytest
from spoilt_records import FORBIDDING, SPOILT, good_record

from workbench.identification.record_tests.report import reported

SEED = 4712


def findings(spoil, draw):
    return reported(spoil(np.random.default_rng([SEED, draw]))).findings


@pytest.mark.parametrize("spoil", SPOILT, ids=lambda spoil: spoil.__name__)
def test_what_is_wrong_is_found(spoil):
    assert SPOILT[spoil] in {f.kind for f in findings(spoil, 0)}


@pytest.mark.slow
@pytest.mark.parametrize("spoil", SPOILT, ids=lambda spoil: spoil.__name__)
def test_what_is_wrong_is_found_in_nearly_every_draw(spoil):
    found = [SPOILT[spoil] in {f.kind for f in findings(spoil, draw)} for draw in range(60)]
    assert np.mean(found) >= 0.9


@pytest.mark.parametrize("spoil", SPOILT, ids=lambda spoil: spoil.__name__)
def test_a_record_is_refused_only_where_the_way_out_is_in_the_users_hand(spoil):
    strong = {"clipped"}  # where more than a twentieth is
    forbidding = {f.kind for f in findings(spoil, 0) if f.forbids} - strong
    assert bool(forbidding) == (spoil in FORBIDDING)


@pytest.mark.parametrize("spoil", SPOILT, ids=lambda spoil: spoil.__name__)
@pytest.mark.parametrize("unit", [1e-12, 1e12])
def test_findings_do_not_depend_on_units(spoil, unit):
    record = spoil(np.random.default_rng([SEED, 0]))
    if SPOILT[spoil] == "flags":
        pytest.skip("a customary value in another unit is none")
    scaled = replace(record, u=record.u * unit, y=record.y / unit)
    kinds = [sorted(f.kind for f in reported(each).findings) for each in (record, scaled)]
    assert kinds[0] == kinds[1]


@pytest.mark.cases(0)
def test_messages_name_channel_strength_and_remedy():
    for spoil, kind in SPOILT.items():
        found = next(f for f in findings(spoil, 0) if f.kind == kind)
        assert "'" in found.where or "all channels" in found.where
        assert np.isfinite(found.strength) and found.measure and found.remedy
        assert str(found).startswith(kind)


def test_flags_do_not_hide_the_rest():
    record = good_record(np.random.default_rng(3), wait=150)
    y = record.y.copy()
    y[[700, 1400, 2100]] = -9999.0
    kinds = {f.kind for f in reported(replace(record, y=y)).findings}
    assert kinds == {"flags", "delay"}


def test_several_experiments_and_missing_outputs_are_taken():
    record = good_record(np.random.default_rng(5), n=6000)
    y = record.y.copy()
    y[np.random.default_rng(6).random(len(y)) < 0.01] = np.nan
    several = replace(record, y=y, starts=(0, 50, 2500, 2502, 4000))
    report = reported(several)
    assert report.usable and not report.findings


@pytest.mark.parametrize("samples", [1, 2, 3, 7, 20, 60])
def test_short_records_are_taken(samples):
    record = good_record(np.random.default_rng(7), n=400)
    short = replace(record, u=record.u[:samples], y=record.y[:samples])
    assert reported(short).usable


@pytest.mark.parametrize("name", ["u", "y"])
def test_channels_that_never_move_are_taken(name):
    record = good_record(np.random.default_rng(8), n=500)
    assert reported(replace(record, **{name: np.full((500, 1), 3.0)})).usable
