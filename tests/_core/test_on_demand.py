"""Names of a room are imported when they are first asked for, and are what their modules define."""

import ast
import importlib
import subprocess
import sys
from pathlib import Path
from types import ModuleType

import pytest

import workbench

SOURCES = Path(workbench.__file__).parent
ROOMS = sorted(
    ".".join(file.parent.relative_to(SOURCES.parent).parts)
    for file in SOURCES.rglob("__init__.py")
    if "on_demand(__name__)" in file.read_text(encoding="utf-8")
)


def module_of(file):
    return ".".join(file.relative_to(SOURCES.parent).with_suffix("").parts)


def test_all_large_rooms_are_among_them():
    wanted = {"fitting", "geometry", "identification", "mu", "synthesis", "uncertainty"}
    assert {"workbench", *(f"workbench.{room}" for room in wanted)} <= {*ROOMS}


@pytest.mark.parametrize("room", ROOMS)
def test_every_name_of_a_room_is_found_and_listed(room):
    package = importlib.import_module(room)
    for name in package.__all__:
        found = getattr(package, name)
        assert not isinstance(found, ModuleType), name
        assert name in dir(package)


@pytest.mark.parametrize("room", ROOMS)
def test_no_name_of_a_room_is_that_of_a_module_in_it(room):
    """Python would hand over the module, once it is imported."""
    package = importlib.import_module(room)
    below = {file.stem for file in Path(package.__file__).parent.iterdir()}
    assert not below & {*package.__all__}


def test_a_name_that_a_room_does_not_have_is_refused_as_by_python():
    import workbench.mu

    with pytest.raises(AttributeError, match=r"module 'workbench\.mu' has no attribute 'mu_bound'"):
        workbench.mu.mu_bound  # noqa: B018
    with pytest.raises(ImportError, match="cannot import name 'mu_bound'"):
        from workbench.mu import mu_bound  # noqa: F401
    assert not hasattr(workbench.mu, "__wrapped__")


def test_a_statement_runs_when_one_of_its_names_is_asked_for(tmp_path, monkeypatch):
    (tmp_path / "shelf").mkdir()
    (tmp_path / "shelf" / "__init__.py").write_text(
        "from typing import TYPE_CHECKING\nfrom workbench._core.on_demand import on_demand\n"
        "if TYPE_CHECKING:\n    from shelf.books import atlas as map, novel\n"
        "else:\n    __getattr__, __dir__ = on_demand(__name__)\n"
        '__all__ = ["map", "novel"]\n'
    )
    (tmp_path / "shelf" / "books.py").write_text("atlas, novel = 'atlas', 'novel'\n")
    monkeypatch.syspath_prepend(tmp_path)
    import shelf

    assert {"map", "novel"} <= {*dir(shelf)} and "shelf.books" not in sys.modules
    assert shelf.map == "atlas" and vars(shelf)["novel"] == "novel"
    assert not hasattr(shelf, "atlas")


def test_a_room_alone_imports_nothing_else():
    code = (
        "import sys, workbench.synthesis; "
        "print(*(name for name in sys.modules if name.startswith('workbench')))"
    )
    told = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert {*told.stdout.split()} == {
        "workbench",
        "workbench._core",
        "workbench._core.on_demand",
        "workbench.synthesis",
    }


def test_modules_of_methods_are_named_by_their_programs():
    """A method that nothing imports would not be found."""
    named, register, programs = set(), set(), set()
    for file in SOURCES.rglob("*.py"):
        if "plants" in file.parts or (file.name == "program.py" and file.parent == SOURCES):
            continue
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
            if isinstance(node, ast.AnnAssign) and ast.unparse(node.target) == "methods_in":
                named |= {*ast.literal_eval(node.value)}
                programs.add(module_of(file))
            called = node.func if isinstance(node, ast.Call) else None
            if isinstance(called, ast.Name) and called.id in ("method", "conic_method"):
                register.add(module_of(file))
    assert len(register) > 30
    own = {
        "workbench.conic.program",
        "workbench.conic.cvxpy_program",
        "workbench.geometry.circle",
        "workbench.geometry.stadium",
    }
    unnamed = register - named - {*own, "workbench.synthesis.h_infinity.loop_shaping", *programs}
    assert not unnamed, f"add to methods_in of the Program, or of its base class: {unnamed}"
    assert named <= register, f"no methods are registered in {named - register}"


def test_a_room_is_imported_when_it_is_asked_for():
    code = """
import sys, workbench as wb
assert {*filter(lambda name: name.startswith("workbench"), sys.modules)} == {
    "workbench", "workbench._core", "workbench._core.on_demand"
}
assert "mu" in dir(wb) and "workbench.mu" not in sys.modules
found = wb.mu.robust_stability
from workbench import mu, structure
assert mu is sys.modules["workbench.mu"] and mu.robust_stability is found
assert structure is wb.structure
"""
    subprocess.run([sys.executable, "-c", code], check=True)


def test_every_public_room_is_found_through_the_package(monkeypatch):
    monkeypatch.syspath_prepend(SOURCES.parent / "docs" / "_tools")
    from api_pages import ROOMS as PUBLIC

    below = [room.partition(".")[2] for room in PUBLIC if room.count(".") == 1]
    assert {*below} <= {*dir(workbench)} and len(below) > 15
    for name in below:
        assert getattr(workbench, name) is sys.modules[f"workbench.{name}"]
    for room in PUBLIC:
        with pytest.raises(AttributeError, match="MATLAB's hinfsyn is"):
            importlib.import_module(room).hinfsyn  # noqa: B018
