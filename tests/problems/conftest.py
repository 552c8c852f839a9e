"""Stored results that tests of problems start from."""

from pathlib import Path

import pytest

import workbench as wb

REFERENCE = Path(__file__).parents[2] / "results" / "reference"


@pytest.fixture(scope="session")
def reference():
    """The reference run of a problem; by method and parameters where it has several."""

    def find(name, method=None, **parameters):
        runs = [wb.open_run(folder) for folder in (REFERENCE / name).iterdir()]
        (run,) = (
            run
            for run in runs
            if method in (None, run.method) and parameters.items() <= run.info["parameters"].items()
        )
        return run

    return find


@pytest.fixture(scope="session", params=["stored", pytest.param("anew", marks=pytest.mark.slow)])
def answered(request, reference):
    """Study and solution of a problem: the reference answer, or solved anew."""

    def find(name):
        run = reference(name)
        study = run.task
        if request.param == "anew":
            return study, wb.solve(study)
        return study, run

    return find
