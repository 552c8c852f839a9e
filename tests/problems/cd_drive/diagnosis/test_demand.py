"""How a demand on a fault filter is told: what was asked, what is reached."""

import numpy as np
import pytest
import xarray as xr
from workbench.plants.cd_drive.diagnosis.fault_filter.demand import (
    demand_check,
    demand_table,
    in_metrics,
    limits_of,
    plants_of,
    reached_of,
)

ASKED = 0.3, 0.5e-6


def answer(share=1.0, factor=1.0, off=1.0):
    """A stored answer with the arrays that a demand is read from."""
    error, leakage = (factor * one for one in ASKED)
    stored = {"set_share": share, "demand_factor": factor}
    stored |= {"allowed": off * error, "leakage_allowed": leakage}
    return xr.Dataset(stored)


@pytest.mark.parametrize(
    ("share", "factor", "told"),
    [
        (1.0, 1.0, "yes"),
        (1.0, 1.25, "no: limits 1.25 times as large"),
        (0.9, 1.0, "no: for 0.9 of the set, which is what the loop itself bears"),
        (0.9, 1.25, "no: limits 1.25 times as large, for 0.9 of the set"),
    ],
)
def test_the_table_says_whether_the_demand_is_met_and_by_how_much_not(share, factor, told):
    heads, rows = demand_table(answer(share, factor), *ASKED, ["sensitivity", "3", "3.75"])
    assert heads == ["demand", "asked", "reached"]
    assert rows[0][1:] == ["0.3", f"{0.3 * factor:.4g}"]
    assert rows[1][1:] == ["0.5", f"{0.5 * factor:.4g}"]
    assert rows[-1][2].startswith(told)


def test_metrics_have_what_was_asked_beside_what_is_reached():
    found = in_metrics(answer(0.9, 1.25), *ASKED)
    assert (found["error_asked"], found["leakage_asked"]) == ASKED
    assert found["error_allowed"] == pytest.approx(0.375)
    assert found["leakage_allowed"] == pytest.approx(0.625e-6)
    assert (found["demand_factor"], found["set_share"]) == (1.25, 0.9)


def test_stored_limits_are_the_factor_times_those_asked_up_to_rounding():
    limits = [1.25 * one for one in ASKED]
    for off, holds in ((1.0, True), (np.nextafter(1.0, 2.0), True), (0.999, False)):
        assert demand_check(answer(0.9, 1.25, off), limits).holds is holds


def test_checks_say_what_is_reached():
    asked, less = reached_of(answer()), reached_of(answer(0.9, 1.25))
    assert limits_of(asked) == "" and "of the set" not in plants_of(asked)
    assert limits_of(less) == ", limits 1.25 times those asked"
    assert plants_of(less).endswith("up to 0.9 of the set")
