"""An answer goes stale by what its Program, method and checks import, and by nothing else."""

import importlib
import sys

import pytest

import workbench as wb
from workbench.bench import code
from workbench.bench.code import closure, code_hash

FILES = {
    "__init__.py": "from pkg.room import peak as top\n",
    "problem.py": "from pkg.room import peak\nimport pkg.checks as checks\nchecks.run()\n",
    "checks.py": "import scipy.linalg\n",
    "room/__init__.py": (
        "from pkg.room.upper import peak\nfrom pkg.room.lower import power\nLIMIT = 1\n"
    ),
    "room/upper.py": "import numpy as np\nfrom . import shared\n",
    "room/lower.py": "import cvxpy\n",
    "room/shared.py": "def f():\n    from pkg.late import g\n    return g\n",
    "late.py": "",
    "typed.py": (
        "from typing import TYPE_CHECKING\nif TYPE_CHECKING:\n    from pkg.late import g\n"
    ),
    "whole.py": "import pkg.room\n",
    "through.py": "import pkg as p\nfrom pkg import room\np.top()\nroom.power()\n",
    "constant.py": "from pkg.room import LIMIT\n",
    "star.py": "from pkg.room import *\n",
    "cyclic.py": "from pkg.cycle import x\n",
    "cycle.py": "from pkg.cyclic import y\n",
}


@pytest.fixture
def package(tmp_path, monkeypatch):
    """A package of its own, written and importable; edits count at once."""
    for name, text in FILES.items():
        file = tmp_path / "pkg" / name
        file.parent.mkdir(exist_ok=True, parents=True)
        file.write_text(text)
    monkeypatch.syspath_prepend(tmp_path)
    package = type(sys)("pkg")
    package.__path__ = [str(tmp_path / "pkg")]
    monkeypatch.setitem(sys.modules, "pkg", package)
    return tmp_path / "pkg"


CLOSURES = {
    "problem": {"problem", "checks", "room.upper", "room.shared", "late"},
    "checks": {"checks"},
    "typed": {"typed"},
    "whole": {"whole", "room", "room.upper", "room.lower", "room.shared", "late"},
    "constant": {"constant", "room", "room.upper", "room.lower", "room.shared", "late"},
    "star": {"star", "room", "room.upper", "room.lower", "room.shared", "late"},
    "cyclic": {"cyclic", "cycle"},
}


@pytest.mark.parametrize("name", CLOSURES)
def test_imports_are_followed_to_what_defines_them(package, name):
    found, _ = closure([f"pkg.{name}"])
    assert {one.removeprefix("pkg.") for one in found} == CLOSURES[name]


def test_a_name_taken_through_a_package_leads_to_what_defines_it(package):
    found, _ = closure(["pkg.through"])
    assert {"pkg.through", "pkg.room.upper", "pkg.room.lower"} <= found.keys()


def test_other_packages_are_told_by_name(package):
    _, packages = closure(["pkg.problem"])
    assert packages & {"numpy", "scipy", "cvxpy"} == {"numpy", "scipy"}


@pytest.mark.parametrize(
    ("edited", "stale"),
    [("room/upper.py", True), ("late.py", True), ("room/lower.py", False), ("typed.py", False)],
)
def test_an_edit_counts_where_it_is_imported(package, edited, stale):
    before = code_hash(["pkg.problem"])
    file = package / edited
    file.write_text(file.read_text() + "x = 1\n")
    assert (code_hash(["pkg.problem"]) != before) is stale


def test_the_hash_is_that_of_the_text_wherever_it_lies(package, tmp_path, monkeypatch):
    """A problem folder gets a package whose name depends on its place."""
    before = code_hash(["pkg.checks"])
    hashes = set()
    for name in ("workbench_problems_1", "workbench_problems_2"):
        root = type(sys)(name)
        root.__path__ = [str(package)]
        monkeypatch.setitem(sys.modules, name, root)
        hashes.add(code_hash([f"{name}.checks"]))
    assert len(hashes) == 1 and before not in hashes


