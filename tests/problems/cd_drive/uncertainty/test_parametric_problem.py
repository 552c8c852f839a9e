"""Deviations of the parametric uncertainty, and its models against the actuator's equations."""

import numpy as np
import pytest
from workbench.plants.cd_drive.drive.actuator import transfer_coefficients
from workbench.plants.cd_drive.drive.plants import nominal_response
from workbench.plants.cd_drive.drive.tables import (
    ActuatorParameters,
    nominal_table,
    reduced_tolerances,
)
from workbench.plants.cd_drive.uncertainty.parametric.problem import (
    ParametricSpread,
    parametric_spread,
)
from workbench.plants.cd_drive.uncertainty.parametric_model import (
    COPIES,
    parametric_nominal,
    parametric_plant,
    uncertain_parameters,
)

from workbench import Options, solve
from workbench.errors import InputError
from workbench.systems.generalised_plant import response

FREQUENCY = np.geomspace(5.0, 5000.0, 40)


@pytest.fixture(scope="module", params=["focus", "radial"])
def solved(request):
    study = ParametricSpread(request.param, FREQUENCY, between=4, samples=50)
    return study, solve(study, options=Options(seed=2))


def polynomial(axis, values):
    """Table 3.2."""
    gain = values.pop("K_total")
    num, den = transfer_coefficients(ActuatorParameters(**values))
    s = 2j * np.pi * FREQUENCY
    return gain * np.polyval(num, s) / np.polyval(den, s)


@pytest.mark.parametrize("reduced", [True, False])
@pytest.mark.parametrize("axis", ["focus", "radial"])
def test_the_model_is_the_printed_transfer_function(axis, reduced):
    model = parametric_plant(axis, reduced)
    assert model.inputs == ("u",) and model.outputs == ("f_en",)
    names = [p.name for p in model.parameters]
    assert {b.name: b.rows for b in model.structure} == {n: COPIES[n] for n in names}
    table = {name: entry.nominal for name, entry in nominal_table(axis).items()}
    for delta in np.random.default_rng(0).uniform(-1, 1, (5, len(names))):
        changed = {p.name: float(p.at(d)) for p, d in zip(model.parameters, delta, strict=True)}
        found = model.response(2 * np.pi * FREQUENCY, delta)[:, 0, 0]
        np.testing.assert_allclose(found, polynomial(axis, table | changed), rtol=1e-9)
    nominal = response(parametric_nominal(axis), 2 * np.pi * FREQUENCY)[:, 0, 0]
    np.testing.assert_allclose(nominal, nominal_response(axis, FREQUENCY, False), rtol=1e-9)


def test_the_reduced_set_is_that_of_table_5_3():
    for axis in ("focus", "radial"):
        found = {p.name: p.tolerance for p in uncertain_parameters(axis)}
        assert found == reduced_tolerances(axis)
        assert len(uncertain_parameters(axis, reduced=False)) == 9


@pytest.mark.cases(1)
def test_the_certificate_holds(solved):
    study, solution = solved
    assert solution.certificate.failures == ()
    metrics = study.metrics(solution.answer)
    assert (metrics["channels"], metrics["channels_reduced"]) == (10, 3)
    assert 0 <= metrics["interior_excess_reduced"] < 0.2
    assert metrics["interior_excess"] > {"focus": 0.2, "radial": 0.02}[study.axis]
    assert 0.5 < metrics["drawn_share"] < 1
    nine, without, reduced = solution.answer["deviation"].values
    assert (without <= nine + 1e-12).all()
    assert (reduced > 0).all()


@pytest.mark.cases(1)
def test_the_run_is_stored_and_shown(solved):
    study, solution = solved
    stored = study.from_dataset(study.to_dataset(solution.answer))
    assert all(check.holds for check in study.checks(stored, 1e-6))
    table = study.tables(stored)["tables-5-2-5-3"]
    assert table.count("\n") == 11
    assert "| Bl " in table
    assert study.figures(stored).keys() == {"deviation", "bode"}


@pytest.mark.parametrize("factor", [1.001, 0.9])
def test_other_deviations_fail(solved, factor):
    study, solution = solved
    spoiled = solution.answer.assign(deviation=solution.answer["deviation"] * factor)
    failed = [c.name for c in study.checks(spoiled, 1e-6) if not c.holds]
    assert "largest deviations" in failed
    assert ("vertices" in failed) == (factor < 1)


def test_a_plant_beyond_the_tolerances_fails(solved):
    study, solution = solved
    beyond = solution.answer["sought_delta"] * 1.5
    spoiled = solution.answer.assign(sought_delta=beyond)
    failed = [c.name for c in study.checks(spoiled, 1e-6) if not c.holds]
    assert failed == ["largest deviations"]


def test_frequencies_that_are_refused():
    with pytest.raises(InputError, match="lowest"):
        parametric_spread("focus", lowest=10.0, highest=5.0)
