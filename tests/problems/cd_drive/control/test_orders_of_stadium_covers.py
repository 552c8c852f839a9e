"""The front of an axis: its checks can fail, and a rule chooses the cover."""

from types import SimpleNamespace

import numpy as np
import pytest
from workbench.plants.cd_drive.control.cover_front import ORDERS, RATIOS, CoverFrontOfAxis, needs

import workbench as wb


@pytest.fixture(scope="module")
def solved(covered):
    """One cover in place of all, with sizes that fall as if the order helped up to 18 states."""
    cover, answer = covered("focus", "stadium", "steps")
    data = cover.to_dataset(answer)
    runs = [
        SimpleNamespace(
            data=data, task=cover, metrics=dict.fromkeys(RATIOS, max(18, sum(o)) / sum(o))
        )
        for o in ORDERS
    ]
    study = CoverFrontOfAxis("focus", runs)
    return study, wb.solve(study)


def test_the_fewest_states_near_the_best_are_chosen(solved):
    study, solution = solved
    numbers = study.metrics(solution.answer)
    assert solution.certificate.valid
    assert numbers["chosen_states"] == 18
    assert numbers["chosen_for_mu_states"] == min(map(sum, ORDERS))  # all have the same model


def test_wrong_peaks_are_rejected(solved):
    study, answer = solved[0], solved[1].answer
    wrong = answer.assign(peak=answer["peak"] * [1.5, 1.0])
    failed = {check.name for check in study.certify(wrong, 1e-6).checks if not check.holds}
    assert failed == {"peaks"}


def test_an_unstable_nominal_loop_has_an_infinite_peak_and_is_not_chosen(solved):
    study, answer = solved[0], solved[1].answer
    peak = answer["peak"].copy()
    peak[0] = np.inf
    unstable = answer.assign(peak=peak)
    assert study.certify(unstable, 1e-6).valid
    assert study.metrics(unstable)["chosen_for_mu_states"] > min(map(sum, ORDERS))
    peak[0] = np.nan
    assert not study.certify(answer.assign(peak=peak), 1e-6).valid


def test_its_table_and_figure_show_every_cover(solved):
    study, solution = solved
    assert all(", ".join(map(str, o)) in study.tables(solution.answer)["costs"] for o in ORDERS)
    assert len(study.figures(solution.answer)["front"].axes) == 2


def test_its_needs_are_covers_of_all_orders():
    covers = needs("focus", frequencies=50)["covers"]
    asked = [ref.parameters for ref in covers]
    assert [(p["order"], p["complex_order"], p["real_order"]) for p in asked] == list(ORDERS)
    assert all(p["zeros"] <= p["order"] for p in asked)
