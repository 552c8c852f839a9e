"""A fast test that takes too long fails, and one that is marked slow does not."""

import os
import subprocess
import sys
from functools import partial
from pathlib import Path

import pytest

CONFTEST = """
import cpu_seconds

cpu_seconds.LIMIT = 0.02
cpu_seconds.LIMIT_OF_ALL = 0.01

def pytest_addoption(parser):
    parser.addoption("--sampled", action="store_true")

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
def said(tmp_path):
    """What pytest says of these tests, with some words."""
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
    run = partial(subprocess.run, cwd=tmp_path, env=own, capture_output=True, text=True)
    return lambda *more: run([*words, *more])


def test_a_fast_test_above_the_limit_fails(said):
    report = said().stdout
    outcomes = {"quick": "PASSED", "itself": "FAILED", "its_setup": "FAILED"}
    outcomes |= {"its_child": "FAILED", "slow": "PASSED", "compiles": "PASSED"}
    for name, outcome in outcomes.items():
        assert f"{outcome} test_some.py::test_{name}" in report, report
    assert "s of processor time, a test that is not marked slow at most 0.02 s" in report


def test_a_sample_that_takes_too_long_fails_as_a_whole(said):
    told = "the sample of all tests is to take at most 0.01 s"
    whole, sample = said("-k", "slow"), said("-k", "slow", "--sampled")
    assert whole.returncode == 0 and told not in whole.stdout
    assert sample.returncode == 1 and told in sample.stdout
