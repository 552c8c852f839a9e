"""Problems and Programs that take, answer and say odd things: all is told, nothing is lost."""

import warnings

import numpy as np
import pytest
from fuzzed_values import ODD, POOL

import workbench as wb
from workbench.errors import WorkbenchError

TRIALS, FEW = 1500, 60
"""Runs in the slow lane, and in the quick one."""
PLACES = (
    *("parameter", "number", "method", "message", "claim", "checks", "value", "metrics"),
    *("gap", "to_dataset", "from_dataset", "raise", "needs", "said", "headline", "options"),
)
"""Where something odd is put."""

SOURCE = '''
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import xarray as xr

from fuzzed_values import ODD
from workbench import Check, Outcome, Program, method, problem, ref

def odd(place, usual):
    """What is usual, or in the place that is tried the odd value, called where it is an error."""
    if ODD["place"] != place:
        return usual
    return ODD["value"]


@dataclass(frozen=True)
class Halves(Program):
    """Half of a number."""

    number: float
    default_method = "half"

    def checks(self, answer, tolerance):
        if ODD["place"] == "raise":
            raise ValueError(ODD["value"])
        if ODD["place"] == "checks":
            return ODD["value"]
        value = odd("value", float(abs(answer - self.number / 2)))
        return [Check("half", odd("said", "distance from half"), value, 1e-9)]

    def gap(self, answer):
        return odd("gap", ("distance", 0.0))

    @property
    def headline(self):
        return odd("headline", "half")

    def metrics(self, answer):
        return odd("metrics", {"half": float(answer)})

    def to_dataset(self, answer):
        return odd("to_dataset", xr.Dataset({"x": ((), float(answer))}))

    def from_dataset(self, data):
        return odd("from_dataset", float(data["x"]))


@method(Halves, "half", optimal=True)
def half(program, context):
    if ODD["place"] == "method":
        return ODD["value"]
    return program.number / 2, odd("claim", Outcome.SOLVED), odd("message", "")


@problem("odd/any")
def any_(parameter: Any = None, number: float = 1.0) -> Halves:
    """Takes anything."""
    return Halves(number)


@problem("odd/needs", needs=lambda **_: odd("needs", {"before": ref("odd/any")}))
def needs(before=None) -> Halves:
    """Needs another."""
    return Halves(1.0)
'''


@pytest.fixture
def odd(project):
    project.write("plants/odd/problems.py", SOURCE)
    return project


def trial(seed, project):
    """A run with one odd thing in it; what was wrong with what became of it, or None."""
    rng = np.random.default_rng(seed)
    place = PLACES[int(rng.integers(len(PLACES)))]
    value = POOL[int(rng.integers(len(POOL)))]
    ODD.update(place=place, value=value)
    asked = {"parameter": value} if place == "parameter" else {}
    asked |= {"number": value} if place == "number" else {}
    asked |= {"options": value} if place == "options" else {}
    name = "odd/needs" if place == "needs" else "odd/any"
    told = f"{seed} {place} {value!r:.80}"
    try:
        run = wb.run(name, fresh=True, **asked)
        repr(run)
        if not run.path.name.endswith(".failed"):
            ODD.update(place="", value=None)
            wb.verify(run.path)
    except WorkbenchError as error:
        try:
            str(error).encode()
        except UnicodeEncodeError:
            return f"{told}: cannot be printed: {error!a}"
    except Exception as error:
        return f"{told}: {type(error).__name__}: {error!a:.200}"
    finally:
        ODD.update(place="", value=None)
    return lost(told, project.results)


def lost(told, results):
    """What a run left half done: a folder without checksums, or one that is being written."""
    for folder in [*results.glob("odd/*/*"), *results.glob(".partial/*")]:
        if folder.is_dir() and not (folder / "SHA256SUMS").exists():
            inside = [one.name for one in folder.iterdir()]
            if inside:
                return f"{told}: {folder.name} is half a folder: {inside}"
    return None


def raw(seeds, project):
    """What went wrong in the trials of these seeds."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # as a user sees them: they do not end a run
        return [found for seed in seeds if (found := trial(seed, project)) is not None]


def test_a_few_odd_runs(odd):
    assert not raw(range(FEW), odd)


@pytest.mark.slow
def test_odd_runs(odd):
    found = raw(range(TRIALS), odd)
    print(f"{TRIALS} runs, {len(found)} raw tracebacks or half folders", *found, sep="\n")
    assert not found
