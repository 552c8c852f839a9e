"""The problem cd/{axis}/excursion at a small size, its theory and its checks."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from workbench.plants.cd_drive.tolerance.excursion.problem import excursion
from workbench.plants.cd_drive.tolerance.excursion.runs import DefectCase, excursion_of
from workbench.plants.cd_drive.tolerance.excursion.theory import BlindLens, standing

import workbench as wb
from workbench.errors import InputError


@pytest.fixture(scope="module")
def focus(slower):
    study = excursion("focus", slower["focus"], angles=2, lengths=2, draws=3)
    return study, wb.solve(study)


def failures(study, answer):
    return {check.name for check in study.checks(answer, 1e-6) if not check.holds}


def test_equation_8_1_gives_the_worst_case_of_the_thesis():
    assert standing(500e-6, 9.0, 1.9e-3, 0.0) == pytest.approx(53.7e-6, rel=1e-3)


@given(st.floats(0.0, np.pi), st.floats(1e-4, 3e-3), st.floats(1.0, 20.0))
@settings(max_examples=50, deadline=None)
def test_no_angle_is_worse_than_symmetry(middle, duration, rotation):
    worst = standing(1.0, rotation, duration, 0.0)
    assert abs(standing(1.0, rotation, duration, middle)) <= worst * (1 + 1e-12)


def test_a_lens_that_keeps_speed_and_voltage_hardly_strays():
    lens = BlindLens("focus", "nominal", 500e-6, 9.0, driven=False)
    angles = np.linspace(0.0, np.pi, 7)
    short, long = (abs(lens.error(each, angles)).max() for each in (0.1e-3, 0.2e-3))
    assert long / short == pytest.approx(8.0, rel=0.1)  # the third derivative is missed first
    assert long < 1e-3 * standing(500e-6, 9.0, 0.2e-3, 0.0)


@pytest.mark.cases(0)
def test_the_map_is_certified(focus):
    _, solution = focus
    assert solution.certificate is not None, solution.message
    assert solution.certificate.holds, solution.certificate


@pytest.mark.cases(0)
def test_the_strategies_are_in_the_order_of_the_thesis(focus):
    worst = focus[1].answer["peak"].sel(share=1.0).max(["angle", "length", "draw"])
    for name in ("A", "B", "C"):
        assert worst.sel(strategy=name) < worst.sel(strategy="reference")
    numbers = focus[0].metrics(focus[1].answer)
    assert numbers["survived_A_low"] >= numbers["survived_reference_high"]


@pytest.mark.cases(1)
@pytest.mark.parametrize(
    ("name", "factor", "check"),
    [
        ("standing", 1.01, "equation 8.1"),
        ("free", 1.01, "lens in flight"),
        ("free", 10.0, "order"),
        ("driven", -1.0, "reference strategy"),
        ("peak", 0.5, "replay"),
    ],
)
def test_the_checks_can_fail(focus, name, factor, check):
    study, solution = focus
    spoiled = solution.answer.copy(deep=True)
    spoiled[name] = spoiled[name] * factor
    assert check in failures(study, spoiled)


def test_a_reversed_map_is_a_failure(focus):
    study, solution = focus
    spoiled = solution.answer.copy(deep=True)
    spoiled["peak"].values = spoiled["peak"].isel(share=slice(None, None, -1)).values
    assert "harder" in failures(study, spoiled)


@pytest.mark.slow
def test_another_seed_changes_no_verdict(focus):
    study, solution = focus
    other = wb.solve(study, options=wb.Options(seed=1)).answer
    assert (other["peak"] != solution.answer["peak"]).any()
    assert failures(study, other) == failures(study, solution.answer) == set()


def test_figures_and_tables(focus):
    study, solution = focus
    for figure in study.figures(solution.answer).values():
        figure.canvas.draw()
    assert all("|" in text for text in study.tables(solution.answer).values())


@pytest.mark.parametrize("wrong", [{"angles": 0}, {"rotation": 0.0}, {"depth": 1.5}])
def test_parameters_out_of_range_are_named(wrong):
    with pytest.raises(InputError, match=next(iter(wrong))):
        wb.load("cd/focus/excursion", **wrong)


def test_only_strategy_c_has_the_designed_fault_filter(focus, slower, reference):
    designed = reference("cd/focus/designed-filter")
    with_it = excursion("focus", slower["focus"], designed, fault_filter="with margins").crossing
    usual, case = focus[0].crossing, DefectCase(0.0, 2e-3, 500e-6)

    def error(crossing, strategy):
        return excursion_of(crossing.run(case, strategy), case.length)[0]

    assert error(with_it, "A") == error(usual, "A")
    assert error(with_it, "C") != pytest.approx(error(usual, "C"), rel=0.05)
    with pytest.raises(InputError, match="no run of it is given"):
        excursion("focus", slower["focus"], fault_filter="with margins")


def test_an_unknown_drive_is_named(slower):
    assert (
        "CD13"
        in wb.solve(excursion("focus", slower["focus"], drive="CD13", angles=2, lengths=2)).message
    )


def test_defects_are_counted_by_verdict():
    """Three draws of two defects: smaller in all, in two, in none."""
    import xarray as xr
    from workbench.plants.cd_drive.tolerance.excursion.cells import OTHERS, cells_table, counts
    from workbench.plants.cd_drive.tolerance.tactics import STRATEGIES

    dims = ("angle", "length", "share", "draw", "strategy")
    peak = xr.DataArray(
        np.ones((2, 1, 1, 3, len(STRATEGIES))), {"share": [1.0], "strategy": list(STRATEGIES)}, dims
    )
    peak.loc[{"strategy": "A"}] = 0.5
    peak.loc[{"strategy": "B"}] = 2.0
    peak.loc[{"strategy": "C", "draw": [0, 1]}] = 0.5
    numbers = counts(peak)
    assert [numbers[f"{one}_red_book_A"] for one in ("better", "worse", "undecided")] == [2, 0, 0]
    assert [numbers[f"{one}_red_book_B"] for one in ("better", "worse", "undecided")] == [0, 2, 0]
    assert [numbers[f"{one}_all_C"] for one in ("better", "worse", "undecided")] == [0, 0, 2]
    _, rows = cells_table(peak)
    assert len(rows) == len(OTHERS) and rows[1][-1] == "2.00" and rows[0][-1] == "-"
