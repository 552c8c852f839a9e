"""What demands on a controller cost: weaker demands never cost more."""

from pathlib import Path

import numpy as np
import pytest
from workbench.plants.textbook.first_order import unstable_first_order

import workbench as wb
from workbench.bench.formats import netcdf
from workbench.certificate import deep_checks
from workbench.errors import InputError
from workbench.solution import solve
from workbench.synthesis import DemandCost

STORED = Path(__file__).parents[2] / "results" / "reference"


@pytest.mark.slow
def test_weaker_demands_cost_no_more():
    study = DemandCost(unstable_first_order(), orders=(1, 2), fastest_pole=20.0)
    found = solve(study)
    assert found.certificate.holds
    peak = found.answer["peak"].sel(bound="upper").values  # (demand, order)
    assert np.isfinite(peak).all()
    assert (np.diff(peak, axis=1) <= 0).all()  # more states
    assert (np.diff(peak, axis=0) >= 0).all()  # more is asked
    free = float(found.answer["free"].sel(bound="upper"))
    assert free <= peak.min() * 1.01
    assert peak.max() < 0.75
    assert found.plot().axes[0].get_ylabel().startswith("certified peak")
    # A stored controller that is another one is found out.
    wrong = found.answer.copy(deep=True)
    wrong["controllers"].values[0, 0, 0, 0] *= 3
    assert not study.certify(wrong, 1e-6).valid


@pytest.mark.slow
def test_a_deep_opinion_tries_every_loop_and_refutes_a_peak_that_is_too_small():
    study = wb.load("unstable-first-order/demands")
    (file,) = STORED.glob("unstable-first-order/demands/*/data.nc")
    answer = netcdf.read(file)
    kept = deep_checks(study, answer)
    assert len(kept) == 4 * int(np.isfinite(answer["peak"].sel(bound="upper")).sum())
    assert all(check.holds for check in kept), [check.line for check in kept]
    small = answer.assign(peak=0.9 * answer["peak"])
    assert any("sampled plants" in one.name for one in deep_checks(study, small) if not one.holds)


@pytest.mark.parametrize(
    ("asked", "words"),
    [
        ({"orders": ()}, "orders is empty"),
        ({"orders": 3}, "orders must be a list"),
        ({"orders": (1, -2)}, "order is -2"),
        ({"fastest_pole": 0.0}, "fastest_pole is 0.0"),
        ({"plant": None}, "plant must be a GeneralisedPlant"),
    ],
)
def test_bad_input(asked, words):
    with pytest.raises(InputError, match=words):
        DemandCost(**({"plant": unstable_first_order()} | asked))
