"""The Python face."""

import importlib

import pytest

import workbench as wb


@pytest.mark.parametrize("name", wb.__all__)
def test_every_public_name_is_there_with_help(name):
    found = getattr(wb, name)
    assert name == "__version__" or found.__doc__
    assert name in dir(wb)


def test_an_unknown_name_is_an_attribute_error():
    with pytest.raises(AttributeError, match="no attribute 'rnu'"):
        _ = wb.rnu
    assert not hasattr(wb, "numpy")


HEAVY = {
    "numpy",
    "scipy",
    "cvxpy",
    "casadi",
    "matplotlib",
    "xarray",
    "control",
    "numba",
    "pydantic",
}


@pytest.mark.parametrize(
    "code", ["import workbench", "import workbench as wb; assert {*wb.__all__} <= {*dir(wb)}"]
)
def test_importing_the_workbench_imports_nothing_heavy(project, code):
    loaded = project.python(f"{code}\nimport sys\nprint(*sys.modules)")
    assert not HEAVY & set(loaded.split())


def test_the_problems_are_a_table_that_is_not_imported(project):
    project.edit("OFFSET = 0.0", "raise RuntimeError('imported')")
    found = wb.problems("toy/*root")
    assert [entry.name for entry in found] == ["toy/root", "toy/x/root", "toy/y/root"]
    assert len(found) == 3 and found[0].name == "toy/root"
    assert repr(found).splitlines()[0] == "toy/root    Least roots of the targets (table 1)."


def test_the_problems_that_come_with_the_workbench_are_there(project):
    names = [entry.name for entry in wb.problems("cd/*")]
    assert {"cd/focus/circles", "cd/radial/stadiums"} <= set(names)
    assert all(entry.summary for entry in wb.problems("cd/*"))


def test_a_problem_is_loaded_with_its_data_and_solved_by_hand(project):
    program = wb.load("toy/root", scale=4)
    assert program.targets == (4.0, 16.0, 8.0)
    solution = wb.solve(program, method="rough")
    assert solution.outcome is wb.Outcome.SOLVED and solution.answer[0] == 3.0
    assert not project.results.exists()


def test_run_results_and_verify_agree(project):
    run = wb.run("toy/root", method="rough", scale=4)
    (found,) = wb.results("toy/*")
    assert found.path == run.path and found.metrics == run.metrics
    assert wb.verify(found.path).certificate == run.certificate


def test_progress_is_handed_to_the_method(project):
    told = []
    wb.run("toy/root", method="patient", progress=lambda *what: told.append(what))
    assert told[0] == ("waiting", 0, 1000) and told[-1] == ("waiting", 1000, 1000)


@pytest.mark.cases(1)
@pytest.mark.parametrize(("verbose", "printed"), [(False, False), (True, True)])
def test_a_problem_of_the_workbench_runs_and_is_verified(project, capfd, verbose, printed):
    run = wb.run("cd/focus/circles", method="clarabel", frequencies=3, verbose=verbose)
    assert run.holds and run.certificate.gap.required
    assert wb.verify(run.path).holds
    assert ("Clarabel" in "".join(capfd.readouterr())) is printed


def test_an_added_folder_is_there_at_once(project):
    project.write(
        "mine/p.py",
        'from workbench import problem\n@problem("mine/a")\ndef f():\n    """Help."""\n',
    )
    assert "mine/a" not in [entry.name for entry in wb.problems()]
    wb.add_problems("mine")
    assert [entry.summary for entry in wb.problems("mine/*")] == ["Help."]


def test_names_are_found_where_type_checkers_look():
    assert wb.Run is importlib.import_module("workbench.bench.results").Run
