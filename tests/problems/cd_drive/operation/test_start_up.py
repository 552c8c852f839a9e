"""The focus loop is closed on a ramp."""

from dataclasses import replace

import numpy as np
import pytest
from workbench.plants.cd_drive.drive.disc import Disc
from workbench.plants.cd_drive.drive.photo_diodes import surface_of
from workbench.plants.cd_drive.drive.tables import disc_formats
from workbench.plants.cd_drive.laboratory.experiment import Laboratory, measurements
from workbench.plants.cd_drive.operation.focus_search import END, Search, volts_per_metre
from workbench.plants.cd_drive.operation.start_up.bounds import escape_speed, held_speed
from workbench.plants.cd_drive.operation.start_up.problem import StartUpStudy
from workbench.plants.cd_drive.operation.start_up.runs import (
    LAWS,
    OUTCOMES,
    QUIET,
    StartUp,
    outcome,
)

from workbench import solve
from workbench.errors import InputError
from workbench.simulation import play
from workbench.solvers import Options


def test_the_surface_lies_three_quarters_of_a_millimetre_before_the_layer():
    depth, light = surface_of(disc_formats()["CD"])
    assert depth == pytest.approx(0.755e-3, abs=1e-6)
    assert light == pytest.approx(0.0465 / 0.7, abs=1e-3)


def test_sum_of_a_lens_that_passes_the_surface_and_the_layer():
    """Lifted by hand, a lens far below meets the surface's light before the layer's."""
    bench = Laboratory("focus", "nominal", surface=True, **QUIET)
    level = bench.parameters.K_opt / bench.parameters.K_optn
    offsets = np.linspace(0.70e-3, 0.80e-3, 41)  # of a layer above a lens that rests
    sums = [
        bench.open_loop(np.zeros(20), Disc(offset=float(one), rotation=0.0, run_up=0.0)).sum[-1]
        for one in offsets
    ]
    depth, light = surface_of(disc_formats()["CD"])
    assert abs(offsets[int(np.argmax(sums))] - depth) < 6e-6
    assert max(sums) / level == pytest.approx(light, rel=0.01)
    without = replace(bench, surface=False)
    disc = Disc(offset=float(depth), rotation=0.0, run_up=0.0)
    assert without.open_loop(np.zeros(20), disc).sum[-1] < 1e-3 * level


def test_the_search_closes_where_there_is_light_and_the_error_changes_its_sign():
    """Drawn back, waited, advancing; then a crossing in the dark, and one with light."""
    search = Search(speed=5e-3, light=1.0)
    dark, lit = [0.3, 0.1], [0.3, 2.0]
    begun = [dark] * 6200
    told = play(search.law, [*begun, [-0.3, 0.1], lit, lit, [-0.1, 2.0], dark])
    closed = told[6200:, 0]
    assert not told[:6200, 0].any() and closed.tolist() == [0.0, 0.0, 0.0, 1.0, 1.0]
    assert told[-1, 1] == told[-2, 1]  # the ramp stands still


def test_a_search_that_finds_nothing_begins_anew():
    search = Search(speed=40e-3, light=1.0)
    ramp = play(search.law, [[0.0, 0.0]] * 35000)[:, 1] / volts_per_metre()
    assert ramp.max() == pytest.approx(END, rel=1e-2)
    assert (np.diff(ramp) < 0.0)[9000:].any()


@pytest.mark.parametrize("drive", ["CD4", "CD8"])
def test_bounds_enclose_what_is_simulated(drive):
    """A lens at the lower bound's speed stays in the linear range, one above the upper leaves."""
    assert held_speed(drive) < escape_speed(drive, 0.0) < escape_speed(drive, 0.6e-3)
    slow = StartUp(LAWS[0], 0.7 * held_speed(drive), 0.0).attempt(drive, 3, **QUIET)
    fast = StartUp(LAWS[0], 80e-3, 0.0).attempt(drive, 3, **QUIET)
    assert OUTCOMES[slow.outcome] == "captured" and slow.overshoot < 2e-6
    assert abs(fast.speed) > escape_speed(drive, 0.6e-3) and fast.overshoot > 6e-6


def test_a_low_threshold_ends_on_the_surface():
    found = StartUp(LAWS[3], 2.5e-3, 0.0).attempt("CD1", 1)
    assert OUTCOMES[found.outcome] == "surface"
    assert OUTCOMES[StartUp(LAWS[2], 2.5e-3, 0.0).attempt("CD1", 1).outcome] == "dark"


def test_without_light_the_loop_is_never_closed():
    bench = Laboratory("focus", "CD1", surface=True)
    record = bench.closed_loop(Search(40e-3, 1.0).cascade, duration=0.1)
    assert OUTCOMES[outcome(record).outcome] == "never"
    assert measurements(record).shape == (3500, 6)


def test_unknown_laws_are_named():
    with pytest.raises(InputError, match=r"law is 'all'; known: 1/2 of its light"):
        StartUp("all", 1e-3, 0.0).threshold("CD1")


@pytest.mark.slow
@pytest.mark.cases(0)
def test_study():
    """Another seed changes no verdict."""
    task = StartUpStudy(1)
    for seed in (0, 1):
        solution = solve(task, options=Options(seed=seed))
        assert solution.certificate.holds, solution.certificate
        numbers = task.metrics(solution.answer)
        assert numbers["surface_low_threshold_without_noise"] > 0.3
        assert numbers["captured_slow_still_mean"] > numbers["captured_slow_red_book_mean"]
        assert 0.02 < numbers["fastest_captured"] < 0.06
    wrong = solution.answer.copy(deep=True)
    wrong["outcome"].loc[{"law": LAWS[0]}] = OUTCOMES.index("surface")
    wrong["per_speed"][...] *= 0.9
    failed = {one.name for one in task.certify(wrong, 1e-6).checks if not one.holds}
    assert failed == {"slow", "surface", "linear bound"}
