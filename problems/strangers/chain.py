"""The user's way from records to C: `workbench init` and `workbench run` in an empty folder."""

from __future__ import annotations

import ast
import json
import os
import re
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
covers = {
    tuple(int(k) - 1 for k in name.split("-")[1:]) or (0, 0): run
    for name, run in runs.items() if name.startswith("cover")
}
p, m = (max(place[side] for place in covers) + 1 for side in (0, 1))
found = {name: np.zeros((len(omega), p, m), complex) for name in ("nominal", "W_c", "W_r")}
bands = np.zeros((p, m, 2))
for (i, j), run in covers.items():
    model, frequency = run.answer.model, run.task.responses.frequency_hz
    for name, values in found.items():
        part = getattr(model, name)
        values[:, i, j] = 0 if part is None else part.response(omega)
    bands[i, j] = frequency[0], frequency[-1]
K = runs["controller"].answer.K
found["K"] = np.moveaxis(K(1j * omega, squeeze=False), -1, 0)
told = {
    name: {"outcome": str(one.outcome), "holds": bool(one.holds), "metrics": one.metrics,
           "parameters": one.info["parameters"], "path": str(one.path),
           "states": getattr(getattr(one.answer, "K", None), "nstates", None)}
    for name, one in runs.items()
}
np.savez("evidence.npz", bands=bands, **found)
print(json.dumps({"form": model.form, "runs": told}, default=str))
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
    """Results of the chain: facts about its runs, responses by name, and the header file.

    Responses of the covers are (F, p, m), those of the controller (F, m, p). ``bands`` (p, m, 2)
    [Hz]: frequencies for which the covers were made. ``sizes`` (p,): sizes of the outputs that
    count as equally large.
    """

    form: str
    bands: RealArray
    sizes: RealArray
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
    given = []
    for kind, channels in (("--input", one.inputs), ("--output", one.outputs)):
        given += [word for channel in channels for word in (kind, channel.name)]
    for actuator in one.inputs:
        given += ["--limits", f"{actuator.low:g}", f"{actuator.high:g}"]
    workbench = ["-m", "workbench"]
    way.go([*workbench, "init", study, "--data", "records/*.csv", *given], way.folder)
    place = way.folder / study
    way.go([*workbench, "run", f"{study}/*"], place)
    return delivered_by(study, place, way, omega)


def delivered_by(study: str, place: Path, way: Way, omega: RealArray) -> Delivered:
    """What a study in its folder has delivered. Raises `RefusedError` if there is no header."""
    np.save(place / "omega.npy", omega)
    told = json.loads(way.go(["-c", EVIDENCE, study], place).splitlines()[-1])
    headers = sorted(place.glob(f"results/{study}/*/*/controller.h"))
    if not headers:
        raise RefusedError("no controller.h was written")
    with np.load(place / "evidence.npz") as stored:
        responses = {name: stored[name] for name in stored.files}
    bands = responses.pop("bands")
    (design,) = place.glob("problems/*/design.py")
    said = re.search(r"^SIZES = (.*)$", design.read_text(encoding="utf-8"), re.MULTILINE)
    sizes = np.ones(len(bands)) if said is None else np.array(ast.literal_eval(said[1])[1])
    return Delivered(told["form"], bands, sizes, told["runs"], responses, headers[0])
