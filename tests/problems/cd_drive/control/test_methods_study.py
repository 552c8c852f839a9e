"""Table 5.1 in numbers: each method is best at what it minimises, and none at everything."""

import numpy as np
import pytest
from workbench.plants.cd_drive.control.control_problem import generalised
from workbench.plants.cd_drive.control.design import cover_of, uncertainty
from workbench.plants.cd_drive.control.methods.checks import _plants
from workbench.plants.cd_drive.control.methods.designs import FULL_ORDER, design_task
from workbench.plants.cd_drive.control.methods.problem import CONDITIONS, Methods, methods
from workbench.plants.cd_drive.control.methods.report import CLAIMS, LOOKS
from workbench.plants.cd_drive.drive.plants import ANTIALIASING, nominal_response

import workbench as wb
from workbench.executor import Context
from workbench.synthesis import DESIGNS
from workbench.systems.generalised_plant import response

QUICK = ("reference", "LQG", "mixed sensitivity", "loop shaping")
HERTZ = np.geomspace(1, 1e4, 40)


@pytest.fixture(scope="module")
def solved():
    study = Methods("focus", uncertainty("focus", None), 20, QUICK)
    return study, wb.solve(study)


@pytest.fixture(scope="module")
def data(solved):
    return solved[1].answer


@pytest.mark.slow
def test_its_certificate_holds(solved):
    assert solved[1].certificate.failures == ()


@pytest.mark.slow
def test_the_simple_methods_do_not_see_the_resonance_move(data):
    upper = data["peak"].sel(bound="upper")
    assert (upper.sel(condition="nominal performance", design="mixed sensitivity") < 0.71).all()
    robust = upper.sel(condition="robust performance")
    assert float(robust.sel(design="reference")) == pytest.approx(0.871, abs=2e-3)
    for name in ("LQG", "mixed sensitivity"):
        assert float(robust.sel(design=name)) > 1.4
        at = data["peak_frequency"].sel(condition="robust performance", design=name)
        assert float(at) == pytest.approx(30, abs=3)


@pytest.mark.slow
def test_peaks_grow_with_the_uncertainty(data):
    lower, upper = data["peak"].sel(bound="lower"), data["peak"].sel(bound="upper")
    for small, large in (("robust performance", "complex scalars"), (CONDITIONS[4], CONDITIONS[5])):
        assert (lower.sel(condition=small) <= upper.sel(condition=large)).all()


@pytest.mark.slow
def test_a_controller_that_is_not_the_best_at_its_own_is_found(solved, data):
    study, _ = solved
    worse = data.copy(deep=True)
    for part in "ABCD":
        worse[f"lqg_{part}"] = worse[f"loop_shaping_{part}"]
    failed = {check.name for check in study.checks(worse, 1e-6) if not check.holds}
    assert "LQG is best at its own" in failed


@pytest.mark.slow
def test_tables_and_figures_are_made(solved, data):
    study, _ = solved
    tables = study.tables(data)
    assert "mixed sensitivity" in tables["methods"]
    rows = tables["methods"].splitlines()
    assert len(rows) == 2 + len(QUICK)
    assert len({len(row) for row in rows}) == 1  # aligned
    assert set(study.figures(data)) == {"mu", "sensitivity"}
    assert set(CLAIMS) == set(LOOKS) == set(DESIGNS)
    assert set(FULL_ORDER) < set(DESIGNS)


@pytest.mark.parametrize("axis", ["focus", "radial"])
def test_the_nominal_plant_is_that_of_the_generalised_one(axis):
    uncertain = uncertainty(axis, None)
    task = design_task(axis, uncertain)
    omega = 2 * np.pi * HERTZ
    np.testing.assert_allclose(
        response(task.nominal, omega)[:, 0, 0], nominal_response(axis, HERTZ), rtol=1e-9
    )
    P = generalised(axis, uncertain).nominal().response(omega)
    np.testing.assert_allclose(-P[:, -1, -1], response(task.nominal, omega)[:, 0, 0], rtol=1e-6)


@pytest.mark.cases(0)
def test_covers_are_plants_too(covered):
    _, answer = covered("focus", "circle", "steps")
    task = design_task("focus", answer.model)
    omega = 2 * np.pi * HERTZ
    filtered = ANTIALIASING / (1j * omega + ANTIALIASING)
    G = answer.model.nominal.response(omega)
    np.testing.assert_allclose(response(task.nominal, omega)[:, 0, 0], G * filtered, rtol=1e-6)
    for design in ("LQG", "mixed sensitivity"):
        loop = task.plant.nominal().close(DESIGNS[design](task, Context()))
        assert loop.poles().real.max() < 0
    away = abs(_plants("focus", answer.model, 0.5, HERTZ) / G - 1)
    np.testing.assert_allclose(away, 0.5 * abs(answer.model.W_c.response(omega))[None] + 0 * away)


def test_a_cover_is_needed_where_it_is_asked_for():
    assert cover_of("focus") == {}
    asked = cover_of("focus", form="circle", frequencies=60)
    assert asked["covered"].parameters["frequencies"] == 60
    assert methods("focus").names == tuple(DESIGNS)


@pytest.mark.slow
def test_mu_synthesis_lowers_what_it_sees():
    """D-K has the least peak with complex scalars, (mu, D)-K does better with real ones."""
    study = methods("radial", frequencies=20)
    solution = wb.solve(study)
    assert solution.certificate.failures == ()
    upper = solution.answer["peak"].sel(bound="upper")
    of = upper.sel(condition="complex scalars")
    assert float(of.sel(design="D-K")) == pytest.approx(float(of.min()))
    robust = upper.sel(condition="robust performance")
    assert float(robust.sel(design="(mu,D)-K")) < float(robust.sel(design="D-K"))
    assert float(robust.sel(design="fixed order")) == pytest.approx(float(robust.min()))