@pytest.mark.parametrize(
    ("package_name", "counts"), [("scipy", True), ("cvxpy", False), ("xarray", False)]
)
def test_versions_count_of_the_solvers_that_are_imported(
    package, monkeypatch, package_name, counts
):
    before = code_hash(["pkg.problem"])
    real = code.versions
    monkeypatch.setattr(
        code,
        "versions",
        lambda packages: {
            n: v + "x" * (n == package_name) for n, v in real(packages=packages).items()
        },
    )
    assert (code_hash(["pkg.problem"]) != before) is counts


def test_a_solver_that_a_method_calls_by_name_counts(package):
    assert code_hash(["pkg.checks"]) != code_hash(["pkg.checks"], ["scs"])


def test_what_was_fed_counts(package):
    assert (
        len({code_hash(["pkg.checks"], (), fed) for fed in ((), ("a",), ("b",), ("a", "b"))}) == 4
    )


def test_a_module_without_a_file_has_no_code(package):
    assert closure(["builtins", "__main__"])[0].keys() <= {"__main__"}


def test_one_room_of_the_workbench_changes_without_the_others():
    circle, _ = closure(["workbench.geometry.circle"])
    assert "workbench.certify.cones.form" in circle
    assert not any(name.startswith(("workbench.mu", "workbench.bench")) for name in circle)


def test_a_helper_outside_of_the_package_counts(package, tmp_path, monkeypatch):
    """A module of the user's, which is not installed, changes what imports it."""
    (tmp_path / "helper_of_mine.py").write_text("FACTOR = 1\n")
    (package / "helped.py").write_text("import helper_of_mine\nimport json, numpy\n")
    importlib.import_module("helper_of_mine")
    monkeypatch.setitem(sys.modules, "helper_of_mine", sys.modules["helper_of_mine"])
    assert code.helper_modules(["pkg.helped"]) == {"helper_of_mine"}
    before = code_hash(["pkg.helped"])
    assert before != code_hash(["pkg.checks"])
    (tmp_path / "helper_of_mine.py").write_text("FACTOR = 20\n")
    assert code_hash(["pkg.helped"]) != before
    found, packages = closure(["pkg.helped"])
    assert "helper_of_mine" in found and {"json", "numpy"} <= packages


@pytest.mark.parametrize("linked", [False, True])
def test_packages_of_a_searched_folder_are_installed(package, tmp_path, monkeypatch, linked):
    """Overlays of environments put packages on the path by PYTHONPATH or .pth files: they count by
    name, whether or not they are imported yet.
    """
    kept, layer, name = tmp_path / "kept", tmp_path / "layer", f"layered_{linked}"
    (kept if linked else layer).mkdir()
    layer.mkdir(exist_ok=True)
    (layer / f"{name}-1.0.dist-info").mkdir()
    ((kept if linked else layer) / f"{name}.py").write_text("VALUE = 1\n")
    if linked:
        try:
            (layer / f"{name}.py").symlink_to(kept / f"{name}.py")
        except OSError:
            pytest.skip("this system makes no links")
    (package / "above.py").write_text(f"import {name}\n")
    monkeypatch.syspath_prepend(layer)
    code._installed.cache_clear()
    code._is_installed.cache_clear()
    before = code_hash(["pkg.above"])
    monkeypatch.setitem(sys.modules, name, importlib.import_module(name))
    assert code_hash(["pkg.above"]) == before
    found, packages = closure(["pkg.above"])
    assert name in packages and name not in found
    code._installed.cache_clear()


def test_an_edit_of_a_helper_is_run_and_not_found_stored(tmp_path, monkeypatch, project):
    (tmp_path / "gain_of_mine.py").write_text("GAIN = 1.0\n")
    monkeypatch.syspath_prepend(tmp_path)
    project.write(
        "plants/helped/problems.py",
        "import numpy as np\nfrom gain_of_mine import GAIN\nfrom workbench import problem\n"
        "from workbench.geometry import SmallestCircle\n\n"
        '@problem("helped/circle")\ndef circle():\n'
        '    """A circle."""\n    return SmallestCircle(GAIN * np.array([0, 1, 1j]))\n',
    )
    before = wb.run("helped/circle").value
    assert wb.run("helped/circle").reused
    (tmp_path / "gain_of_mine.py").write_text("GAIN = 2.0 + 0\n")
    second = wb.run("helped/circle")
    assert not second.reused
    assert second.value == pytest.approx(2 * before)
    sys.modules.pop("gain_of_mine")
