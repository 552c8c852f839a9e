"""A fast test that takes too long fails, and one that is marked slow does not."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

CONFTEST = """
import cpu_seconds

cpu_seconds.LIMIT = 0.02

def pytest_configure(config):
    config.addinivalue_line("markers", "slow: takes long")
    config.pluginmanager.register(cpu_seconds.CpuSeconds(config))
"""
TESTS = """
import subprocess, sys, time
import pytest

SPIN = "import time\\nwhile time.process_time() < 0.2: pass"

def spin():
    until = time.process_time() + 0.1
    while time.process_time() < until:
        pass

@pytest.fixture
def made():
    spin()

def test_quick(): time.sleep(0.1)
def test_itself(): spin()
def test_its_setup(made): pass
def test_its_child(): subprocess.run([sys.executable, "-c", SPIN], check=True)
@pytest.mark.slow
def test_slow(): spin()
def test_compiles(pytestconfig):
    spin()
    (pytestconfig.rootpath / "workbench" / "new.nbi").touch()
"""


@pytest.fixture
def report(tmp_path):
    """What pytest says of these tests."""
    (tmp_path / "workbench").mkdir()
    (tmp_path / "problems").mkdir()
    (tmp_path / "conftest.py").write_text(CONFTEST)
    (tmp_path / "test_some.py").write_text(TESTS)
    (tmp_path / "pyproject.toml").write_text(
        f'[tool.pytest.ini_options]\npythonpath = ["{Path(__file__).parent.as_posix()}"]\n'
    )
    words = [sys.executable, "-m", "pytest", "-rA", "-p", "no:xdist"]
    # What is compiled for another processor lies elsewhere, where the small checkout has nothing.
    own = {name: value for name, value in os.environ.items() if name != "NUMBA_CACHE_DIR"}
    return subprocess.run(words, cwd=tmp_path, env=own, capture_output=True, text=True).stdout


def test_a_fast_test_above_the_limit_fails(report):
    outcomes = {"quick": "PASSED", "itself": "FAILED", "its_setup": "FAILED"}
    outcomes |= {"its_child": "FAILED", "slow": "PASSED", "compiles": "PASSED"}
    for name, outcome in outcomes.items():
        assert f"{outcome} test_some.py::test_{name}" in report, report
    assert "s of processor time, a test that is not marked slow at most 0.02 s" in report
