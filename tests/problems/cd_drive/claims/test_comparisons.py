"""A number that compares two cases holds everything but one variable fixed."""

import re
from itertools import takewhile

import pytest
from workbench.plants.cd_drive.claims.chapters import items

ALTERNATIVES = [
    {"stadium", "circle"},
    {"stadium narrowest", "stadium for mu", "stadium of smallest area", "stadium third set"},
    {"A", "B", "C", "reference", "state_feedback"},
    {"slow", "fast"},
    {"4s", "half_s"},
    {"CD", "DVD", "BRD"},
    {"", "adapted", "wrong"},
    {"", "complex_scalars", "full_block"},
    {"", "control"},
    {"disturbance", "control"},
    {"", "mu", "G", "mu_D", "D_G", "third_order", "D_G_K"},
    {"controller_only", ""},
    {"driven", "standing", "free"},
    {"excursion", "periodic"},
    {"extrapolated", "default", "minimum_phase"},
    {"", "fitted"},
    {"full", "adjusted"},
    {"model", "change"},
    {"", "no_gain", "reduced"},
    {"norm", "bound"},
    {"ordinary_mean", "before"},
    {"peak_circle_D_K", "least_possible_circle"},
    {"drives_peak_agc", "deviation_peak_no_gain"},
    {"width", "radius"},
    {"inside", "red_book"},
    {"5_0", "1_25"},
    {"dim", "ordinary"},
]
"""Values of one variable each, as names of metrics spell them."""
AT_ITS_OWN_GAIN = re.compile(r"^([ABC]_less|best_gain)_")
"""Metrics of cd/*/best-gains in which each strategy has another gain."""


def compared():
    """Every comparison that decides, with the two names."""
    for _, item in items():
        for number in item.numbers:
            arguments = number.quantity.arguments or {}
            pair = [arguments.get(one) for one in ("above", "below")]
            if "more" in arguments:
                pair = [arguments["more"], arguments["less"]]
            if number.decides and all(pair):
                yield pytest.param(*pair, id=f"{item.place}: {number.what}")


def apart(one, other):
    """What two names do not share at their beginning and end."""
    one, other = one.split("_"), other.split("_")
    for _ in range(2):  # from the beginning, then from the end
        same = len(list(takewhile(lambda pair: pair[0] == pair[1], zip(one, other, strict=False))))
        one, other = one[same:][::-1], other[same:][::-1]
    return "_".join(one), "_".join(other)


@pytest.mark.parametrize(("above", "below"), list(compared()))
def test_one_variable_moves(above, below):
    assert any({*apart(above, below)} <= one for one in ALTERNATIVES), apart(above, below)


def test_what_two_names_do_not_share():
    assert apart("peak_stadium_own", "peak_circle_own") == ("stadium", "circle")
    assert apart("peak_stadium_agc", "peak_circle_own") == ("stadium_agc", "circle_own")


def test_strategies_are_compared_at_one_gain():
    """But where the item is about the best gain of each itself."""
    for _, item in items():
        if "more bandwidth" not in item.says:
            named = [number.quantity.name for number in item.numbers if number.decides]
            assert not any(AT_ITS_OWN_GAIN.match(name) for name in named), item.says
