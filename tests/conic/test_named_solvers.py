"""Further solvers of CVXPY, by name: what they take, what they are told, who finds them."""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import workbench as wb
from workbench import program, solvers
from workbench.conic import ConeFactor, ConeKind, ConicForm, ConicProgram
from workbench.conic.named_solvers import _SETTINGS, conic_solver
from workbench.errors import InputError, UnknownNameError
from workbench.geometry import SmallestCircle
from workbench.program import methods
from workbench.solvers import ConicSolver, Options, add_conic_solver

FREE = {
    "highs": "linear", "osqp": "linear", "piqp": "linear",
    "qoco": "second-order", "sdpa": "semidefinite",
}  # fmt: skip
POINTS = np.array([[0j, 2, 1 + 0.5j]])
PROGRAMS = {  # the least x with x >= 3 in each cone
    "linear": ConicProgram(
        ConicForm([1.0], [[-1.0]], [-3.0], [ConeFactor(ConeKind.NONNEGATIVE, 1)])
    ),
    "second-order": ConicProgram(
        ConicForm([1.0], [[-1.0], [0.0]], [0.0, 3.0], [ConeFactor(ConeKind.SECOND_ORDER, 2)])
    ),
    "semidefinite": ConicProgram(
        ConicForm(
            [1.0], [[-1.0], [0.0], [-1.0]], [0.0, 3.0, 0.0], [ConeFactor(ConeKind.SEMIDEFINITE, 2)]
        )
    ),
}
ORDER = list(PROGRAMS)


@pytest.fixture(autouse=True)
def kept(monkeypatch):
    """Solvers that a test adds are gone behind it, and no others: methods are imported before."""
    methods(SmallestCircle(POINTS))
    monkeypatch.setattr(solvers, "_CONIC", [*solvers._CONIC])
    known = {kind: dict(entries) for kind, entries in program._METHODS.items()}
    monkeypatch.setattr(program, "_METHODS", known)


@pytest.mark.parametrize("cones", PROGRAMS)
@pytest.mark.parametrize("name", FREE)
def test_a_free_solver_serves_what_it_takes_and_is_unfit_for_the_rest(name, cones):
    assert conic_solver(name).widest == FREE[name]
    task = PROGRAMS[cones]
    if ORDER.index(cones) > ORDER.index(FREE[name]):
        with pytest.raises(
            InputError, match=f"{name} takes {FREE[name]} cones only, it has {cones}"
        ):
            wb.solve(task, method=name)
        return
    solution = wb.solve(task, method=name)
    assert solution.outcome == "solved", solution.message
    assert solution.answer["x"].values == pytest.approx([3.0], abs=1e-5)


def test_a_solver_is_a_method_of_every_program_that_was_stated_before():
    conic_solver("qoco")
    conic_solver("osqp")
    solution = wb.solve(SmallestCircle(POINTS), method="qoco")
    assert solution.certificate.holds
    assert methods(SmallestCircle)["qoco"].packages == ("qoco",)
    assert "takes linear cones only" in methods(SmallestCircle)["osqp"].unfit(
        SmallestCircle(POINTS)
    )


def test_a_name_is_registered_once():
    assert conic_solver("highs") is conic_solver("HiGHS")
    assert conic_solver("clarabel").name == "clarabel"
    with pytest.raises(InputError, match="'highs' is there already"):
        add_conic_solver(conic_solver("highs"))


def test_a_solver_with_other_settings_is_another_one():
    def hasty(options):
        return {"eps_abs": 1e-2, "eps_rel": 1e-2, "max_iters": 1}

    add_conic_solver(ConicSolver("scs-hasty", "scs", hasty, of_cvxpy="scs"))
    solution = wb.solve(SmallestCircle(POINTS), method="scs-hasty")
    assert solution.outcome == "inaccurate" and not solution.certificate.holds
    assert wb.solve(SmallestCircle(POINTS), method="scs").certificate.holds


def test_a_solver_that_is_not_there_says_what_to_install():
    with pytest.raises(InputError, match="mosek is not installed; try: pip install mosek"):
        conic_solver("mosek")
    with pytest.raises(InputError, match="try: pip install gurobipy"):
        conic_solver("gurobi")
    with pytest.raises(UnknownNameError, match="did you mean"):
        conic_solver("hihgs")


