"""Processor time of every test; one that is not marked slow fails above `LIMIT`, a sample of all
tests, which is what `make test` runs, above `LIMIT_OF_ALL`.

Wall seconds tell how busy a machine is, processor seconds what a test asks of it. Those of the
processes that it started and waited for count too.
"""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

LIMIT = 5.0
"""Most processor seconds of a test that is not marked slow, where `yardstick` takes `REFERENCE`."""
LIMIT_OF_ALL = 600.0
"""Most processor seconds of a sample of all tests in a new checkout: 450, and 150 to compile;
two processors need about five minutes for the former."""
REFERENCE = 0.045
"""Processor seconds of `yardstick` where the limit was set; on a slower processor, or one that is
shared, a test may take longer in proportion."""
NOISE = 1.5
"""Processor seconds of a test differ with what else the processor does: for one, 3.9 to 5.6 were
seen. Only above this multiple of the limit is it certain that a test is beyond it."""
MODULES = 50
"""A test that is the first of its process to import so many modules is not judged by `LIMIT`."""
KEPT = "cpu_seconds.txt"
"""File below pytest's cache folder with the processor seconds of each test of the last session."""
NAME = "cpu_seconds"


def spent() -> float:
    """Processor seconds of this process so far, and of those that it has waited for."""
    times = os.times()
    return times.user + times.system + times.children_user + times.children_system


def yardstick() -> float:
    """Processor seconds of a fixed piece of work, now."""
    begun, total = time.process_time(), 0
    for k in range(1_000_000):
        total += k * k % 7
    return time.process_time() - begun


def beyond(seconds: float, limit: float) -> bool:
    """Whether it is certain that something takes longer than a limit, on this processor."""
    return seconds > NOISE * limit * max(1.0, yardstick() / REFERENCE)


class CpuSeconds:
    """Measures each test from the begin of its setup to the end of its call."""

    def __init__(self, config: pytest.Config) -> None:
        self.root, self.begun, self.since, self.modules = config.rootpath, 0.0, 0.0, 0
        self.seconds: dict[str, float] = {}
        self.told = ""

    @pytest.hookimpl(tryfirst=True)
    def pytest_runtest_setup(self) -> None:
        self.begun, self.since, self.modules = spent(), time.time(), len(sys.modules)

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_makereport(
        self, item: pytest.Item, call: pytest.CallInfo[None]
    ) -> Iterator[None]:
        report = yield
        if call.when == "call":
            seconds = spent() - self.begun
            report.user_properties.append((NAME, seconds))
            slow = item.get_closest_marker("slow") is not None
            if report.passed and not slow and self._too_long(seconds):
                report.outcome = "failed"
                report.longrepr = (
                    f"{item.nodeid} took {seconds:.1f} s of processor time, a test that is not "
                    f"marked slow at most {LIMIT:g} s: make it smaller, share what it makes, or "
                    "mark it slow and keep a quick part of it"
                )
        return report

    def _too_long(self, seconds: float) -> bool:
        """Whether a test took longer than the limit on this processor, not being the first."""
        return seconds > NOISE * LIMIT and not self._is_first() and beyond(seconds, LIMIT)

    def _is_first(self) -> bool:
        """Whether much was imported since the test began, or anything compiled.

        The one happens once in a process, the other once in a checkout, whichever test comes first.
        """
        if len(sys.modules) - self.modules >= MODULES:
            return True
        own = os.environ.get("NUMBA_CACHE_DIR")
        folders = [Path(own)] if own else [self.root / "workbench", self.root / "problems"]
        files = (file for folder in folders for file in folder.rglob("*.nbi"))
        return any(file.stat().st_mtime >= self.since for file in files)

    # --- in the process that collects the reports of the workers -------------------------------

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        if report.when == "call":
            self.seconds[report.nodeid] = dict(report.user_properties).get(NAME, 0.0)

    def pytest_sessionfinish(self, session: pytest.Session) -> None:
        """A sample that takes too long fails as a whole."""
        sampled = session.config.getoption("sampled", default=False)
        if sampled and beyond(sum(self.seconds.values()), LIMIT_OF_ALL):
            self.told = (
                f"the sample of all tests is to take at most {LIMIT_OF_ALL:g} s: make its dearest "
                f"tests smaller, or mark them cases(0); pytest's cache has them in {KEPT}"
            )
            session.exitstatus = pytest.ExitCode.TESTS_FAILED

    def pytest_terminal_summary(self, terminalreporter: pytest.TerminalReporter) -> None:
        ordered = sorted(self.seconds.items(), key=lambda pair: -pair[1])
        total = sum(self.seconds.values())
        terminalreporter.write_line(f"{total:.0f} s of processor time in {len(ordered)} tests")
        if self.told:
            terminalreporter.write_line(self.told)
        if cache := getattr(terminalreporter.config, "cache", None):
            lines = [f"{seconds:8.2f} {test}\n" for test, seconds in ordered]
            (cache.mkdir("seconds") / KEPT).write_text("".join(lines), encoding="utf-8")
