"""Verify believes nothing stored: checksums, key, arrays and certificate, each recomputed."""

import json
import shutil
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

import workbench as wb
from workbench.bench.files import write_json
from workbench.bench.formats import netcdf
from workbench.bench.question import plain
from workbench.bench.store import CHECKSUMS, seal
from workbench.bench.trust.numbers import certificates_apart
from workbench.bench.trust.untrusted import read_json
from workbench.bench.verify import finished_folders
from workbench.certificate import Certificate, Check
from workbench.errors import ResultError


@pytest.fixture
def run(project):
    return wb.run("toy/root")


def edit(folder, name, change):
    """Change a JSON file in place."""
    content = read_json(folder / name)
    change(content)
    write_json(folder / name, content)


def edit_data(folder, change):
    """Change the arrays as a reader of NetCDF would."""
    data = change(netcdf.read(folder / "data.nc"))
    (folder / "data.nc").unlink()
    netcdf.write(data, folder / "data.nc")


def scaled(factor):
    """The answer multiplied, and what follows from it too: only the certificate can tell."""

    def change(data):
        x = factor * data["x"].values
        phasor = x * np.exp(1j * x)
        return data.assign(x=data["x"].copy(data=x), phasor=data["phasor"].copy(data=phasor))

    return change


def put(*path):
    """Set an entry below a path of keys: put("a", 0, "b", value)."""

    def change(content):
        *keys, last, value = path
        for key in keys:
            content = content[key]
        content[last] = value

    return change


# --- good folders -----------------------------------------------------------------------------


@pytest.mark.cases(1)
@pytest.mark.parametrize(
    ("name", "method"),
    [
        ("toy/root", "exact"),
        ("toy/root", "rough"),
        ("toy/x/root", None),
        ("toy/total", None),
        ("toy/sum", None),
        ("toy/y/total", None),
    ],
)
def test_a_good_folder_is_verified_without_a_solver(project, monkeypatch, name, method):
    made = wb.run(name, method=method)
    project.restart()

    def solve(*arguments, **keywords):
        raise AssertionError("verify must not solve")

    monkeypatch.setattr("workbench.bench.run.solve", solve)
    found = wb.verify(made.path)
    assert found.holds and found.problems == () == found.notes
    assert found.certificate == made.certificate
    assert repr(found) == f"{made.path}: verified"


def test_a_folder_may_be_given_as_text_and_relative(project, run):
    assert wb.verify(str(run.path.relative_to(project.root))).holds


def test_verifying_changes_nothing(run):
    before = {file: file.stat().st_mtime_ns for file in run.path.rglob("*")}
    wb.verify(run.path)
    assert before == {file: file.stat().st_mtime_ns for file in run.path.rglob("*")}


def test_a_folder_is_verified_anywhere_it_is_copied_to(project, run):
    copy = shutil.copytree(run.path, project.root / "elsewhere" / run.path.name)
    assert wb.verify(copy).holds


def test_a_failure_is_not_verified_as_an_answer(project):
    failed = wb.run("toy/root", method="lying")
    found = wb.verify(failed.path)
    assert not found.holds
    assert any("reach: 4 exceeds" in text for text in found.problems)


# --- edits ------------------------------------------------------------------------------------

