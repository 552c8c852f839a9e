"""A Dask scheduler and its workers on this machine, as programs that end with their caller."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
import time
from contextlib import suppress
from pathlib import Path
from typing import Any

from workbench.errors import ClusterError
from workbench.executor.workers import KILLS, search_path

START = 30.0
"""Time within which a scheduler must have started [s]."""


class LocalCluster:
    """A scheduler and workers on this machine.

    Each worker is a process that does one task at a time.

    They are started as programs, since processes started by `multiprocessing` would run the
    caller's script again. They end with this object, or with the caller's process.
    """

    def __init__(self, workers: int) -> None:
        self.workers = workers
        self._folder = tempfile.TemporaryDirectory(ignore_cleanup_errors=True)
        told = Path(self._folder.name) / "scheduler.json"
        own = {"host": "127.0.0.1", "dashboard": False, "scheduler_file": str(told)}
        self._processes = [self._start("distributed.Scheduler", own)]
        try:
            self.address = self._address(told)
        except BaseException:
            self.end()
            raise
        each = {"nthreads": 1, "memory_limit": 0, "dashboard": False}
        self._processes += [
            self._start("distributed.Nanny", each, self.address) for _ in range(workers)
        ]

    def _start(self, kind: str, settings: dict[str, Any], *where: str) -> subprocess.Popen[bytes]:
        spec = json.dumps({"cls": kind, "opts": settings})
        variables = {
            f"DASK_{name.upper().replace('.', '__')}".replace("-", "_"): repr(value)
            for name, value in SETTINGS.items()
        }
        return subprocess.Popen(
            [sys.executable, "-c", SERVE_DASK, *where, "--spec", spec],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,  # an error of a task reaches its future
            cwd=self._folder.name,  # folder for the workers' temporary files
            env=os.environ | variables | {"PYTHONPATH": search_path()},
        )

    def _address(self, told: Path) -> str:
        """The scheduler's address, once it has written it to the file."""
        until = time.monotonic() + START
        while time.monotonic() < until and self._processes[0].poll() is None:
            with suppress(OSError, ValueError):  # not there yet, or incomplete
                return str(json.loads(told.read_text(encoding="utf-8"))["address"])
            time.sleep(0.02)
        raise ClusterError("a Dask scheduler on this machine did not start")

    def end(self) -> None:
        """Kill the scheduler, the workers, and the processes that they have started."""
        import psutil

        for process in self._processes:
            with suppress(psutil.Error):
                for child in psutil.Process(process.pid).children(recursive=True):
                    with suppress(psutil.Error):
                        child.kill()
            process.kill()
            process.wait()
        self._folder.cleanup()


SERVE_DASK = (
    "from workbench.executor.worker import die_with_parent; die_with_parent(); "
    "from distributed.cli.dask_spec import main; main()"
)
"""Program of each process of a local cluster."""
SETTINGS = {
    "distributed.scheduler.allowed-failures": KILLS - 1,
    "distributed.scheduler.worker-ttl": None,  # a worker whose solver holds the GIL is not dead
    "distributed.admin.tick.limit": "1h",  # and no warning is needed
}
