"""What the table of readings leaves out of a reading's reach cannot change with the reading."""

from dataclasses import fields
from pathlib import Path

import numpy as np
import pytest
from tables import each
from workbench.plants.cd_drive.claims import summaries
from workbench.plants.cd_drive.claims.assignments import asked as parameters_of
from workbench.plants.cd_drive.claims.assignments import natural, of_problem, variables
from workbench.plants.cd_drive.claims.chapters import numbers, sources
from workbench.plants.cd_drive.drive.disc import VELOCITY
from workbench.plants.cd_drive.drive.tables import (
    ActuatorParameters,
    drives,
    red_book,
    reduced_tolerances,
)
from workbench.plants.cd_drive.laboratory.bench_setup import coil_gain, find_drive
from workbench.plants.cd_drive.laboratory.experiment import Laboratory
from workbench.plants.cd_drive.laboratory.scans import radial_scan
from workbench.plants.cd_drive.tolerance.excursion.theory import WORST, BlindLens, standing

import workbench as wb
from workbench.bench.project import registry

REFERENCE = Path(__file__).parents[4] / "results" / "reference"
SCANS = "cd/radial/optical-gain"
SET_BY = {setting.parameter: name for name, one in variables().items() for setting in one.settings}
"""The reading that a parameter of a problem sets."""
PARAMETRIC = "cd/focus/methods"
"""A problem whose gain is that of a cover, which its form of the uncertainty does not need."""


def stored(name):
    """The reference result of a problem."""
    (folder,) = (REFERENCE / name).iterdir()
    return wb.open_run(folder)


def asked(name):
    """A problem with the parameters of its reference result."""
    problem = registry().find(name)
    return problem, problem.bind({})


@each("name", sources())
def test_no_parameter_that_sets_a_reading_is_forgotten(name):
    """`values` differ radially only; the gain of a cover matters only where there is one."""
    problem, _ = asked(name)
    known = of_problem(name)
    left_out = {SET_BY[one] for one in problem.parameters if one in SET_BY} - known.keys()
    if name == PARAMETRIC:
        left_out -= {"gain"}
    if name.startswith("cd/focus/") or name in variables()["tables"].spares:
        left_out -= {"tables"}
    assert not left_out


def test_the_gain_of_a_cover_that_is_not_needed_changes_nothing():
    problem, natural = asked(PARAMETRIC)
    for gain in variables()["gain"].values:
        assert problem.needs(natural | {"gain": gain}) == {}
        task = problem.task(natural | {"gain": gain}, {})
        usual = problem.task(natural, {})
        assert {**vars(task), "uncertain": None} == {**vars(usual), "uncertain": None}
        one, other = (
            each.uncertain.at(dict.fromkeys(reduced_tolerances("focus"), 1.0))
            for each in (task, usual)
        )
        assert all(np.array_equal(getattr(one, m), getattr(other, m)) for m in "ABCD")


def test_controllers_for_three_parameters_are_made_and_judged_without_a_set_of_points():
    """Their numbers are the same with fitted weights and with the sets of each frequency."""
    of_parameters = [
        n for n in numbers() if n.run.endswith("/controllers") and "sets" in n.untouched
    ]
    assert of_parameters
    assert all("parametric" in str(n.quantity).lower() for n in of_parameters)
    assert not any(form in str(n.quantity) for n in of_parameters for form in ("stadium", "circle"))
    for axis in ("focus", "radial"):
        problem = registry().find(f"cd/{axis}/controllers")
        natural = problem.bind({})
        for need in problem.needs(natural)["designed"]:
            if need.parameters["form"] == "parametric":
                design = registry().find(need.name)
                every = design.needs(design.bind(dict(need.parameters)))
                assert not any("cover" in one.name for one in every.values())


def test_the_corrected_values_of_the_focus_loop_do_not_move_a_lens():
    """Only a damper of the lumped model differs, and no loop contains that model."""
    pairs = zip(drives("focus"), drives("focus", "corrected"), strict=True)
    changed = {
        (one.name, name)
        for one, other in pairs
        for name in vars(one)
        if getattr(one, name) != getattr(other, name)
    }
    assert changed == {("CD10", "b")}
    assert "b" not in {one.name for one in fields(ActuatorParameters)}


@pytest.mark.parametrize("name", sorted({*variables()["tables"].spares} - {SCANS}))
def test_a_run_of_one_drive_does_not_see_the_corrections(name):
    problem, natural = asked(name)
    one, other = (find_drive("radial", natural["drive"], v) for v in ("printed", "corrected"))
    assert one == other
    for gain in variables()["gain"].values:
        assert coil_gain(one, gain) == coil_gain(one, gain, "corrected")
    every = problem.needs(natural)
    assert all(need.parameters["drive"] == natural["drive"] for need in every.values())


def test_a_scan_does_not_see_the_corrections_as_the_lens_rests():
    name = next(
        one.name
        for one, other in zip(drives("radial"), drives("radial", "corrected"), strict=True)
        if one.k1 != other.k1
    )
    found = [
        radial_scan(Laboratory("radial", name, values), 2, 5) for values in ("printed", "corrected")
    ]
    assert found[0].gains == found[1].gains and found[0].scatter == found[1].scatter


def test_exact_numbers_do_not_change_with_the_draws():
    data = stored("cd/claims").data
    ends = zip(data["low"].values, data["high"].values, strict=True)
    interval = dict(zip(data["entry"].values, ends, strict=True))
    told = [number for number in numbers() if number.exact]
    for number in told:
        low, high = interval[f"{number.run}: {number.quantity}"]
        assert np.isinf([low, high]).all() or low == high, number.what
    assert len(told) > 5


def test_exact_numbers_of_the_excursion_follow_from_closed_forms():
    """Without noise, delay, detector or fault filter; the nominal drive has one gain only."""
    exact = {n.quantity.name for n in numbers() if n.exact and n.run == "cd/focus/excursion"}
    assert exact == {"thesis_um", "longest_at", "error_at_top", "standing_um", "quotient"}
    run = stored("cd/focus/excursion")
    theta, times = run.data["theta"].values, run.data["length"].values / VELOCITY
    case = red_book("focus").deviation, run.info["parameters"]["rotation"]
    free, driven = (BlindLens("focus", "nominal", *case, one) for one in (False, True))
    stops = [standing(*case, time, theta) for time in times]
    for name, every in (
        ("standing_um", stops),
        ("free_um", [free.error(time, theta) for time in times]),
        ("driven_um", [driven.error(time, theta) for time in times]),
        ("thesis_um", [standing(case[0], *WORST, 0.0)]),
    ):
        largest = max(float(np.abs(one).max()) for one in every)
        assert run.metrics[name] == pytest.approx(1e6 * largest, rel=1e-9)
    nominal = find_drive("focus", "nominal")
    assert len({coil_gain(nominal, gain) for gain in variables()["gain"].values}) == 1


def test_numbers_that_are_said_to_be_untouched_are_so_in_the_runs_of_other_readings():
    tried = 0
    for number in numbers():
        value = number.quantity.of(stored(number.run)) if number.untouched else None
        for name in number.untouched:
            for answer in variables()[name].values:
                parameters = parameters_of(number.run, natural() | {name: answer}, number.told)
                key = (number.run, summaries.words(parameters or {}), str(number.quantity))
                if parameters and key in summaries.stored():
                    assert summaries.stored()[key].value == pytest.approx(value, rel=1e-5)
                    tried += 1
    assert tried > 20
