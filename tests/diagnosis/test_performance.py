"""False alarms, missed faults, delays and ROC curves, against counts by hand and SciPy."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats

from workbench.diagnosis import detection, intervals, roc
from workbench.errors import InputError

scores = st.lists(st.integers(-5, 5), min_size=1, max_size=30)


def test_an_alarm_by_hand():
    alarm = np.zeros(100)
    alarm[[10, 11, 40, 41, 42, 63, 90]] = 1.0
    found = detection(alarm, [(38, 45), (60, 62), (80, 85)], dt=0.1, tail=2)
    assert found.delays == pytest.approx([0.2, 0.3, np.nan], nan_ok=True)
    assert found.missed == pytest.approx(1 / 3)
    assert found.false_alarms == 2  # at 10 and at 90
    assert found.fault_free == pytest.approx((100 - 9 - 4 - 7) * 0.1)
    assert found.false_alarm_share == pytest.approx(3 / 80)
    assert found.false_alarm_rate == pytest.approx(2 / 8.0)


def test_an_alarm_that_began_before_its_fault_is_not_false():
    found = detection([0, 1, 1, 1, 0], [(2, 4)], 1.0)
    assert found.delays.tolist() == [0.0]
    assert found.false_alarms == 0
    assert found.false_alarm_share == pytest.approx(1 / 3)


@pytest.mark.parametrize(
    "faults", [[(3, 3)], [(2, 20)], [(-1, 2)], [(4, 6), (1, 2)], [(1, 3), (4, 6)]]
)
def test_faults_that_cannot_be(faults):
    with pytest.raises(InputError, match="ordered, within it"):
        detection(np.zeros(10), faults, 1.0, tail=2)


def test_empty_records():
    with pytest.raises(InputError, match="alarm has shape"):
        detection([], [], 1.0)
    with pytest.raises(InputError, match="faulty"):
        roc([1.0], [])
    with pytest.raises(InputError, match=r"clean is not finite, first at sample 1 of 2"):
        roc([1.0, np.nan], [1.0])


def test_no_fault_and_nothing_but_fault():
    assert np.isnan(detection(np.zeros(5), [], 1.0).missed)
    assert np.isnan(detection(np.ones(5), [(0, 5)], 1.0).false_alarm_rate)


@given(st.lists(st.booleans(), min_size=1, max_size=40))
def test_intervals_put_together_again(flags):
    again = np.zeros(len(flags), bool)
    for start, end in intervals(flags):
        again[start:end] = True
    assert again.tolist() == flags


@settings(max_examples=100)
@given(scores, scores)
def test_the_curve_rises_and_its_area_is_mann_whitneys(clean, faulty):
    curve = roc(clean, faulty)
    assert (np.diff(curve.false_alarm) >= 0).all()
    assert (np.diff(curve.detection) >= 0).all()
    assert curve.false_alarm[0] == curve.detection[0] == 0.0
    assert curve.false_alarm[-1] == curve.detection[-1] == 1.0
    u = stats.mannwhitneyu(faulty, clean).statistic
    assert curve.area == pytest.approx(u / (len(clean) * len(faulty)))
    for level, false, hit in zip(curve.levels, curve.false_alarm, curve.detection, strict=True):
        assert false == pytest.approx(np.mean(np.array(clean) >= level))
        assert hit == pytest.approx(np.mean(np.array(faulty) >= level))


def test_the_deviation_of_the_area():
    rng = np.random.default_rng(1)
    found = [roc(rng.exponential(size=60), 2 * rng.exponential(size=40)) for _ in range(400)]
    areas = np.array([one.area for one in found])
    assert areas.mean() == pytest.approx(2 / 3, abs=0.01)
    assert np.mean([one.deviation for one in found]) == pytest.approx(areas.std(), rel=0.15)
