"""The speed of synthesis: a small one, whose arithmetic must be right whatever the clock says."""

import sys

import control
import numpy as np
import pytest
from workbench.plants.bench.synthesis import FASTER, PEAK, SLOWER, SynthesisSpeed, failed
from workbench.plants.bench.synthesis_peers import (
    AUTOMATIC,
    Claimed,
    achieved,
    dk_iterations,
    hinfsyn,
)
from workbench.plants.bench.synthesis_plants import drive_plants, random_plant
from workbench.plants.textbook.distillation import distillation_column

import workbench as wb
from workbench.errors import InputError
from workbench.synthesis import hinf


def peers():
    """What dkpy would give, but by the first controller of D-K iteration, in no time."""
    plant = distillation_column()
    K = hinf(plant).K
    return {"dkpy": Claimed(K, 1.2, 3600.0), AUTOMATIC: Claimed(K, 1.1, 7200.0)}, plant.system


@pytest.fixture(scope="module")
def solved():
    study = SynthesisSpeed((3,), 2, drives=False, distillation=True)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("workbench.plants.bench.synthesis.dk_iterations", peers)
        return study, wb.solve(study)


def failures(study, answer):
    return {check.name for check in study.checks(answer, 1e-6) if not check.holds}


@pytest.mark.cases(0)
def test_the_small_one_holds(solved):
    study, solution = solved
    assert solution.certificate.holds, solution.certificate
    assert (solution.answer["seconds"] > 0).all()
    numbers = study.metrics(solution.answer)
    ours, theirs = (solution.answer["seconds"].sel(by=by) for by in ("workbench", "hinfsyn"))
    assert numbers["hinf_over_hinfsyn_3"] == pytest.approx(float((ours / theirs).max()))
    assert numbers["hinf_over_hinfsyn_3"] < SLOWER
    assert numbers["norm_over_hinfsyn_3"] <= 1.001
    assert numbers["dkpy_over_ours"] > FASTER
    assert numbers["peak"] <= PEAK < numbers["peak_dkpy"] == 1.2
    assert numbers["peak_dkpy_automatic"] == 1.1


@pytest.mark.cases(0)
def test_what_is_not_reached_is_found(solved):
    study, solution = solved
    answer = solution.answer.copy(deep=True)
    answer["seconds"].loc[{"by": "hinfsyn"}] /= 1e6
    answer["norm"].loc[{"by": "hinfsyn"}] *= 0.99
    answer["dk_seconds"].loc[{"package": "dkpy"}] = 1e-3
    assert failures(study, answer) == {"3 states, time", "3 states, norm", "time to the peak"}
    answer["norm"].loc[{"by": "workbench"}] = np.inf
    answer["own_A"][:] = np.eye(len(answer["own_A"]))  # the peak is that of the stored controller
    assert {"3 states, success", "peak"} <= failures(study, answer)


@pytest.mark.cases(0)
def test_failures_of_the_peer_are_counted(solved):
    _, solution = solved
    answer = solution.answer.copy(deep=True)
    assert not failed(answer).any()
    answer["norm"][0, 1] = np.inf
    answer["claim"][1, 1] /= 2.0
    assert failed(answer).all()


@pytest.mark.cases(0)
def test_the_run_is_shown(solved):
    study, solution = solved
    assert set(study.figures(solution.answer)) == {"hinf"}
    tables = study.tables(solution.answer)
    assert tables["hinf"].count("\n") == 2 + 2
    assert "3.6e+03" in tables["distillation"].splitlines()[-2]


def test_without_dkpy(monkeypatch):
    monkeypatch.setitem(sys.modules, "dkpy", None)
    with pytest.raises(InputError, match=r"'robust-workbench\[benchmark\]'.*distillation"):
        dk_iterations()
    study = wb.load("bench/synthesis", largest=10, plants=1, distillation=False, drives=False)
    assert study.sizes == (10,)
    assert study.groups == ["10 states"]


def test_a_loop_without_stability_has_no_norm():
    plant = random_plant(np.random.default_rng(3), 4)
    K = hinf(plant).K
    assert achieved(plant, K) == pytest.approx(control.linfnorm(plant.close(K))[0])
    assert achieved(plant, 1e3 * K) == np.inf
    assert achieved(plant, None) == np.inf


def test_what_hinfsyn_raises_is_kept(monkeypatch):
    def refuse(*_):
        raise ArithmeticError("no\n  luck")

    monkeypatch.setattr(control, "hinfsyn", refuse)
    found = hinfsyn(random_plant(np.random.default_rng(0), 2))
    assert found.K is None
    assert found.failure == "no luck"
    assert np.isnan(found.claim)


@pytest.mark.cases(1)
@pytest.mark.parametrize("name", ["focus nominal", "radial parametric", "focus parametric"])
def test_the_drives_in_si_units_have_controllers(name):
    plant = drive_plants()[name]
    assert achieved(plant, hinf(plant).K) < np.inf


@pytest.mark.slow
def test_what_we_claim_of_a_drive_in_si_units_is_reached():
    """Whether hinfsyn claims too much there, and by how much, depends on the processor."""
    for plant in drive_plants().values():
        ours = hinf(plant)
        reached = achieved(plant, ours.K)
        assert reached <= 1.002 * ours.gamma
        assert reached <= 1.002 * achieved(plant, hinfsyn(plant).K)


@pytest.mark.slow
def test_everything_asked_for_is_reached():
    pytest.importorskip("dkpy")
    study = wb.load("bench/synthesis")
    solution = wb.solve(study)
    assert solution.certificate.holds, solution.certificate