EDITS = {
    "too small": (lambda f: edit_data(f, scaled(0.9)), "certificate: reach: "),
    "too large": (lambda f: edit_data(f, scaled(1.1)), "certificate: optimality gap: "),
    "a derived array": (
        lambda f: edit_data(f, lambda d: d.assign(phasor=2 * d["phasor"])),
        "data.nc: phasor differs",
    ),
    "the question's array": (
        lambda f: edit_data(f, lambda d: d.assign_coords(target=d["target"] + 1)),
        "data.nc: target differs",
    ),
    "a unit": (
        lambda f: edit_data(f, lambda d: d.assign(x=d["x"].assign_attrs(units="km"))),
        "data.nc: x",
    ),
    "an array less": (lambda f: edit_data(f, lambda d: d.drop_vars("phasor")), "data.nc: phasor"),
    "the answer away": (lambda f: edit_data(f, lambda d: d.drop_vars("x")), "data.nc"),
    "an array more": (
        lambda f: edit_data(f, lambda d: d.assign(y=2.0)),
        "data.nc: y is unexpected",
    ),
    "an entry less": (lambda f: edit_data(f, lambda d: d.isel(target=[0, 1])), "data.nc"),
    "a metric": (
        lambda f: edit(f, "metrics.json", put("largest", 1.9)),
        "metrics.json: largest says 1.9, recomputed 2",
    ),
    "a metric more": (
        lambda f: edit(f, "metrics.json", put("beauty", 10)),
        "metrics.json: beauty says 10",
    ),
    "a check's value": (
        lambda f: edit(f, "certificate.json", put("checks", 0, "value", -5.0)),
        "certificate.json: checks[0].value says -5",
    ),
    "a check's limit": (
        lambda f: edit(f, "certificate.json", put("checks", 0, "limit", 1.0)),
        "certificate.json: checks[0].limit says 1",
    ),
    "a check's value that is no number": (
        lambda f: edit(f, "certificate.json", put("checks", 0, "value", "small")),
        "certificate.json: checks[0].value says 'small'",
    ),
    "a check without a value": (
        lambda f: edit(f, "certificate.json", put("checks", 0, {"name": "reach"})),
        "certificate.json: checks[0]",
    ),
    "checks that are none": (
        lambda f: edit(f, "certificate.json", put("checks", "all hold")),
        "certificate.json: checks says 'all hold'",
    ),
    "a check away": (
        lambda f: edit(f, "certificate.json", put("checks", [])),
        "certificate.json: checks",
    ),
    "the gap away": (
        lambda f: edit(f, "certificate.json", put("gap", None)),
        "certificate.json: gap",
    ),
    "the verdict": (
        lambda f: edit(f, "certificate.json", put("holds", False)),
        "certificate.json: holds says 0, recomputed 1",
    ),
    "the problem's name": (
        lambda f: edit(f, "run.json", put("problem", "toy/x/root")),
        "run.json: its question has key",
    ),
    "a parameter": (
        lambda f: edit(f, "run.json", put("parameters", "scale", 2.0)),
        "run.json: its question has key",
    ),
    "the method": (
        lambda f: edit(f, "run.json", put("method", "rough")),
        "run.json: its question has key",
    ),
    "the tolerance": (
        lambda f: edit(f, "run.json", put("options", "tolerance", 0.9)),
        "run.json: its question has key",
    ),
    "the seed": (
        lambda f: edit(f, "run.json", put("options", "seed", 1)),
        "run.json: its question has key",
    ),
    "the data's hash": (
        lambda f: edit(f, "run.json", put("data", "targets.csv", "0" * 64)),
        "run.json: its question has key",
    ),
    "the key": (
        lambda f: edit(f, "run.json", put("key", "00000000")),
        "run.json: its question has key",
    ),
    "the outcome": (lambda f: edit(f, "run.json", put("outcome", "inaccurate")), "run.json"),
    "a field away": (lambda f: edit(f, "run.json", lambda info: info.pop("method")), "run.json"),
    "another type": (lambda f: (f / "run.json").write_text("[1, 2]"), "run.json"),
    "half of run.json": (lambda f: halve(f / "run.json"), "run.json is no JSON"),
    "half of data.nc": (lambda f: halve(f / "data.nc"), "data.nc cannot be read"),
    "half of certificate.json": (
        lambda f: halve(f / "certificate.json"),
        "certificate.json is no JSON",
    ),
    "half of metrics.json": (lambda f: halve(f / "metrics.json"), "metrics.json is no JSON"),
    "no data.nc": (lambda f: (f / "data.nc").unlink(), "data.nc is missing"),
    "no certificate.json": (
        lambda f: (f / "certificate.json").unlink(),
        "certificate.json is missing",
    ),
    "no metrics.json": (lambda f: (f / "metrics.json").unlink(), "metrics.json is missing"),
}
UNSEALED = (
    "too small",
    "a metric",
    "a check's value",
    "a parameter",
    "half of data.nc",
    "no data.nc",
)


