"""The user's way from records to C: `workbench init` and `workbench run` in an empty folder."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from workbench.types import ComplexArray, RealArray

from .simulators.recorder import write_records
from .simulators.stranger import Stranger

LONGEST = 3600.0
"""Longest time [s] that one command may take."""

EVIDENCE = """
import json, sys
import numpy as np
import workbench as wb

omega = np.load("omega.npy")
runs = {one.problem.rpartition("/")[2]: one for one in wb.results(sys.argv[1] + "/*")}
model, K = runs["cover"].answer.model, runs["controller"].answer.K
found = {name: getattr(model, name).response(omega) for name in ("nominal", "W_c")}
found["W_r"] = 0 * omega if model.W_r is None else model.W_r.response(omega)
found["K"] = np.asarray(K(1j * omega)).ravel()
told = {
    name: {"outcome": str(one.outcome), "holds": bool(one.holds), "metrics": one.metrics,
           "parameters": one.info["parameters"], "path": str(one.path),
           "states": getattr(getattr(one.answer, "K", None), "nstates", None)}
    for name, one in runs.items()
}
np.savez("evidence.npz", **found)
frequency = runs["cover"].task.responses.frequency_hz
band = [float(frequency[0]), float(frequency[-1])]
print(json.dumps({"form": model.form, "band": band, "runs": told}, default=str))
"""
"""Script that reads the results in the study's own folder, where its problems are registered."""


@dataclass
class Way:
    """Record of a user's commands: for each the words, exit status, time [s] and output."""

    folder: Path
    steps: list[tuple[str, int, float, str]] = field(default_factory=list)

    def go(self, words: list[str], place: Path) -> str:
        """Run a command and return its standard output. Raises `RefusedError` if it fails."""
        started = time.monotonic()
        try:
            done = subprocess.run(
                [sys.executable, "-P", *words],
                cwd=place,
                capture_output=True,
                text=True,
                timeout=LONGEST,
                env={name: one for name, one in os.environ.items() if name != "WORKBENCH_RESULTS"},
            )
            status, said, shown = done.returncode, done.stdout + done.stderr, done.stdout
        except subprocess.TimeoutExpired:
            status, said, shown = -1, f"not ended after {LONGEST:g} s", ""
        self.steps.append((" ".join(words), status, time.monotonic() - started, said))
        if status != 0:
            raise RefusedError(f"{' '.join(words[:4])} ended with {status}: {said.strip()[-1500:]}")
        return shown


class RefusedError(Exception):
    """A command failed or wrote no header, so the chain stops; the message quotes the command's
    output.
    """


@dataclass(frozen=True)
class Delivered:
    """Results of the chain: facts about its runs, responses (F,) by name, and the header file.

    ``band`` [Hz]: frequencies for which the cover was made.
    """

    form: str
    band: tuple[float, float]
    runs: dict[str, Any]
    responses: dict[str, ComplexArray]
    header: Path


def name_of(plant: str) -> str:
    """The name of a stranger's study."""
    return f"stranger-{plant}"


def delivered(plant: str, one: Stranger, way: Way, omega: RealArray) -> Delivered:
    """Run the whole chain from records to the header file. Raises `RefusedError` if a
    step fails.
    """
    write_records(one, way.folder / "records")
    study = name_of(plant)
    actuator = one.inputs[0]
    given = ["--input", actuator.name, "--output", one.outputs[0].name]
    given += ["--limits", f"{actuator.low:g}", f"{actuator.high:g}"]
    workbench = ["-m", "workbench"]
    way.go([*workbench, "init", study, "--data", "records/*.csv", *given], way.folder)
    place = way.folder / study
    way.go([*workbench, "run", f"{study}/*"], place)
    np.save(place / "omega.npy", omega)
    told = json.loads(way.go(["-c", EVIDENCE, study], place).splitlines()[-1])
    headers = sorted(place.glob(f"results/{study}/*/*/controller.h"))
    if not headers:
        raise RefusedError("no controller.h was written")
    with np.load(place / "evidence.npz") as stored:
        responses = {name: stored[name] for name in stored.files}
    low, high = told["band"]
    return Delivered(told["form"], (low, high), told["runs"], responses, headers[0])
