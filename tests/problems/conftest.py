"""Stored results that tests of problems start from."""

from pathlib import Path

import pytest

import workbench as wb
from workbench.bench.project import registry

REFERENCE = Path(__file__).parents[2] / "results" / "reference"


@pytest.fixture(scope="session")
def reference():
    """The reference run of a problem; by method and parameters where it has several.

    Parameters that are not named have their defaults, where there is such a run.
    """

    def find(name, method=None, **parameters):
        runs = [wb.open_run(folder) for folder in (REFERENCE / name).iterdir()]
        fitting = [
            run
            for run in runs
            if method in (None, run.method) and parameters.items() <= run.info["parameters"].items()
        ]
        changed = [len(not_default(run) - parameters.keys()) for run in fitting]
        (run,) = (run for run, n in zip(fitting, changed, strict=True) if n == min(changed))
        return run

    return find


def not_default(run):
    """Names of the parameters of a run that are not at their defaults."""
    defaults = registry().find(run.problem).parameters
    given = run.info["parameters"].items()
    return {name for name, value in given if name in defaults and value != defaults[name].default}


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
