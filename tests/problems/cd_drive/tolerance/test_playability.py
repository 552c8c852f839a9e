"""The problem cd/playability at a small size: scores, balloon, search, checks."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from workbench.plants.cd_drive.tolerance.ensemble import circumstances
from workbench.plants.cd_drive.tolerance.playability.checks import continuous_peak
from workbench.plants.cd_drive.tolerance.playability.problem import named, playability
from workbench.plants.cd_drive.tolerance.playability.runs import (
    Design,
    Player,
    chosen,
    sampled_controller,
    scored,
)
from workbench.plants.cd_drive.tolerance.playability.search import (
    BOUNDS,
    LARGEST_SENSITIVITY,
    Search,
    peak_sensitivity,
)

import workbench as wb
from workbench.errors import InputError, UnknownNameError

SMALL = {"scenarios": 14, "training": 7, "trials": 4, "drives": 2, "duration": 0.6}


@pytest.fixture(scope="module", params=[pytest.param("small", marks=pytest.mark.slow)])
def small(slower):
    study = playability(**slower, **SMALL, strategies="reference,A", workers=2)
    return study, wb.solve(study)


def failures(study, answer):
    return {check.name for check in study.checks(answer, 1e-6) if not check.holds}


def test_the_ensemble_is_certified(small):
    _, solution = small
    assert solution.certificate is not None, solution.message
    assert solution.certificate.holds, solution.certificate


def test_strategy_a_makes_the_balloon_smaller(small):
    numbers = small[0].metrics(small[1].answer)
    for axis in ("focus", "radial"):
        assert numbers[f"balloon_{axis}_A"] < numbers[f"balloon_{axis}_reference"]


@pytest.mark.slow
def test_workers_do_not_change_the_answer(small):
    study, solution = small
    alone = wb.solve(replace(study, workers=1)).answer
    assert alone.equals(solution.answer)


@pytest.mark.parametrize(
    ("name", "change", "check"),
    [
        ("trace", 1.5, "stored traces"),
        ("out", 0.5, "arms"),
        ("burst", 2.0, "stored traces"),
        ("deviation", 1.1, "replay"),
        ("balloon", 2.0, "intervals"),
        ("best", 100.0, "bounds"),
        ("best", 9.0, "margin"),
    ],
)
def test_the_checks_can_fail(small, name, change, check):
    study, solution = small
    spoiled = solution.answer.copy(deep=True)
    spoiled[name] = spoiled[name] * change
    if name == "best" and change == 9.0:
        spoiled["best"] = 0.0 * spoiled["best"] + change
    if name == "trace":
        spoiled[name] = spoiled[name] + 1e-5
    if name == "burst":
        spoiled[name] = spoiled[name] + 1e-3
    assert check in failures(study, spoiled)


def test_bursts_without_a_cause_and_a_worse_tuning_are_failures(small):
    study, solution = small
    spoiled = solution.answer.copy(deep=True)
    spoiled["burst"] = spoiled["burst"] + 1e-3
    spoiled["cost"] = spoiled["cost"] * 0.0 + np.arange(4.0) + 1.0
    spoiled["cost"][{"trial": 0}] = 0.5
    assert "bursts" in failures(study, spoiled)
    assert study.metrics(spoiled)["unrepaired_focus_A"] >= 0.0


def test_figures_and_tables(small):
    study, solution = small
    for figure in study.figures(solution.answer).values():
        figure.canvas.draw()
    assert all("|" in text for text in study.tables(solution.answer).values())


@given(arrays(bool, st.integers(1, 200)))
def test_scores_are_what_counting_says(out):
    share, losses, burst, _ = scored(np.where(out, 3e-6, 1e-6), "focus")
    runs = [len(run) for run in "".join("x" if one else " " for one in out).split()]
    assert share == pytest.approx(np.mean(out))
    assert losses == 0.0
    assert burst == pytest.approx(max(runs, default=0) / 35e3 * 1.3)


def test_a_loss_is_counted_once_until_it_is_over():
    error = np.array([7.0, 7.0, 0.0, -8.0, 0.0, 5.0]) * 1e-6
    assert scored(error, "focus")[1] == 2.0


@pytest.mark.parametrize("axis", ["focus", "radial"])
def test_sampled_and_continuous_loops_are_as_near_to_instability(axis):
    for gain_db in (-3.0, 0.0, 3.0):
        sampled = peak_sensitivity(axis, sampled_controller(axis, gain_db))
        assert sampled == pytest.approx(continuous_peak(axis, gain_db), rel=0.05)
    assert peak_sensitivity(axis, sampled_controller(axis, 9.0)) > LARGEST_SENSITIVITY


def test_the_search_finds_a_minimum_and_stays_within_bounds():
    def cost(design):
        return (design.gain_db - 3.0) ** 2 + 100.0 * (design.dist_max - 0.5) ** 2

    found, tried, costs = Search(Design("reference"), cost, 60).run()
    assert found.gain_db == pytest.approx(3.0, abs=0.2)
    assert found.dist_max == pytest.approx(0.5, abs=0.02)
    assert costs.min() == cost(found)
    assert (tried[:, 1] <= BOUNDS["dist_max"][1]).all()
    assert (tried[:, 2] == 200.0).all()  # no corner where there is no repetitive control


def test_a_corner_is_looked_for_where_there_is_one():
    found, _, _ = Search(Design("A"), lambda one: abs(one.corner - 300.0), 40).run()
    assert found.corner == pytest.approx(300.0, abs=20.0)


def test_a_corner_changes_what_a_player_does():
    one = circumstances("focus", 1, 0.6, np.random.default_rng(1))[0]
    player = Player((Design("A"), Design("A", corner=80.0), Design("A", 3.0)), ("CD1",), 0.6)
    rms = player(one)[0, :, 3]
    assert len(set(rms.tolist())) == 3


def test_unknown_names_are_refused(slower):
    for names in ("reference,D", "", "A,A"):
        with pytest.raises(InputError, match="strategies"):
            named(names)
    with pytest.raises(UnknownNameError, match="D"):
        Design("D")
    with pytest.raises(InputError, match="tuned"):
        playability(**slower, strategies="A,B", tuned="C")
    with pytest.raises(InputError, match="dist_max"):
        Design("A", dist_max=0.1)


@pytest.mark.parametrize("wrong", [{"scenarios": 0}, {"drives": 13}, {"duration": 0.1}])
def test_sizes_out_of_range_are_named(wrong):
    with pytest.raises(InputError, match=next(iter(wrong))):
        wb.load("cd/playability", **wrong)


def test_a_player_needs_designs_drives_and_time():
    with pytest.raises(InputError, match="design"):
        Player((), ("CD1",), 1.0)
    with pytest.raises(InputError, match="duration"):
        Player((Design("A"),), ("CD1",), 0.3)


def test_drives_are_spread_over_the_twelve():
    assert chosen(12) == tuple(f"CD{n}" for n in range(1, 13))
    assert chosen(3) == ("CD1", "CD5", "CD9")
