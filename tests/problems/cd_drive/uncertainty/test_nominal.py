"""Table 5.2 against Tables A.1-A.3."""

import numpy as np
import pytest
from workbench.plants.cd_drive.drive import nominal_table as nominal
from workbench.plants.cd_drive.drive import tables


@pytest.mark.parametrize(
    ("axis", "values", "expected"),
    [
        ("focus", "printed", {"K_total", "b2"}),
        ("focus", "corrected", {"K_total", "b2"}),
        ("radial", "printed", {"K_total", "k1", "m1"}),
        ("radial", "corrected", {"K_total", "m1"}),
    ],
)
def test_table_5_2_entries_that_do_not_follow(axis, values, expected):
    rows = nominal.compare_nominal(axis, values)
    assert len(rows) == 9
    assert {row.parameter for row in rows if not row.follows} == expected
    assert all(row.note for row in rows if not row.follows)


def test_table_5_2_entries_to_the_last_digit():
    exact = {row.parameter for row in nominal.compare_nominal("focus") if not row.note}
    assert exact == {"R", "k2", "m1"}


def test_computed_nominal_values():
    focus, radial = nominal.nominal("focus"), nominal.nominal("radial")
    assert list(focus) == list(tables.nominal_table("focus"))
    assert focus["R"].nominal == pytest.approx(17.5)
    assert focus["R"].tolerance == pytest.approx(1.2 / 17.5)
    assert radial["k1"].nominal == pytest.approx(57.8)
    assert nominal.nominal("radial", "corrected")["k1"].nominal == pytest.approx(60.25)
    # K_at K_amp K_optn falls short of the printed DC_gain.
    assert focus["K_total"].nominal / 76000 == pytest.approx(0.735, abs=1e-3)
    assert radial["K_total"].nominal / 300000 == pytest.approx(0.664, abs=1e-3)


def test_lost_digits_of_table_5_2():
    """The reasons given hold: 0.5 % for radial m1 follows, 5 % of b gives focus b2."""
    computed = nominal.nominal("radial")["m1"]
    assert nominal._rounds_to(computed, 1e-6, tables.Uncertain(0.535e-3, 0.005), 1e-6, 0.001)
    b = np.array([drive.b for drive in tables.drives("focus")])
    assert 0.05 * (b.max() + b.min()) / 2 == pytest.approx(0.38e-3)
    assert (b.max() - b.min()) / (b.max() + b.min()) == pytest.approx(0.092, abs=2e-4)
