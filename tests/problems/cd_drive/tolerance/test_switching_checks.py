"""The checks of cd/{axis}/switching-stability fail where the answer is wrong."""

import numpy as np
import pytest
from workbench.plants.cd_drive.tolerance.switching_stability import checks
from workbench.plants.cd_drive.tolerance.switching_stability.study import SwitchingStability

from workbench.systems.storage import restored_system


@pytest.fixture(scope="module")
def stored(slower, reference):
    run = reference("cd/focus/switching-stability")
    K_lower = restored_system(slower["focus"].data, "controller")
    return SwitchingStability("focus", K_lower, 2.5e-3, 1.0, 0.0, "own", False), run.data


def test_functions_that_rise(stored):
    study, answer = stored
    assert checks._functions(study, answer, "open").holds
    spoiled = answer.copy(deep=True)
    spoiled["P_open"][{"drive": 3, "mode": 1}] *= 2.0
    assert not checks._functions(study, spoiled, "open").holds
    spoiled = answer.copy(deep=True)
    spoiled["dwell"].loc[{"strategy": "open"}] -= 8
    assert not checks._functions(study, spoiled, "open").holds
    assert not checks._ordered(spoiled).holds


@pytest.mark.parametrize(
    ("name", "factor", "check"),
    [("simulated", 1.3, checks._bounded), ("laboratory", 1.6, checks._in_laboratory)],
)
def test_errors_beyond_their_bounds(stored, name, factor, check):
    _, answer = stored
    assert check(answer).holds
    assert not check(answer.assign({name: answer[name] * factor})).holds


@pytest.mark.cases(0)
def test_cells_that_are_missing_overlap_or_lie_outside(stored):
    study, answer = stored
    assert checks._cells(study, answer).holds
    assert checks._in_cells(study, answer).holds
    fewer = answer.isel(cell=slice(1, None))
    assert not checks._cells(study, fewer).holds
    assert checks._in_cells(study, fewer).value == np.inf
    for end in ("cell_low", "cell_high"):
        moved = answer.copy(deep=True)
        moved[end][{"cell": 0}] = moved[end][{"cell": 1}]
        assert not checks._cells(study, moved).holds
    wrong = answer.copy(deep=True)
    wrong["cell_P"][:, 0] *= 3.0
    wrong["cell_P"][:, 1] = np.eye(answer.sizes["state_box"])
    assert not checks._in_cells(study, wrong).holds


def test_loops_of_other_drives(stored):
    study, _ = stored
    assert checks._loops(study).holds
    other = SwitchingStability("focus", study.lower, 2.5e-3, 1.0, 0.0, "equal", False)
    other.__dict__["alone"] = study.alone
    assert not checks._loops(other).holds
