"""Examination of the installation: versions, solvers, threads, cache, and a self-test."""

from __future__ import annotations

import os
import platform
import shutil
import tempfile
import time
import warnings
from collections.abc import Iterator
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

import workbench
from workbench.bench.project import registry, results_root
from workbench.errors import WorkbenchError
from workbench.solvers import conic_solvers

SOLVERS = {
    "clarabel": "Clarabel",
    "scs": "SCS",
    "cvxopt": "CVXOPT",
    "highspy": "HiGHS",
    "osqp": "OSQP",
    "piqp": "PIQP",
    "qoco": "QOCO",
    "sdpa-python": "SDPA",
}
"""Names of the conic solvers by their distributions."""
GROUND = ("numpy", "scipy", "numba", "control", "cvxpy", "casadi", "python-flint", "xarray")
"""Distributions whose version can change an answer or a time."""


@dataclass(frozen=True)
class Examined:
    """A line of the examination: what it is, what was found, and what to do, if anything."""

    topic: str
    found: str
    advice: str = ""
    well: bool = True


def examination(*, test: bool = True) -> Iterator[Examined]:
    """Yield the findings, one after the other; with ``test`` the self-test comes last."""
    place = Path(workbench.__file__).parent
    yield Examined("robust-workbench", f"{workbench.__version__}, imported from {place}")
    yield _twins()
    yield Examined("python", f"{platform.python_version()}, {platform.platform()}")
    for name in GROUND:
        yield _package(name)
    yield _slycot()
    yield _solvers()
    yield _threads()
    yield _cache()
    yield from _roads(test)
    yield _compiler()
    yield Examined("problems", f"{len(registry().entries)} named", "; ".join(registry().unfit))
    yield Examined("results", str(results_root()))
    if test:
        yield from _self_test()


def _version(name: str) -> str | None:
    try:
        return version(name)
    except PackageNotFoundError:
        return None


def _package(name: str) -> Examined:
    found = _version(name)
    if found is None:
        return Examined(name, "missing", f"pip install {name}", well=False)
    return Examined(name, found)


def _twins() -> Examined:
    """Check whether the other distribution that is imported as `workbench` is installed too."""
    other = _version("workbench")
    if other is None or _version("robust-workbench") is None:
        return Examined("import name", "workbench is this project's alone")
    words = "one of both has overwritten files of the other: use an environment for each"
    return Examined("import name", f"the distribution workbench {other} is here too", words, False)


def _slycot() -> Examined:
    found = _version("slycot")
    if found is not None:
        return Examined("slycot", found)
    words = (
        "methods of SLICOT and what needs its routines (reduction, Gramians) will stop with an "
        "error that says so: pip install slycot, or conda install -c conda-forge slycot"
    )
    return Examined("slycot", "missing", words, well=False)


def _solvers() -> Examined:
    """The installed conic solvers, which of them are used as methods, and how to add more."""
    named = ", ".join(solver.name for solver in conic_solvers())
    versions = {name: _version(name) for name in SOLVERS}
    here = ", ".join(f"{SOLVERS[name]} {found}" for name, found in versions.items() if found)
    missing = [name for name, found in versions.items() if found is None]
    words = f"pip install 'robust-workbench[solvers]' brings {', '.join(missing)}"
    told = f"{here}; methods: {named}, and others by [tool.workbench] solvers = [...]"
    return Examined("conic solvers", told, words if missing else "")


def _threads() -> Examined:
    """Linear algebra libraries and their numbers of threads."""
    import numpy as np
    from threadpoolctl import threadpool_info

    np.linalg.norm(np.eye(2), 2)  # importing it loads the library
    pools = {
        f"{one['internal_api']} {one.get('version') or ''}".strip(): one["num_threads"]
        for one in threadpool_info()
    }
    told = ", ".join(f"{name}: {count} threads" for name, count in pools.items())
    cores = os.cpu_count() or 1
    words = ""
    if any(count > 1 for count in pools.values()) and "OPENBLAS_NUM_THREADS" not in os.environ:
        words = "for many small problems at once (--jobs): export OPENBLAS_NUM_THREADS=1"
    return Examined("linear algebra", f"{told}; {cores} cores", words)


def _cache() -> Examined:
    """The folder where Numba caches compiled code, and whether it can be written."""
    place = Path(os.environ.get("NUMBA_CACHE_DIR", Path(workbench.__file__).parent))
    if os.access(place, os.W_OK):
        return Examined("cache of Numba", str(place))
    words = (
        "it cannot be written, so that every start compiles: export NUMBA_CACHE_DIR=~/.cache/numba"
    )
    return Examined("cache of Numba", str(place), words, well=False)


def _roads(test: bool) -> Iterator[Examined]:
    """The fast roads through machine code; with ``test`` that of simulations makes its self-test.

    That of mu would compile for half a minute the first time, so only its release is looked at.
    """
    from workbench._core.machine_code.door import check_releases
    from workbench.simulation.road import SIMULATION

    words = "results stay the same and take longer; install a release that was tested"
    try:
        check_releases()
        reason = ""
    except ImportError as error:
        reason = str(error)
    found = reason or "releases of Numba and llvmlite that were tested"
    yield Examined("machine code", found, words if reason else "", not reason)
    if test and not reason:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # the line below says it
            SIMULATION.taken()
        reason = SIMULATION.reason
        found = reason or "self-test passed"
        yield Examined("machine code: simulations", found, words if reason else "", not reason)


def _compiler() -> Examined:
    """A C compiler, which only exported controllers need."""
    found = shutil.which("cc") or shutil.which("gcc") or shutil.which("clang")
    return Examined("C compiler", found or "none; only tests of exported C code need one")


TESTS: tuple[tuple[str, str, dict[str, Any]], ...] = (
    ("smallest circles", "cd/focus/circles", {"frequencies": 5}),
    ("H-infinity synthesis", "quick/unstable-first-order/hinf", {}),
    ("dwell time", "quick/cart/dwell", {}),
)
"""Name, problem and parameters of each self-test; each has a certificate.

Together they call compiled loops, SLICOT, a conic solver and ball arithmetic. Bounds of mu are not
among them: where they are asked for the first time, Numba compiles for a minute.
"""


def _self_test() -> Iterator[Examined]:
    """Solve and certify small problems of several kinds, in a temporary folder."""
    before = os.environ.get("WORKBENCH_RESULTS")
    with tempfile.TemporaryDirectory() as folder:
        os.environ["WORKBENCH_RESULTS"] = folder
        try:
            for title, name, parameters in TESTS:
                started = time.perf_counter()
                try:
                    run = workbench.run(name, fresh=True, **parameters)
                    said = "certificate holds" if run.holds else f"{run.outcome}: no certificate"
                    well, advice = run.holds, "" if run.holds else run.outcome.advice
                except (WorkbenchError, ImportError, OSError) as error:
                    said, well, advice = f"{type(error).__name__}: {error}", False, ""
                took = time.perf_counter() - started
                advice = advice or ("" if well else f"workbench run {name} --verbose says more")
                yield Examined(f"test: {title}", f"{said}, {took:.1f} s", advice, well)
        finally:
            if before is None:
                del os.environ["WORKBENCH_RESULTS"]
            else:
                os.environ["WORKBENCH_RESULTS"] = before
