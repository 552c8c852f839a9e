"""Without slycot everything imports, SLICOT's methods are unfit, and errors say what to do."""

import importlib.util
import subprocess
import sys

import pytest

import workbench as wb
from workbench import solvers
from workbench.errors import SolverError, WorkbenchError

WITHOUT = """
import importlib.abc, sys

class Absent(importlib.abc.MetaPathFinder):
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] == "slycot":
            raise ModuleNotFoundError(name)

sys.meta_path.insert(0, Absent())
import workbench, workbench.mu, workbench.synthesis, workbench.diagnosis, workbench.fitting
import workbench.uncertainty, workbench.identification, workbench.simulation
assert "slycot" not in sys.modules
run = workbench.run("cd/focus/circles", frequencies=3)
print(run.holds)
"""


@pytest.mark.cases(0)
def test_everything_imports_without_it(tmp_path):
    words = [sys.executable, "-c", WITHOUT]
    done = subprocess.run(words, cwd=tmp_path, capture_output=True, text=True)
    assert done.stdout.strip() == "True", done.stderr


@pytest.fixture
def absent(monkeypatch):
    real = importlib.util.find_spec
    monkeypatch.setattr(
        importlib.util,
        "find_spec",
        lambda name, *rest: None if name == "slycot" else real(name, *rest),
    )
    solvers.slycot_missing.cache_clear()
    yield
    solvers.slycot_missing.cache_clear()


@pytest.mark.parametrize(
    ("name", "method"),
    [("quick/unstable-first-order/hinf", "sb10ad"), ("quick/distillation/mu-upper", "ab13md")],
)
def test_methods_of_slicot_are_unfit(absent, name, method):
    with pytest.raises(WorkbenchError, match="slycot is not installed"):
        wb.solve(wb.load(name), method=method)


def test_a_routine_says_that_it_is_needed(absent):
    with pytest.raises(SolverError, match=r"AB13DD is needed.*conda"):
        solvers.slicot_routine("ab13dd")