@pytest.mark.parametrize("name", _SETTINGS)
def test_accuracy_is_told(name):
    def numbers(accuracy):
        found = _SETTINGS[name](Options(tolerance=accuracy, time_limit=7.0))
        return {k: v for k, v in found.items() if isinstance(v, float) and v < 1}

    fine, coarse = numbers(1e-6), numbers(1e-3)
    assert fine and fine.keys() == coarse.keys()
    assert all(fine[k] < coarse[k] for k in fine)


PACKAGE = {
    "lens/__init__.py": "",
    "lens/problems/__init__.py": "",
    "lens/problems/spot.py": """
import numpy as np
from workbench import problem
from workbench.geometry import SmallestCircle

@problem("lens/spot")
def spot() -> SmallestCircle:
    \"\"\"The smallest circle around three points.\"\"\"
    return SmallestCircle(np.array([[0j, 2, 1 + 0.5j]]))
""",
    "lens/methods.py": """
from workbench.conic.named_solvers import conic_solver
conic_solver("qoco")
""",
    "lens-1.0.dist-info/METADATA": "Metadata-Version: 2.1\nName: lens\nVersion: 1.0\n",
    "lens-1.0.dist-info/entry_points.txt": """
[workbench.problems]
lens = lens.problems
[workbench.solvers]
lens = lens.methods
""",
}


def ran(folder: Path, *words: str, **environment: str):
    import os

    done = subprocess.run(
        [sys.executable, "-m", "workbench", *words],
        cwd=folder,
        env=os.environ | environment,
        capture_output=True,
        text=True,
    )
    return done.returncode, done.stdout, done.stderr


@pytest.mark.slow
def test_an_installed_package_brings_problems_and_solvers(tmp_path):
    site, work = tmp_path / "site", tmp_path / "work"
    for name, text in PACKAGE.items():
        (site / name).parent.mkdir(parents=True, exist_ok=True)
        (site / name).write_text(text)
    work.mkdir()
    status, out, said = ran(work, "list", "lens/*", PYTHONPATH=str(site))
    assert (status, out.split()[0]) == (0, "lens/spot"), said
    words = ("compare", "lens/spot", "--methods", "exact,qoco", "--accuracy", "middle", "--json")
    status, out, said = ran(work, *words, PYTHONPATH=str(site))  # cells in another process
    assert status == 0, said
    assert [cell["verdict"] for cell in json.loads(out)["cells"]] == ["solved", "solved"]


@pytest.mark.cases(1)
@pytest.mark.parametrize(
    ("points", "message"),
    [
        ("[workbench.problems]\nlens = nowhere.problems", "entry point lens = nowhere.problems: "),
        ("[workbench.problems]\nlens = json.tool", "json.tool is no package"),
        (
            "[workbench.solvers]\nlens = lens.absent",
            "entry point lens = lens.absent: ModuleNotFound",
        ),
    ],
)
def test_an_entry_point_that_leads_nowhere_costs_its_own_part_and_is_named(
    tmp_path, points, message
):
    (tmp_path / "lens-1.0.dist-info").mkdir()
    (tmp_path / "lens-1.0.dist-info/METADATA").write_text(PACKAGE["lens-1.0.dist-info/METADATA"])
    (tmp_path / "lens-1.0.dist-info/entry_points.txt").write_text(points)
    status, out, said = ran(tmp_path, "list", PYTHONPATH=str(tmp_path))
    assert status == 0 and message in said and "cd/focus/circles" in out, said


@pytest.mark.cases(0)
def test_a_project_names_its_solvers(tmp_path):
    (tmp_path / "pyproject.toml").write_text('[tool.workbench]\nsolvers = ["qoco"]\n')
    words = ("compare", "cd/focus/circles", "--set", "frequencies=20", "--methods", "qoco")
    status, out, said = ran(tmp_path, *words, "--accuracy", "middle", "--json")
    assert status == 0, said
    assert json.loads(out)["cells"][0]["verdict"] == "solved"


@pytest.mark.cases(0)
def test_solvers_of_a_project_that_are_none_are_named(tmp_path):
    (tmp_path / "pyproject.toml").write_text('[tool.workbench]\nsolvers = ["hihgs"]\n')
    status, out, said = ran(tmp_path, "run", "cd/focus/circles", "--set", "frequencies=50")
    assert status == 0 and "solver hihgs of pyproject.toml: " in said and "holds" in out
    (tmp_path / "pyproject.toml").write_text("[tool.workbench]\nsolvers = 3\n")
    status, _, said = ran(tmp_path, "list")
    assert status == 2 and "solvers must be a list of names, not 3" in said