def halve(file: Path) -> None:
    content = file.read_bytes()
    file.write_bytes(content[: len(content) // 2])


@pytest.mark.cases(1)
@pytest.mark.parametrize(("harm", "words"), EDITS.values(), ids=EDITS)
def test_what_was_edited_and_sealed_again_is_found_and_named(run, harm, words):
    harm(run.path)
    seal(run.path)
    found = wb.verify(run.path)
    assert not found.holds
    assert any(text.startswith(words) for text in found.problems), found
    assert "NOT verified" in repr(found)


@pytest.mark.cases(2)
@pytest.mark.parametrize("name", UNSEALED)
def test_what_was_edited_is_found_by_its_checksum(run, name):
    EDITS[name][0](run.path)
    found = wb.verify(run.path)
    assert not found.holds
    assert any("was changed: SHA-256" in t or "is missing" in t for t in found.problems), found


@pytest.mark.cases(2)
@pytest.mark.parametrize(
    ("harm", "words"),
    [
        (lambda f: (f / "log.txt").unlink(), "log.txt is missing"),
        (lambda f: (f / "log.txt").write_text("all is well"), "log.txt was changed"),
        (lambda f: (f / "extra.py").write_text("1"), f"extra.py is not in {CHECKSUMS}"),
        (lambda f: (f / CHECKSUMS).unlink(), f"{CHECKSUMS} is missing"),
        (lambda f: halve(f / CHECKSUMS), CHECKSUMS),
        (lambda f: (f / CHECKSUMS).write_bytes(b"\xff\xfe"), CHECKSUMS),
    ],
    ids=["log away", "log edited", "file more", "no checksums", "half of them", "no text"],
)
def test_every_file_counts(run, harm, words):
    harm(run.path)
    found = wb.verify(run.path)
    assert not found.holds
    assert any(words in text for text in found.problems), found


def test_the_folder_must_bear_its_key(run):
    moved = run.path.rename(run.path.with_name("12345678"))
    (found,) = wb.verify(moved).problems
    assert found.endswith("unlike the folder's name")


def test_a_forged_key_does_not_help(run):
    """Parameters, key and name changed to fit each other: the arrays still answer the old one."""
    from workbench.bench.question import Question

    edit(run.path, "run.json", put("parameters", "scale", 2.0))
    info = read_json(run.path / "run.json")
    key = Question(**{name: info[name] for name in Question.__dataclass_fields__}).key
    edit(run.path, "run.json", put("key", key))
    seal(run.path)
    found = wb.verify(run.path.rename(run.path.with_name(key)))
    assert any(text.startswith("certificate: reach") for text in found.problems), found
    assert any(text.startswith("data.nc: target differs") for text in found.problems), found


def test_an_edited_study_is_found_by_its_check_and_metrics(project):
    run = wb.run("toy/total")
    edit_data(run.path, lambda data: data.assign(total=data["total"] * 2))
    seal(run.path)
    files = [text.partition(" ")[0] for text in wb.verify(run.path).problems]
    assert files == ["certificate.json:", "metrics.json:"]


def test_nothing_stored_is_executed(project, run, monkeypatch):
    trap = "import pathlib; pathlib.Path('sprung').touch()\n"
    for name in ("problems.py", "__init__.py", "conftest.py", "sitecustomize.py"):
        (run.path / name).write_text(trap)
    edit(run.path, "run.json", put("message", "__import__('pathlib').Path('sprung').touch()"))
    seal(run.path)
    monkeypatch.chdir(run.path)
    wb.add_problems(project.root / "plants")
    wb.verify(run.path, rerun=True)
    assert not list(project.root.rglob("sprung"))


# --- what surrounds the folder ----------------------------------------------------------------


def test_a_metric_that_only_later_code_has_is_a_note(project, run):
    """What the stored run says must be true still."""
    project.edit(
        '"count": len(self.targets)', '"count": len(self.targets), "sum": float(answer.sum())'
    )
    found = wb.verify(run.path)
    assert found.holds and "metrics that its code did not have: sum" in found.notes
    edit(run.path, "metrics.json", put("largest", 3.0))
    assert not wb.verify(run.path).holds


def test_other_code_is_a_note(project, run):
    project.edit("OFFSET = 0.0", "OFFSET = 0.0  # other code")
    found = wb.verify(run.path)
    assert found.holds and found.notes == ("answered by other code than this",)


def test_other_versions_are_notes(run, monkeypatch):
    monkeypatch.setattr("workbench.bench.verify.environment", lambda: {"python": "9.9"})
    found = wb.verify(run.path)
    assert found.holds
    assert any(note.startswith("python 3.") and "9.9 now" in note for note in found.notes)
    assert any(note.endswith("absent now") for note in found.notes)


def test_other_data_is_a_problem_that_names_the_file(project, run):
    project.write("plants/toy/targets.csv", "1,4,3\n")
    assert any("targets.csv" in text for text in wb.verify(run.path).problems)


def test_an_unregistered_problem_gets_checksums_and_key_only(project, run):
    shutil.rmtree(project.toy.parent)
    project.restart()
    found = wb.verify(run.path)
    assert found.intact and not found.holds and found.certificate is None
    assert found.notes == ("problem 'toy/root' is not registered: checksums and key only",)
    assert repr(found).startswith(f"{run.path}: intact, its answer NOT checked")
    (run.path / "log.txt").write_text("")
    edit(run.path, "run.json", put("parameters", "scale", 2.0))
    found = wb.verify(run.path).problems
    assert any("log.txt" in text for text in found)
    assert any(text.startswith("run.json: its question has key") for text in found)


def test_the_project_of_a_folder_is_imported_only_where_it_is_trusted(
    project, run, tmp_path_factory, monkeypatch
):
    project.write("plants/toy/more.py", "raise SystemExit\n@problem('toy/more')\ndef f(): ...\n")
    project.restart()
    monkeypatch.chdir(tmp_path_factory.mktemp("elsewhere"))
    found = wb.verify(run.path)
    assert found.intact and not found.holds
    assert found.notes[1] == "the project about the folder is not trusted; --trust imports it"
    assert wb.verify(run.path, trust=True).holds


def test_a_problem_that_takes_other_parameters_now_says_so(project, run):
    project.edit("scale: float = 1.0, copies", "scale: float = 1.0, more: int = 0, copies")
    (found,) = wb.verify(run.path).problems
    assert "the problem takes other parameters now" in found


def test_a_problem_that_cannot_be_imported_now_says_so(project, run):
    project.edit("OFFSET = 0.0", "OFFSET = 1 / 0")
    (found,) = wb.verify(run.path).problems
    assert "cannot be imported: ZeroDivisionError" in found


@pytest.mark.cases(0)
def test_a_problem_that_cannot_be_bound_now_says_so(project, run):
    project.edit("    text = (Path", "    raise IndexError('nothing there')\n    text = (Path")
    (found,) = wb.verify(run.path).problems
    assert "nothing there" in found


@pytest.mark.cases(1)
@pytest.mark.parametrize("name", ["toy/total", "toy/sum"])
def test_a_missing_need_says_what_to_run(project, name):
    run = wb.run(name)
    shutil.rmtree(project.results / "toy" / "root")
    (found,) = wb.verify(run.path).problems
    assert found.endswith("is not here: run toy/root first")
    wb.run(name, fresh=True)
    assert wb.verify(run.path).holds


def test_a_damaged_need_is_named(project):
    run = wb.run("toy/total")
    (need,) = wb.results("toy/root")
    (need.path / "log.txt").write_text("")
    (found,) = wb.verify(run.path).problems
    assert f"{need.problem}/{need.key} is damaged: log.txt was changed" in found


# --- again ------------------------------------------------------------------------------------


def test_a_rerun_agrees_and_says_how_long_it_took(run):
    found = wb.verify(run.path, rerun=True)
    assert found.holds
    assert any("re-run within 1e-06" in note and "as long" in note for note in found.notes)


def test_a_rerun_leaves_the_results_alone(project, run):
    before = sorted(project.results.rglob("*"))
    wb.verify(run.path, rerun=True)
    assert sorted(project.results.rglob("*")) == before


def test_a_rerun_that_differs_is_found(project):
    run = wb.run("toy/root", method="rough")
    project.edit("OFFSET = 0.0", "OFFSET = 0.5")
    assert wb.verify(run.path).holds
    found = wb.verify(run.path, rerun=True)
    assert any(text.startswith("re-run: x differs by 0.2") for text in found.problems)


def test_a_rerun_that_fails_is_found(project):
    run = wb.run("toy/root")
    project.edit("OFFSET = 0.0", "OFFSET = -0.5")
    (found,) = wb.verify(run.path, rerun=True).problems
    assert found.startswith("re-run: failed")


@pytest.mark.cases(0)
def test_a_study_edited_where_no_check_looks_is_found_by_a_rerun(project):
    run = wb.run("toy/total")
    edit_data(run.path, lambda data: data.assign(total=data["total"] * 2))
    edit(run.path, "metrics.json", lambda metrics: put("total", 2 * metrics["total"])(metrics))
    edit(
        run.path,
        "certificate.json",
        lambda c: put("value", 2 * c["checks"][-1]["value"])(c["checks"][-1]),
    )
    seal(run.path)
    assert wb.verify(run.path).holds
    found = wb.verify(run.path, rerun=True)
    assert any(text.startswith("re-run: total differs") for text in found.problems)


@pytest.mark.parametrize(
    ("opinion", "value", "same"),
    [
        (False, -4.8e-7, True),
        (False, 9e-4, True),
        (False, -2e-3, False),
        (False, np.nan, False),
        (True, 9e-4, True),
        (True, 2e-3, False),
    ],
)
def test_a_check_counts_as_the_same_within_its_limit(opinion, value, same):
    """Where a proof was found differs between machines; what an opinion measured, even more so."""

    def written(excess):
        check = Check("peak", "over the claim, less 1", excess, 1e-3, opinion=opinion)
        return plain(Certificate((check,)).to_json())

    assert (not certificates_apart(written(value), written(0.0))) is same


@pytest.mark.parametrize(("pole", "same"), [(-7.74711156353, True), (-7.75, False)])
def test_a_check_counts_as_the_same_within_a_part_of_its_distance_from_the_limit(pole, same):
    """A pole that two processors compute differs by its condition, however far it is."""

    def written(value):
        check = Check("stability", "worst pole beyond the boundary", value, -2.3e-308)
        return plain(Certificate((check,)).to_json())

    assert (not certificates_apart(written(-7.74711154887), written(pole))) is same


# --- where folders are ------------------------------------------------------------------------


def test_finished_folders_at_or_below_a_path(project, run):
    other = wb.run("toy/x/root")
    wb.run("toy/root", method="lying")
    assert finished_folders(run.path) == [run.path]
    assert finished_folders(run.path.parent) == [run.path]
    assert finished_folders(project.results) == sorted([run.path, other.path])


@pytest.mark.cases(2)
@pytest.mark.parametrize("below", ["", "toy", "toy/root"])
def test_reference_results_are_found_by_their_path(project, run, below):
    reference = project.results / "reference"
    copy = shutil.copytree(run.path, reference / "toy" / "root" / run.key)
    assert finished_folders(reference / below) == [copy]
    assert finished_folders(project.results) == [run.path]
    assert wb.verify(copy).holds


@pytest.mark.parametrize("path", [".", "nowhere"])
def test_no_folder_is_an_error(project, path):
    with pytest.raises(ResultError, match="no results folder at or below"):
        finished_folders(Path(path))


def test_what_is_no_results_folder_is_an_error(project):
    with pytest.raises(ResultError, match="is no results folder"):
        wb.verify(project.root)


def test_a_stored_dataset_opens_with_xarray_alone(run):
    with xr.open_dataset(run.path / "data.nc", engine="h5netcdf") as data:
        assert data["x"].attrs["units"] == "m"
    assert json.loads((run.path / "metrics.json").read_text())["count"] == 3


GAPS = """
from dataclasses import dataclass
from typing import ClassVar

from workbench import Study, problem
from workbench.study import array, check


@dataclass(frozen=True)
class Gaps(Study):
    relative_metrics: ClassVar[tuple[str, ...]] = ("gap",)

    number = array(dims="number", unit="1", meaning="some", value=lambda self: [1.0])
    small = check(
        title="small", statement="the number", value=lambda number: number, at_most=2.0
    )

    def metrics(self, answer):
        return {"gap": 1e-8, "length": 1e-8}


@problem("gaps")
def gaps() -> Gaps:
    '''Two small numbers.'''
    return Gaps()
"""


def test_metrics_that_are_logarithms_are_compared_as_numbers_near_1(project):
    """A gap of 1e-8 has the rounding of 1; a length of 1e-8 has its own."""
    project.write("plants/gaps.py", GAPS)
    folder = wb.run("gaps").path
    for stored, problems in (
        ({"gap": 1.00001e-8}, ()),
        ({"length": 1.00001e-8}, ("metrics.json: length says 1.00001e-08, recomputed 1e-08",)),
        ({"gap": 1e-6, "length": 1e-8}, ("metrics.json: gap says 1e-06, recomputed 1e-08",)),
    ):
        edit(folder, "metrics.json", lambda metrics, stored=stored: metrics.update(stored))
        seal(folder)
        assert wb.verify(folder).problems == problems
