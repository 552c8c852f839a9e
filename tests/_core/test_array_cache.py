"""Results are remembered while they fit, the last ones first."""

import numpy as np

from workbench._core.array_cache import array_cache


def counted(megabytes):
    calls = []

    @array_cache(megabytes)
    def zeros(count, axis="focus"):
        calls.append((count, axis))
        return np.zeros(count), np.zeros(count)

    return zeros, calls


def test_a_result_is_computed_once_for_each_of_its_arguments():
    zeros, calls = counted(1)
    assert zeros(3) is zeros(3)
    assert zeros(3, axis="radial") is not zeros(3)
    assert calls == [(3, "focus"), (3, "radial")]


def test_the_one_that_was_asked_for_longest_ago_makes_room():
    zeros, calls = counted(0.1)  # 12,500 numbers
    for count in (3000, 2000, 3000, 2500):  # 16 bytes for each of the count
        zeros(count)
    assert len(calls) == 3
    zeros(3000)
    assert len(calls) == 3
    zeros(2000)
    assert len(calls) == 4


def test_a_result_that_never_fits_is_not_remembered():
    zeros, calls = counted(0.1)
    zeros(100)
    assert zeros(10_000) is not zeros(10_000)
    zeros(100)
    assert calls == [(100, "focus"), (10_000, "focus"), (10_000, "focus")]
