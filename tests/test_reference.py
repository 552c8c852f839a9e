"""The committed reference results: one of each problem, each verified from its arrays alone."""

import json
import re
from pathlib import Path

import h5py
import pytest

import workbench as wb
from workbench.bench.problem import Problem
from workbench.bench.verify import finished_folders
from workbench.study import Study
from workbench.study.declarations import ArrayDeclaration, Dim

REFERENCE = Path(__file__).parents[1] / "results" / "reference"
FOLDERS = finished_folders(REFERENCE)


SLOW = {entry.name for entry in wb.problems() if entry.slow} | {"cd/focus/controller"}
"""Slow problems, the ledger among them, and the problem that feeds most of them."""
ILL_CONDITIONED = "cd/focus/controller/bac2ba4d"
"""Its modes have eigenvectors of condition 3e9, which a kernel was once too coarse for."""


def marked(folder):
    """The radial results repeat what those of focus prove, by the same code on other numbers."""
    name = folder.relative_to(REFERENCE).as_posix()
    slow = name.startswith("cd/radial/") or folder.parent.relative_to(REFERENCE).as_posix() in SLOW
    slow = slow and name != ILL_CONDITIONED
    return pytest.param(folder, id=name, marks=pytest.mark.slow if slow else ())


@pytest.mark.cases(6)
@pytest.mark.parametrize("folder", [marked(folder) for folder in FOLDERS])
def test_reference_result_is_verified(folder):
    assert wb.verify(folder).holds, wb.verify(folder)


TIMES = {"bench/cold-start", "bench/mu-yardstick"}
"""Times of a machine against limits that not every machine keeps."""
LOOPS = {entry.name for entry in wb.problems("strangers/*/loop")} | {"bench/regions"}
"""Each is a study in a folder of its own, that takes many minutes."""
BROUGHT = {"bench/compleib"}
"""These need data that a user brings."""

TOO_LARGE = {"cd/radial/cover-front"}
"""With its covers the stored results would pass 25 MB; focus is the same study."""


def test_every_problem_has_a_reference_result():
    """The slow ones a small one, so that the gallery shows them."""
    named = {wb.open_run(folder).problem for folder in FOLDERS}
    assert named >= {entry.name for entry in wb.problems()} - TIMES - LOOPS - BROUGHT - TOO_LARGE


KEPT = {
    "SHA256SUMS",
    "certificate.json",
    "data.nc",
    "log.txt",
    "metrics.json",
    "ro-crate-metadata.json",
    "run.json",
}
"""What proves a result; figures and tables are made from it when somebody looks."""


def test_reference_results_are_what_proves_them_and_small():
    for folder in FOLDERS:
        assert {file.name for file in folder.iterdir()} - {"controller.h"} == KEPT, folder
    sizes = {file: file.stat().st_size for folder in FOLDERS for file in folder.iterdir()}
    assert max(sizes.values()) < 1_000_000
    assert sum(sizes.values()) < 25_000_000


NOT_ALWAYS = {"K_obs_printed", "P_common_open", "P_common_filter", "P_common_lower", "dwell_common"}
"""Arrays that a study leaves out: no common Lyapunov function, no printed gain."""


def declared_names(kind):
    """Names of the dimensions and arrays that a study declares."""
    found = set()
    for base in reversed(kind.__mro__):
        for name, one in vars(base).items():
            if isinstance(one, ArrayDeclaration):
                found.update(one.names)
            elif isinstance(one, Dim):
                found.add(name)
    return found


def test_stored_studies_hold_all_that_they_declare():
    """A renamed declaration would leave old runs whole, and let every new one fail."""
    kinds = {entry.name: Problem(entry).kind for entry in wb.problems()}
    studies = {name: kind for name, kind in kinds.items() if kind and issubclass(kind, Study)}
    missing, told = {}, 0
    for folder in FOLDERS:
        name = json.loads((folder / "run.json").read_text("utf-8"))["problem"]
        if name in studies:
            told += 1
            with h5py.File(folder / "data.nc") as file:
                stored = {array.removesuffix("_real") for array in file} | set(file)
            lost = declared_names(studies[name]) - stored - NOT_ALWAYS
            missing |= {name: lost} if lost else {}
    assert missing == {}
    assert told > 100


FREQUENCIES = re.compile(
    r"^(\w*_)?(frequency|pole|zero|crossover|bandwidth|resonance|corner|roll_off)(_\w+)?$"
)
NO_FREQUENCIES = re.compile(
    r"_(off|db|um|samples|index)$|^zero_damping$|_spread_|deviation|^poles_|reference_strategy|_per_frequency$"
)


def test_numbers_that_are_frequencies_name_their_unit():
    told = {name for folder in FOLDERS for name in wb.open_run(folder).metrics}
    found = {n for n in told if FREQUENCIES.match(n) and not NO_FREQUENCIES.search(n)}
    assert len(found) > 50
    assert {name for name in found if not name.endswith(("_hz", "_rad_s"))} == set()
