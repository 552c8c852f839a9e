"""An ageing suspension: what a start finds of it, and controllers for what is known."""

from dataclasses import replace

import control
import numpy as np
import pytest
from workbench.plants.cd_drive.control.ageing.problem import CONTROLLERS, SETS, SOFTENINGS
from workbench.plants.cd_drive.control.ageing.sets import (
    AGEING,
    aged_model,
    all_known,
    designed,
    life,
    narrowed,
    peak_of,
    plant_of,
)
from workbench.plants.cd_drive.control.ageing.start import StartUp, Suspension, suspension_of
from workbench.plants.cd_drive.drive.actuator import resonances
from workbench.plants.cd_drive.drive.plants import controller, nominal_parameters, plant, total_gain
from workbench.plants.cd_drive.drive.tables import nominal_table
from workbench.plants.cd_drive.drive.two_masses import lumped
from workbench.plants.cd_drive.laboratory.experiment import Laboratory

from workbench.errors import InputError, SolverError
from workbench.solvers import Options


def test_a_softer_suspension_resonates_lower():
    """By the square root of the factor, as the link to the lens is far stiffer."""
    new = Laboratory("focus", "CD3")
    old = replace(new, suspension=0.5)
    ratio = resonances(old.parameters).first / resonances(new.parameters).first
    assert ratio == pytest.approx(0.5**0.5, rel=0.05)
    assert old.parameters.m1 == new.parameters.m1 and old.parameters.k2 == new.parameters.k2
    assert old.coil_gain == new.coil_gain  # the bench does not age
    for wrong in (0.0, -1.0, np.inf):
        with pytest.raises(InputError, match="suspension"):
            _ = replace(new, suspension=wrong).parameters


@pytest.mark.parametrize("axis", ["focus", "radial"])
@pytest.mark.parametrize("softening", SOFTENINGS)
def test_lumped_values_give_the_suspension_back(axis, softening):
    own = Laboratory(axis, "nominal", suspension=softening).parameters
    values = lumped(own)
    found = suspension_of(axis, (values.k, 0.0), (values.b, 0.0))
    assert (found.k1, found.b1) == pytest.approx((own.k1, own.b1), rel=1e-9)
    wider = suspension_of(axis, (values.k, 0.05 * values.k), (values.b, 0.0))
    assert wider.k1_off > found.k1_off + 0.045  # the link's tolerance alone, and the interval


def test_ranges_of_a_life_and_what_a_start_leaves_of_them():
    whole = life("focus", 0.5)
    table = nominal_table("focus")
    low, high = whole["k1"]
    assert high == pytest.approx(table["k1"].nominal * (1 + table["k1"].tolerance))
    assert low == pytest.approx(0.5 * table["k1"].nominal * (1 - table["k1"].tolerance))
    found = Suspension(12.0, 0.004, 0.1, 0.2)
    left = narrowed(whole, found)
    assert left["k1"] == pytest.approx((10.8, 13.2))
    assert whole["b1"][0] <= left["b1"][0] < left["b1"][1] <= whole["b1"][1]
    with pytest.raises(SolverError, match="k1"):
        narrowed(whole, found._replace(k1=3.0))


def test_models_hold_their_members():
    """Where all is known it is the plant of Table 5.2 with that suspension."""
    omega = np.array([30.0, 200.0, 3000.0])
    model = aged_model("focus", life("focus", 0.5))
    names = [one.name for one in model.parameters]
    assert set(AGEING) < set(names)
    known = all_known("focus", 0.5)
    own = replace(
        nominal_parameters("focus"),
        k1=0.5 * nominal_table("focus")["k1"].nominal,
        b1=0.5 * nominal_table("focus")["b1"].nominal,
    )
    nominal = np.asarray(known.at(np.zeros(len(AGEING)))(1j * omega)).ravel()
    exact = np.asarray(plant(own, total_gain("focus"), antialiasing=False)(1j * omega)).ravel()
    np.testing.assert_allclose(nominal, exact, rtol=1e-9)


@pytest.mark.slow  # a minute
def test_more_uncertainty_never_lowers_the_peak():
    K = control.ss(controller("focus"))
    peaks = [
        peak_of(plant_of("focus", model), K)
        for model in (all_known("focus", 1.0), aged_model("focus", life("focus", 0.75)))
    ]
    assert peaks[0][0] <= peaks[1][1]
    assert peak_of(plant_of("focus", all_known("focus", 1.0)), -K) == (np.inf, np.inf)


@pytest.mark.slow
def test_a_start_finds_an_aged_suspension():
    start = StartUp("radial", 0.5)
    found, own = start.found(5), start.experiment.laboratory.parameters
    assert found.k1 == pytest.approx(own.k1, rel=found.k1_off)
    assert found.b1 == pytest.approx(own.b1, rel=found.b1_off)
    assert found.k1_off < 0.15


@pytest.fixture(scope="module")
def stored(reference):
    """Program and stored answer of the focus loop."""
    run = reference("cd/focus/ageing")
    return run.task, run.answer


def test_the_run_is_shown(stored):
    task, answer = stored
    assert set(task.figures(answer)) == {"ageing"}
    assert task.tables(answer)["peaks"].count("\n") == 2 + len(SOFTENINGS) * len(CONTROLLERS)
    assert set(SETS) < set(CONTROLLERS)


def test_wrong_answers_are_noticed(stored):
    task, answer = stored
    crossed = answer.assign(peak=answer["peak"] * [1.1, 1.0])
    assert any("bounds" in one for one in task.certify(crossed, 1e-6).failures)
    off = answer.assign(found=2 * answer["found"])
    assert any("intervals" in one for one in task.certify(off, 1e-6).failures)
    peak = answer["peak"].copy()
    peak.loc[{"plants": "found", "judged": "found"}] *= 1.2
    failing = " ".join(task.certify(answer.assign(peak=peak), 1e-6).failures)
    assert "chosen" in failing and "smaller sets" in failing


@pytest.mark.slow
def test_another_seed_changes_no_verdict():
    """A controller for what another start finds gains less than 5 % on it."""
    whole = life("focus", 0.5)
    found = narrowed(whole, StartUp("focus", 0.5).found(7))
    options = Options()
    plants = [plant_of("focus", aged_model("focus", one)) for one in (whole, found)]
    for_life, for_found = (designed("focus", plant, "fixed", options) for plant in plants)
    on_it = [peak_of(plants[1], K)[1] for K in (for_life, for_found)]
    assert 1 - on_it[1] / on_it[0] < 0.05
